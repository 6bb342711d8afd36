//! Recordings: raw datagrams (or pieces of a TCP stream) with their arrival times, as they came.
//!
//! Layout, little-endian: 8 bytes `MNRREC1\n`, one byte for the protocol, `u64` start in nanoseconds since 1970; then
//! for each datagram `u64` nanoseconds since the start, `u32` length, bytes; in a stream, an empty record is the beginning
//! of a new connection. A file cut off by a crash keeps all its
//! whole records.

use crate::bytes::{Reader, Writer};
use thiserror::Error;

const MAGIC: [u8; 8] = *b"MNRREC1\n";

/// What was recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Protocol {
    /// Datagrams of NatNet.
    NatNet,
    /// Pieces of an OpenIGTLink stream, as they were received.
    OpenIgtLink,
}

/// Why a recording cannot be replayed.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum RecordingError {
    /// The file does not begin as a recording does.
    #[error(
        "this is no recording of a tracker (it does not begin with MNRREC1); those of sessions are for \"monro replay\""
    )]
    Magic,
    /// The protocol's number is not known.
    #[error("the recording holds protocol {0}, which this version does not know")]
    Protocol(u8),
    /// A record is longer than a length field can say.
    #[error("a record of {0} bytes is too long for a recording")]
    TooLong(usize),
}

/// Whether a file begins as recordings do.
pub fn is_recording(file: &[u8]) -> bool {
    file.starts_with(&MAGIC)
}

/// The bytes with which a recording begins. `start` is in nanoseconds since 1970.
pub fn begin(protocol: Protocol, start: u64) -> Vec<u8> {
    let mut w = Writer::<false>::new();
    w.bytes(&MAGIC);
    w.u8(match protocol {
        Protocol::NatNet => 1,
        Protocol::OpenIgtLink => 2,
    });
    w.u64(start);
    w.0
}

/// The bytes of one record: what arrived, and how many nanoseconds after the start.
///
/// # Errors
/// When there are more than 4 GiB of it.
pub fn record(since_start: u64, bytes: &[u8]) -> Result<Vec<u8>, RecordingError> {
    let length = u32::try_from(bytes.len()).map_err(|_| RecordingError::TooLong(bytes.len()))?;
    let mut w = Writer::<false>::new();
    w.u64(since_start);
    w.u32(length);
    w.bytes(bytes);
    Ok(w.0)
}

/// One datagram of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Record<'a> {
    /// Nanoseconds since the start.
    pub since_start: u64,
    /// What arrived.
    pub bytes: &'a [u8],
}

/// A recording, read in place.
#[derive(Debug, Clone)]
pub struct Recording<'a> {
    protocol: Protocol,
    start: u64,
    records: Vec<Record<'a>>,
    cut_off: usize,
}

impl<'a> Recording<'a> {
    /// Reads a whole file. Bytes of an unfinished last record are left out and counted.
    ///
    /// # Errors
    /// When it is no recording.
    pub fn read(file: &'a [u8]) -> Result<Self, RecordingError> {
        let mut r = Reader::<'a, false>::new(file);
        if r.array("magic").ok() != Some(MAGIC) {
            return Err(RecordingError::Magic);
        }
        let protocol = match r.u8("protocol").map_err(|_| RecordingError::Magic)? {
            1 => Protocol::NatNet,
            2 => Protocol::OpenIgtLink,
            other => return Err(RecordingError::Protocol(other)),
        };
        let start = r.u64("start").map_err(|_| RecordingError::Magic)?;
        let mut records = Vec::new();
        let mut whole = r.left();
        while let Ok(record) = one(&mut r) {
            records.push(record);
            whole = r.left();
        }
        Ok(Self { protocol, start, records, cut_off: whole })
    }

    /// What was recorded.
    pub const fn protocol(&self) -> Protocol {
        self.protocol
    }

    /// Nanoseconds since 1970 at the start.
    pub const fn start(&self) -> u64 {
        self.start
    }

    /// All whole records.
    pub fn records(&self) -> &[Record<'a>] {
        &self.records
    }

    /// Bytes of an unfinished record at the end.
    pub const fn cut_off(&self) -> usize {
        self.cut_off
    }
}

fn one<'a>(r: &mut Reader<'a, false>) -> Result<Record<'a>, crate::ReadError> {
    let since_start = r.u64("time")?;
    let length = r.u32("length")? as usize;
    Ok(Record { since_start, bytes: r.take(length, "record")? })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn written(records: &[(u64, Vec<u8>)]) -> Vec<u8> {
        let mut file = begin(Protocol::NatNet, 42);
        records.iter().for_each(|(t, b)| file.extend(record(*t, b).expect("short")));
        file
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_and_a_cut_file_keeps_its_whole_records(
            records in proptest::collection::vec((any::<u64>(), proptest::collection::vec(any::<u8>(), 0..50)), 0..6), cut in 0usize..400,
        ) {
            let file = written(&records);
            let read = Recording::read(&file).expect("whole");
            prop_assert_eq!((read.start(), read.protocol(), read.cut_off()), (42, Protocol::NatNet, 0));
            let back: Vec<_> = read.records().iter().map(|r| (r.since_start, r.bytes.to_vec())).collect();
            prop_assert_eq!(&back, &records);
            let cut = cut.clamp(17, file.len());
            let part = Recording::read(&file[..cut]).expect("begins well");
            let whole: usize = part.records().iter().map(|r| 12 + r.bytes.len()).sum();
            prop_assert_eq!(17 + whole + part.cut_off(), cut);
            prop_assert!(part.records().iter().zip(&records).all(|(a, b)| a.bytes == b.1));
        }

        #[test]
        fn any_bytes_are_survived(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = Recording::read(&bytes);
            let _ = Recording::read(&[begin(Protocol::OpenIgtLink, 0), bytes].concat()).expect("begins well");
        }
    }

    #[test]
    fn other_files_are_refused() {
        assert_eq!(Recording::read(b"PK\x03\x04 and so on").err(), Some(RecordingError::Magic));
        assert_eq!(Recording::read(b"MNRREC1\n\x09________").err(), Some(RecordingError::Protocol(9)));
    }
}
