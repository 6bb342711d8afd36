//! Wrong input of each kind gets an error that names the file, the rule and the numbers. (More kinds, made by foreign
//! writers, stand in `scripts/oracle_scan.py`.)

use crate::common::{any_size, edit, folder, grid, sampled};
use dicom_core::{Tag, VR};
use dicom_dictionary_std::tags;
use monro_geometry::{Affine, Grid, Matrix3, Volume};
use monro_scan::dicom::{SeriesMeta, write_series};
use monro_scan::{ReadOptions, head_extent_check, inspect, nifti, nrrd, read, read_labels};
use std::fs;
use std::path::{Path, PathBuf};

#[track_caller]
fn refused(path: &Path, fragments: &[&str]) {
    let message = read(path, &any_size()).expect_err("a refusal").to_string();
    for f in fragments {
        assert!(message.contains(f), "{f:?} is not in {message:?}");
    }
}

/// A small sound series; gives its files.
fn series(dir: &Path, meta: &SeriesMeta) -> Vec<PathBuf> {
    let volume = sampled(grid([5, 4, 6], [1.0, 1.5, 2.0], [0.1, 0.2, 0.3], [1.0, 2.0, 3.0], false));
    write_series(&volume, dir, meta).expect("written")
}

#[test]
fn a_label_volume_of_no_known_format_was_called_no_ct() {
    let f = folder();
    let file = f.path().join("labels.nii.gz");
    fs::write(&file, "").expect("write");
    let said = read_labels(&file).expect_err("a refusal").to_string();
    assert!(said.contains("is not a label volume in a known format (it is empty)"), "{said}");
}

#[test]
fn folders_without_a_series() {
    let f = folder();
    refused(f.path(), &["holds no file"]);
    fs::write(f.path().join("a.dcm"), "a letter").expect("written");
    refused(f.path(), &["no DICOM image among its 1 files", "a.dcm"]);
    refused(&f.path().join("a.dcm"), &["a.dcm", "is not a CT in a known format", "8 bytes that begin with 61 20"]);
    refused(&f.path().join("nothing"), &["nothing", "cannot be read"]);
}

/// Inspection tells beforehand what reading will refuse.
fn foretold(path: &Path, fragment: &str) {
    let listed = inspect(path).expect("still a listing");
    let told = |w: &String| w.contains("will be refused") && w.contains(fragment);
    assert!(listed.warnings.iter().any(told), "{fragment:?} not in {:?}", listed.warnings);
}

#[test]
fn inspection_was_silent_about_a_compressed_file_that_ends_early() {
    let f = folder();
    let volume = cylinder(100.0, 60);
    for (name, bytes) in [("a.nii.gz", nifti::encode_i16(&volume)), ("b.nrrd", nrrd::encode_i16(&volume))] {
        let path = f.path().join(name);
        fs::write(&path, &bytes[..bytes.len() * 3 / 4]).expect("written");
        let said = "is cut short: the header promises";
        refused(&path, &[name, said]);
        foretold(&path, &format!("{name}: {said}"));
    }
}

#[test]
fn a_missing_slice_in_the_finer_part_of_a_series_of_two_spacings_is_named() {
    let f = folder();
    let upright = Grid::axis_aligned([5, 4, 24], [1.0; 3], [0.0; 3]).expect("a grid");
    let files = write_series(&sampled(upright), f.path(), &SeriesMeta::default()).expect("written");
    for (n, file) in files.iter().enumerate() {
        let z = if n < 10 { 4 * n } else { 36 + 7 * (n - 9) };
        edit(file, tags::IMAGE_POSITION_PATIENT, VR::DS, &format!("0\\0\\{z}"));
    }
    fs::remove_file(&files[4]).expect("removed");
    let listed = inspect(f.path()).expect("a listing");
    let told = |fragment: &str| listed.warnings.iter().any(|w| w.contains(fragment));
    assert!(told("slices 4 and 5 are 8.000 mm apart, expected 4.000"), "{:?}", listed.warnings);
    assert!(!listed.warnings.iter().any(|w| w.contains("further apart")), "{:?}", listed.warnings);
}

