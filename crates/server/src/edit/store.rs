//! Where the work is kept: a folder beside the case with the labels at the start and the journal of all edits. Both
//! survive a killed browser and a killed server; finished steps also a power cut.
//!
//! ```text
//! CASE.edit/base.nii.gz   labels at the start
//!           journal       every edit since, appended as it happens; locked while it is open
//!           edit.json     which scan and which labels of the case this belongs to; written last
//! ```

use super::Start;
use monro_anatomy::edit::{Editor, ReplayError};
use monro_case::{Confidence, DoubtfulSpot};
use monro_geometry::{Grid, Volume};
use monro_scan::{ScanError, nifti};
use serde::{Deserialize, Serialize};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why the work cannot be opened or kept.
#[derive(Debug, Error)]
pub enum StoreError {
    /// The file system refused.
    #[error("{path}: {error}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The reason.
        error: io::Error,
    },
    /// The description does not parse.
    #[error("{path}: {error}; move the folder away to begin anew")]
    Description {
        /// The file.
        path: PathBuf,
        /// The reason.
        error: serde_json::Error,
    },
    /// The folder holds edits of another scan.
    #[error(
        "{folder} holds edits of the scan {found}, this one is {wanted}; move the folder away, or choose another --out"
    )]
    OtherScan {
        /// The folder.
        folder: PathBuf,
        /// The scan in it.
        found: String,
        /// The scan to be edited.
        wanted: String,
    },
    /// There are no labels to begin with; earlier work stays as it is.
    #[error("there are no labels to begin with: {reason}; nothing was changed")]
    Start {
        /// The reason.
        reason: String,
    },
    /// The labels that earlier work began with cannot be read, or do not fit.
    #[error("the labels in {folder} cannot be used: {reason}; move the folder away to begin anew")]
    Base {
        /// The folder.
        folder: PathBuf,
        /// The reason.
        reason: String,
    },
    /// Two editors would write into each other's journal.
    #[error("{folder} is being edited by another program: end that one, or go on in the page that it opened")]
    InUse {
        /// The folder.
        folder: PathBuf,
    },
    /// The journal cannot be replayed.
    #[error("{path}: {error}")]
    Journal {
        /// The journal.
        path: PathBuf,
        /// The reason.
        error: ReplayError,
    },
}

/// Which scan and labels the work belongs to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Subject {
    /// Name of the scan (its pseudonym).
    pub scan: String,
    /// What the labels were at the start or at the last rebuilding: a hash of the case's labels, or how they were made.
    pub origin: String,
    /// What is known of the automatic segmentation that the labels began with; nothing until they are made or found
    /// again, and for labels made elsewhere.
    #[serde(flatten)]
    pub known: Known,
}

/// What an automatic segmentation says of itself.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Known {
    /// How far it can be trusted.
    #[serde(default)]
    pub confidence: Vec<Confidence>,
    /// Borders that the scan does not show.
    #[serde(default)]
    pub doubts: Vec<DoubtfulSpot>,
    /// Sentences that a user must see.
    #[serde(default)]
    pub findings: Vec<String>,
}

/// The folder, open for appending. Its journal is locked against other programs for as long as this lives.
#[derive(Debug)]
pub(crate) struct Store {
    folder: PathBuf,
    journal: File,
    /// Bytes of the journal that are whole.
    whole: u64,
    /// Bytes of it that are written through to the disk.
    on_disk: u64,
    /// Edits that found no room yet.
    waiting: Vec<u8>,
}

fn at(path: &Path) -> impl FnOnce(io::Error) -> StoreError + '_ {
    |error| StoreError::Io { path: path.to_owned(), error }
}

