//! COMMAND, and the request to stream.

use super::TextEncoding;
use crate::openigtlink::content::{Fault, exactly, field};
use crate::openigtlink::{IgtlError, R, W};

/// A COMMAND or its answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Command {
    /// Number that ties an answer to its command.
    pub id: u32,
    /// Name, at most 128 bytes.
    pub name: String,
    /// Encoding of the text.
    pub encoding: TextEncoding,
    /// Usually XML.
    pub text: String,
}

impl Command {
    pub(in crate::openigtlink) fn decode(bytes: &[u8]) -> Result<Self, Fault> {
        let mut r = R::new(bytes);
        let id = r.u32("command id")?;
        let name = r.fixed_text(128, "command name")?;
        let encoding = TextEncoding::from_number(r.u16("text encoding")?);
        let length = r.u32("text length")? as usize;
        exactly(bytes, length.saturating_add(138))?;
        Ok(Self { id, name, encoding, text: String::from_utf8_lossy(r.take(length, "text")?).into_owned() })
    }

    pub(in crate::openigtlink) fn encode(&self, w: &mut W) -> Result<(), IgtlError> {
        w.u32(self.id);
        field(w, "command name", &self.name, 128)?;
        w.u16(self.encoding.number());
        w.u32(u32::try_from(self.text.len()).map_err(|_| IgtlError::TooLong {
            field: "command text",
            text: String::new(),
            size: self.text.len(),
            limit: u32::MAX as usize,
        })?);
        w.bytes(self.text.as_bytes());
        Ok(())
    }
}

/// What `STT_TDATA` and `STT_QTDATA` ask for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StreamRequest {
    /// Wanted interval between messages, ms.
    pub interval_ms: i32,
    /// Name of the wanted coordinate system, at most 32 bytes.
    pub coordinate_system: String,
}

impl StreamRequest {
    pub(in crate::openigtlink) fn decode(r: &mut R<'_>) -> Result<Self, Fault> {
        Ok(Self { interval_ms: r.i32("interval")?, coordinate_system: r.fixed_text(32, "coordinate system")? })
    }

    pub(in crate::openigtlink) fn encode(&self, w: &mut W) -> Result<(), IgtlError> {
        w.i32(self.interval_ms);
        field(w, "coordinate system", &self.coordinate_system, 32)
    }
}
