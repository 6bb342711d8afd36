//! Segmentation and landmarks against phantoms (truth) and real scans (references of the data set).

use monro_anatomy::landmarks::{self, LandmarkError};
use monro_anatomy::phantom::{HeadOptions, head};
use monro_anatomy::segment::{SegmentError, Segmentation, from_labels, onto_grid, outside_head, segment};
use monro_geometry::{Affine, Grid, Matrix3, Patient, Point, Rigid, Vector, Volume};
use monro_scan::ReadOptions;
use std::path::PathBuf;

/// A file of the shared data; `None` (said on stdout) where there are none.
fn data(name: &str) -> Option<PathBuf> {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")).join(name);
    if !path.exists() {
        println!("skipped: no data");
        return None;
    }
    Some(path)
}

fn scan(name: &str) -> Option<Volume<i16>> {
    Some(monro_scan::read(&data(name)?, &ReadOptions::default()).expect("scan").volume)
}

/// Dice of the structures that `ours` accepts against the reference labels that `theirs` accepts, on the reference's grid.
fn dice(found: &Segmentation, reference: &Volume<u16>, ours: impl Fn(u8) -> bool, theirs: impl Fn(u16) -> bool) -> f64 {
    let (mut both, mut sum) = (0usize, 0usize);
    for (n, &r) in reference.data().iter().enumerate() {
        let [i, j, k] = reference.grid().voxel(n);
        let a = ours(found.labels.nearest(reference.grid().centre(i, j, k)).unwrap_or(0));
        let b = theirs(r);
        both += usize::from(a && b);
        sum += usize::from(a) + usize::from(b);
    }
    2.0 * both as f64 / sum as f64
}

/// The confidence of our structures is their Dice against labels of the reference, to 0.045.
fn calibrated(found: &Segmentation, reference: &Volume<u16>, pairs: &[(u8, u16)]) {
    for &(ours, theirs) in pairs {
        let score = dice(found, reference, |l| l == ours, |r| r == theirs);
        let expected = found.confidence.iter().find(|(s, _)| s.label() == ours).expect("confidence").1;
        assert!((expected - score).abs() < 0.045, "structure {ours}: Dice {score:.3}, expected {expected:.3}");
    }
}

fn lateral(l: u8) -> bool {
    l == 5 || l == 6
}

/// A `"key": [x, y, z]` entry (RAS mm) of a landmarks file, as LPS.
fn entry(text: &str, key: &str) -> Point<Patient> {
    let rest = &text[text.find(&format!("\"{key}\"")).expect("key")..];
    let inside = &rest[rest.find('[').expect("[") + 1..rest.find(']').expect("]")];
    let v: Vec<f64> = inside.split(',').map(|n| n.trim().parse().expect("number")).collect();
    Point::new(-v[0], -v[1], v[2])
}

/// Falx and tentorium of the size of anatomy (some 50 to 60 cm2 each), inside the skull, clear of the ventricles, the falx in the midplane.
fn check_septa(found: &Segmentation) {
    let [falx, tentorium] = landmarks::septa(found).expect("septa");
    let cm2 = [&falx, &tentorium].map(|sheet| sheet.area() / 100.0);
    assert!(cm2.iter().all(|a| (35.0..85.0).contains(a)), "{cm2:?}");
    assert!(falx.vertices.iter().all(|p| found.midsagittal.signed_distance(*p).abs() < 1e-6));
    // Not outside of the head, where a speck of bone or lime does no harm; nowhere in a ventricle.
    let within = |p: &&Point<Patient>| found.labels.nearest(**p).is_some_and(|l| (3..5).contains(&l));
    for sheet in [&falx, &tentorium] {
        let share = sheet.vertices.iter().filter(within).count() as f64 / sheet.vertices.len() as f64;
        assert!(share > 0.98, "{share}");
    }
    let wet = falx.vertices.iter().filter(|p| found.labels.nearest(**p).is_some_and(|l| l >= 5)).count();
    assert_eq!(wet, 0);
}

