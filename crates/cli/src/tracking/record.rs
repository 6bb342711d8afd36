//! Writes what arrives to a file, as it came.

use super::Clock;
use anyhow::{Context, Result};
use monro_wire::recording::{Protocol, begin, record};
use std::fs::File;
use std::io::Write;
use std::path::Path;

/// An open recording. Each datagram is handed to the system at once, so that a crash loses none that was written.
#[derive(Debug)]
pub struct Recorder {
    file: File,
    clock: Clock,
    begun: bool,
}

impl Recorder {
    /// Makes a new file; an existing one is refused.
    ///
    /// # Errors
    /// When the file exists or cannot be made.
    pub fn create(path: &Path, clock: Clock) -> Result<Self> {
        let file = File::create_new(path).with_context(|| format!("cannot make the recording {}", path.display()))?;
        Ok(Self { file, clock, begun: false })
    }

    pub(super) fn write(&mut self, protocol: Protocol, arrival: f64, bytes: &[u8]) -> Result<()> {
        let start = self.clock.start_nanos();
        let mut out = if self.begun { Vec::new() } else { begin(protocol, start) };
        self.begun = true;
        let since = ((arrival - start as f64 / 1e9) * 1e9).max(0.0) as u64;
        out.extend(record(since, bytes)?);
        self.file.write_all(&out).context("cannot write the recording (disk full?)")
    }
}
