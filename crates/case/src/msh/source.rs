//! Numbers of an MSH section, from text or from bytes.

/// Bytes of a line that an error quotes.
const MOST_QUOTED: usize = 60;

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

    /// The name of the next section, behind its `$`; `None` at the end of the file.
    pub(super) fn section(&mut self) -> Option<&'a str> {
        loop {
            let name = self.line()?.strip_prefix('$');
            if let Some(name) = name.filter(|n| !n.starts_with("End")) {
                return Some(name);
            }
        }
    }

    /// Passes over what is left of a section: it may hold lines that look like another.
    pub(super) fn skip(&mut self, name: &str) -> Result<(), String> {
        while let Some(line) = self.line() {
            if line.strip_prefix("$End") == Some(name) {
                return Ok(());
            }
        }
        Err(missing_end(name))
    }

    /// Reads the end of a section of which all is read.
    pub(super) fn close(&mut self, name: &str) -> Result<(), String> {
        self.bytes = self.bytes.trim_ascii_start();
        let here = self.bytes.len().min(MOST_QUOTED);
        let quoted = String::from_utf8_lossy(&self.bytes[..here]).lines().next().unwrap_or("").trim().to_owned();
        match self.line() {
            None => Err(missing_end(name)),
            Some(line) if line.strip_prefix("$End") == Some(name) => Ok(()),
            Some(_) => Err(format!(
                "\"{quoted}\" stands where $End{name} should: the section is cut off or holds more than its counts say"
            )),
        }
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

    /// The next word of a text.
    pub(super) fn text(&mut self) -> Result<String, String> {
        let start = self.bytes.iter().position(|b| !b.is_ascii_whitespace()).ok_or("the file ends here")?;
        let rest = &self.bytes[start..];
        let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        let (word, rest) = rest.split_at(end);
        self.bytes = rest;
        Ok(String::from_utf8_lossy(word).into_owned())
    }

    fn word<T: core::str::FromStr>(&mut self) -> Result<T, String> {
        let word = self.text()?;
        word.parse().map_err(|_| format!("\"{word}\" is not the number expected here"))
    }
}

fn missing_end(name: &str) -> String {
    format!("its $End{name} is missing: the file is cut off; save or copy it anew")
}
