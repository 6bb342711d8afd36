//! Write aside, then rename: an output folder appears whole or not at all, and one that is replaced is there at any moment,
//! the old one or the new.

use crate::output::{OutputError, OutputKind, check_output, real, replaceable};
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
    /// It must not be.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// Nothing can be written where it is to be.
    #[error("no folder can be made in {place}: {error}; choose another place for the output")]
    Place {
        /// The folder that it would lie in.
        place: PathBuf,
        /// The reason.
        error: io::Error,
    },
    /// The file system refused.
    #[error("{path}: {error}")]
    Io {
        /// The path.
        path: PathBuf,
        /// The reason.
        error: io::Error,
    },
}

/// A folder under construction beside its final place. Dropping it unfinished removes it.
#[derive(Debug)]
pub struct Staging {
    temporary: PathBuf,
    /// Folders around it that were not there, from the innermost.
    around: Vec<PathBuf>,
    /// As it was asked for.
    named: PathBuf,
    /// Where that leads.
    target: PathBuf,
    force: bool,
    kind: OutputKind,
    finished: bool,
}

impl Staging {
    /// Begins a folder that will become `target`, of a command that reads `inputs`.
    ///
    /// # Errors
    /// What [`check_output`] refuses, or the parent of `target` cannot be written.
    pub fn begin(target: &Path, force: bool, kind: &OutputKind, inputs: &[&Path]) -> Result<Self, StagingError> {
        check_output(target, force, kind, inputs)?;
        let named = target.to_owned();
        let target = real(target).map_err(|error| StagingError::Io { path: named.clone(), error })?;
        let parent = target.parent().unwrap_or(Path::new("/")).to_owned();
        let refused = |error| StagingError::Place { place: parent.clone(), error };
        let around = parent.ancestors().take_while(|p| !p.exists()).map(Path::to_owned).collect();
        fs::create_dir_all(&parent).map_err(refused)?;
        let mut name = OsString::from(".");
        name.push(target.file_name().unwrap_or_default());
        name.push(".partial-");
        let name_of_all = name.clone();
        name.push(std::process::id().to_string());
        let temporary = parent.join(name);
        remove_leftovers(&parent, &name_of_all)?;
        fs::create_dir(&temporary).map_err(refused)?;
        Ok(Self { temporary, around, named, target, force, kind: *kind, finished: false })
    }

    /// Where to write the files meanwhile.
    pub fn path(&self) -> &Path {
        &self.temporary
    }

    /// What was made for it and is to go with it where it is not finished: the folder itself, then those around it that were not
    /// there, of which one with anything else in it stays.
    pub fn made(&self) -> impl Iterator<Item = &Path> {
        core::iter::once(&self.temporary).chain(&self.around).map(PathBuf::as_path)
    }

    /// Writes one file.
    ///
    /// # Errors
    /// When the file system refuses.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), StagingError> {
        let path = self.temporary.join(name);
        fs::write(&path, bytes).map_err(|error| StagingError::Io { path, error })
    }

    /// Moves the folder to its final place; an old one is looked at again and replaced only now, by exchanging the two at once. A file system
    /// that cannot do that (some network shares) is without either for a moment: a program killed just then leaves the old
    /// folder beside, as `.NAME.partial-PROCESS.old`.
    ///
    /// # Errors
    /// When somebody has put something there meanwhile, or the file system refuses; an old folder stays, or is put back,
    /// then.
    pub fn finish(mut self) -> Result<PathBuf, StagingError> {
        replaceable(&self.target, self.force, &self.kind)?;
        let io = |path: &Path, error| StagingError::Io { path: path.to_owned(), error };
        if self.target.exists() {
            let old = exchange(&self.temporary, &self.target).map_err(|e| io(&self.target, e))?;
            self.finished = true;
            fs::remove_dir_all(&old).map_err(|e| io(&old, e))?;
        } else {
            fs::rename(&self.temporary, &self.target).map_err(|e| io(&self.target, e))?;
            self.finished = true;
        }
        Ok(self.named.clone())
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
            self.around.iter().for_each(|empty| _ = fs::remove_dir(empty));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CASE;

    #[test]
    fn a_dropped_staging_leaves_nothing_and_a_finished_one_everything() {
        let dir = tempfile::tempdir().expect("temp");
        let out = dir.path().join("a case");
        let staging = Staging::begin(&out, false, &CASE, &[]).expect("begin");
        staging.write("x", b"1").expect("write");
        drop(staging);
        assert_eq!(fs::read_dir(dir.path()).expect("list").count(), 0);
        let staging = Staging::begin(&out, false, &CASE, &[]).expect("begin");
        staging.write("case.toml", b"1").expect("write");
        staging.finish().expect("finish");
        assert_eq!(fs::read(out.join("case.toml")).expect("file"), b"1");
        assert_eq!(fs::read_dir(dir.path()).expect("list").count(), 1);
    }

    #[test]
    fn folders_made_for_an_output_that_never_came_stayed() {
        let dir = tempfile::tempdir().expect("temp");
        let begin = |name: &str| Staging::begin(&dir.path().join(name), false, &CASE, &[]).expect("begin");
        drop(begin("a/b/case"));
        assert_eq!(fs::read_dir(dir.path()).expect("list").count(), 0);
        // Where there is anything else by then they stay.
        let staging = begin("a/b/case");
        fs::write(dir.path().join("a/notes"), "x").expect("write");
        drop(staging);
        assert!(dir.path().join("a/notes").exists() && !dir.path().join("a/b").exists());
        let staging = begin("a/c/case");
        staging.write("case.toml", b"1").expect("write");
        staging.finish().expect("finish");
        assert!(dir.path().join("a/c/case/case.toml").exists());
    }

    #[test]
    fn a_place_where_nothing_can_be_made_was_told_as_a_file_that_is_missing() {
        let dir = tempfile::tempdir().expect("temp");
        let file = dir.path().join("file");
        fs::write(&file, b"").expect("file");
        let refused = Staging::begin(&file.join("case"), false, &CASE, &[]).expect_err("refused").to_string();
        assert!(
            refused.contains(file.to_str().expect("text")) && refused.contains("choose another place"),
            "{refused}"
        );
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
        drop(Staging::begin(&parent.join("case"), false, &CASE, &[]).expect("begin"));
        let left: Vec<_> = [gone, alive, old, ".cases.partial-4194305"].map(|n| parent.join(n).exists()).to_vec();
        assert_eq!(left, [false, true, true, true]);
    }
}
