//! Reading and writing packed numbers with every length checked before use.

use thiserror::Error;

/// Why packed bytes could not be read.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ReadError {
    /// The bytes end too early.
    #[error("{what} at byte {offset} needs {needed} bytes, but {left} are left")]
    Truncated {
        /// What was being read.
        what: &'static str,
        /// Where, counted from the start of the message's payload or section.
        offset: usize,
        /// Bytes it needs.
        needed: usize,
        /// Bytes present.
        left: usize,
    },
    /// A count that cannot be true of the bytes present.
    #[error("{what}: a count of {count} does not fit into the {left} bytes that are left")]
    Count {
        /// What was to be counted.
        what: &'static str,
        /// The count as sent.
        count: i64,
        /// Bytes present.
        left: usize,
    },
    /// A text without its terminating NUL.
    #[error("{what} at byte {offset} is not ended by a NUL")]
    Unterminated {
        /// What was being read.
        what: &'static str,
        /// Where.
        offset: usize,
    },
}

/// A reader over borrowed bytes; `BIG` says the byte order.
#[derive(Debug, Clone)]
pub(crate) struct Reader<'a, const BIG: bool> {
    bytes: &'a [u8],
    at: usize,
}

macro_rules! read_numbers {
    ($($name:ident: $type:ty),*) => {$(
        pub(crate) fn $name(&mut self, what: &'static str) -> Result<$type, ReadError> {
            let raw = self.array(what)?;
            Ok(if BIG { <$type>::from_be_bytes(raw) } else { <$type>::from_le_bytes(raw) })
        }
    )*};
}

impl<'a, const BIG: bool> Reader<'a, BIG> {
    pub(crate) const fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    pub(crate) const fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    pub(crate) fn take(&mut self, n: usize, what: &'static str) -> Result<&'a [u8], ReadError> {
        let left = self.left();
        if n > left {
            return Err(ReadError::Truncated { what, offset: self.at, needed: n, left });
        }
        let taken = &self.bytes[self.at..self.at + n];
        self.at += n;
        Ok(taken)
    }

    /// All that is left.
    pub(crate) fn rest(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.at..];
        self.at = self.bytes.len();
        rest
    }

    pub(crate) fn array<const N: usize>(&mut self, what: &'static str) -> Result<[u8; N], ReadError> {
        let mut out = [0; N];
        out.copy_from_slice(self.take(N, what)?);
        Ok(out)
    }

    read_numbers!(u8: u8, u16: u16, u32: u32, u64: u64, i32: i32, i64: i64, f32: f32, f64: f64);

    pub(crate) fn floats<const N: usize>(&mut self, what: &'static str) -> Result<[f32; N], ReadError> {
        let mut out = [0.0; N];
        for v in &mut out {
            *v = self.f32(what)?;
        }
        Ok(out)
    }

    /// An `i32` count of items of at least `smallest` bytes each, refused when the bytes left cannot hold them.
    pub(crate) fn count(&mut self, smallest: usize, what: &'static str) -> Result<usize, ReadError> {
        let count = self.i32(what)?;
        let left = self.left();
        match usize::try_from(count) {
            Ok(n) if n.checked_mul(smallest).is_some_and(|size| size <= left) => Ok(n),
            _ => Err(ReadError::Count { what, count: count.into(), left }),
        }
    }

    /// `n` items read one after the other. The vector grows with what is read, never with what is promised.
    pub(crate) fn many<T, E>(
        &mut self,
        n: usize,
        mut item: impl FnMut(&mut Self) -> Result<T, E>,
    ) -> Result<Vec<T>, E> {
        let mut out = Vec::new();
        for _ in 0..n {
            out.push(item(self)?);
        }
        Ok(out)
    }

    /// A NUL-terminated text, lossily decoded, without control characters.
    pub(crate) fn c_text(&mut self, what: &'static str) -> Result<String, ReadError> {
        let tail = &self.bytes[self.at..];
        let Some(end) = tail.iter().position(|&b| b == 0) else {
            return Err(ReadError::Unterminated { what, offset: self.at });
        };
        self.at += end + 1;
        Ok(printable(&tail[..end]))
    }

    /// A text in a field of `n` bytes, up to the first NUL or the field's end, without control characters.
    pub(crate) fn fixed_text(&mut self, n: usize, what: &'static str) -> Result<String, ReadError> {
        let field = self.take(n, what)?;
        let end = field.iter().position(|&b| b == 0).unwrap_or(n);
        Ok(printable(&field[..end]))
    }
}

/// A name as it came, but for what is no text and for control characters: a peer's name must not write to a terminal what
/// moves its cursor or sets its title.
fn printable(bytes: &[u8]) -> String {
    let shown = |c: char| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c };
    String::from_utf8_lossy(bytes).chars().map(shown).collect()
}

