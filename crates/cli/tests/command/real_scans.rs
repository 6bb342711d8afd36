//! The real scans of `../shared/data`, where they exist: landmarks, ventricles, and a catheter that ends in one.

use crate::common::{data, distance, json, point, text};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// Prepares and simulates one scan and compares its landmarks with those estimated by hand.
fn check(folder: &str, scan: &str, side: &str) {
    let Some(data) = data() else {
        println!("skipped: no data");
        return;
    };
    let dir = tempfile::tempdir().expect("temp");
    let [case, out] = ["case", "out"].map(|n| dir.path().join(n));
    let scan = data.join(folder).join(scan);
    let prepared = json(&["prepare", text(&scan), "--out", text(&case), "--side", side]);
    compare_landmarks(&data.join(folder).join("landmarks.json"), &prepared);
    let elements = prepared["elements"].as_f64().expect("elements");
    assert!((elements / 37336.0 - 1.0).abs() <= 0.05, "{elements} elements");
    // At the default speed: a faster catheter carries the tissue along, and a target on a ventricle's wall slips past.
    let done = json(&["simulate", text(&case), "--out", text(&out), "--withdraw"]);
    assert_eq!((&done["reached_ventricle"], &done["ends_in_ventricle"]), (&true.into(), &true.into()), "{done}");
    assert!(done["tip_error_mm"].as_f64().expect("error") < 5.0, "{done}");
    came_out(&done["withdrawal"]);
}

/// The catheter came out, held back by less than went in, and left nothing behind: tissue is elastic.
fn came_out(withdrawal: &Value) {
    assert_eq!((&withdrawal["reliable"], &withdrawal["at_tip"]), (&true.into(), &Value::Null), "{withdrawal}");
    let number = |name: &str| withdrawal[name].as_f64().expect(name);
    assert!((1.0..200.0).contains(&number("max_pull_mn")), "{withdrawal}");
    assert!(number("left_ventricle_depth_mm") > number("left_brain_depth_mm"), "{withdrawal}");
    assert!(number("target_shift_mm") < 0.05 && number("wall_shift_mm") < 0.5, "{withdrawal}");
}

/// The file is in RAS; Monro answers in LPS.
fn compare_landmarks(file: &Path, prepared: &Value) {
    let truth: Value = serde_json::from_slice(&fs::read(file).expect("landmarks.json")).expect("JSON");
    let limits = [
        ("Monro left", "foramen_monro_left", 6.0),
        ("Monro right", "foramen_monro_right", 6.0),
        ("Kocher left", "kocher_left_skin", 12.0),
        ("Kocher right", "kocher_right_skin", 12.0),
    ];
    for (label, key, limit) in limits {
        let [r, a, s] = point(&truth[key]);
        let found = point(&prepared["landmarks_lps_mm"][label]);
        let error = distance(found, [-r, -a, s]);
        assert!(error <= limit, "{label}: {error:.1} mm from the estimate, limit {limit} mm");
    }
}

#[test]
fn head_ct_2mm() {
    check("head-ct-2mm", "head_ct.mha", "right");
}

#[test]
fn head_ct_thin() {
    check("head-ct-thin", "head_ct.nii.gz", "left");
}

#[test]
fn head_ct_dicom_tilt() {
    check("head-ct-dicom-tilt", "dicom", "right");
}