#[test]
fn a_slice_with_other_pixels_was_left_out_of_its_series_without_a_word() {
    let f = folder();
    let upright = Grid::axis_aligned([5, 4, 24], [1.0, 1.0, 3.0], [0.0; 3]).expect("a grid");
    let files = write_series(&sampled(upright), f.path(), &SeriesMeta::default()).expect("written");
    edit(&files[7], tags::PIXEL_SPACING, VR::DS, "1.02\\1.02");
    let listed = inspect(f.path()).expect("a listing");
    let said = "1 image(s) of the same series lie between its slices and are not like them (the first: 0008.dcm, 5 x 4 pixels of \
                1.0200 x 1.0200 mm";
    assert!(listed.warnings.iter().any(|w| w.contains(said)), "{:?}", listed.warnings);
    let scan = read(f.path(), &any_size()).expect("a scan");
    assert!(scan.warnings.iter().any(|w| w.contains(said)), "{:?}", scan.warnings);
    // What lies beyond the stack takes nothing from it.
    edit(&files[7], tags::IMAGE_POSITION_PATIENT, VR::DS, "0\\0\\90");
    let listed = inspect(f.path()).expect("a listing");
    assert!(!listed.warnings.iter().any(|w| w.contains("same series")), "{:?}", listed.warnings);
}

#[test]
fn truncated_slices() {
    let f = folder();
    let files = series(f.path(), &SeriesMeta::default());
    let whole = fs::read(&files[2]).expect("there");
    fs::write(&files[2], &whole[..whole.len() - 7]).expect("written");
    // In the same words by both.
    let said = "0003.dcm: is cut short: the header promises 40 bytes of voxels, 33 are there; copy it again";
    refused(f.path(), &[said]);
    foretold(f.path(), said);
    let other = fs::read(&files[4]).expect("there");
    fs::write(&files[4], &other[..other.len() - 1]).expect("written");
    let said = "2 files of the series are cut short (the first: 0003.dcm); copy them again";
    refused(f.path(), &[said]);
    foretold(f.path(), said);
    fs::write(&files[4], other).expect("written");
    fs::write(&files[2], &whole[..400]).expect("written");
    refused(f.path(), &["0003.dcm", "truncated"]);
    let listed = inspect(f.path()).expect("still a listing");
    assert!(listed.chosen.is_none() && listed.warnings.iter().any(|w| w.contains("0003.dcm")), "{listed:?}");
}

#[test]
fn two_patients_are_refused_without_naming_them() {
    let f = folder();
    series(f.path(), &SeriesMeta::default());
    let other = SeriesMeta { patient_id: "OTHER".into(), seed: 2, ..SeriesMeta::default() };
    let files = series(&f.path().join("b"), &other);
    refused(f.path(), &["2 patients", "patient 1: 6", "patient 2: 6"]);
    let message = read(f.path(), &any_size()).expect_err("a refusal").to_string();
    assert!(!message.contains("OTHER") && !message.contains("NOBODY"), "{message}");
    assert!(inspect(f.path()).expect("a listing").chosen.is_none());
    // A choice resolves it.
    let listed = inspect(f.path()).expect("a listing");
    let chosen = ReadOptions { series_uid: Some(listed.series[1].source.series.clone()), ..any_size() };
    assert!(read(f.path(), &chosen).is_ok());
    for file in &files {
        edit(file, tags::PATIENT_ID, VR::LO, &SeriesMeta::default().patient_id);
    }
    let one = read(f.path(), &any_size()).expect("one patient");
    assert!(one.warnings.iter().any(|w| w.contains("was taken: 2 series can be taken")), "{:?}", one.warnings);
    assert!(!one.warnings.iter().any(|w| w.contains("different names")), "{:?}", one.warnings);
    for file in &files {
        edit(file, tags::PATIENT_NAME, VR::PN, "Somebody^Else");
    }
    for warnings in
        [read(f.path(), &any_size()).expect("one id").warnings, inspect(f.path()).expect("a listing").warnings]
    {
        let told = warnings.iter().find(|w| w.contains("different names")).expect("two names under one id");
        assert!(!told.to_uppercase().contains("ELSE"), "{told}");
    }
}

