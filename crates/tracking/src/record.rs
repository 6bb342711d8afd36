//! Writes what arrives to a file, as it came.

use crate::{Clock, TrackingError};
use monro_wire::recording::{Protocol, begin, record};
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// An open recording. Each datagram is handed to the system at once, so that a crash loses none that was written.
#[derive(Debug)]
pub struct Recorder {
    file: File,
    path: PathBuf,
    clock: Clock,
    begun: bool,
}

/// Makes a new file for a recording.
///
/// # Errors
/// When it cannot be made, or is there already: nothing recorded is overwritten.
pub fn new_file(path: &Path) -> io::Result<File> {
    let taken = "there is a file of that name already, and what was recorded is not overwritten: name another";
    File::create_new(path).map_err(|e| match e.kind() {
        io::ErrorKind::AlreadyExists => io::Error::new(e.kind(), taken),
        _ => e,
    })
}

impl Recorder {
    /// Makes a new file; an existing one is refused.
    ///
    /// # Errors
    /// When the file exists or cannot be made.
    pub fn create(path: &Path, clock: Clock) -> Result<Self, TrackingError> {
        let path = path.to_owned();
        match new_file(&path) {
            Ok(file) => Ok(Self { file, path, clock, begun: false }),
            Err(error) => Err(TrackingError::File { path, error }),
        }
    }

    /// Writes what arrived `since` nanoseconds after the start of the clock.
    pub(crate) fn write(&mut self, protocol: Protocol, since: u64, bytes: &[u8]) -> Result<(), TrackingError> {
        let start = self.clock.start_nanos();
        let mut out = if self.begun { Vec::new() } else { begin(protocol, start) };
        self.begun = true;
        let named = |error| TrackingError::Recording { path: self.path.clone(), error };
        out.extend(record(since, bytes).map_err(named)?);
        self.file.write_all(&out).map_err(|error: io::Error| TrackingError::File { path: self.path.clone(), error })
    }
}
