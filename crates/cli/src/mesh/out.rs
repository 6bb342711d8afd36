//! The file that is written.

use crate::output_file;
use anyhow::{Context, Result, bail};
use std::fs;
use std::path::{Path, PathBuf};

/// Refuses, before any work is done, a file that cannot be written or would overwrite another one or `input`.
pub(super) fn check(out: &Path, force: bool, input: &Path) -> Result<()> {
    output_file::check(out, force, &[input])?;
    let target = target(out);
    match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() && !folder.is_dir() => {
            bail!("{} cannot be written: there is no folder {}; make it first", out.display(), folder.display())
        }
        _ => Ok(()),
    }
}

/// Where the bytes go: through a symbolic link, so that it stays one.
fn target(out: &Path) -> PathBuf {
    let Ok(link) = fs::read_link(out) else { return out.to_owned() };
    // The link may point to what is not there yet.
    fs::canonicalize(out).unwrap_or_else(|_| out.with_file_name(link))
}

/// Writes aside and renames, so that an interrupted run leaves no half file.
pub(super) fn write(out: &Path, bytes: &[u8]) -> Result<()> {
    let target = target(out);
    let mut name = target.file_name().unwrap_or_default().to_owned();
    name.push(format!(".partial-{}", std::process::id()));
    let aside = target.with_file_name(name);
    let written = fs::write(&aside, bytes).and_then(|()| fs::rename(&aside, &target));
    if written.is_err() {
        // Nothing may be there; the first error is what counts.
        let _ = fs::remove_file(&aside);
    }
    written.with_context(|| format!("cannot write {}", out.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_output_that_is_a_folder_or_in_no_folder_is_refused_beforehand() {
        let dir = tempfile::tempdir().expect("temp");
        let other = tempfile::tempdir().expect("temp");
        let input = other.path().join("input.vtu");
        fs::write(&input, "x").expect("write");
        let said = |out: &Path, force| check(out, force, &input).expect_err("refused").to_string();
        assert!(said(dir.path(), true).contains("is a folder"));
        let missing = dir.path().join("none").join("q.vtu");
        assert!(said(&missing, true).contains(&format!("no folder {}", dir.path().join("none").display())));
        let there = dir.path().join("there.vtu");
        fs::write(&there, "x").expect("write");
        assert!(said(&there, false).contains("--force"));
        check(&there, true, &input).expect("forced");
        check(Path::new("plain.vtu"), false, &input).expect("a plain name");
        assert!(said(&input, true).contains("which this command reads"));
    }

    #[test]
    fn a_failed_write_left_a_partial_file() {
        let dir = tempfile::tempdir().expect("temp");
        let folder = dir.path().join("d.vtu");
        fs::create_dir(&folder).expect("folder");
        let said = write(&folder, b"x").expect_err("refused").to_string();
        assert!(said.contains("d.vtu") && !said.contains("partial"), "{said}");
        assert_eq!(fs::read_dir(dir.path()).expect("list").count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn a_symbolic_link_was_replaced_by_a_file() {
        let dir = tempfile::tempdir().expect("temp");
        let [real, link, late] = ["real.vtu", "link.vtu", "late.vtu"].map(|n| dir.path().join(n));
        fs::write(&real, "old").expect("write");
        std::os::unix::fs::symlink("real.vtu", &link).expect("link");
        write(&link, b"new").expect("through the link");
        assert_eq!((fs::read(&real).expect("real"), link.is_symlink()), (b"new".to_vec(), true));
        std::os::unix::fs::symlink("later.vtu", &late).expect("link");
        write(&late, b"late").expect("through a link to nothing yet");
        assert_eq!(fs::read(dir.path().join("later.vtu")).expect("made"), b"late");
    }
}