/// Foramina within 6 mm and Kocher's points within 12 mm of the data set's estimates.
fn check_landmarks(ct: &Volume<i16>, found: &Segmentation, folder: &str) {
    let text = std::fs::read_to_string(data(folder).expect("data").join("landmarks.json")).expect("landmarks");
    let marks = landmarks::find(ct, found).expect("landmarks");
    for (name, p, limit) in [
        ("foramen_monro_left", marks.monro_left, 6.0),
        ("foramen_monro_right", marks.monro_right, 6.0),
        ("kocher_left_skin", marks.kocher_left, 12.0),
        ("kocher_right_skin", marks.kocher_right, 12.0),
        ("nasion_skin", marks.nasion, 8.0),
    ] {
        let off = p.distance(entry(&text, name));
        assert!(off <= limit, "{folder} {name}: {off:.1} mm off; {:?}", marks.findings);
    }
}

#[test]
fn the_2mm_head_agrees_with_its_reference_and_the_cyst_stays_out() {
    let Some(ct) = scan("head-ct-2mm/head_ct.mha") else { return };
    let found = segment(&ct).expect("segmentation");
    let reference =
        monro_scan::read_labels(&data("head-ct-2mm/ventricles_reference.nii.gz").expect("data")).expect("reference");
    let score = dice(&found, &reference, lateral, |r| r == 1 || r == 2);
    assert!(score >= 0.88, "{score}");
    calibrated(&found, &reference, &[(5, 1), (6, 2)]);
    let sides = [(5, 1), (6, 2)].map(|(a, b)| dice(&found, &reference, |l| l == a, |r| r == b));
    assert!(sides.iter().all(|s| *s > 0.8), "{sides:?}");
    // The cyst of the posterior fossa has ventricle-like HU; 40 mm below the foramina nothing is ventricle.
    let low = (0..ct.data().len()).filter(|&n| (5..8).contains(&found.labels.data()[n]));
    let [_, _, z] = low
        .map(|n| ct.grid().voxel(n))
        .map(|[i, j, k]| ct.grid().centre(i, j, k).to_array())
        .fold([0.0, 0.0, f64::INFINITY], |best, p| if p[2] < best[2] { p } else { best });
    assert!(z > -561.0, "{z}");
    check_landmarks(&ct, &found, "head-ct-2mm");
    check_septa(&found);
}

#[test]
fn the_thin_head_agrees_with_its_reference_and_its_cuts_are_told() {
    let Some(ct) = scan("head-ct-thin/head_ct.nii.gz") else { return };
    let found = segment(&ct).expect("segmentation");
    let reference =
        monro_scan::read_labels(&data("head-ct-thin/ventricles_reference.nii.gz").expect("data")).expect("reference");
    let score = dice(&found, &reference, lateral, |r| r == 1 || r == 2);
    // The reference is a threshold of the same noisy voxels: a truer border does not follow their wobbles.
    assert!(score >= 0.87, "{score}");
    calibrated(&found, &reference, &[(5, 1), (6, 2)]);
    assert!(found.findings.iter().any(|f| f.contains("vertex cut")), "{:?}", found.findings);
    check_landmarks(&ct, &found, "head-ct-thin");
    check_septa(&found);
}

#[test]
fn the_tilted_turned_head_gives_a_sane_model() {
    let Some(ct) = scan("head-ct-dicom-tilt/dicom") else { return };
    let found = segment(&ct).expect("segmentation");
    let normal = found.midsagittal.normal;
    // The head is turned by about 11 degrees about the vertical.
    assert!((normal.y.atan2(normal.x).to_degrees() + 11.0).abs() < 2.5, "{normal:?}");
    let ml = |s: u8| {
        found.labels.data().iter().filter(|&&l| l == s).count() as f64 * found.labels.grid().voxel_volume() / 1000.0
    };
    assert!((25.0..50.0).contains(&ml(5)) && (25.0..50.0).contains(&ml(6)), "{} {}", ml(5), ml(6));
    assert!((2.0..9.0).contains(&ml(7)) && ml(4) > 1000.0);
    check_landmarks(&ct, &found, "head-ct-dicom-tilt");
    check_septa(&found);
}

