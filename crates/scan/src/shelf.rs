//! A folder with other files than DICOM: which volumes lie in it, and which scans lie in a folder of many.

use crate::dicom;
use std::fs;
use std::io;
use std::path::Path;

/// How the names of volumes end; a `.raw` belongs to its header.
const ENDINGS: [&str; 6] = [".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd"];

/// Names of what lies in a folder, sorted; hidden entries are left out.
fn names(folder: &Path) -> io::Result<Vec<String>> {
    let entries = fs::read_dir(folder)?.filter_map(|e| e.ok()?.file_name().into_string().ok());
    let mut names: Vec<String> = entries.filter(|n| !n.starts_with('.')).collect();
    names.sort();
    Ok(names)
}

/// Names of the volumes (NIfTI, NRRD, MetaImage) that lie right in a folder, by their endings.
pub(crate) fn volumes(folder: &Path) -> Vec<String> {
    let mut names = names(folder).unwrap_or_default();
    names.retain(|name| is_volume(name) && folder.join(name).is_file());
    names
}

/// Whether a name is that of a volume.
pub(crate) fn is_volume(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    ENDINGS.iter().any(|end| name.ends_with(end))
}

/// What in a folder can be given to [`crate::read`], from the folder on: volumes, DICOM files, folders with DICOM in them,
/// and volumes in folders without. Nothing is opened further than its beginning.
///
/// # Errors
/// When the folder cannot be read.
pub fn scans_in(folder: &Path) -> io::Result<Vec<String>> {
    let mut out = Vec::new();
    for name in names(folder)? {
        let path = folder.join(&name);
        if !path.is_dir() {
            out.extend((is_volume(&name) || dicom::is_dicom_file(&path)).then_some(name));
        } else if dicom::holds_dicom(&path) {
            out.push(name);
        } else {
            out.extend(volumes(&path).into_iter().map(|volume| format!("{name}/{volume}")));
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_without_dicom_were_offered_and_the_volumes_in_them_were_not() {
        let dir = tempfile::tempdir().expect("temp");
        let dicom = [&[0; 128][..], b"DICM"].concat();
        for (name, bytes) in [
            ("a/head.nii.gz", &b"x"[..]),
            ("a/README.md", b"x"),
            ("a/truth.nrrd", b"x"),
            ("b/series 1/0001", &dicom),
            ("c/README.md", b"x"),
            ("d.mha", b"x"),
            ("e", &dicom),
            ("f.txt", b"x"),
            (".g.nii", b"x"),
        ] {
            let file = dir.path().join(name);
            fs::create_dir_all(file.parent().expect("folder")).expect("dir");
            fs::write(file, bytes).expect("write");
        }
        let found = scans_in(dir.path()).expect("list");
        assert_eq!(found, ["a/head.nii.gz", "a/truth.nrrd", "b", "d.mha", "e"]);
    }
}