/// Their images had one series id in common, and choosing it as the message says gave one head of two.
#[test]
fn two_patients_in_one_series_became_one_head() {
    let f = folder();
    let files = series(f.path(), &SeriesMeta::default());
    for file in files.iter().skip(3) {
        edit(file, tags::PATIENT_ID, VR::LO, "OTHER");
    }
    refused(f.path(), &["2 patients", "choose a series by its id"]);
    let listed = inspect(f.path()).expect("a listing");
    let images: Vec<usize> = listed.series.iter().map(|s| s.images).collect();
    assert_eq!(images, [3, 3]);
    for (s, slices) in listed.series.iter().zip(images) {
        let chosen = ReadOptions { series_uid: Some(s.source.series.clone()), ..any_size() };
        assert_eq!(read(f.path(), &chosen).expect("one patient").volume.grid().dims()[2], slices);
    }
}

#[test]
fn attributes_that_make_no_head_ct() {
    for (tag, vr, value, fragments) in [
        (tags::MODALITY, VR::CS, "MR", &["MR", "is not CT"][..]),
        (tags::IMAGE_TYPE, VR::CS, "ORIGINAL\\PRIMARY\\LOCALIZER", &["localizer"]),
        (tags::PHOTOMETRIC_INTERPRETATION, VR::CS, "MONOCHROME1", &["0001.dcm", "MONOCHROME1"]),
        (tags::IMAGE_ORIENTATION_PATIENT, VR::DS, "1\\0\\0\\1\\0\\0", &["0001.dcm", "ImageOrientationPatient"]),
        (tags::IMAGE_POSITION_PATIENT, VR::DS, "1\\2", &["0001.dcm", "ImagePositionPatient", "not 3 numbers"]),
        (tags::PIXEL_SPACING, VR::DS, "0\\1", &["PixelSpacing", "not positive"]),
        (tags::RESCALE_SLOPE, VR::DS, "0", &["RescaleSlope"]),
        // Decimal commas were said to be missing, and an intercept of them was taken as 0.
        (tags::PIXEL_SPACING, VR::DS, "0,48\\0,48", &["0001.dcm: PixelSpacing", "0,48\\\\0,48\" is not 2 numbers"]),
        (tags::RESCALE_INTERCEPT, VR::DS, "-1024,0", &["RescaleIntercept: \"-1024,0\" is no number"]),
    ] {
        let f = folder();
        for file in series(f.path(), &SeriesMeta::default()) {
            edit(&file, tag, vr, value);
        }
        refused(f.path(), fragments);
    }
}

#[test]
fn too_few_slices_wide_gaps_and_conflicts() {
    let f = folder();
    let files = series(f.path(), &SeriesMeta::default());
    edit(&files[2], tags::IMAGE_POSITION_PATIENT, VR::DS, "1\\2\\3");
    refused(f.path(), &["0001.dcm", "0003.dcm", "same position"]);
    // Inspection fell over the series that was left without images.
    let listed = inspect(f.path()).expect("a listing");
    assert_eq!((listed.series.len(), listed.chosen), (1, None), "{listed:?}");
    let far = folder();
    let files = series(far.path(), &SeriesMeta::default());
    let object = dicom_object::open_file(&files[5]).expect("DICOM");
    let p = object.element(tags::IMAGE_POSITION_PATIENT).expect("there").to_multi_float64().expect("numbers");
    edit(&files[5], tags::IMAGE_POSITION_PATIENT, VR::DS, &format!("{:.6}\\{:.6}\\{:.6}", p[0], p[1], p[2] + 20.0));
    refused(far.path(), &["slices 5 and 6", "expected 2.000", "more than 10.0 mm"]);
    for file in &files[1..] {
        fs::remove_file(file).expect("removed");
    }
    refused(far.path(), &["1 slices make no volume"]);
    refused(&files[0], &["1 slices make no volume"]);
}