/// How far falx and tentorium lie from where the reference labels of the template have one hemisphere or the cerebellum on one side
/// and another on the other, mm: on average and at most.
fn septa_to_borders(found: &Segmentation, reference: &Volume<u16>) -> [f64; 2] {
    let part = |label: u16| match label {
        38..=41 | 71..=73 => 1,
        // Cortex and white matter: even numbers on the right from 100 on, odd ones before.
        42 | 44 => 2,
        43 | 45 => 3,
        100.. => 2 + label % 2,
        _ => 0,
    };
    let grid = reference.grid();
    let at = |v: [usize; 3]| part(reference.data()[grid.index(v[0], v[1], v[2])]);
    let centre = |[i, j, k]: [usize; 3]| grid.centre(i, j, k);
    let mut borders = Vec::new();
    for v in (0..grid.len()).map(|n| grid.voxel(n)).filter(|v| at(*v) > 0) {
        for a in 0..3 {
            // Up to 10 mm of fluid that has no label may lie between.
            let along = (v[a] + 1..(v[a] + 6).min(grid.dims()[a])).map(|i| {
                let mut next = v;
                next[a] = i;
                next
            });
            let next = along.into_iter().find(|next| at(*next) > 0).filter(|next| at(*next) != at(v));
            borders.extend(next.map(|next| centre(v).lerp(centre(next), 0.5)));
        }
    }
    let [falx, tentorium] = landmarks::septa(found).expect("septa");
    let off = |p: &Point<Patient>| borders.iter().map(|b| b.distance(*p)).fold(f64::INFINITY, f64::min);
    let all: Vec<f64> = falx.vertices.iter().chain(&tentorium.vertices).map(off).collect();
    [all.iter().sum::<f64>() / all.len() as f64, all.iter().copied().fold(0.0, f64::max)]
}

#[test]
fn the_masked_template_has_no_skin_and_says_so() {
    let Some(ct) = scan("ct-template-labels/template_with_skull_2mm.nii.gz") else { return };
    let found = segment(&ct).expect("segmentation");
    // On the scan's own grid: the centres of the finer labels lie between its voxels, and the nearest shifts by half a mm.
    let reference =
        monro_scan::read_labels(&data("ct-template-labels/structures_2mm.nii.gz").expect("data")).expect("reference");
    let score = dice(&found, &reference, lateral, |r| r == 51 || r == 52);
    assert!(score >= 0.85, "{score}");
    calibrated(&found, &reference, &[(5, 52), (6, 51), (7, 4)]);
    check_septa(&found);
    let [mean, most] = septa_to_borders(&found, &reference);
    assert!(mean < 2.5 && most < 10.0, "{mean} {most}");
    ventricles_that_grow_turned_the_tentorium(&found);
    // Zeros around it are air since they are told as filled in; a voxel of blurred bone was its skin then.
    let none = landmarks::find(&ct, &found).expect_err("no skin");
    assert!(matches!(none, LandmarkError::BareSkull { thickness_mm } if thickness_mm < 3.0), "{none}");
}

/// They say how the head is nodded first: 6 mm larger ones turned it by up to 15 degrees, and the tentorium with it.
fn ventricles_that_grow_turned_the_tentorium(found: &Segmentation) {
    let mut large = found.clone();
    let dims = found.labels.grid().dims();
    let steps = [1, dims[0], dims[0] * dims[1]];
    for _ in 0..3 {
        let before = large.labels.data().to_vec();
        for (n, label) in large.labels.data_mut().iter_mut().enumerate().filter(|(_, l)| **l == 4) {
            let beside = steps.iter().flat_map(|s| [n.checked_sub(*s), Some(n + s)]).flatten();
            let wet = beside.filter_map(|m| before.get(m).copied()).find(|l| lateral(*l));
            *label = wet.unwrap_or(*label);
        }
    }
    let [before, after] = [found, &large].map(|s| landmarks::septa(s).expect("septa")[1].vertices.clone());
    let off = |p: &Point<Patient>| before.iter().map(|b| b.distance(*p)).fold(f64::INFINITY, f64::min);
    let mean = after.iter().map(off).sum::<f64>() / after.len() as f64;
    assert!(mean < 4.0, "{mean}");
}

