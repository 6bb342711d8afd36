//! A container for things that are sent once: `MNRB`, a `u32` length, that many bytes of JSON (padded with blanks so that
//! what follows is aligned to 8), then the arrays, little-endian, each at a multiple of 8. The JSON names each array's
//! offset from the end of the JSON.

use serde_json::Value;

const MAGIC: &[u8; 4] = b"MNRB";
const ALIGN: usize = 8;

/// Collects arrays.
#[derive(Debug, Default)]
pub(crate) struct Arrays(Vec<u8>);

impl Arrays {
    /// Appends an array of numbers and gives its offset.
    pub(crate) fn push<const N: usize>(&mut self, bytes: impl Iterator<Item = [u8; N]>) -> usize {
        self.0.resize(self.0.len().next_multiple_of(ALIGN), 0);
        let offset = self.0.len();
        bytes.for_each(|b| self.0.extend_from_slice(&b));
        offset
    }

    /// The whole container.
    pub(crate) fn finish(self, header: &Value) -> Vec<u8> {
        let mut json = header.to_string();
        let padding = (8 + json.len()).next_multiple_of(ALIGN) - 8 - json.len();
        json.extend(core::iter::repeat_n(' ', padding));
        let mut out = Vec::with_capacity(8 + json.len() + self.0.len());
        out.extend_from_slice(MAGIC);
        out.extend_from_slice(&(json.len() as u32).to_le_bytes());
        out.extend_from_slice(json.as_bytes());
        out.extend_from_slice(&self.0);
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn arrays_are_aligned_whatever_the_header() {
        for name in ["", "a", "ab", "abcdefg"] {
            let mut arrays = Arrays::default();
            assert_eq!(arrays.push([[1u8], [2], [3]].into_iter()), 0);
            let at = arrays.push([7.5f32.to_le_bytes()].into_iter());
            assert_eq!(at, 8);
            let out = arrays.finish(&json!({ "name": name }));
            let length = u32::from_le_bytes([out[4], out[5], out[6], out[7]]) as usize;
            assert_eq!((&out[..4], (8 + length) % 8), (&MAGIC[..], 0));
            assert!(serde_json::from_slice::<Value>(&out[8..8 + length]).is_ok());
            assert_eq!(out[8 + length + at..], 7.5f32.to_le_bytes());
        }
    }
}