/// "None is neither little nor big".
#[test]
fn voxels_as_text_were_refused_for_the_order_of_their_bytes() {
    let f = folder();
    let path = f.path().join("a.nrrd");
    let write = |more: &str| {
        let head = "NRRD0005\ntype: int16\ndimension: 3\nsizes: 1 1 2\nspace: LPS\nspace directions: (1,0,0) (0,1,0) (0,0,2)\n";
        fs::write(&path, format!("{head}space origin: (0,0,0)\n{more}\n\n1 2 3 4")).expect("written");
    };
    write("encoding: ascii");
    refused(&path, &["NRRD encoding \"ascii\"", "save it with encoding raw or gzip"]);
    write("encoding: raw");
    refused(&path, &["endian: is missing"]);
    write("encoding: raw\nendian: middle");
    refused(&path, &["\"middle\" is neither little nor big"]);
}

#[test]
fn copies_and_foreign_files_are_left_out_with_a_warning() {
    let f = folder();
    let files = series(f.path(), &SeriesMeta::default());
    let alone = read(f.path(), &any_size()).expect("read");
    fs::copy(&files[3], f.path().join("again")).expect("copied");
    fs::write(f.path().join("readme.txt"), "text").expect("written");
    let scan = read(f.path(), &any_size()).expect("read");
    assert_eq!(scan.volume, alone.volume);
    assert!(scan.warnings.iter().any(|w| w.contains("1 copy of a slice was left out")), "{:?}", scan.warnings);
    assert!(scan.warnings.iter().any(|w| w.contains("1 of 8 files are not DICOM")), "{:?}", scan.warnings);
}

/// "The only series" was said of a folder with three more scans in it, and of three series only the second best was named.
#[test]
fn what_is_passed_over_is_named() {
    let f = folder();
    series(f.path(), &SeriesMeta::default());
    fs::write(f.path().join("head.nii.gz"), "text").expect("written");
    let listed = inspect(f.path()).expect("a listing");
    assert_eq!(listed.reason, "the only DICOM series");
    assert!(listed.warnings.iter().any(|w| w.contains("1 of them NIfTI")), "{:?}", listed.warnings);
    for seed in [2, 3] {
        series(&f.path().join(seed.to_string()), &SeriesMeta { seed, ..SeriesMeta::default() });
    }
    let listed = inspect(f.path()).expect("a listing");
    let others = listed.series.iter().enumerate().filter(|(n, _)| listed.chosen != Some(*n));
    assert_eq!((listed.series.len(), others.clone().count()), (3, 2), "{listed:?}");
    assert!(others.into_iter().all(|(_, s)| listed.reason.contains(&s.source.series)), "{}", listed.reason);
}

/// Phantoms of two kinds had all identifiers of each other: an archive takes one for the other.
#[test]
fn series_of_one_seed_and_two_names_have_identifiers_of_their_own() {
    let f = folder();
    for name in ["head-0", "drawer-0"] {
        series(&f.path().join(name), &SeriesMeta { description: name.into(), ..SeriesMeta::default() });
    }
    let listed = inspect(f.path()).expect("a listing");
    let names: Vec<&str> = listed.series.iter().map(|s| s.source.series.as_str()).collect();
    assert!(names.len() == 2 && names.iter().all(|n| !n.contains('-')), "{names:?}");
}

#[test]
fn compressed_series_give_their_values() {
    for codec in ["jpeg-lossless", "jpeg-2000", "rle"] {
        let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data")).join(codec);
        let scan = read(&path, &any_size()).expect(codec);
        assert_eq!(scan.volume.grid().dims(), [16, 12, 3]);
        for n in 0..scan.volume.grid().len() {
            let [i, j, k] = scan.volume.grid().voxel(n);
            // As the files were made, by GDCM and pydicom.
            assert_eq!(usize::try_from(scan.volume.at(i, j, k)), Ok(20 * i + 7 * j + 100 * k + i * j % 5), "{codec}");
        }
    }
}