#[test]
fn a_phantom_is_found_again() {
    let made = head(&HeadOptions { seed: 3, ..HeadOptions::default() }).expect("phantom");
    let found = segment(&made.ct).expect("segmentation");
    let truth = made.labels.map(u16::from);
    for (s, least) in [(1, 0.95), (2, 0.9), (4, 0.88), (5, 0.97), (6, 0.97), (7, 0.91)] {
        let score = dice(&found, &truth, |l| l == s, |t| t == u16::from(s));
        assert!(score >= least, "structure {s}: {score}");
    }
    calibrated(&found, &truth, &[(5, 5), (6, 6), (7, 7)]);
    check_septa(&found);
    let marks = landmarks::find(&made.ct, &found).expect("landmarks");
    for (name, p, q, limit) in [
        ("nasion", marks.nasion, made.landmarks.nasion, 4.0),
        ("kocher left", marks.kocher_left, made.landmarks.kocher_left, 5.0),
        ("kocher right", marks.kocher_right, made.landmarks.kocher_right, 5.0),
        ("monro left", marks.monro_left, made.landmarks.monro_left, 4.0),
        ("monro right", marks.monro_right, made.landmarks.monro_right, 4.0),
    ] {
        assert!(p.distance(q) < limit, "{name}: {:.1} mm off", p.distance(q));
    }
}

/// Large ventricles reach where other heads have sulci and cisterns: the fluid that began there filled half of them from within.
#[test]
fn large_ventricles_were_lost_to_the_fluid_around_the_brain() {
    let options = HeadOptions { seed: 3, ventricle_width: Some(5.0), ..HeadOptions::default() };
    let made = head(&options).expect("phantom");
    let found = segment(&made.ct).expect("segmentation");
    let truth = made.labels.map(u16::from);
    let voxels = truth.data().iter().filter(|&&t| t == 5).count();
    assert!(voxels as f64 * truth.grid().voxel_volume() > 150_000.0, "{voxels}");
    let scores = [5, 6].map(|s| dice(&found, &truth, |l| l == s, |t| t == u16::from(s)));
    assert!(scores.iter().all(|s| *s > 0.97), "{scores:?}");
}

/// The same voxels in another position: turned about the patient's axes (degrees), rows and slices in reverse order.
fn turned(ct: &Volume<i16>, degrees: [f64; 3]) -> Volume<i16> {
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Vector::<Patient>::from_array);
    let centre = ct.grid().centre(ct.grid().dims()[0] / 2, ct.grid().dims()[1] / 2, ct.grid().dims()[2] / 2);
    let about = |a: usize| {
        Rigid::<Patient, Patient>::from_axis_angle(axes[a], degrees[a].to_radians(), Vector::ZERO).expect("axis")
    };
    let turn = about(2).after(&about(1)).after(&about(0));
    let [nx, ny, nz] = ct.grid().dims();
    let place = |i: f64, j: f64, k: f64| {
        let p = ct.grid().patient_from_voxel().point(Point::new(i, ny as f64 - 1.0 - j, nz as f64 - 1.0 - k));
        centre + turn.vector(p - centre)
    };
    let origin = place(0.0, 0.0, 0.0);
    let linear = Matrix3::from_columns(
        place(1.0, 0.0, 0.0) - origin,
        place(0.0, 1.0, 0.0) - origin,
        place(0.0, 0.0, 1.0) - origin,
    );
    let grid = Grid::new([nx, ny, nz], Affine::new(linear, origin.to_array())).expect("grid");
    let data = (0..grid.len())
        .map(|n| {
            let [i, j, k] = grid.voxel(n);
            ct.at(i, ny - 1 - j, nz - 1 - k)
        })
        .collect();
    Volume::new(grid, data).expect("count")
}

