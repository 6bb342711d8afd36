//! Numbers of an MSH section, from text or from bytes.

/// How the numbers are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Little,
    Big,
}

/// What is left of a file.
#[derive(Debug, Clone)]
pub(super) struct Source<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) encoding: Encoding,
}

impl<'a> Source<'a> {
    /// The next line without its end; `None` at the end of the file.
    pub(super) fn line(&mut self) -> Option<&'a str> {
        if self.bytes.is_empty() {
            return None;
        }
        let end = self.bytes.iter().position(|&b| b == b'\n').unwrap_or(self.bytes.len());
        let (line, rest) = self.bytes.split_at(end);
        self.bytes = rest.get(1..).unwrap_or(&[]);
        Some(core::str::from_utf8(line).unwrap_or("").trim())
    }

    /// A 32-bit integer (tags of entities, types of elements).
    pub(super) fn int(&mut self) -> Result<i32, String> {
        match self.encoding {
            Encoding::Ascii => self.word(),
            order => {
                self.take().map(|b| if order == Encoding::Big { i32::from_be_bytes(b) } else { i32::from_le_bytes(b) })
            }
        }
    }

    /// A count or a tag of a node or element.
    pub(super) fn size(&mut self) -> Result<u64, String> {
        match self.encoding {
            Encoding::Ascii => self.word(),
            order => {
                self.take().map(|b| if order == Encoding::Big { u64::from_be_bytes(b) } else { u64::from_le_bytes(b) })
            }
        }
    }

    pub(super) fn double(&mut self) -> Result<f64, String> {
        match self.encoding {
            Encoding::Ascii => self.word(),
            order => {
                self.take().map(|b| if order == Encoding::Big { f64::from_be_bytes(b) } else { f64::from_le_bytes(b) })
            }
        }
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let (head, rest) = self.bytes.split_first_chunk().ok_or("the file ends here")?;
        self.bytes = rest;
        Ok(*head)
    }

    fn word<T: core::str::FromStr>(&mut self) -> Result<T, String> {
        let start = self.bytes.iter().position(|b| !b.is_ascii_whitespace()).ok_or("the file ends here")?;
        let rest = &self.bytes[start..];
        let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        let (word, rest) = rest.split_at(end);
        self.bytes = rest;
        let word = String::from_utf8_lossy(word);
        word.parse().map_err(|_| format!("\"{word}\" is not the number expected here"))
    }
}