/// A cylinder of tissue in air.
fn cylinder(radius_mm: f64, height: usize) -> Volume<i16> {
    let grid = Grid::axis_aligned([125, 125, height], [2.0, 2.0, 2.0], [-124.0, -124.0, 0.0]).expect("a grid");
    let hu = |n: usize| {
        let [i, j, k] = grid.voxel(n);
        let p = grid.centre(i, j, k);
        if p.x.hypot(p.y) <= radius_mm { 60 } else { -1000 }
    };
    Volume::new(grid, (0..grid.len()).map(hu).collect()).expect("a volume")
}

#[test]
fn values_1024_too_high_were_refused_for_want_of_contrast() {
    let dir = folder();
    let mut head = cylinder(90.0, 150);
    head.data_mut().iter_mut().for_each(|v| *v += 1024);
    let path = dir.path().join("head.nrrd");
    fs::write(&path, nrrd::encode_i16(&head)).expect("written");
    let message = read(&path, &ReadOptions::default()).expect_err("a refusal").to_string();
    assert!(message.contains("from 1000 to 1110") && message.contains("subtract 1024"), "{message}");
    head.data_mut().iter_mut().for_each(|v| *v -= 1024);
    fs::write(&path, nrrd::encode_i16(&head)).expect("written");
    assert!(read(&path, &ReadOptions::default()).is_ok());
}

/// 577 ml of a head's bone have such values where the header gives it twice its size: it was told to subtract 1024.
#[test]
fn bone_of_a_head_that_is_twice_too_large_is_not_taken_for_lifted_tissue() {
    let dir = folder();
    let mut head = cylinder(90.0, 150);
    // Bone of all values up to 1800 in a ring, and of it more than 400 ml between 1000 and 1110.
    let grid = *head.grid();
    for (n, hu) in head.data_mut().iter_mut().enumerate() {
        let [i, j, k] = grid.voxel(n);
        let p = grid.centre(i, j, k);
        if (70.0..=90.0).contains(&p.x.hypot(p.y)) {
            *hu = 300 + (n * 7 % 1500) as i16;
        }
    }
    let large = head.data().iter().filter(|v| (1000..=1110).contains(*v)).count();
    let spacing = 2.0 * grid.spacing()[0];
    assert!(large as f64 * spacing.powi(3) > 400e3, "{large} voxels of {spacing} mm");
    let large = Grid::axis_aligned(grid.dims(), [spacing; 3], [0.0; 3]).expect("a grid");
    let head = Volume::new(large, head.data().to_vec()).expect("a volume");
    let path = dir.path().join("large.nrrd");
    fs::write(&path, nrrd::encode_i16(&head)).expect("written");
    let read = read(&path, &ReadOptions::default()).map(drop).map_err(|e| e.to_string());
    assert!(!read.as_ref().is_err_and(|e| e.contains("subtract 1024")), "{read:?}");
}

#[test]
fn inspection_was_silent_about_what_reading_says_of_the_voxels() {
    let f = folder();
    let head = cylinder(90.0, 150);
    let write = |name: &str, volume: &Volume<i16>| {
        let path = f.path().join(name);
        fs::write(&path, nrrd::encode_i16(volume)).expect("written");
        path
    };
    foretold(&write("lifted.nrrd", &head.map(|v| v + 1024)), "subtract 1024");
    for volume in [head.map(|v| (v / 8).clamp(0, 255)), head.map(|v| if v < 0 { -2048 } else { v })] {
        let path = write("odd.nrrd", &volume);
        let read = read(&path, &ReadOptions::default()).expect("a scan").warnings;
        assert!(!read.is_empty());
        assert_eq!(inspect(&path).expect("a listing").warnings, read);
    }
    let series = f.path().join("series");
    write_series(&head.map(|v| if v < 0 { -2048 } else { v }), &series, &SeriesMeta::default()).expect("written");
    let listed = inspect(&series).expect("a listing").warnings;
    assert!(listed.iter().any(|w| w.contains("below -1024 HU")), "{listed:?}");
}

