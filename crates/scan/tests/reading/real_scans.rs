//! The real scans: geometry, values and landmarks. Skipped where they are not.

use crate::common::data;
use monro_geometry::{Patient, Point, Vector, Volume};
use monro_scan::{Format, ReadOptions, Scan, inspect, read, read_labels};
use std::path::Path;

fn scan(path: &Path) -> Scan {
    read(path, &ReadOptions::default()).expect("a readable scan")
}

/// A landmark in LPS mm.
fn landmark(folder: &Path, name: &str) -> Point<Patient> {
    let text = std::fs::read_to_string(folder.join("landmarks.json")).expect("landmarks");
    let json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let at = |n: usize| json[name][n].as_f64().expect("a number");
    Point::new(-at(0), -at(1), at(2))
}

/// HU at all points of a 1 mm lattice within `radius` mm.
fn around(volume: &Volume<i16>, centre: Point<Patient>, radius: i32) -> Vec<f64> {
    let steps = || (-radius..=radius).map(f64::from);
    let inside = |v: &Vector<Patient>| v.norm() <= f64::from(radius);
    let ball = steps().flat_map(|x| steps().flat_map(move |y| steps().map(move |z| Vector::new(x, y, z))));
    ball.filter(inside).filter_map(|v| volume.trilinear(centre + v)).collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Even and rectangular, by the placement itself.
fn assert_rectangular(volume: &Volume<i16>) {
    let axes = [0, 1, 2].map(|a| Vector::<Patient>::from_array(volume.grid().patient_from_voxel().linear.column(a)));
    for (a, b) in [(0, 1), (0, 2), (1, 2)] {
        assert!((axes[a].angle(axes[b]).to_degrees() - 90.0).abs() < 0.01);
    }
}

/// The foramina lie in CSF within brain; nasion and Kocher's points lie where air, skin and bone are all near.
fn assert_landmarks(folder: &Path, volume: &Volume<i16>) {
    for name in ["foramen_monro_left", "foramen_monro_right"] {
        let p = landmark(folder, name);
        // The landmarks are known to 3 to 5 mm, and a foramen is about as wide.
        let steps = [-4.0, -2.0, 0.0, 2.0, 4.0];
        let shifts = steps.iter().flat_map(|&x| steps.iter().map(move |&z| Vector::new(x, 0.0, z)));
        let near = shifts.map(|v| median(around(volume, p + v, 2))).fold(f64::MAX, f64::min);
        // Half way between CSF (5) and brain (29) and the noise of a small sample (13 / sqrt 33 = 2): brain alone
        // would not come below 23.
        assert!((-5.0..22.0).contains(&near), "{name}: {near} HU");
        let wide = median(around(volume, p, 25));
        assert!((20.0..45.0).contains(&wide), "{name}: {wide} HU around");
    }
    for name in ["nasion_skin", "kocher_left_skin", "kocher_right_skin"] {
        let hu = around(volume, landmark(folder, name), 12);
        let share = |f: fn(f64) -> bool| hu.iter().filter(|&&v| f(v)).count() as f64 / hu.len() as f64;
        let (air, bone) = (share(|v| v < -500.0), share(|v| v > 250.0));
        assert!(air > 0.15 && bone > 0.05, "{name}: air {air:.2}, bone {bone:.2}");
    }
}

#[test]
fn tilted_dicom_series_is_straightened() {
    let Some(folder) = data("head-ct-dicom-tilt") else { return };
    let scan = scan(&folder.join("dicom"));
    assert_rectangular(&scan.volume);
    assert_landmarks(&folder, &scan.volume);
    assert_eq!(scan.source.native_dims, [512, 512, 28]);
    assert!((scan.source.tilt_deg - 18.5).abs() < 0.01, "{}", scan.source.tilt_deg);
    let said = scan.resampled.expect("a sentence");
    assert!(said.contains("1.081 to 6.999 mm") && said.contains("18.50 degrees"), "{said}");
    assert!(scan.warnings.iter().any(|w| w.contains("padding")), "{:?}", scan.warnings);
    assert!(scan.volume.data().iter().all(|&v| v >= -1024));
    // README: file 17, row 234, columns 225 and 250 are the foramina; the slice has x = -125 + 0.48828 column.
    let p = landmark(&folder, "foramen_monro_right");
    assert!((p.x - (-125.0 + 225.0 * 0.488_281_2)).abs() < 0.1);
}

/// At the places of its own pixels the straightened volume must give the slices back. The first 14 slices are evenly
/// spaced and coincide (within 0.02 mm) with every second slice of the grid.
#[test]
fn straightened_slices_keep_their_values() {
    let Some(folder) = data("head-ct-dicom-tilt") else { return };
    let scan = scan(&folder.join("dicom"));
    let file = dicom_object::open_file(folder.join("dicom/05.dcm")).expect("DICOM");
    let tag = dicom_dictionary_std::tags::IMAGE_POSITION_PATIENT;
    let origin = file.element(tag).expect("a position").to_multi_float64().expect("numbers");
    let pixels = file.element(dicom_dictionary_std::tags::PIXEL_DATA).expect("pixels").to_bytes().expect("bytes");
    let (mut worst, mut sum, mut count) = (0.0f64, 0.0, 0);
    for row in (60..450).step_by(7) {
        for column in (60..450).step_by(7) {
            let [x, y] = [column, row].map(|n| f64::from(n) * 0.488_281_2);
            let p = Point::new(origin[0] + x, origin[1] + 0.948_323_7 * y, origin[2] - 0.317_304_7 * y);
            let at = 2 * (row * 512 + column) as usize;
            let stored = f64::from(i16::from_le_bytes([pixels[at], pixels[at + 1]]));
            let found = scan.volume.trilinear(p).expect("inside");
            // Bone edges differ, because the shift within the slice is a fraction of a pixel: compare soft tissue.
            if (0.0..80.0).contains(&stored) && (0.0..80.0).contains(&found) {
                let d = (found - stored).abs();
                (worst, sum, count) = (worst.max(d), sum + d, count + 1);
            }
        }
    }
    let mean = sum / f64::from(count);
    // Noise of 4 HU averaged by a half-pixel shift changes by about its own size.
    assert!(count > 500 && mean < 3.0, "{count} pixels differ by {mean:.2} HU on average, {worst:.1} at most");
}

#[test]
fn metaimage_head_is_read_unchanged() {
    let Some(folder) = data("head-ct-2mm") else { return };
    let scan = scan(&folder.join("head_ct.mha"));
    assert_eq!(scan.volume.grid().dims(), [512, 512, 91]);
    assert_eq!(scan.volume.grid().patient_from_voxel().offset, [-96.3766, -117.9391, -619.0]);
    assert_eq!((scan.source.format, scan.source.orientation), (Format::MetaImage, "axial"));
    assert!(scan.resampled.is_none());
    assert!(scan.warnings.iter().any(|w| w.contains("-2048")), "{:?}", scan.warnings);
    assert_landmarks(&folder, &scan.volume);
}

#[test]
fn nifti_head_is_read_unchanged_and_agrees_with_its_reference_labels() {
    let Some(folder) = data("head-ct-thin") else { return };
    let scan = scan(&folder.join("head_ct.nii.gz"));
    assert_eq!(scan.volume.grid().dims(), [278, 278, 157]);
    assert!(scan.resampled.is_none() && scan.warnings.is_empty(), "{:?}", scan.warnings);
    assert_landmarks(&folder, &scan.volume);
    let labels = read_labels(&folder.join("ventricles_reference.nii.gz")).expect("labels");
    // Label 1 is the patient's left: its x (LPS) lies above that of label 2.
    let mean_x = |label: u16| {
        let at = |n: usize| {
            let [i, j, k] = labels.grid().voxel(n);
            labels.grid().centre(i, j, k).x
        };
        let xs: Vec<f64> = (0..labels.grid().len()).filter(|&n| labels.data()[n] == label).map(at).collect();
        xs.iter().sum::<f64>() / xs.len() as f64
    };
    assert!(mean_x(1) > mean_x(2) + 10.0);
}

#[test]
fn the_same_scan_always_has_the_same_pseudonym_and_another_has_another() {
    let (Some(a), Some(b)) = (data("head-ct-dicom-tilt"), data("head-ct-thin")) else { return };
    let first = scan(&a.join("dicom"));
    assert_eq!(first.pseudonym, scan(&a.join("dicom")).pseudonym);
    assert_ne!(first.pseudonym, scan(&b.join("head_ct.nii.gz")).pseudonym);
}

#[test]
fn inspection_says_what_a_scan_is() {
    let Some(folder) = data("head-ct-dicom-tilt") else { return };
    let found = inspect(&folder.join("dicom")).expect("a listing");
    assert_eq!((found.series.len(), found.chosen, found.reason.as_str()), (1, Some(0), "the only DICOM series"));
    let s = &found.series[0];
    assert_eq!((s.images, s.source.orientation, s.source.kernel.as_deref()), (28, "axial", Some("STD+")));
    assert_eq!(s.source.kvp, Some(120.0));
    assert!((s.step_mm[0] - 1.081).abs() < 1e-3 && (s.step_mm[1] - 6.999).abs() < 1e-3, "{:?}", s.step_mm);
}
