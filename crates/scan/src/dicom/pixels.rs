//! From stored pixels to HU.

use super::codestream;
use super::image::{Image, Stored, chain};
use super::outline::{Outline, Pixels, outline};
use super::rle;
use crate::error::{Problem, ScanError, header};
use crate::hu::{AIR, HuNotes};
use dicom_dictionary_std::uids;
use dicom_object::OpenFileOptions;
use dicom_pixeldata::PixelDecoder;
use std::path::PathBuf;

/// Decodes slices of equal size, one after the other, with two threads.
pub(crate) fn decode(images: &[Image]) -> Result<(Vec<i16>, HuNotes), ScanError> {
    let plane = images[0].size[0] * images[0].size[1];
    let mut data = vec![AIR; plane * images.len()];
    // Frames of one file are decoded together, so there is nothing to share out.
    let half = if images[0].frames > 1 { images.len() } else { images.len().div_ceil(2) };
    let (first, second) = images.split_at(half);
    let (lower, upper) = data.split_at_mut(half * plane);
    let (a, b) = std::thread::scope(|scope| {
        let other = scope.spawn(|| decode_part(second, upper));
        (decode_part(first, lower), other.join())
    });
    let mut notes = a?;
    notes.add(&b.map_err(|_| ScanError::file(&images[half].file, Problem::Corrupt("the decoder failed".into())))??);
    Ok((data, notes))
}

fn decode_part(images: &[Image], out: &mut [i16]) -> Result<HuNotes, ScanError> {
    let mut notes = HuNotes::default();
    let mut file: Option<(PathBuf, Vec<u8>)> = None;
    for (n, image) in images.iter().enumerate() {
        let at = |problem| ScanError::file(&image.file, problem);
        let plane = image.size[0] * image.size[1];
        let native = match file.take().filter(|(path, _)| *path == image.file) {
            Some((_, native)) => native,
            None => native(image).map_err(at)?,
        };
        let size = plane * image.stored.allocated as usize / 8;
        let frame = native.get(image.frame * size..(image.frame + 1) * size);
        let frame = frame.ok_or_else(|| at(header("NumberOfFrames", "changed while the file was read")))?;
        convert(&image.stored, frame, &mut out[n * plane..(n + 1) * plane], &mut notes);
        file = Some((image.file.clone(), native));
    }
    Ok(notes)
}

/// All frames of a file as uncompressed samples in the byte order of its transfer syntax.
fn native(image: &Image) -> Result<Vec<u8>, Problem> {
    let bytes = super::folder::load(&image.file)?;
    let bytes = bytes.ok_or_else(|| Problem::Unrecognised("it is no DICOM file any more".into()))?;
    let outline = outline(&bytes)?;
    let pixels = outline.pixels.clone().ok_or_else(|| header("PixelData", "is missing"))?;
    let needed = image.size[0] * image.size[1] * image.frames * (image.stored.allocated as usize / 8);
    if pixels.promised.is_some() {
        let found = pixels.range.len();
        let value = outline.data.get(pixels.range).and_then(|v| v.get(..needed));
        let short = Problem::Truncated { expected: needed as u64, found: found as u64 };
        return value.map(<[u8]>::to_vec).ok_or(short);
    }
    decompressed(image, &bytes, &outline, &pixels, needed)
}