impl Store {
    /// Goes on with the work in a folder, or begins it with the labels of `start`. The third part says what happened.
    /// The subject gets what is known of the labels.
    ///
    /// # Errors
    /// [`StoreError`]; whatever `start` says, as [`StoreError::Start`].
    pub(crate) fn open(
        folder: &Path,
        grid: &Grid,
        subject: &mut Subject,
        start: impl FnOnce() -> Result<Start, String>,
    ) -> Result<(Self, Editor, Vec<String>), StoreError> {
        let fresh = !folder.exists();
        let journal = journal_of(folder)?;
        let found = described(folder, &subject.scan)?;
        let is_other = found.is_some();
        if let Some(same) = found.filter(|found| found.origin == subject.origin) {
            subject.known = same.known;
            return Self::resume(folder, grid, journal);
        }
        let Start { labels: base, known } = start().map_err(|reason| {
            if fresh {
                // Nothing began; a folder that cannot be removed does no harm.
                let _ = fs::remove_dir_all(folder);
            }
            StoreError::Start { reason }
        })?;
        subject.known = known;
        // Not before there are labels to begin with: what was refused leaves the earlier edits where they are looked for.
        let (journal, notes) = if is_other { set_aside(folder)? } else { (journal, Vec::new()) };
        let (store, editor) = Self::begin(folder, base, subject, journal)?;
        Ok((store, editor, notes))
    }

    fn begin(folder: &Path, base: Volume<u8>, subject: &Subject, journal: File) -> Result<(Self, Editor), StoreError> {
        let labels = folder.join("base.nii.gz");
        write_through(&labels, &nifti::encode_u8(&base)).map_err(at(&labels))?;
        journal.set_len(0).map_err(at(&folder.join("journal")))?;
        let mut editor = Editor::new(base);
        let mut store = Self { folder: folder.to_owned(), journal, whole: 0, on_disk: 0, waiting: Vec::new() };
        store.append(&editor.take_journal())?;
        store.sync()?;
        store.describe(subject)?;
        Ok((store, editor))
    }

    fn resume(folder: &Path, grid: &Grid, journal: File) -> Result<(Self, Editor, Vec<String>), StoreError> {
        let [labels, path] = ["base.nii.gz", "journal"].map(|n| folder.join(n));
        let base = base(&labels, grid).map_err(|reason| StoreError::Base { folder: folder.to_owned(), reason })?;
        let bytes = fs::read(&path).map_err(at(&path))?;
        let (mut editor, recovery) =
            Editor::replay(base, &bytes).map_err(|error| StoreError::Journal { path: path.clone(), error })?;
        let whole = recovery.valid_bytes as u64;
        journal.set_len(whole).map_err(at(&path))?;
        let mut store = Self { folder: folder.to_owned(), journal, whole, on_disk: 0, waiting: Vec::new() };
        store.append(&editor.take_journal())?;
        store.sync()?;
        let mut notes = vec![format!("the work of an earlier session was restored ({} entries)", recovery.events)];
        if recovery.torn_bytes > 0 {
            notes.push("the last edit was torn off in the middle and is lost".into());
        }
        Ok((store, editor, notes))
    }

    /// Appends to the journal; on return the system has the bytes, so that a killed process loses nothing. What finds
    /// no room is kept and written before the next edit, for a torn record may only be the last.
    ///
    /// # Errors
    /// When the file system refuses.
    pub(crate) fn append(&mut self, bytes: &[u8]) -> Result<(), StoreError> {
        let torn = !self.waiting.is_empty();
        self.waiting.extend_from_slice(bytes);
        if self.waiting.is_empty() {
            return Ok(());
        }
        let path = self.folder.join("journal");
        // Without a name it would take the bytes, and be gone with the process.
        fs::metadata(&path).map_err(at(&path))?;
        let cut = if torn { self.journal.set_len(self.whole) } else { Ok(()) };
        let written = cut.and_then(|()| self.journal.write_all(&self.waiting)).and_then(|()| self.journal.flush());
        written.map_err(at(&path))?;
        self.whole += self.waiting.len() as u64;
        self.waiting.clear();
        Ok(())
    }

    /// Writes what was appended through to the disk, so that a power cut loses nothing of it either.
    ///
    /// # Errors
    /// When the file system refuses; the next call tries again.
    pub(crate) fn sync(&mut self) -> Result<(), StoreError> {
        if self.on_disk < self.whole {
            self.journal.sync_data().map_err(at(&self.folder.join("journal")))?;
            self.on_disk = self.whole;
        }
        Ok(())
    }

