//! Wrong input of each kind gets a clear error and leaves nothing behind.

use crate::common::{json, monro, refusal, text};
use monro_geometry::{Grid, Volume};
use monro_scan::dicom::{self, SeriesMeta};
use monro_scan::nifti;
use std::fs;
use std::path::Path;

/// Nothing but the given names may be in the folder.
fn only(dir: &Path, names: &[&str]) {
    let mut found: Vec<String> = fs::read_dir(dir)
        .expect("list")
        .map(|e| e.expect("entry").file_name().to_string_lossy().into_owned())
        .collect();
    found.sort();
    assert_eq!(found, names, "left behind in {}", dir.display());
}

#[test]
fn an_empty_folder_is_no_scan() {
    let dir = tempfile::tempdir().expect("temp");
    fs::create_dir(dir.path().join("scan")).expect("dir");
    let said = refusal(&["prepare", text(&dir.path().join("scan")), "--out", text(&dir.path().join("case"))]);
    assert!(said.contains("scan"), "{said}");
    only(dir.path(), &["scan"]);
}

#[test]
fn a_folder_of_recordings_was_an_error_of_the_system() {
    let dir = tempfile::tempdir().expect("temp");
    let said = refusal(&["replay", text(dir.path())]);
    assert!(said.contains(text(dir.path())) && said.contains("one of the recordings"), "{said}");
}

#[test]
fn a_missing_file_was_told_after_all_phantoms_had_been_meshed_and_their_numbers_were_lost() {
    let dir = tempfile::tempdir().expect("temp");
    let missing = dir.path().join("head.nii.gz");
    let said = refusal(&["bench", "mesh", "--seeds", "1", "--elements", "612", text(&missing)]);
    assert!(said.contains("head.nii.gz") && !said.contains("phantom 0"), "{said}");
}

#[test]
fn a_text_file_named_dcm_is_named() {
    let dir = tempfile::tempdir().expect("temp");
    let file = dir.path().join("notes.dcm");
    fs::write(&file, "this is no image").expect("write");
    let said = refusal(&["prepare", text(&file), "--out", text(&dir.path().join("case"))]);
    assert!(said.contains("notes.dcm"), "{said}");
    only(dir.path(), &["notes.dcm"]);
}

#[test]
fn a_path_that_does_not_exist_is_named() {
    let dir = tempfile::tempdir().expect("temp");
    let said = refusal(&["inspect", text(&dir.path().join("nowhere"))]);
    assert!(said.contains("nowhere"), "{said}");
    let said = refusal(&["edit", text(&dir.path().join("typo"))]);
    assert!(said.contains("typo: no such file"), "{said}");
    let said = refusal(&["simulate", text(&dir.path().join("nocase")), "--out", text(&dir.path().join("out"))]);
    assert!(said.contains("nocase"), "{said}");
    only(dir.path(), &[]);
}

#[test]
fn an_occupied_folder_is_refused_before_any_work() {
    let dir = tempfile::tempdir().expect("temp");
    let out = dir.path().join("photos");
    fs::create_dir(&out).expect("dir");
    fs::write(out.join("cat.jpg"), b"x").expect("write");
    let said = refusal(&["phantom", "--out", text(&out)]);
    assert!(said.contains("--force"), "{said}");
    let said = refusal(&["phantom", "--out", text(&out), "--force"]);
    assert!(said.contains("will not delete"), "{said}");
    assert_eq!(fs::read(out.join("cat.jpg")).expect("still there"), b"x");
    only(dir.path(), &["photos"]);
}

#[test]
fn a_bad_option_is_explained_with_status_two() {
    let out = monro(&["simulate", "case", "--out", "x", "--mode", "magic"]);
    assert_eq!(out.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&out.stderr).contains("paper"));
}

/// A ball of tissue of the given radius in a box of 4 mm voxels.
fn ball(radius: f64, voxels: usize) -> Volume<i16> {
    let grid = Grid::axis_aligned([voxels; 3], [4.0; 3], [0.0; 3]).expect("grid");
    let middle = grid.centre(voxels / 2, voxels / 2, voxels / 2);
    let at = |n: usize| {
        let [i, j, k] = grid.voxel(n);
        if grid.centre(i, j, k).distance(middle) < radius { 40 } else { -1000 }
    };
    Volume::new(grid, (0..grid.len()).map(at).collect()).expect("count")
}

fn series(dir: &Path, number: u16, patient: &str) {
    fs::create_dir_all(dir).expect("dir");
    let meta = SeriesMeta { seed: number.into(), number, patient_id: patient.into(), ..SeriesMeta::default() };
    dicom::write_series(&ball(95.0, 64), dir, &meta).expect("series");
}

#[test]
fn two_patients_in_one_folder_are_refused_without_their_names() {
    let dir = tempfile::tempdir().expect("temp");
    let scan = dir.path().join("scan");
    series(&scan.join("a"), 1, "SMITH-1");
    series(&scan.join("b"), 2, "JONES-2");
    let said = refusal(&["prepare", text(&scan), "--out", text(&dir.path().join("case"))]);
    assert!(said.contains("2 patients") || said.contains("two patients"), "{said}");
    assert!(!said.contains("SMITH") && !said.contains("JONES"), "{said}");
    only(dir.path(), &["scan"]);
}

