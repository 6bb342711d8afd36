//! STATUS and STRING: words.

use crate::openigtlink::content::{Fault, exactly, field, fits};
use crate::openigtlink::{IgtlError, R, W};

macro_rules! codes {
    ($($name:ident = $code:literal, $text:literal;)*) => {
        /// The codes of a STATUS message.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum StatusCode {
            $(#[doc = $text] $name,)*
            /// A number not in the list.
            Other(u16),
        }

        impl StatusCode {
            /// The number on the wire.
            pub const fn number(self) -> u16 {
                match self { $(Self::$name => $code,)* Self::Other(n) => n }
            }

            /// The code of a number.
            pub const fn from_number(n: u16) -> Self {
                match n { $($code => Self::$name,)* n => Self::Other(n) }
            }
        }
    };
}

codes! {
    Invalid = 0, "Invalid packet.";
    Ok = 1, "All is well.";
    UnknownError = 2, "Unknown error.";
    Panic = 3, "Emergency.";
    NotFound = 4, "File, device or resource not found.";
    AccessDenied = 5, "Access denied.";
    Busy = 6, "Busy.";
    TimeOut = 7, "Time out, or connection lost.";
    Overflow = 8, "Overflow.";
    ChecksumError = 9, "Checksum error.";
    ConfigurationError = 10, "Configuration error.";
    OutOfResources = 11, "Out of memory or other resources.";
    UnknownInstruction = 12, "Unknown or unimplemented instruction.";
    NotReady = 13, "Device not ready.";
    ManualMode = 14, "Manual mode: the device does not accept commands.";
    Disabled = 15, "Device disabled.";
    NotPresent = 16, "Device not present.";
    UnknownVersion = 17, "Device version not known.";
    HardwareFailure = 18, "Hardware failure.";
    ShuttingDown = 19, "Shutting down.";
}

/// A STATUS message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Status {
    /// The general code.
    pub code: StatusCode,
    /// Device-specific code.
    pub sub_code: i64,
    /// Short name of the error, at most 20 bytes.
    pub name: String,
    /// Message for people.
    pub message: String,
}

impl Status {
    pub(in crate::openigtlink) fn decode(bytes: &[u8]) -> Result<Self, Fault> {
        let mut r = R::new(bytes);
        let code = StatusCode::from_number(r.u16("status code")?);
        let sub_code = r.i64("status sub-code")?;
        let name = r.fixed_text(20, "error name")?;
        let message = r.left();
        Ok(Self { code, sub_code, name, message: r.fixed_text(message, "message")? })
    }

    pub(in crate::openigtlink) fn encode(&self, w: &mut W) -> Result<(), IgtlError> {
        w.u16(self.code.number());
        w.i64(self.sub_code);
        field(w, "error name", &self.name, 20)?;
        w.c_text(&self.message);
        Ok(())
    }
}

/// How the bytes of a text are to be read (IANA MIB number).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TextEncoding {
    /// 3.
    Ascii,
    /// 106.
    Utf8,
    /// Any other; the bytes are read as UTF-8, lossily.
    Other(u16),
}

impl TextEncoding {
    pub(in crate::openigtlink) const fn from_number(n: u16) -> Self {
        match n {
            3 => Self::Ascii,
            106 => Self::Utf8,
            n => Self::Other(n),
        }
    }

    pub(in crate::openigtlink) const fn number(self) -> u16 {
        match self {
            Self::Ascii => 3,
            Self::Utf8 => 106,
            Self::Other(n) => n,
        }
    }

    /// The narrowest encoding of a text.
    pub const fn of(text: &str) -> Self {
        if text.is_ascii() { Self::Ascii } else { Self::Utf8 }
    }
}

/// A STRING message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Text {
    /// Encoding as announced.
    pub encoding: TextEncoding,
    /// The text, at most 65 535 bytes.
    pub text: String,
}

impl Text {
    /// A text in its narrowest encoding.
    pub fn new(text: impl Into<String>) -> Self {
        let text = text.into();
        Self { encoding: TextEncoding::of(&text), text }
    }

    pub(in crate::openigtlink) fn decode(bytes: &[u8]) -> Result<Self, Fault> {
        let mut r = R::new(bytes);
        let encoding = TextEncoding::from_number(r.u16("text encoding")?);
        let length = usize::from(r.u16("text length")?);
        exactly(bytes, 4 + length)?;
        Ok(Self { encoding, text: String::from_utf8_lossy(r.take(length, "text")?).into_owned() })
    }

    pub(in crate::openigtlink) fn encode(&self, w: &mut W) -> Result<(), IgtlError> {
        fits("text", &self.text, usize::from(u16::MAX))?;
        w.u16(self.encoding.number());
        w.u16(self.text.len() as u16);
        w.bytes(self.text.as_bytes());
        Ok(())
    }
}
