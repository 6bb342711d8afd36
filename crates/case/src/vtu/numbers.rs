//! The numbers of arrays in any of their encodings.

use super::Kind;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use core::cell::Cell;
use flate2::read::ZlibDecoder;
use roxmltree::Node;
use std::io::Read;

/// Numbers that all arrays together may hold for each byte of the file. Zlib makes a thousand equal bytes one, so that what a
/// file says of its own sizes bounds nothing. But elements differ: an even grid of tetrahedra in its best order takes 6 bytes
/// for each of them and 2 for each node, which leaves several hundred numbers for each node.
const PER_BYTE: usize = 16;
/// What files of any size may hold.
const ALWAYS: usize = 1 << 16;

/// How the file stores its arrays.
pub(super) struct Layout<'a> {
    big_endian: bool,
    long_header: bool,
    compressed: bool,
    /// Appended data behind its underscore, and whether it is base64.
    appended: Option<(&'a [u8], bool)>,
    /// Length of the file.
    bytes: usize,
    /// Numbers that may still be read.
    left: Cell<usize>,
}

/// How many numbers an array should hold.
#[derive(Debug, Clone, Copy)]
pub(super) enum Wanted {
    Exactly { components: usize, count: usize },
    AtMost(usize),
    Any,
}

impl Wanted {
    fn check(self, found: usize) -> Result<(), String> {
        match self {
            Self::Exactly { components, count } if components.checked_mul(count) != Some(found) => {
                Err(format!("{found} values, expected {components} x {count}"))
            }
            Self::AtMost(most) if found > most => Err(format!("{found} values, expected {most} at most")),
            _ => Ok(()),
        }
    }
}

