//! Wrong input of each kind gets a clear error and leaves nothing behind.

use crate::common::{monro, refusal, text};
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
