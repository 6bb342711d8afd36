//! Write aside, then rename: an output folder appears whole or not at all.

use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why an output folder could not be made.
#[derive(Debug, Error)]
pub enum StagingError {
    /// The folder exists and overwriting was not asked for.
    #[error("{0} exists already; give --force to overwrite it, or another --out")]
    Exists(PathBuf),
    /// The folder exists but was not written by Monro.
    #[error(
        "{0} exists and does not look like an output of Monro (it holds none of {markers}); --force will not delete it",
        markers = MARKERS.join(", ")
    )]
    Foreign(PathBuf),
    /// The file system refused.
    #[error("{path}: {error}")]
    Io {
        /// The path.
        path: PathBuf,
        /// The reason.
        error: io::Error,
    },
}

/// A folder with one of these files was written by Monro and may be overwritten with `--force`.
const MARKERS: [&str; 5] = ["case.toml", "summary.json", "phantom.json", "demo.json", "mesh.json"];

/// A folder under construction beside its final place. Dropping it unfinished removes it.
#[derive(Debug)]
pub struct Staging {
    temporary: PathBuf,
    target: PathBuf,
    finished: bool,
}

impl Staging {
    /// Begins a folder that will become `target`.
    ///
    /// # Errors
    /// `target` exists (without `force`), is not Monro's (with it), or its parent cannot be written.
    pub fn begin(target: &Path, force: bool) -> Result<Self, StagingError> {
        check_target(target, force)?;
        let parent = match target.parent() {
            Some(p) if !p.as_os_str().is_empty() => p.to_owned(),
            _ => PathBuf::from("."),
        };
        fs::create_dir_all(&parent).map_err(|error| StagingError::Io { path: parent.clone(), error })?;
        let mut name = OsString::from(".");
        name.push(target.file_name().unwrap_or_default());
        name.push(format!(".partial-{}", std::process::id()));
        let temporary = parent.join(name);
        if temporary.exists() {
            fs::remove_dir_all(&temporary).map_err(|error| StagingError::Io { path: temporary.clone(), error })?;
        }
        fs::create_dir(&temporary).map_err(|error| StagingError::Io { path: temporary.clone(), error })?;
        Ok(Self { temporary, target: target.to_owned(), finished: false })
    }

    /// Where to write the files meanwhile.
    pub fn path(&self) -> &Path {
        &self.temporary
    }

    /// Writes one file.
    ///
    /// # Errors
    /// When the file system refuses.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), StagingError> {
        let path = self.temporary.join(name);
        fs::write(&path, bytes).map_err(|error| StagingError::Io { path, error })
    }

    /// Moves the folder to its final place; an old one is replaced only now.
    ///
    /// # Errors
    /// When the file system refuses; an old folder is put back then.
    pub fn finish(mut self) -> Result<PathBuf, StagingError> {
        let io = |path: &Path, error| StagingError::Io { path: path.to_owned(), error };
        let old = self.temporary.with_extension("old");
        let replaced = self.target.exists();
        if replaced {
            fs::rename(&self.target, &old).map_err(|e| io(&self.target, e))?;
        }
        if let Err(error) = fs::rename(&self.temporary, &self.target) {
            if replaced {
                fs::rename(&old, &self.target).map_err(|e| io(&old, e))?;
            }
            return Err(io(&self.target, error));
        }
        self.finished = true;
        if replaced {
            fs::remove_dir_all(&old).map_err(|e| io(&old, e))?;
        }
        Ok(self.target.clone())
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        if !self.finished {
            // Nothing sensible can be done about a failure while unwinding; the name says that it is a leftover.
            let _ = fs::remove_dir_all(&self.temporary);
        }
    }
}

fn check_target(target: &Path, force: bool) -> Result<(), StagingError> {
    let Ok(mut entries) = fs::read_dir(target) else {
        return if target.exists() { Err(StagingError::Foreign(target.to_owned())) } else { Ok(()) };
    };
    if entries.next().is_none() {
        return Ok(());
    }
    if !force {
        return Err(StagingError::Exists(target.to_owned()));
    }
    let ours = MARKERS.iter().any(|m| target.join(m).is_file());
    if ours { Ok(()) } else { Err(StagingError::Foreign(target.to_owned())) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dropped_staging_leaves_nothing_and_a_finished_one_everything() {
        let dir = tempfile::tempdir().expect("temp");
        let out = dir.path().join("a case");
        let staging = Staging::begin(&out, false).expect("begin");
        staging.write("x", b"1").expect("write");
        drop(staging);
        assert_eq!(fs::read_dir(dir.path()).expect("list").count(), 0);
        let staging = Staging::begin(&out, false).expect("begin");
        staging.write("case.toml", b"1").expect("write");
        staging.finish().expect("finish");
        assert_eq!(fs::read(out.join("case.toml")).expect("file"), b"1");
        assert_eq!(fs::read_dir(dir.path()).expect("list").count(), 1);
    }

    #[test]
    fn an_existing_folder_is_refused_and_only_ours_is_overwritten_with_force() {
        let dir = tempfile::tempdir().expect("temp");
        let out = dir.path().join("holiday");
        fs::create_dir(&out).expect("dir");
        fs::write(out.join("photo.jpg"), b"x").expect("file");
        assert!(matches!(Staging::begin(&out, false), Err(StagingError::Exists(_))));
        assert!(matches!(Staging::begin(&out, true), Err(StagingError::Foreign(_))));
        fs::write(out.join("case.toml"), b"old").expect("file");
        let staging = Staging::begin(&out, true).expect("begin");
        staging.write("case.toml", b"new").expect("write");
        assert_eq!(fs::read(out.join("case.toml")).expect("file"), b"old");
        staging.finish().expect("finish");
        assert_eq!(fs::read(out.join("case.toml")).expect("file"), b"new");
        assert!(!out.join("photo.jpg").exists());
        assert_eq!(fs::read_dir(dir.path()).expect("list").count(), 1);
    }
}
