//! A walk over the elements of a DICOM file before anything parses it.
//!
//! `dicom-object` allocates what an element's length field says, so four bad bytes could ask for 4 GiB. This walk
//! follows the same encoding rules without allocating, refuses lengths that leave the file, bounds the nesting, and
//! notes where the pixel data are.

use crate::error::{Problem, header};
use crate::raster::fill;
use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry};
use dicom_core::{Tag, VR};
use dicom_dictionary_std::{StandardDataDictionary, tags, uids};
use std::borrow::Cow;
use std::ops::Range;

/// Sequences within sequences beyond this depth are no CT.
const DEEPEST: usize = 16;
/// A deflated data set may not grow beyond this.
const LARGEST_INFLATED: usize = 1 << 30;
const UNDEFINED: u32 = u32::MAX;
const ITEM: Tag = Tag(0xFFFE, 0xE000);
const ITEM_END: Tag = Tag(0xFFFE, 0xE00D);
const SEQUENCE_END: Tag = Tag(0xFFFE, 0xE0DD);

/// What the walk found.
#[derive(Debug)]
pub(crate) struct Outline<'a> {
    /// Transfer syntax UID.
    pub(crate) syntax: String,
    /// The data set, inflated where it was deflated.
    pub(crate) data: Cow<'a, [u8]>,
    /// The pixel data within `data`; `None` when there are none.
    pub(crate) pixels: Option<Pixels>,
}

/// Where pixel data are.
#[derive(Debug, Clone)]
pub(crate) struct Pixels {
    /// Value bytes (native), or all fragments with their headers (encapsulated), as far as they are in the file.
    pub(crate) range: Range<usize>,
    /// Length that the header promises; `None` for fragments.
    pub(crate) promised: Option<u64>,
    /// Whether fragments end as they should.
    pub(crate) complete: bool,
}

/// Walks a DICOM file with preamble.
///
/// # Errors
/// An element that leaves the file, too deep nesting, no transfer syntax.
pub(crate) fn outline(bytes: &[u8]) -> Result<Outline<'_>, Problem> {
    let mut meta = Walk { bytes, implicit: false, big: false, pixels: None };
    let (syntax, start) = meta.file_meta()?;
    let (data, start) = if syntax == uids::DEFLATED_EXPLICIT_VR_LITTLE_ENDIAN {
        (Cow::Owned(inflate(&bytes[start..])?), 0)
    } else {
        (Cow::Borrowed(bytes), start)
    };
    let implicit = syntax == uids::IMPLICIT_VR_LITTLE_ENDIAN;
    // Retired, but still met.
    let big = syntax == "1.2.840.10008.1.2.2";
    let mut walk = Walk { bytes: &data, implicit, big, pixels: None };
    walk.data_set(start, data.len(), 0)?;
    let pixels = walk.pixels;
    Ok(Outline { syntax, data, pixels })
}

/// Of an element of unknown type and length, whose items have implicit types (PS3.5, 6.2.2), which the parser takes for explicit.
fn of_unknown(tag: Tag, why: &Problem) -> Problem {
    header(
        "DICOM elements",
        format!("{tag} is a sequence of unknown type, which is not read ({why}); rewrite the files, as with gdcmconv"),
    )
}

fn inflate(bytes: &[u8]) -> Result<Vec<u8>, Problem> {
    let mut stream = flate2::read::DeflateDecoder::new(bytes);
    let mut out = Vec::new();
    let mut chunk = vec![0; 1 << 16];
    loop {
        let got = fill(&mut stream, &mut chunk)?;
        out.extend_from_slice(&chunk[..got]);
        if out.len() > LARGEST_INFLATED {
            return Err(header("deflated data set", format!("grows beyond {LARGEST_INFLATED} bytes")));
        }
        if got < chunk.len() {
            return Ok(out);
        }
    }
}

struct Walk<'a> {
    bytes: &'a [u8],
    implicit: bool,
    big: bool,
    pixels: Option<Pixels>,
}

struct Element {
    tag: Tag,
    vr: VR,
    length: u32,
    /// Where the value begins.
    value: usize,
}

