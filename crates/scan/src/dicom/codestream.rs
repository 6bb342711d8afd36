//! What a compressed frame says of itself. A codec trusts it, so it is compared with the DICOM header first.

use crate::error::{Problem, header, unsupported};

/// Size and type in a JPEG or JPEG 2000 codestream.
#[derive(Debug, PartialEq, Eq)]
struct Claim {
    columns: u64,
    rows: u64,
    components: u64,
    /// JPEG 2000 only.
    signed: Option<bool>,
    /// Bits of a sample, when it is a lossy JPEG.
    lossy_bits: Option<u64>,
}

/// Refuses a codestream that contradicts the DICOM header; what is neither JPEG nor JPEG 2000 passes.
///
/// # Errors
/// Other size, several components, other signedness (the decoder would give other values than other software does).
pub(crate) fn check(bytes: &[u8], size: [usize; 2], signed: bool) -> Result<(), Problem> {
    let claim = match bytes {
        [0xFF, 0x4F, ..] => jpeg2000(bytes),
        [0xFF, 0xD8, ..] => jpeg(bytes),
        _ => return Err(header("PixelData", "the compressed frame is no JPEG or JPEG 2000 codestream")),
    };
    let claim = claim.ok_or_else(|| header("PixelData", "the compressed frame has no size: it is damaged"))?;
    if [claim.columns, claim.rows, claim.components] != [size[0] as u64, size[1] as u64, 1] {
        let Claim { columns, rows, components, .. } = claim;
        return Err(header(
            "PixelData",
            format!(
                "the compressed frame has {columns} x {rows} pixels of {components} components, the header says {} x {} of 1",
                size[0], size[1]
            ),
        ));
    }
    if let Some(bits) = claim.lossy_bits.filter(|&b| b > 8) {
        let what = format!("{bits}-bit lossy JPEG compression");
        return Err(unsupported(what, "export it uncompressed or as JPEG Lossless"));
    }
    match claim.signed {
        Some(s) if s != signed => {
            let word = |s| if s { "signed" } else { "unsigned" };
            Err(header(
                "PixelRepresentation",
                format!("says {}, but the JPEG 2000 frame is {}: the values are ambiguous", word(signed), word(s)),
            ))
        }
        _ => Ok(()),
    }
}

fn number(bytes: &[u8], at: usize, width: usize) -> Option<u64> {
    Some(bytes.get(at..at + width)?.iter().fold(0, |n, &b| n << 8 | u64::from(b)))
}

/// The SIZ marker, which always comes first (ISO 15444-1, A.5.1).
fn jpeg2000(bytes: &[u8]) -> Option<Claim> {
    if number(bytes, 2, 2)? != 0xFF51 {
        return None;
    }
    let at = |offset: usize| number(bytes, 4 + offset, 4);
    let columns = at(4)?.checked_sub(at(12)?)?;
    let rows = at(8)?.checked_sub(at(16)?)?;
    let components = number(bytes, 4 + 36, 2)?;
    let signed = number(bytes, 4 + 38, 1)? & 0x80 != 0;
    Some(Claim { columns, rows, components, signed: Some(signed), lossy_bits: None })
}

/// The first frame header, SOF0 to SOF15 (ISO 10918-1, B.2.2).
fn jpeg(bytes: &[u8]) -> Option<Claim> {
    let mut at = 2;
    loop {
        if *bytes.get(at)? != 0xFF {
            return None;
        }
        let marker = *bytes.get(at + 1)?;
        match marker {
            0xFF => at += 1,
            0xC0..=0xCF if !matches!(marker, 0xC4 | 0xC8 | 0xCC) => {
                let (rows, columns) = (number(bytes, at + 5, 2)?, number(bytes, at + 7, 2)?);
                // SOF3, 7, 11 and 15 are lossless.
                let lossy_bits = if marker & 3 == 3 { None } else { Some(number(bytes, at + 4, 1)?) };
                return Some(Claim { columns, rows, components: number(bytes, at + 9, 1)?, signed: None, lossy_bits });
            }
            0xDA | 0xD9 => return None,
            _ => at += 2 + usize::try_from(number(bytes, at + 2, 2)?).ok()?,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// SOI and a frame header of 4 x 3 pixels.
    fn stream(marker: u8, bits: u8, components: u8) -> Vec<u8> {
        let start = [0xFF, 0xD8, 0xFF, 0xE0, 0, 4, 1, 2];
        [&start[..], &[0xFF, marker, 0, 11, bits, 0, 3, 0, 4, components, 0]].concat()
    }

    #[test]
    fn frames_that_contradict_the_header_are_refused_by_name() {
        assert!(check(&stream(0xC3, 16, 1), [4, 3], true).is_ok());
        assert!(check(&stream(0xC0, 8, 1), [4, 3], false).is_ok());
        let refusal = |s: &[u8], size| check(s, size, false).expect_err("a refusal").to_string();
        assert!(refusal(&stream(0xC1, 12, 1), [4, 3]).contains("12-bit lossy JPEG"));
        assert!(refusal(&stream(0xC3, 16, 1), [4, 4]).contains("4 x 3"));
        assert!(refusal(&stream(0xC3, 16, 3), [4, 3]).contains("3 components"));
        assert!(refusal(&stream(0xC3, 16, 1)[..14], [4, 3]).contains("damaged"));
        assert!(refusal(b"text", [4, 3]).contains("no JPEG"));
    }
}