#[test]
fn a_spacing_ten_times_too_large_was_called_hu_plus_1024() {
    let f = folder();
    let head = cylinder(90.0, 150);
    let linear = head.grid().patient_from_voxel().linear;
    let tenfold = Affine::new(Matrix3 { rows: linear.rows.map(|row| row.map(|v| v * 10.0)) }, [0.0; 3]);
    let grid = Grid::new(head.grid().dims(), tenfold).expect("a grid");
    let path = f.path().join("head.nrrd");
    fs::write(&path, nrrd::encode_i16(&Volume::new(grid, head.data().to_vec()).expect("values"))).expect("written");
    let message = read(&path, &ReadOptions::default()).expect_err("a refusal").to_string();
    assert!(message.contains("3000 x 1820 x 1820 mm") && message.contains("spacing of 20.000"), "{message}");
    foretold(&path, "spacing of 20.000");
}

#[test]
fn a_contrast_agent_in_the_header_was_passed_over() {
    let told = |tag: Tag, vr: VR, value: &str| {
        let f = folder();
        series(f.path(), &SeriesMeta::default()).iter().for_each(|file| edit(file, tag, vr, value));
        let read = read(f.path(), &any_size()).expect("a scan").warnings;
        let about = |all: &[String]| all.iter().find(|w| w.contains("contrast agent")).cloned();
        assert_eq!(about(&read), about(&inspect(f.path()).expect("a listing").warnings));
        about(&read)
    };
    let said = told(tags::CONTRAST_BOLUS_AGENT, VR::LO, "OMNIPAQUE").expect("a warning");
    assert!(said.contains("ContrastBolusAgent \"OMNIPAQUE\", in 6 of 6 slices"), "{said}");
    assert!(told(tags::CONTRAST_BOLUS_ROUTE, VR::LO, "IV").is_some());
    assert!(told(tags::CONTRAST_BOLUS_VOLUME, VR::DS, "80").is_some());
    for nothing in ["", "NONE", "no"] {
        assert_eq!(told(tags::CONTRAST_BOLUS_AGENT, VR::LO, nothing), None);
    }
    assert_eq!(told(tags::CONTRAST_BOLUS_VOLUME, VR::DS, "0"), None);
}

#[test]
fn a_knee_is_no_head() {
    let knee = head_extent_check(&cylinder(58.0, 80)).expect_err("a refusal").to_string();
    assert!(knee.contains("not a head"), "{knee}");
    // Long, but thin.
    let leg = head_extent_check(&cylinder(62.0, 120)).expect_err("a refusal").to_string();
    assert!(leg.contains("not a head") && leg.contains("cm2"), "{leg}");
    let slab = head_extent_check(&cylinder(80.0, 20)).expect_err("a refusal").to_string();
    assert!(slab.contains("250 x 250 x 40 mm"), "{slab}");
    assert!(head_extent_check(&cylinder(80.0, 60)).is_ok());
    let small = sampled(grid([60, 60, 50], [2.0; 3], [0.0; 3], [0.0; 3], false));
    let small = head_extent_check(&small).expect_err("a refusal").to_string();
    assert!(small.contains("120 x 120 x 100 mm"), "{small}");
}

#[test]
fn a_knee_written_as_any_format_is_refused_by_read() {
    let f = folder();
    write_series(&cylinder(58.0, 80), &f.path().join("knee"), &SeriesMeta::default()).expect("written");
    fs::write(f.path().join("knee.nii.gz"), nifti::encode_i16(&cylinder(58.0, 80))).expect("written");
    for name in ["knee", "knee.nii.gz"] {
        let message = read(&f.path().join(name), &ReadOptions::default()).expect_err("a refusal").to_string();
        assert!(message.contains("not a head"), "{message}");
    }
}

#[test]
fn labels_must_be_whole_numbers() {
    let f = folder();
    let mut volume = Volume::filled(grid([3, 3, 3], [1.0; 3], [0.0; 3], [0.0; 3], false), 1);
    let at = volume.grid().index(1, 0, 2);
    volume.data_mut()[at] = -7;
    let path = f.path().join("labels.nii.gz");
    fs::write(&path, nifti::encode_i16(&volume)).expect("written");
    let message = read_labels(&path).expect_err("a refusal").to_string();
    assert!(message.contains("-7") && message.contains("[1, 0, 2]"), "{message}");
}
