//! Write aside, then rename: an output folder appears whole or not at all, and one that is replaced is there at any moment,
//! the old one or the new.

use rustix::fs::{CWD, RenameFlags, renameat_with};
use rustix::io::Errno;
use std::ffi::{OsStr, OsString};
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
        name.push(".partial-");
        let name_of_all = name.clone();
        name.push(std::process::id().to_string());
        let temporary = parent.join(name);
        remove_leftovers(&parent, &name_of_all)?;
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

    /// Moves the folder to its final place; an old one is replaced only now, by exchanging the two at once. A file system
    /// that cannot do that (some network shares) is without either for a moment: a program killed just then leaves the old
    /// folder beside, as `.NAME.partial-PROCESS.old`.
    ///
    /// # Errors
    /// When the file system refuses; an old folder stays, or is put back, then.
    pub fn finish(mut self) -> Result<PathBuf, StagingError> {
        let io = |path: &Path, error| StagingError::Io { path: path.to_owned(), error };
        if self.target.exists() {
            let old = exchange(&self.temporary, &self.target).map_err(|e| io(&self.target, e))?;
            self.finished = true;
            fs::remove_dir_all(&old).map_err(|e| io(&old, e))?;
        } else {
            fs::rename(&self.temporary, &self.target).map_err(|e| io(&self.target, e))?;
            self.finished = true;
        }
        Ok(self.target.clone())
    }
}

/// Puts `new` where `old` is; gives where the old folder is then.
fn exchange(new: &Path, old: &Path) -> io::Result<PathBuf> {
    match renameat_with(CWD, new, CWD, old, RenameFlags::EXCHANGE) {
        Err(Errno::INVAL | Errno::NOSYS | Errno::NOTSUP) => exchange_in_steps(new, old),
        Err(error) => Err(error.into()),
        Ok(()) => Ok(new.to_owned()),
    }
}

/// The same where the file system cannot do it at once.
fn exchange_in_steps(new: &Path, old: &Path) -> io::Result<PathBuf> {
    let aside = new.with_extension("old");
    fs::rename(old, &aside)?;
    if let Err(error) = fs::rename(new, old) {
        fs::rename(&aside, old)?;
        return Err(error);
    }
    Ok(aside)
}

/// Removes what a killed process has left unfinished of the same folder: files named `prefix` and the process's number,
/// whose process is gone (where the system tells), or was an earlier try of this one.
fn remove_leftovers(parent: &Path, prefix: &OsStr) -> Result<(), StagingError> {
    let is_gone = |process: u32| {
        process == std::process::id()
            || (Path::new("/proc/self").exists() && !Path::new(&format!("/proc/{process}")).exists())
    };
    for entry in fs::read_dir(parent).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let process =
            name.as_encoded_bytes().strip_prefix(prefix.as_encoded_bytes()).and_then(|p| str::from_utf8(p).ok());
        // What ends in `.old` is no number: it may be the only copy of a case.
        if process.and_then(|p| p.parse().ok()).is_some_and(is_gone) {
            fs::remove_dir_all(entry.path()).map_err(|error| StagingError::Io { path: entry.path(), error })?;
        }
    }
    Ok(())
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

    #[test]
    fn where_folders_cannot_be_exchanged_at_once_it_is_done_in_steps() {
        let dir = tempfile::tempdir().expect("temp");
        let [new, old] = ["new", "old"].map(|name| dir.path().join(name));
        for folder in [&new, &old] {
            fs::create_dir(folder).expect("dir");
            fs::write(folder.join("x"), folder.to_str().expect("text")).expect("file");
        }
        let aside = exchange_in_steps(&new, &old).expect("exchanged");
        assert_eq!(fs::read(old.join("x")).expect("file"), new.to_str().expect("text").as_bytes());
        assert_eq!(fs::read(aside.join("x")).expect("file"), old.to_str().expect("text").as_bytes());
        assert!(exchange_in_steps(&new, &old).is_err(), "there is nothing new any more");
        assert!(old.join("x").exists(), "put back");
    }

    #[test]
    fn what_a_killed_process_left_is_removed_and_what_a_living_one_writes_is_not() {
        let dir = tempfile::tempdir().expect("temp");
        let parent = dir.path();
        // No process has the largest number; the first one always runs.
        let (gone, alive, old) = (".case.partial-4194305", ".case.partial-1", ".case.partial-4194305.old");
        for name in [gone, alive, old, ".cases.partial-4194305"] {
            fs::create_dir(parent.join(name)).expect("dir");
        }
        drop(Staging::begin(&parent.join("case"), false).expect("begin"));
        let left: Vec<_> = [gone, alive, old, ".cases.partial-4194305"].map(|n| parent.join(n).exists()).to_vec();
        assert_eq!(left, [false, true, true, true]);
    }
}
