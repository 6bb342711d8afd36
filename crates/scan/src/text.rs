//! Pieces of text headers, shared by NRRD and MetaImage.

use crate::error::{Problem, header};

/// A text header is never longer than this.
const LONGEST: usize = 1 << 20;

/// Lines without their ends, each with the offset behind it.
pub(crate) fn lines(bytes: &[u8]) -> impl Iterator<Item = (&[u8], usize)> {
    let bytes = &bytes[..bytes.len().min(LONGEST)];
    let mut at = 0;
    core::iter::from_fn(move || {
        let rest = bytes.get(at..).filter(|r| !r.is_empty())?;
        let length = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
        at = (at + length + 1).min(bytes.len());
        Some((rest[..length].strip_suffix(b"\r").unwrap_or(&rest[..length]), at))
    })
}

/// The beginning of a text, for messages.
pub(crate) fn excerpt(text: &str) -> String {
    text.chars().take(60).collect()
}

/// Exactly `N` numbers separated by blanks.
pub(crate) fn numbers<const N: usize>(field: &'static str, text: &str) -> Result<[f64; N], Problem> {
    let values: Vec<f64> = text.split_whitespace().map_while(|w| w.parse().ok()).collect();
    let count = text.split_whitespace().count();
    <[f64; N]>::try_from(values)
        .ok()
        .filter(|_| count == N)
        .ok_or_else(|| header(field, format!("{:?} is not {N} numbers", excerpt(text))))
}

/// Three positive whole numbers.
pub(crate) fn dims(field: &'static str, text: &str) -> Result<[u64; 3], Problem> {
    let values: Vec<u64> = text.split_whitespace().filter_map(|w| w.parse().ok()).collect();
    <[u64; 3]>::try_from(values)
        .ok()
        .filter(|d| text.split_whitespace().count() == 3 && !d.contains(&0))
        .ok_or_else(|| header(field, format!("{:?} is not three positive whole numbers", excerpt(text))))
}

/// The name of a detached data file, which must lie beside its header.
pub(crate) fn plain_name(name: &str) -> Result<String, Problem> {
    let plain = name.strip_prefix("./").unwrap_or(name);
    let bad = plain.is_empty() || plain == ".." || plain == "." || plain.contains(['/', '\\', '\0', ':']);
    if bad { Err(Problem::OutsideFolder(excerpt(name))) } else { Ok(plain.to_owned()) }
}