#[test]
fn a_knee_is_no_head() {
    let dir = tempfile::tempdir().expect("temp");
    let file = dir.path().join("knee.nii.gz");
    fs::write(&file, nifti::encode_i16(&ball(45.0, 40))).expect("write");
    let said = refusal(&["prepare", text(&file), "--out", text(&dir.path().join("case"))]);
    assert!(said.contains("not a head") && said.contains("mm"), "{said}");
    only(dir.path(), &["knee.nii.gz"]);
}

#[test]
fn a_ball_of_tissue_without_a_skull_is_refused_with_a_way_out() {
    let dir = tempfile::tempdir().expect("temp");
    let file = dir.path().join("ball.nii.gz");
    fs::write(&file, nifti::encode_i16(&ball(95.0, 64))).expect("write");
    let said = refusal(&["prepare", text(&file), "--out", text(&dir.path().join("case"))]);
    assert!(said.contains("segmentation") && said.contains("--labels"), "{said}");
    only(dir.path(), &["ball.nii.gz"]);
}

#[test]
fn truncated_files_of_each_kind_are_named() {
    let dir = tempfile::tempdir().expect("temp");
    series(&dir.path().join("scan"), 1, "P");
    let slice = fs::read_dir(dir.path().join("scan")).expect("list").next().expect("a slice").expect("entry").path();
    let bytes = fs::read(&slice).expect("read");
    fs::write(&slice, &bytes[..bytes.len() / 2]).expect("write");
    let said = refusal(&["prepare", text(&dir.path().join("scan")), "--out", text(&dir.path().join("case"))]);
    assert!(said.contains(text(Path::new(slice.file_name().expect("name")))), "{said}");
    let file = dir.path().join("head.nii.gz");
    let whole = nifti::encode_i16(&ball(95.0, 64));
    fs::write(&file, &whole[..whole.len() / 3]).expect("write");
    let said = refusal(&["prepare", text(&file), "--out", text(&dir.path().join("case"))]);
    assert!(said.contains("head.nii.gz"), "{said}");
    only(dir.path(), &["head.nii.gz", "scan"]);
}

#[test]
fn labels_on_no_known_numbers_are_refused() {
    let dir = tempfile::tempdir().expect("temp");
    let [scan, labels] = ["head.nii.gz", "labels.nii.gz"].map(|n| dir.path().join(n));
    let ct = ball(95.0, 64);
    fs::write(&scan, nifti::encode_i16(&ct)).expect("write");
    fs::write(&labels, nifti::encode_u8(&ct.map(|hu| if hu > 0 { 42 } else { 0 }))).expect("write");
    let said = refusal(&["prepare", text(&scan), "--labels", text(&labels), "--out", text(&dir.path().join("case"))]);
    assert!(said.contains("42") && said.contains("labels.nii.gz"), "{said}");
}

#[test]
fn a_folder_with_volumes_but_no_dicom_did_not_name_them() {
    let dir = tempfile::tempdir().expect("temp");
    let scan = dir.path().join("patient");
    fs::create_dir(&scan).expect("dir");
    fs::write(scan.join("README.md"), "x").expect("write");
    fs::write(scan.join("head.nii.gz"), nifti::encode_i16(&ball(95.0, 40))).expect("write");
    let found = json(&["inspect", text(&scan)]);
    assert_eq!(found["dims"], serde_json::json!([40, 40, 40]), "the one volume is taken");
    fs::write(scan.join("truth.mha"), "x").expect("write");
    let out = dir.path().join("case");
    for args in [&["inspect", text(&scan)][..], &["prepare", text(&scan), "--out", text(&out)]] {
        let said = refusal(args);
        assert!(said.contains("head.nii.gz, truth.mha"), "{said}");
    }
    fs::write(scan.join("case.toml"), "").expect("write");
    let said = refusal(&["prepare", text(&scan), "--out", text(&out)]);
    assert!(said.contains("is a case already") && said.contains("simulate"), "{said}");
}

#[test]
fn values_in_a_wrong_form_did_not_say_which_form_is_wanted() {
    for (args, words) in [
        (&["simulate", "x", "--out", "y", "--speed", "-3"][..], "x: no such file or folder"),
        (&["simulate", "x", "--out", "y", "--drain-ml", "5ml"], "without a unit"),
        (&["simulate", "x", "--out", "y", "--tip", "cone:95"], "3 to 86 degrees"),
        (&["serve", "x", "--listen", "9000"], "ADDRESS:PORT"),
        (&["serve"], "--scans <DIR> --out <CASE>"),
        (&["mesh", "x", "--out", "y", "--elements", "-5"], "from 500 to 20000000"),
        (&["simulate", "x", "--out", "y", "--side", "left"], "monro prepare"),
    ] {
        let said = refusal(args);
        assert!(said.contains(words), "{said}");
    }
}

#[test]
fn a_recording_of_the_script_was_an_empty_file() {
    let dir = tempfile::tempdir().expect("temp");
    let file = dir.path().join("rec.mnr");
    let said = refusal(&["track", "sim:", "--record", text(&file), "--frames", "3"]);
    assert!(said.contains("sim:") && said.contains("fake-tracker"), "{said}");
    let said =
        refusal(&["track", "natnet://127.0.0.1:1?interface=203.0.113.7", "--record", text(&file), "--frames", "3"]);
    assert!(said.contains("203.0.113.7"), "{said}");
    only(dir.path(), &[]);
}

/// `monro register ... | head -1` used to panic.
#[test]
fn a_closed_output_is_no_panic() {
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_monro"))
        .args(["doctor", "sim:", "--listen", "0.3"])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("the command starts");
    drop(child.stdout.take());
    let out = child.wait_with_output().expect("ends");
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
}