#[test]
fn a_turned_and_reordered_head_keeps_its_labels() {
    let Some(ct) = scan("head-ct-thin/head_ct.nii.gz") else { return };
    let plain = segment(&ct).expect("segmentation");
    let moved = segment(&turned(&ct, [10.0, -9.0, 13.0])).expect("turned");
    let [_, ny, nz] = ct.grid().dims();
    let mut pairs = [[0usize; 2]; 8];
    for (n, &m) in moved.labels.data().iter().enumerate() {
        let [i, j, k] = ct.grid().voxel(n);
        let p = plain.labels.at(i, ny - 1 - j, nz - 1 - k);
        pairs[usize::from(m)][0] += usize::from(m == p);
        pairs[usize::from(m)][1] += 1;
        pairs[usize::from(p)][1] += 1;
    }
    for (s, least) in [(1, 0.95), (2, 0.95), (4, 0.95), (5, 0.9), (6, 0.9)] {
        let score = 2.0 * pairs[s][0] as f64 / pairs[s][1] as f64;
        assert!(score > least, "structure {s}: {score}");
    }
}

#[test]
fn what_is_no_head_is_refused_by_name() {
    let grid = Grid::axis_aligned([60, 60, 60], [3.0; 3], [0.0; 3]).expect("grid");
    let air = Volume::filled(grid, -1000i16);
    assert!(matches!(segment(&air), Err(SegmentError::NoSkull { .. })));
    let water = air.map(|_| 0i16);
    assert!(matches!(segment(&water), Err(SegmentError::NoSkull { .. })));
    // A block of bone without a brain.
    let mut bone = air.clone();
    for n in 0..bone.data().len() {
        let [i, j, k] = grid.voxel(n);
        if [i, j, k].iter().all(|c| (15..45).contains(c)) {
            bone.data_mut()[n] = 900;
        }
    }
    let refused = segment(&bone).expect_err("no brain");
    assert!(refused.to_string().contains("--labels FILE"), "{refused}");
}

/// The labels moved through the patient, mm, as from a program that lost the origin.
fn shifted(labels: &Volume<u8>, by: [f64; 3]) -> Volume<u8> {
    let mut place = *labels.grid().patient_from_voxel();
    place.offset.iter_mut().zip(by).for_each(|(o, b)| *o += b);
    let grid = Grid::new(labels.grid().dims(), place).expect("grid");
    Volume::new(grid, labels.data().to_vec()).expect("count")
}

