//! The journal's bytes: a header that names the labels it started from, then one checked record per event.
//!
//! ```text
//! header   "MONROED1"  dims: 3 x u32  crc32 of the labels: u32  crc32 of the header so far: u32
//! record   length of the payload: u32  kind: u8  payload  crc32 of length, kind and payload: u32
//! ```
//! Little-endian. Records are only ever appended, so a process that is killed leaves at most the last one torn.

use super::{Diff, Drawn};
use crc32fast::hash as crc32;
use monro_geometry::Volume;
use thiserror::Error;

const MAGIC: &[u8; 8] = b"MONROED1";
const HEADER: usize = 8 + 12 + 4 + 4;
/// Length, kind and checksum.
const FRAME: usize = 4 + 1 + 4;

/// Something that happened to the labels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Event {
    /// An edit; one that continues the step before it is undone together with it.
    Edit {
        diff: Diff,
        continues: bool,
    },
    Undo,
    Redo,
    /// A slice was drawn on by hand.
    Drawn(Drawn),
}

/// What a replay found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Recovery {
    /// Edits, undos and redos restored.
    pub events: usize,
    /// Bytes of the journal that are whole; cut the file to this length before appending to it.
    pub valid_bytes: usize,
    /// Bytes of a torn last record that were dropped.
    pub torn_bytes: usize,
}

/// Why a journal was not replayed.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ReplayError {
    /// Not a journal, or its header is damaged.
    #[error("these bytes are no edit journal (damaged or foreign header)")]
    Header,
    /// The journal of other labels.
    #[error(
        "the journal belongs to labels of {journal:?} voxels with checksum {journal_crc:08x}, not to these of {labels:?} with {labels_crc:08x}; open the labels it was started on"
    )]
    Base {
        /// Dimensions in the journal.
        journal: [usize; 3],
        /// Checksum in the journal.
        journal_crc: u32,
        /// Dimensions of the labels.
        labels: [usize; 3],
        /// Checksum of the labels.
        labels_crc: u32,
    },
    /// A record in the middle is damaged.
    #[error(
        "record {record} at byte {offset} is damaged; the {record} before it are whole: cut the file to {offset} bytes to keep those"
    )]
    Damaged {
        /// Its number, from 0.
        record: usize,
        /// Its first byte.
        offset: usize,
    },
}

pub(super) fn header(labels: &Volume<u8>) -> Vec<u8> {
    let mut out = MAGIC.to_vec();
    for d in labels.grid().dims() {
        // Grids have below 2^60 voxels in all; a side beyond 2^32 would only make the checksum differ.
        out.extend((d as u32).to_le_bytes());
    }
    out.extend(crc32(labels.data()).to_le_bytes());
    let check = crc32(&out);
    out.extend(check.to_le_bytes());
    out
}

pub(super) fn append(out: &mut Vec<u8>, event: &Event) {
    let begin = out.len();
    let mut payload = Vec::new();
    let kind = match event {
        Event::Edit { diff, continues } => {
            diff.encode(&mut payload);
            if *continues { 2 } else { 1 }
        }
        Event::Undo => 3,
        Event::Redo => 4,
        Event::Drawn(d) => {
            payload.extend([d.axis, d.label]);
            payload.extend(d.slice.to_le_bytes());
            5
        }
    };
    out.extend((payload.len() as u32).to_le_bytes());
    out.push(kind);
    out.extend(payload);
    let check = crc32(&out[begin..]);
    out.extend(check.to_le_bytes());
}

/// All whole events of a journal of these labels, and how much of it is whole.
pub(super) fn read(bytes: &[u8], labels: &Volume<u8>) -> Result<(Vec<Event>, Recovery), ReplayError> {
    let mut events = Vec::new();
    let torn = |events: &[Event], at: usize| Recovery {
        events: events.iter().filter(|e| !matches!(e, Event::Drawn(_))).count(),
        valid_bytes: at,
        torn_bytes: bytes.len() - at,
    };
    if bytes.len() < HEADER && (MAGIC.starts_with(&bytes[..bytes.len().min(8)]) || bytes.starts_with(MAGIC)) {
        return Ok((events, torn(&[], 0)));
    }
    check_header(bytes, labels)?;
    let mut at = HEADER;
    while at < bytes.len() {
        let rest = &bytes[at..];
        match record(rest) {
            Some((event, length)) => {
                events.push(event);
                at += length;
            }
            None if is_torn(rest) => return Ok((events.clone(), torn(&events, at))),
            None => return Err(ReplayError::Damaged { record: events.len(), offset: at }),
        }
    }
    let recovery = torn(&events, at);
    Ok((events, recovery))
}

fn check_header(bytes: &[u8], labels: &Volume<u8>) -> Result<(), ReplayError> {
    let head = bytes.get(..HEADER).ok_or(ReplayError::Header)?;
    if !head.starts_with(MAGIC) || word(head, HEADER - 4) != Some(crc32(&head[..HEADER - 4])) {
        return Err(ReplayError::Header);
    }
    let expected = header(labels);
    if head == expected {
        return Ok(());
    }
    let number = |at: usize| word(head, at).unwrap_or(0);
    Err(ReplayError::Base {
        journal: [8, 12, 16].map(|at| number(at) as usize),
        journal_crc: number(20),
        labels: labels.grid().dims(),
        labels_crc: crc32(labels.data()),
    })
}

/// The record at the beginning of some bytes and its length, if it is whole.
fn record(bytes: &[u8]) -> Option<(Event, usize)> {
    let length = word(bytes, 0)? as usize;
    let end = length.checked_add(5)?;
    let body = bytes.get(..end)?;
    if word(bytes, end)? != crc32(body) {
        return None;
    }
    let payload = &body[5..];
    let event = match body[4] {
        1 | 2 => Event::Edit { diff: Diff::decode(payload)?, continues: body[4] == 2 },
        3 => Event::Undo,
        4 => Event::Redo,
        5 => Event::Drawn(drawn(payload)?),
        _ => return None,
    };
    Some((event, length + FRAME))
}

fn drawn(payload: &[u8]) -> Option<Drawn> {
    let [axis, label, slice @ ..] = payload else { return None };
    Some(Drawn { axis: *axis, label: *label, slice: u32::from_le_bytes(slice.try_into().ok()?) })
}

/// Whether a record that is not whole is the last one: it reaches to the end of the file or beyond, or a file system
/// left zeros after a crash.
fn is_torn(rest: &[u8]) -> bool {
    let end = word(rest, 0).map(|length| length as usize + FRAME);
    end.is_none_or(|end| end >= rest.len()) || rest.iter().all(|&b| b == 0)
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk::<4>().map(|b| u32::from_le_bytes(*b))
}