/// A growing message; `BIG` says the byte order.
#[derive(Debug, Default)]
pub(crate) struct Writer<const BIG: bool>(pub(crate) Vec<u8>);

macro_rules! write_numbers {
    ($($name:ident: $type:ty),*) => {$(
        pub(crate) fn $name(&mut self, v: $type) {
            self.0.extend_from_slice(&if BIG { v.to_be_bytes() } else { v.to_le_bytes() });
        }
    )*};
}

impl<const BIG: bool> Writer<BIG> {
    pub(crate) const fn new() -> Self {
        Self(Vec::new())
    }

    write_numbers!(u8: u8, u16: u16, u32: u32, u64: u64, i32: i32, i64: i64, f32: f32, f64: f64);

    pub(crate) fn bytes(&mut self, b: &[u8]) {
        self.0.extend_from_slice(b);
    }

    pub(crate) fn floats(&mut self, values: &[f32]) {
        for &v in values {
            self.f32(v);
        }
    }

    /// A count as `i32`; what we encode is far below its limit (a datagram holds 65 503 bytes).
    pub(crate) fn count(&mut self, n: usize) {
        self.i32(i32::try_from(n).unwrap_or(i32::MAX));
    }

    /// A NUL-terminated text; a NUL inside ends it.
    pub(crate) fn c_text(&mut self, text: &str) {
        self.bytes(text.split('\0').next().unwrap_or_default().as_bytes());
        self.u8(0);
    }

    /// A text cut to a field of `n` bytes (at a character's boundary) and filled with NUL.
    pub(crate) fn fixed_text(&mut self, text: &str, n: usize) {
        let end = text.floor_char_boundary(n);
        self.bytes(&text.as_bytes()[..end]);
        self.0.resize(self.0.len() + n - end, 0);
    }
}

/// The test vectors' file format: a line that is not indented names the hex lines that follow it.
#[cfg(test)]
pub(crate) mod vectors {
    pub(crate) fn named(file: &str, name: &str) -> Vec<u8> {
        let lines = file.lines().skip_while(|l| *l != name).skip(1).take_while(|l| l.starts_with(' '));
        let hex: String = lines.map(str::trim).collect();
        assert!(!hex.is_empty(), "no vector named {name}");
        let digits = |i: usize| u8::from_str_radix(&hex[i..i + 2], 16).expect("hex");
        (0..hex.len()).step_by(2).map(digits).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_beyond_the_bytes_present_are_refused() {
        let mut r = Reader::<false>::new(&[0xff, 0xff, 0xff, 0x7f, 1, 2, 3]);
        assert_eq!(r.count(1, "items"), Err(ReadError::Count { what: "items", count: i64::from(i32::MAX), left: 3 }));
        let mut r = Reader::<false>::new(&[0xff, 0xff, 0xff, 0xff, 1]);
        assert_eq!(r.count(1, "items"), Err(ReadError::Count { what: "items", count: -1, left: 1 }));
        assert_eq!(Reader::<false>::new(&[2, 0, 0, 0, 1, 2]).count(1, "items"), Ok(2));
    }

    #[test]
    fn texts_end_at_nul_or_are_refused() {
        assert_eq!(Reader::<true>::new(b"ab\0c").c_text("t"), Ok("ab".to_owned()));
        assert_eq!(Reader::<true>::new(b"abc").c_text("t"), Err(ReadError::Unterminated { what: "t", offset: 0 }));
        assert_eq!(Reader::<true>::new(b"ab\0\xff").fixed_text(4, "t"), Ok("ab".to_owned()));
    }

    #[test]
    fn a_peer_s_name_cleared_the_terminal() {
        let told = Reader::<true>::new(b"\x1b[2Jpen\n\x7f\0").fixed_text(9, "t").expect("a text");
        assert_eq!(told, "\u{fffd}[2Jpen\u{fffd}\u{fffd}");
        assert_eq!(
            Reader::<true>::new("Sonde gr\u{f6}\u{df}er\0".as_bytes()).c_text("t"),
            Ok("Sonde gr\u{f6}\u{df}er".to_owned())
        );
    }

    #[test]
    fn a_fixed_text_is_cut_between_characters() {
        let mut w = Writer::<true>::new();
        w.fixed_text("aé", 2);
        assert_eq!(w.0, [b'a', 0]);
    }

    #[test]
    fn byte_order_is_obeyed() {
        assert_eq!(Reader::<true>::new(&[1, 2]).u16("n"), Ok(0x0102));
        assert_eq!(Reader::<false>::new(&[1, 2]).u16("n"), Ok(0x0201));
    }
}