#[test]
fn given_labels_are_checked_and_resampled() {
    let made = head(&HeadOptions { spacing_mm: [2.0, 2.0, 2.5], ..HeadOptions::default() }).expect("phantom");
    let taken = from_labels(&made.ct, made.labels.clone()).expect("own labels");
    assert_eq!(taken.labels, made.labels);
    assert!(!taken.findings.iter().any(|f| f.contains("outside the head")), "{:?}", taken.findings);
    let turn = taken.midsagittal.normal.angle(segment(&made.ct).expect("segmentation").midsagittal.normal);
    assert!(turn.to_degrees() < 2.0, "{turn}");

    let other = head(&HeadOptions { spacing_mm: [2.5, 2.5, 3.0], ..HeadOptions::default() }).expect("phantom");
    let moved = from_labels(&made.ct, other.labels).expect("other grid");
    assert!(moved.findings.iter().any(|f| f.contains("nearest neighbour")), "{:?}", moved.findings);

    let empty = made.labels.map(|l| if l == 6 { 5 } else { l });
    assert_eq!(
        from_labels(&made.ct, empty).expect_err("empty"),
        SegmentError::EmptyStructure { name: "right_lateral_ventricle", label: 6 }
    );
    // Planes lost in the middle of the head had the foramen 45 mm off, in silence.
    for (axis, name) in ['i', 'j', 'k'].into_iter().enumerate() {
        let mut torn = made.labels.clone();
        let grid = *torn.grid();
        let plane = grid.dims()[axis] / 2;
        torn.data_mut().iter_mut().enumerate().filter(|(n, _)| grid.voxel(*n)[axis] == plane).for_each(|(_, l)| *l = 0);
        let refused = from_labels(&made.ct, torn).expect_err("torn");
        let wanted = |e: &SegmentError| matches!(e, SegmentError::EmptyPlanes { axis, first, last, .. } if (*axis, *first, *last) == (name, plane, plane));
        assert!(wanted(&refused), "{name}: {refused}");
    }
    let strange = made.labels.map(|l| if l == 3 { 77 } else { l });
    assert!(matches!(from_labels(&made.ct, strange), Err(SegmentError::UnknownLabel { label: 77, .. })));
    let outside = outside_head(&made.ct, &shifted(&made.labels, [30.0, 0.0, 0.0]));
    assert!(["scalp", "skull"].iter().all(|s| outside.iter().any(|f| f.contains(s))), "{outside:?}");
    assert!(outside.iter().all(|f| f.contains("outside the head")), "{outside:?}");
    let far = Grid::axis_aligned([9, 9, 9], [1.0; 3], [5000.0, 0.0, 0.0]).expect("grid");
    let refused = from_labels(&made.ct, Volume::filled(far, 4)).expect_err("elsewhere");
    assert!(matches!(refused, SegmentError::LabelsElsewhere { .. }));
    // Both geometries whole: the same voxels the other way round differ in their axes only.
    let said = refused.to_string();
    let wanted = "[9, 9, 9] voxels of 1.000 1.000 1.000 mm, first at (5000.00 0.00 0.00), axes (1.000 0.000 0.000) (0.000 1.000 0.000)";
    assert!(said.contains(wanted) && said.matches("axes").count() == 2, "{said}");
    let swapped = made.labels.map(|l| [l, 6, 5][usize::from(l == 5) + 2 * usize::from(l == 6)]);
    let told = from_labels(&made.ct, swapped).expect("labels").findings;
    assert_eq!(told.iter().filter(|f| f.contains("exchanged")).count(), 2, "{told:?}");
    assert!(!taken.findings.iter().any(|f| f.contains("exchanged")), "{:?}", taken.findings);
}

#[test]
fn labels_stored_otherwise_or_cropped_are_taken_voxel_by_voxel() {
    let grid = Grid::axis_aligned([12, 10, 8], [1.0, 1.5, 2.0], [-5.0, 7.0, 30.0]).expect("grid");
    let labels = Volume::new(grid, (0..grid.len()).map(|n| (n % 8) as u8).collect()).expect("count");
    // A corner of it, and the x axis stored backwards: few per cent of the scan, but all of it is in the scan.
    let place = *grid.patient_from_voxel();
    let mut turned = place;
    turned.linear.rows[0][0] = -1.0;
    turned.offset = place.point(Point::new(4.0, 3.0, 2.0)).to_array();
    let crop = Grid::new([3, 4, 2], turned).expect("grid");
    let value = |n: usize| {
        let [i, j, k] = crop.voxel(n);
        labels.at(4 - i, 3 + j, 2 + k)
    };
    let part = Volume::new(crop, (0..crop.len()).map(value).collect()).expect("count");
    let (taken, remark) = onto_grid(&grid, part).expect("in the scan");
    assert_eq!(remark, None);
    for n in 0..grid.len() {
        let [i, j, k] = grid.voxel(n);
        let inside = (2..=4).contains(&i) && (3..7).contains(&j) && (2..4).contains(&k);
        assert_eq!(taken.data()[n], if inside { labels.data()[n] } else { 0 }, "{i} {j} {k}");
    }
    // Half a voxel off is resampled, and a part beyond the scan is told.
    let (_, remark) = onto_grid(&grid, shifted(&labels, [3.5, 0.0, 0.0])).expect("overlaps");
    let remark = remark.expect("told");
    assert!(remark.contains("nearest neighbour") && remark.contains("beyond the scan"), "{remark}");
}