impl<'a> Layout<'a> {
    /// What the root element says, for a file of `bytes`.
    pub(super) fn of(root: Node<'_, '_>, appended: Option<(&'a [u8], bool)>, bytes: usize) -> Self {
        Self {
            big_endian: root.attribute("byte_order") == Some("BigEndian"),
            long_header: root.attribute("header_type") == Some("UInt64"),
            compressed: root.attribute("compressor").is_some(),
            appended,
            bytes,
            left: Cell::new(bytes.saturating_mul(PER_BYTE).max(ALWAYS)),
        }
    }

    /// Refuses an array before it is decoded: one of another length than is wanted, or one too many for the file.
    fn admit(&self, found: usize, wanted: Wanted) -> Result<(), String> {
        wanted.check(found)?;
        let left = self.left.get();
        let rest = left.checked_sub(found).ok_or_else(|| {
            format!(
                "{found} values, where a file of {} bytes has at most {left} more; leave out arrays that are not needed, or save it without compression",
                self.bytes
            )
        })?;
        self.left.set(rest);
        Ok(())
    }

    /// Refuses data that are no whole number of values, or not as many as wanted.
    fn admit_bytes(&self, bytes: usize, kind: Kind, wanted: Wanted) -> Result<(), String> {
        if !bytes.is_multiple_of(kind.size()) {
            return Err(format!("{bytes} bytes are no whole number of values of {} bytes", kind.size()));
        }
        self.admit(bytes / kind.size(), wanted)
    }
}

/// The numbers of an array in any of its encodings.
pub(super) fn numbers(node: Node<'_, '_>, kind: Kind, wanted: Wanted, layout: &Layout<'_>) -> Result<Vec<f64>, String> {
    let text = node.text().unwrap_or("");
    match node.attribute("format") {
        Some("ascii") | None => ascii(text, wanted, layout),
        Some("binary") => binary(text.trim().as_bytes(), true, kind, wanted, layout),
        Some("appended") => appended(node, kind, wanted, layout),
        Some(other) => Err(format!("format {other} is unknown")),
    }
}

fn ascii(text: &str, wanted: Wanted, layout: &Layout<'_>) -> Result<Vec<f64>, String> {
    layout.admit(text.split_ascii_whitespace().count(), wanted)?;
    text.split_ascii_whitespace().map(|w| w.parse().map_err(|_| format!("\"{w}\" is not a number"))).collect()
}

fn appended(node: Node<'_, '_>, kind: Kind, wanted: Wanted, layout: &Layout<'_>) -> Result<Vec<f64>, String> {
    let (data, base64) = layout.appended.ok_or("no AppendedData in the file")?;
    let offset: usize = node.attribute("offset").and_then(|o| o.parse().ok()).ok_or("no offset")?;
    let data =
        data.get(offset..).ok_or_else(|| format!("offset {offset} is beyond the {} appended bytes", data.len()))?;
    binary(data, base64, kind, wanted, layout)
}

/// Reads a header and its data; both may be base64, each compressed header being a base64 run of its own.
fn binary(data: &[u8], base64: bool, kind: Kind, wanted: Wanted, layout: &Layout<'_>) -> Result<Vec<f64>, String> {
    let word = if layout.long_header { 8 } else { 4 };
    let raw = if layout.compressed {
        compressed(data, base64, word, layout.big_endian, |n| layout.admit_bytes(n, kind, wanted))?
    } else {
        let first = take(data, base64, 0, word)?;
        let n = length(&first, layout.big_endian)?;
        layout.admit_bytes(n, kind, wanted)?;
        take(data, base64, word, n)?
    };
    let values = raw.chunks_exact(kind.size()).map(|c| {
        let mut b = [0u8; 8];
        b[..c.len()].copy_from_slice(c);
        if layout.big_endian {
            b[..c.len()].reverse();
        }
        kind.value(&b[..c.len()])
    });
    Ok(values.collect())
}

/// Inflates all blocks, once `admit` has seen how many bytes they say they hold.
fn compressed(
    data: &[u8],
    base64: bool,
    word: usize,
    big_endian: bool,
    admit: impl Fn(usize) -> Result<(), String>,
) -> Result<Vec<u8>, String> {
    let at = |header: &[u8], i: usize| length(&header[i * word..(i + 1) * word], big_endian);
    let blocks = at(&take(data, base64, 0, word)?, 0)?;
    if blocks == 0 {
        return admit(0).map(|()| Vec::new());
    }
    let header_bytes = blocks.checked_add(3).and_then(|n| n.checked_mul(word)).ok_or("too many blocks")?;
    let header = take(data, base64, 0, header_bytes)?;
    let skip = if base64 { header_bytes.div_ceil(3) * 4 } else { header_bytes };
    let body = data.get(skip..).ok_or("the data end inside the header")?;
    let full = at(&header, 1)?;
    let last = Some(at(&header, 2)?).filter(|&n| n != 0).unwrap_or(full);
    let total = full.checked_mul(blocks - 1).and_then(|n| n.checked_add(last));
    admit(total.ok_or("the sizes of its blocks overflow")?)?;
    let mut out = Vec::new();
    let mut start = 0usize;
    for b in 0..blocks {
        let size = at(&header, 3 + b)?;
        let packed = take(body, base64, start, size)?;
        inflate(&packed, if b + 1 == blocks { last } else { full }, &mut out)?;
        start += size;
    }
    Ok(out)
}

/// Inflates a block, but one byte beyond what its header says and no further.
fn inflate(packed: &[u8], expected: usize, out: &mut Vec<u8>) -> Result<(), String> {
    let before = out.len();
    let mut limited = ZlibDecoder::new(packed).take(expected as u64 + 1);
    limited.read_to_end(out).map_err(|e| format!("zlib: {e}"))?;
    let found = out.len() - before;
    if found == expected { Ok(()) } else { Err(format!("a block holds {found} bytes, its header says {expected}")) }
}

/// Bytes `start..start + n` of the data, decoded from base64 if need be.
fn take(data: &[u8], base64: bool, start: usize, n: usize) -> Result<Vec<u8>, String> {
    let end = start.checked_add(n).ok_or("a size overflows")?;
    let short = || format!("{n} bytes expected, the data end before");
    if !base64 {
        return data.get(start..end).map(<[u8]>::to_vec).ok_or_else(short);
    }
    let (from, to) = (start / 3 * 4, end.div_ceil(3).checked_mul(4).ok_or("a size overflows")?);
    let decoded = STANDARD.decode(data.get(from..to).ok_or_else(short)?).map_err(|e| format!("base64: {e}"))?;
    let offset = start - start / 3 * 3;
    decoded.get(offset..offset + n).map(<[u8]>::to_vec).ok_or_else(short)
}

fn length(word: &[u8], big_endian: bool) -> Result<usize, String> {
    let fold = |sum: u64, b: &u8| sum << 8 | u64::from(*b);
    let value = if big_endian { word.iter().fold(0, fold) } else { word.iter().rev().fold(0, fold) };
    usize::try_from(value).map_err(|_| format!("a size of {value} bytes"))
}
