//! What an edit changed, as runs, forwards and backwards.

use monro_geometry::Volume;

/// Consecutive voxels that all had one label and got another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Change {
    start: usize,
    length: usize,
    before: u8,
    after: u8,
}

/// The changes of one edit, ascending; an edit that changes nothing is empty.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Diff {
    changes: Vec<Change>,
}

impl Diff {
    /// Adds a voxel behind all others.
    pub(super) fn push(&mut self, voxel: usize, before: u8, after: u8) {
        if before == after {
            return;
        }
        match self.changes.last_mut() {
            Some(c) if c.start + c.length == voxel && (c.before, c.after) == (before, after) => c.length += 1,
            _ => self.changes.push(Change { start: voxel, length: 1, before, after }),
        }
    }

    /// Whether nothing changed.
    pub const fn is_empty(&self) -> bool {
        self.changes.is_empty()
    }

    /// Number of voxels changed.
    pub fn count(&self) -> usize {
        self.changes.iter().map(|c| c.length).sum()
    }

    /// Whether the labels are those the edit was made on.
    pub(super) fn fits(&self, labels: &Volume<u8>) -> bool {
        self.changes.iter().all(|c| {
            let end = c.start.checked_add(c.length);
            end.and_then(|end| labels.data().get(c.start..end)).is_some_and(|v| v.iter().all(|&l| l == c.before))
        })
    }

    pub(super) fn apply(&self, labels: &mut Volume<u8>) {
        self.changes.iter().for_each(|c| labels.data_mut()[c.start..c.start + c.length].fill(c.after));
    }

    pub(super) fn revert(&self, labels: &mut Volume<u8>) {
        self.changes.iter().for_each(|c| labels.data_mut()[c.start..c.start + c.length].fill(c.before));
    }

    /// Each change as gap to the one before, length (both LEB128), label before and after.
    pub(super) fn encode(&self, out: &mut Vec<u8>) {
        let mut at = 0;
        for c in &self.changes {
            put_number(out, c.start - at);
            put_number(out, c.length);
            out.extend([c.before, c.after]);
            at = c.start + c.length;
        }
    }

    /// The inverse of `encode`; `None` for bytes that are no encoding.
    pub(super) fn decode(mut bytes: &[u8]) -> Option<Self> {
        let (mut changes, mut at) = (Vec::new(), 0usize);
        while !bytes.is_empty() {
            let start = at.checked_add(take_number(&mut bytes)?)?;
            let length = take_number(&mut bytes)?;
            let (&[before, after], rest) = bytes.split_first_chunk::<2>()?;
            bytes = rest;
            at = start.checked_add(length)?;
            changes.push(Change { start, length, before, after });
        }
        Some(Self { changes })
    }
}

fn put_number(out: &mut Vec<u8>, mut n: usize) {
    while n >= 0x80 {
        out.push(n as u8 | 0x80);
        n >>= 7;
    }
    out.push(n as u8);
}

fn take_number(bytes: &mut &[u8]) -> Option<usize> {
    let mut n = 0usize;
    for shift in (0..usize::BITS).step_by(7) {
        let (&byte, rest) = bytes.split_first()?;
        *bytes = rest;
        n |= usize::from(byte & 0x7f).checked_shl(shift)?;
        if byte < 0x80 {
            return Some(n);
        }
    }
    None
}
