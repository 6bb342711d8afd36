//! A case survives its own round trip, and every kind of damage is named.

mod common;

use common::case;
use monro_case::{CASE, Case, CaseError, CaseFiles, Manifest, Staging};
use std::fs;
use std::path::{Path, PathBuf};

fn written(dir: &Path) -> PathBuf {
    let staging = Staging::begin(&dir.join("case"), false, &CASE, &[]).expect("begin");
    let images = CaseFiles { ct: Some(b"ct".to_vec()), labels: Some(b"labels".to_vec()) };
    case().write(&staging, images).expect("write");
    staging.finish().expect("finish")
}

#[test]
fn a_case_is_read_back_as_it_was_written() {
    let dir = tempfile::tempdir().expect("temp");
    let back = Case::open(&written(dir.path())).expect("open");
    assert_eq!(back.plan, case().plan);
    assert_eq!(back.tets, case().tets);
    assert_eq!(back.skin, case().skin);
    assert_eq!(back.landmarks, case().landmarks);
    assert_eq!(back.septa, case().septa);
    assert_eq!(back.manifest.files.len(), 9);
    assert_eq!(Manifest { files: Vec::new(), ..back.manifest }, case().manifest);
}

#[test]
fn a_case_without_its_images_is_still_a_case() {
    let dir = tempfile::tempdir().expect("temp");
    let path = written(dir.path());
    fs::remove_file(path.join("ct.nii.gz")).expect("remove");
    fs::remove_file(path.join("labels.nii.gz")).expect("remove");
    assert!(Case::open(&path).expect("a shared model").septa.is_some());
    // Nor have cases made earlier falx and tentorium.
    fs::remove_file(path.join("septa.ply")).expect("remove");
    assert_eq!(Case::open(&path).expect("an older case").septa, None);
}

#[test]
fn a_flipped_bit_a_missing_file_and_a_foreign_name_are_refused() {
    let dir = tempfile::tempdir().expect("temp");
    let path = written(dir.path());
    let good = fs::read(path.join("tets.vtu")).expect("read");
    let mut bad = good.clone();
    bad[good.len() / 2] ^= 1;
    fs::write(path.join("tets.vtu"), &bad).expect("write");
    assert!(
        matches!(Case::open(&path), Err(CaseError::Damaged { path, .. }) if path.file_name() == Some("tets.vtu".as_ref()))
    );
    fs::remove_file(path.join("tets.vtu")).expect("remove");
    assert!(matches!(Case::open(&path), Err(CaseError::Missing("tets.vtu"))));
    fs::write(path.join("tets.vtu"), &good).expect("write");
    let toml = fs::read_to_string(path.join("case.toml")).expect("read");
    fs::write(path.join("case.toml"), toml.replace("skin.ply", "../skin.ply")).expect("write");
    assert!(matches!(Case::open(&path), Err(CaseError::UnknownFile(n)) if n == "../skin.ply"));
}

#[test]
fn a_newer_schema_an_empty_folder_and_a_broken_manifest_are_named() {
    let dir = tempfile::tempdir().expect("temp");
    assert!(matches!(Case::open(dir.path()), Err(CaseError::NotACase(_))));
    let path = written(dir.path());
    let toml = fs::read_to_string(path.join("case.toml")).expect("read");
    fs::write(path.join("case.toml"), format!("future = 1\n{}", toml.replace("schema = 1", "schema = 2")))
        .expect("write");
    assert!(matches!(Case::open(&path), Err(CaseError::Schema { found: 2, .. })));
    fs::write(path.join("case.toml"), "schema = 1\nbroken [").expect("write");
    assert!(matches!(Case::open(&path), Err(CaseError::Manifest { .. })));
    fs::write(path.join("case.toml"), toml.replace("\"left\"", "\"middle\"")).expect("write");
    assert!(matches!(Case::open(&path), Err(CaseError::Side(s)) if s == "middle"));
}
