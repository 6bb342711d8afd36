//! What `--force` may replace.
#![cfg(unix)]

mod common;

use common::case;
use monro_case::{CASE, Case, CaseFiles, OutputError, Staging, StagingError, check_output, check_output_file};
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

fn write(dir: &Path, force: bool) -> Result<PathBuf, StagingError> {
    let staging = Staging::begin(dir, force, &CASE, &[])?;
    let images = CaseFiles { ct: Some(b"ct".to_vec()), labels: Some(b"labels".to_vec()) };
    case().write(&staging, images).expect("write");
    staging.finish()
}

fn refused<T: std::fmt::Debug>(result: Result<T, impl std::fmt::Display>) -> String {
    match result {
        Ok(made) => panic!("should have been refused: {made:?}"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn a_case_is_replaced_by_a_case_with_force_only() {
    let dir = tempfile::tempdir().expect("temp");
    let out = dir.path().join("case");
    write(&out, false).expect("a new one");
    assert!(matches!(write(&out, false), Err(StagingError::Output(OutputError::Exists(_)))));
    write(&out, true).expect("replaced");
    Case::open(&out).expect("a case");
    fs::create_dir(dir.path().join("empty")).expect("dir");
    write(&dir.path().join("empty"), false).expect("an empty folder holds nothing to lose");
}

#[test]
fn notes_of_a_user_in_a_case_were_deleted_with_force() {
    let dir = tempfile::tempdir().expect("temp");
    let out = write(&dir.path().join("case"), false).expect("a case");
    for name in ["notes.txt", "frames/tets_000.vtu", "dicom/0001.dcm"] {
        let file = out.join(name);
        fs::create_dir_all(file.parent().expect("folder")).expect("dir");
        fs::write(&file, "mine").expect("write");
        let said = refused(write(&out, true));
        assert!(said.contains(name) && said.contains("will not delete"), "{said}");
        assert_eq!(fs::read(&file).expect("still there"), b"mine");
        fs::remove_file(&file).expect("remove");
    }
    symlink("/etc/hosts", out.join("ct.nii.gz.lnk")).expect("link");
    assert!(refused(write(&out, true)).contains("ct.nii.gz.lnk"));
}

#[test]
fn labels_corrected_by_hand_in_a_case_were_deleted_with_force() {
    let dir = tempfile::tempdir().expect("temp");
    let out = write(&dir.path().join("case"), false).expect("a case");
    fs::write(out.join("labels.nii.gz"), "hours of work").expect("write");
    let said = refused(write(&out, true));
    assert!(said.contains("labels.nii.gz") && said.contains("changed"), "{said}");
    assert_eq!(fs::read(out.join("labels.nii.gz")).expect("still there"), b"hours of work");
}

#[test]
fn what_came_into_the_folder_while_the_new_one_was_made_was_deleted() {
    let dir = tempfile::tempdir().expect("temp");
    let out = dir.path().join("case");
    let staging = Staging::begin(&out, true, &CASE, &[]).expect("begin");
    fs::create_dir(&out).expect("dir");
    fs::write(out.join("notes.txt"), "mine").expect("write");
    refused(staging.finish());
    assert_eq!(fs::read(out.join("notes.txt")).expect("still there"), b"mine");
    assert_eq!(fs::read_dir(dir.path()).expect("list").count(), 1);
}

#[test]
fn a_folder_that_is_no_case_or_no_folder_is_never_replaced() {
    let dir = tempfile::tempdir().expect("temp");
    let out = dir.path().join("holiday");
    fs::create_dir(&out).expect("dir");
    fs::write(out.join("photo.jpg"), b"x").expect("file");
    for force in [false, true] {
        let said = refused(write(&out, force));
        assert!(said.contains("a case has case.toml") && said.contains("will not delete"), "{said}");
    }
    // The name alone does not make one.
    fs::write(out.join("case.toml"), b"x").expect("file");
    assert!(refused(write(&out, true)).contains("case.toml"));
    let nowhere = dir.path().join("link");
    symlink(dir.path().join("missing"), &nowhere).expect("link");
    for file in [out.join("photo.jpg"), nowhere] {
        assert!(refused(write(&file, true)).contains("no folder"), "{}", file.display());
    }
}

#[test]
fn an_input_was_deleted_when_it_lay_in_the_output() {
    let dir = tempfile::tempdir().expect("temp");
    let out = write(&dir.path().join("case"), false).expect("a case");
    let [away, link, up] = ["away", "link", "up"].map(|n| dir.path().join(n));
    symlink(&out, &link).expect("link");
    fs::create_dir(&away).expect("dir");
    symlink(out.join("ct.nii.gz"), away.join("scan.nii.gz")).expect("link");
    symlink(dir.path(), &up).expect("link");
    for (out, input, how) in [
        (out.clone(), out.clone(), "is"),
        (out.clone(), out.join("ct.nii.gz"), "holds"),
        (out.clone(), out.join("sub/none"), "holds"),
        (link.clone(), out.join("ct.nii.gz"), "holds"),
        (out.clone(), link.join("ct.nii.gz"), "holds"),
        (out.clone(), away.join("scan.nii.gz"), "holds"),
        (away.join("../case"), up.join("case/ct.nii.gz"), "holds"),
        (up.join("case"), link, "is"),
        (out.join("new/results"), out.clone(), "lies in"),
        (away.join("../case/results"), out.clone(), "lies in"),
    ] {
        for force in [false, true] {
            let said = refused(check_output(&out, force, &CASE, &[&input]));
            let words = format!("{} {how} {}", out.display(), input.display());
            assert!(said.starts_with(&words), "{said}\nwanted: {words}");
        }
    }
    check_output(&dir.path().join("case2"), false, &CASE, &[&out]).expect("beside it");
    Case::open(&out).expect("untouched");
}

#[test]
fn a_link_to_an_earlier_output_stays_a_link() {
    let dir = tempfile::tempdir().expect("temp");
    let real = write(&dir.path().join("case"), false).expect("a case");
    let link = dir.path().join("link");
    symlink(&real, &link).expect("link");
    assert_eq!(write(&link, true).expect("replaced"), link);
    assert!(fs::symlink_metadata(&link).expect("there").is_symlink());
    Case::open(&real).expect("a case");
}

#[test]
fn a_file_was_written_over_its_own_input() {
    let dir = tempfile::tempdir().expect("temp");
    let [scan, slice, link] = ["scan", "scan/0001.dcm", "link"].map(|n| dir.path().join(n));
    fs::create_dir(&scan).expect("dir");
    fs::write(&slice, "x").expect("write");
    fs::hard_link(&slice, &link).expect("link");
    refused(check_output_file(&slice, &[&slice]));
    refused(check_output_file(&link, &[&slice]));
    refused(check_output_file(&slice, &[&scan]));
    check_output_file(&scan.join("new.dcm"), &[&scan]).expect("nothing is lost");
    check_output_file(&slice, &[dir.path().join("other").as_path()]).expect("no input of it");
}
