//! RLE Lossless (PS3.5, annex G). `dicom-pixeldata` decodes it too, but panics on a damaged header.

use crate::error::Problem;

/// Samples of one frame, little endian, from the bytes of its fragment: one `PackBits` segment for each byte of a sample,
/// the most significant first. `None` where the fragment is damaged.
fn frame(fragment: &[u8], pixels: usize, width: usize) -> Option<Vec<u8>> {
    let word = |n: usize| {
        let raw = fragment.get(4 * n..4 * n + 4)?;
        Some(u32::from_le_bytes(<[u8; 4]>::try_from(raw).ok()?) as usize)
    };
    if word(0)? != width {
        return None;
    }
    let mut out = vec![0; pixels * width];
    for segment in 0..width {
        let start = word(1 + segment)?;
        let end = if segment + 1 < width { word(2 + segment)? } else { fragment.len() };
        let bytes = unpacked(fragment.get(start..end)?, pixels)?;
        let place = width - 1 - segment;
        out.iter_mut().skip(place).step_by(width).zip(bytes).for_each(|(o, b)| *o = b);
    }
    Some(out)
}

/// `PackBits`: a count of literal bytes, or a count of copies of one byte.
fn unpacked(mut packed: &[u8], pixels: usize) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(pixels);
    while out.len() < pixels {
        let (&head, rest) = packed.split_first()?;
        packed = match head {
            0..=127 => {
                let count = usize::from(head) + 1;
                out.extend_from_slice(rest.get(..count)?);
                &rest[count..]
            }
            128 => rest,
            129..=255 => {
                let (&value, rest) = rest.split_first()?;
                out.extend(core::iter::repeat_n(value, 257 - usize::from(head)));
                rest
            }
        };
    }
    out.truncate(pixels);
    Some(out)
}

/// All frames, each in its own fragment.
pub(crate) fn decode(fragments: &[&[u8]], frames: usize, pixels: usize, width: usize) -> Result<Vec<u8>, Problem> {
    if fragments.len() != frames {
        return Err(Problem::Corrupt(format!("{} RLE fragments for {frames} frames", fragments.len())));
    }
    let mut out = Vec::new();
    for (n, fragment) in fragments.iter().enumerate() {
        let damaged =
            || Problem::Corrupt(format!("the RLE data of frame {} end early or contradict themselves", n + 1));
        out.extend(frame(fragment, pixels, width).ok_or_else(damaged)?);
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn literal_and_repeated_runs_unpack() {
        // The example of the TIFF specification.
        let packed = [0xFE, 0xAA, 0x02, 0x80, 0x00, 0x2A, 0xFD, 0xAA, 0x03, 0x80, 0x00, 0x2A, 0x22, 0xF7, 0xAA];
        let expected = [
            0xAA, 0xAA, 0xAA, 0x80, 0x00, 0x2A, 0xAA, 0xAA, 0xAA, 0xAA, 0x80, 0x00, 0x2A, 0x22, 0xAA, 0xAA, 0xAA, 0xAA,
            0xAA, 0xAA, 0xAA, 0xAA, 0xAA, 0xAA,
        ];
        assert_eq!(unpacked(&packed, 24).as_deref(), Some(&expected[..]));
        assert_eq!(unpacked(&packed, 25), None);
        assert_eq!(unpacked(&[5, 1, 2], 3), None);
    }

    #[test]
    fn a_header_that_points_outside_is_damaged() {
        let mut fragment = vec![0u8; 64];
        fragment[0] = 2;
        fragment[4..8].copy_from_slice(&64u32.to_le_bytes());
        fragment[8..12].copy_from_slice(&9999u32.to_le_bytes());
        assert!(decode(&[&fragment], 1, 4, 2).is_err());
        assert!(decode(&[&fragment[..3]], 1, 4, 2).is_err());
        assert!(decode(&[], 1, 4, 2).is_err());
    }
}