fn decompressed(
    image: &Image,
    bytes: &[u8],
    outline: &Outline<'_>,
    pixels: &Pixels,
    needed: usize,
) -> Result<Vec<u8>, Problem> {
    if !pixels.complete {
        return Err(Problem::EndsEarly);
    }
    let fragments = fragments(&outline.data[pixels.range.clone()]);
    if image.stored.syntax == uids::RLE_LOSSLESS {
        let pixels = image.size[0] * image.size[1];
        return rle::decode(&fragments, image.frames, pixels, image.stored.allocated as usize / 8);
    }
    // Every fragment that begins a frame must agree with the header.
    let begins = |f: &&&[u8]| matches!(f, [0xFF, 0x4F, 0xFF, 0x51, ..] | [0xFF, 0xD8, 0xFF, ..]);
    for fragment in fragments.iter().filter(begins) {
        codestream::check(fragment, image.size, image.stored.signed)?;
    }
    // The codecs index by what the stream says; should one fail on a damaged stream, that is an error of the file.
    let decoded = std::panic::catch_unwind(|| {
        let object = OpenFileOptions::new().from_reader(&bytes[128..]).map_err(|e| chain(&e))?;
        object.decode_pixel_data().map(|d| d.data().to_vec()).map_err(|e| chain(&e))
    });
    let decoded = decoded.unwrap_or_else(|_| Err("the decoder failed".into()));
    let data = decoded.map_err(|e| Problem::Corrupt(format!("{} ({e})", image.stored.syntax)))?;
    if data.len() != needed {
        let found = data.len();
        return Err(Problem::Corrupt(format!("decompressing gives {found} bytes instead of {needed}")));
    }
    Ok(data)
}

/// The fragments after the offset table, which is the first item.
fn fragments(mut rest: &[u8]) -> Vec<&[u8]> {
    let mut out = Vec::new();
    while let [0xFE, 0xFF, 0x00, 0xE0, a, b, c, d, tail @ ..] = rest {
        let length = (u32::from_le_bytes([*a, *b, *c, *d]) as usize).min(tail.len());
        let (fragment, after) = tail.split_at(length);
        out.push(fragment);
        rest = after;
    }
    out.drain(..out.len().min(1));
    out
}

/// Pixel padding is believed only where it reads as air, or as what no scanner gives (metal ends at 30,710 HU): some files
/// declare a value that is tissue.
const PADDING_HU: f64 = -900.0;
const NO_HU: f64 = 32_768.0;

/// Stored samples to HU (PS3.3, C.11.1): the stored bits, signed or not, times slope plus intercept.
fn convert(s: &Stored, raw: &[u8], out: &mut [i16], notes: &mut HuNotes) {
    let padding = s.believed_padding();
    let mut put = |out: &mut i16, sample: u32| {
        let value = s.value(sample);
        let whole = if s.signed && s.allocated == 16 { i64::from(sample as u16 as i16) } else { i64::from(sample) };
        if let Some([low, high]) = padding
            && ((low..=high).contains(&whole) || (low..=high).contains(&i64::from(value)))
        {
            notes.count += 1;
            notes.padding += 1;
            *out = AIR;
        } else {
            *out = notes.hu(f64::from(value) * s.slope + s.intercept);
        }
    };
    if s.allocated == 8 {
        out.iter_mut().zip(raw).for_each(|(o, &b)| put(o, b.into()));
    } else if s.syntax == "1.2.840.10008.1.2.2" {
        out.iter_mut().zip(raw.as_chunks().0).for_each(|(o, &b)| put(o, u16::from_be_bytes(b).into()));
    } else {
        out.iter_mut().zip(raw.as_chunks().0).for_each(|(o, &b)| put(o, u16::from_le_bytes(b).into()));
    }
}

impl Stored {
    /// Values that mean "no data" and can be nothing else, lowest and highest.
    pub(super) fn believed_padding(&self) -> Option<[i64; 2]> {
        let hu = |stored: i64| stored as f64 * self.slope + self.intercept;
        let between = |[low, high]: [i64; 2]| [hu(low).min(hu(high)), hu(low).max(hu(high))];
        self.padding.filter(|&p| between(p)[1] <= PADDING_HU || between(p)[0] >= NO_HU)
    }

    /// The stored value within a sample's bits.
    #[inline]
    fn value(&self, sample: u32) -> i32 {
        let left = 31 - self.high_bit;
        if self.signed {
            (sample << left).cast_signed() >> (32 - self.bits)
        } else {
            (sample << left >> (32 - self.bits)).cast_signed()
        }
    }
}