    /// Bytes of all edits so far.
    pub(crate) const fn length(&self) -> u64 {
        self.whole + self.waiting.len() as u64
    }

    /// Says what the work belongs to, whole or not at all.
    ///
    /// # Errors
    /// When the file system refuses.
    pub(crate) fn describe(&self, subject: &Subject) -> Result<(), StoreError> {
        let [target, aside] = ["edit.json", ".edit.json.partial"].map(|n| self.folder.join(n));
        let text = serde_json::to_string_pretty(subject).unwrap_or_default();
        write_through(&aside, text.as_bytes()).map_err(at(&aside))?;
        fs::rename(&aside, &target).map_err(at(&target))?;
        // The names, too, where the file system can: not all let a folder be synchronised.
        let _ = File::open(&self.folder).and_then(|folder| folder.sync_all());
        Ok(())
    }
}

/// Writes a file that is on the disk on return.
fn write_through(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = File::create(path)?;
    file.write_all(bytes)?;
    file.sync_all()
}

/// The journal of a folder, made if there is none, locked until it is closed or the process ends, however it ends.
fn journal_of(folder: &Path) -> Result<File, StoreError> {
    fs::create_dir_all(folder).map_err(at(folder))?;
    let path = folder.join("journal");
    let file = OpenOptions::new().append(true).create(true).open(&path).map_err(at(&path))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(StoreError::InUse { folder: folder.to_owned() }),
        // Some network file systems know no locks.
        Err(TryLockError::Error(e)) if e.kind() == io::ErrorKind::Unsupported => Ok(file),
        Err(TryLockError::Error(e)) => Err(at(&path)(e)),
    }
}

/// What the work in a folder belongs to; `None` where there is none.
fn described(folder: &Path, scan: &str) -> Result<Option<Subject>, StoreError> {
    let path = folder.join("edit.json");
    if !path.is_file() {
        return Ok(None);
    }
    let text = fs::read_to_string(&path).map_err(at(&path))?;
    let found: Subject =
        serde_json::from_str(&text).map_err(|error| StoreError::Description { path: path.clone(), error })?;
    if found.scan == scan {
        return Ok(Some(found));
    }
    Err(StoreError::OtherScan { folder: folder.to_owned(), found: found.scan, wanted: scan.to_owned() })
}

fn base(path: &Path, grid: &Grid) -> Result<Volume<u8>, String> {
    let found = monro_scan::read_labels(path).map_err(|e: ScanError| e.to_string())?;
    if found.grid().dims() != grid.dims() {
        return Err(format!("they have {:?} voxels, the scan {:?}", found.grid().dims(), grid.dims()));
    }
    // NIfTI rounds the placement to single precision; the scan's own is exact.
    let labels = found.map(|l| u8::try_from(l).unwrap_or(u8::MAX)).into_data();
    Volume::new(*grid, labels).map_err(|e| e.to_string())
}

/// Puts earlier work aside; the journal of a new folder, and what is to be said of it.
fn set_aside(folder: &Path) -> Result<(File, Vec<String>), StoreError> {
    let aside = put_aside(folder)?;
    let note = format!(
        "the labels of the case are not those that were edited before; the earlier edits are in {}",
        aside.display()
    );
    Ok((journal_of(folder)?, vec![note]))
}

/// Renames a folder to the first free of `NAME.1`, `NAME.2`, ...
fn put_aside(folder: &Path) -> Result<PathBuf, StoreError> {
    let mut number = 1;
    loop {
        let mut name = folder.file_name().unwrap_or_default().to_owned();
        name.push(format!(".{number}"));
        let aside = folder.with_file_name(name);
        if !aside.exists() {
            fs::rename(folder, &aside).map_err(at(folder))?;
            return Ok(aside);
        }
        number += 1;
    }
}

#[cfg(test)]
mod tests;