impl Walk<'_> {
    /// The transfer syntax, and where the data set begins.
    fn file_meta(&mut self) -> Result<(String, usize), Problem> {
        let mut at = 132;
        let mut syntax = None;
        while self.bytes.get(at..at + 2) == Some(&[2, 0]) {
            let e = self.element(at, self.bytes.len())?;
            let end = self.end(&e, self.bytes.len())?;
            if e.tag == tags::TRANSFER_SYNTAX_UID {
                let text = String::from_utf8_lossy(&self.bytes[e.value..end]);
                syntax = Some(text.trim_matches(['\0', ' ']).to_owned());
            }
            at = end;
        }
        let missing = || header("TransferSyntaxUID", "is missing: the file is truncated or damaged");
        Ok((syntax.ok_or_else(missing)?, at))
    }

    fn number<const N: usize>(&self, at: usize, end: usize) -> Result<[u8; N], Problem> {
        let raw = self.bytes.get(at..at + N).filter(|_| at + N <= end);
        let raw = raw.and_then(|r| <[u8; N]>::try_from(r).ok());
        raw.ok_or_else(|| {
            header("DICOM elements", format!("end at byte {at} within an element: the file is truncated"))
        })
    }

    fn short(&self, at: usize, end: usize) -> Result<u16, Problem> {
        let raw = self.number(at, end)?;
        Ok(if self.big { u16::from_be_bytes(raw) } else { u16::from_le_bytes(raw) })
    }

    fn long(&self, at: usize, end: usize) -> Result<u32, Problem> {
        let raw = self.number(at, end)?;
        Ok(if self.big { u32::from_be_bytes(raw) } else { u32::from_le_bytes(raw) })
    }

    /// Tag, value representation and length (PS3.5, 7.1).
    fn element(&self, at: usize, end: usize) -> Result<Element, Problem> {
        let tag = Tag(self.short(at, end)?, self.short(at + 2, end)?);
        if tag.0 == ITEM.0 {
            return Ok(Element { tag, vr: VR::UN, length: self.long(at + 4, end)?, value: at + 8 });
        }
        if self.implicit {
            let vr = StandardDataDictionary.by_tag(tag).map_or(VR::UN, |e| e.vr().relaxed());
            return Ok(Element { tag, vr, length: self.long(at + 4, end)?, value: at + 8 });
        }
        let code = self.number::<2>(at + 4, end)?;
        let vr = VR::from_binary(code)
            .ok_or_else(|| header("DICOM elements", format!("{tag} at byte {at} has no valid type ({code:?})")))?;
        let wide = matches!(
            vr,
            VR::OB
                | VR::OD
                | VR::OF
                | VR::OL
                | VR::OV
                | VR::OW
                | VR::SQ
                | VR::SV
                | VR::UC
                | VR::UN
                | VR::UR
                | VR::UT
                | VR::UV
        );
        if wide {
            return Ok(Element { tag, vr, length: self.long(at + 8, end)?, value: at + 12 });
        }
        Ok(Element { tag, vr, length: self.short(at + 6, end)?.into(), value: at + 8 })
    }

    /// Where an element of known length ends.
    fn end(&self, e: &Element, limit: usize) -> Result<usize, Problem> {
        let end = e.value as u64 + u64::from(e.length);
        if e.length == UNDEFINED || end > limit as u64 {
            let left = limit.saturating_sub(e.value);
            let problem =
                format!("{} claims {} bytes, {left} are left: the file is truncated or damaged", e.tag, e.length);
            return Err(header("DICOM elements", problem));
        }
        Ok(end as usize)
    }

    /// Walks elements up to `end` or an item's end mark; gives the place behind.
    fn data_set(&mut self, mut at: usize, end: usize, depth: usize) -> Result<usize, Problem> {
        while at < end {
            let e = self.element(at, end)?;
            if e.tag == ITEM_END && depth > 0 {
                return Ok(e.value);
            }
            if e.tag == tags::PIXEL_DATA && depth == 0 {
                self.pixel_data(&e);
                return Ok(end);
            }
            let unknown = e.vr == VR::UN && e.length == UNDEFINED;
            at = match unknown || e.vr == VR::SQ {
                true => {
                    self.items(&e, end, depth + 1).map_err(|why| if unknown { of_unknown(e.tag, &why) } else { why })?
                }
                false => self.end(&e, end)?,
            };
        }
        Ok(at)
    }

    /// Walks the items of a sequence.
    fn items(&mut self, sequence: &Element, limit: usize, depth: usize) -> Result<usize, Problem> {
        if depth > DEEPEST {
            return Err(header("DICOM elements", format!("sequences are nested deeper than {DEEPEST}")));
        }
        let end = if sequence.length == UNDEFINED { limit } else { self.end(sequence, limit)? };
        let mut at = sequence.value;
        while at < end {
            let item = self.element(at, end)?;
            match item.tag {
                SEQUENCE_END if sequence.length == UNDEFINED => return Ok(item.value),
                ITEM if item.length == UNDEFINED => at = self.data_set(item.value, end, depth)?,
                ITEM => {
                    at = self.end(&item, end)?;
                    self.data_set(item.value, at, depth)?;
                }
                other => {
                    return Err(header("DICOM elements", format!("{other} stands where an item should (byte {at})")));
                }
            }
        }
        Ok(end)
    }

    /// Notes the pixel data; that they may be cut short is for the decoder to say, which knows how many are needed.
    fn pixel_data(&mut self, e: &Element) {
        let size = self.bytes.len();
        let start = e.value.min(size);
        if e.length != UNDEFINED {
            let end = (start as u64 + u64::from(e.length)).min(size as u64) as usize;
            let promised = u64::from(e.length);
            self.pixels = Some(Pixels {
                range: start..end,
                promised: Some(promised),
                complete: (end - start) as u64 == promised,
            });
            return;
        }
        let (mut at, mut complete) = (start, false);
        while let Ok(item) = self.element(at, size) {
            if item.tag == SEQUENCE_END {
                complete = true;
                break;
            }
            let Ok(next) = self.end(&item, size) else { break };
            if item.tag != ITEM {
                break;
            }
            at = next;
        }
        self.pixels = Some(Pixels { range: start..at, promised: None, complete });
    }
}
