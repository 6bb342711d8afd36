//! `--force` replaces an earlier output of the same command, and nothing else.

use crate::common::{json, refusal, text};
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A manifest without files: a case as far as `--force` can tell.
const MANIFEST: &str = "schema = 1\ngenerator = \"monro\"\nnotice = \"\"\npseudonym = \"case\"\nside = \"right\"\nfiles = []\n\
[source]\nformat = \"DICOM\"\nseries = \"\"\ndims = [1, 1, 1]\nspacing_mm = [1.0, 1.0, 1.0]\n";

/// Something that has the looks of a case, and a file.
fn case(dir: &Path, file: &str) -> PathBuf {
    let file = dir.join(file);
    fs::create_dir_all(file.parent().expect("folder")).expect("dir");
    fs::write(&file, "precious").expect("write");
    fs::write(dir.join("case.toml"), MANIFEST).expect("write");
    file
}

fn kept(file: &Path) {
    assert_eq!(fs::read(file).expect("still there"), b"precious", "{}", file.display());
}

#[test]
fn prepare_with_force_deleted_the_scan_that_it_read() {
    let dir = tempfile::tempdir().expect("temp");
    let out = dir.path().join("out");
    let slice = case(&out, "dicom/0001.dcm");
    symlink(&out, dir.path().join("link")).expect("link");
    for scan in ["out/dicom", "out/dicom/0001.dcm", "link/dicom", "out/../link/dicom"] {
        let said = refusal(&["prepare", text(&dir.path().join(scan)), "--out", text(&out), "--force"]);
        assert!(said.contains("holds") && said.contains(scan), "{said}");
        kept(&slice);
    }
    let relative = Command::new(env!("CARGO_BIN_EXE_monro"))
        .args(["prepare", "dicom", "--out", ".", "--force"])
        .current_dir(&out)
        .output()
        .expect("starts");
    assert!(String::from_utf8_lossy(&relative.stderr).contains(". holds dicom"), "{relative:?}");
    for input in ["--labels", "--plan"] {
        let said = refusal(&["prepare", "elsewhere", input, text(&slice), "--out", text(&out), "--force"]);
        assert!(said.contains("holds") && said.contains("0001.dcm"), "{said}");
    }
    let said = refusal(&["prepare", text(&out), "--out", text(&out.join("dicom/case"))]);
    assert!(said.contains("lies in"), "{said}");
    kept(&slice);
}

#[test]
fn simulate_with_force_left_the_results_in_place_of_its_case() {
    let dir = tempfile::tempdir().expect("temp");
    let labels = case(&dir.path().join("case"), "labels.nii.gz");
    let case = labels.parent().expect("case");
    let said = refusal(&["simulate", text(case), "--out", text(case), "--force"]);
    assert!(said.contains("which this command reads"), "{said}");
    let results = dir.path().join("results");
    fs::create_dir(&results).expect("dir");
    for name in ["summary.json", "insertion.csv", "soft.toml"] {
        fs::write(results.join(name), "precious").expect("write");
    }
    let soft = results.join("soft.toml");
    let said = refusal(&["simulate", text(case), "--materials", text(&soft), "--out", text(&results), "--force"]);
    assert!(said.contains("holds") && said.contains("soft.toml"), "{said}");
    let said = refusal(&["simulate", text(case), "--out", text(&results), "--force"]);
    assert!(said.contains("did not write") && said.contains("soft.toml"), "{said}");
    kept(&labels);
    kept(&soft);
}

#[test]
fn with_force_a_case_was_replaced_by_a_phantom_by_results_or_by_a_demo() {
    let dir = tempfile::tempdir().expect("temp");
    let labels = case(&dir.path().join("case"), "labels.nii.gz");
    let case = text(labels.parent().expect("case"));
    for args in [["phantom", "--out", case, "--force"], ["demo", "--out", case, "--force"]] {
        let said = refusal(&args);
        assert!(said.contains("no earlier output of this kind"), "{said}");
    }
    let said = refusal(&["simulate", "elsewhere", "--out", case, "--force"]);
    assert!(said.contains("a simulation has summary.json"), "{said}");
    kept(&labels);
}

#[test]
fn a_phantom_is_replaced_by_a_phantom_but_not_with_notes_in_it() {
    let dir = tempfile::tempdir().expect("temp");
    let out = dir.path().join("drawer");
    let args = ["phantom", "--kind", "drawer", "--out", text(&out), "--force"];
    json(&args);
    json(&args);
    fs::write(out.join("dicom/notes.txt"), "precious").expect("write");
    assert!(refusal(&args).contains("dicom/notes.txt"));
    kept(&out.join("dicom/notes.txt"));
}

#[test]
fn files_were_written_over_the_inputs_of_their_commands() {
    let dir = tempfile::tempdir().expect("temp");
    let [labels, recording] = ["labels.nii.gz", "session.mnrs"].map(|n| dir.path().join(n));
    let images = case(&dir.path().join("images"), "0001.dcm");
    for file in [&labels, &recording] {
        fs::write(file, "precious").expect("write");
    }
    let onto = dir.path().join("images/../labels.nii.gz");
    refusal(&["labels", "convert", text(&labels), text(&onto), "--force"]);
    let folder = text(images.parent().expect("folder"));
    refusal(&["labels", "convert", text(&labels), text(&images), "--images", folder, "--force"]);
    let said = refusal(&["replay", text(&recording), "--out", text(&recording), "--force"]);
    assert!(said.contains("which this command reads"), "{said}");
    [labels, recording, images].iter().for_each(|file| kept(file));
}

#[test]
fn serve_found_an_occupied_out_only_after_everything_was_prepared() {
    let dir = tempfile::tempdir().expect("temp");
    let labels = case(&dir.path().join("case"), "labels.nii.gz");
    let scans = dir.path().join("scans");
    fs::create_dir(&scans).expect("dir");
    let case = text(labels.parent().expect("case"));
    let said = refusal(&["serve", "--scans", text(&scans), "--out", case]);
    assert!(said.contains("monro serve") && !said.contains("--force"), "{said}");
    let nowhere =
        refusal(&["serve", "--scans", text(&dir.path().join("nowhere")), "--out", text(&dir.path().join("c"))]);
    assert!(nowhere.contains("nowhere") && nowhere.contains("no such folder"), "{nowhere}");
    let said = refusal(&["serve", "--scans", text(&scans), "--out", text(&scans.join("case"))]);
    assert!(said.contains("lies in"), "{said}");
    kept(&labels);
}

#[test]
fn edit_would_build_a_case_over_its_scan() {
    let dir = tempfile::tempdir().expect("temp");
    let file = dir.path().join("scan/head.nii.gz");
    fs::create_dir(dir.path().join("scan")).expect("dir");
    fs::write(&file, "precious").expect("write");
    let scan = dir.path().join("scan");
    let said = refusal(&["edit", text(&scan), "--out", text(&scan.join("case"))]);
    assert!(said.contains("lies in"), "{said}");
    kept(&file);
}
