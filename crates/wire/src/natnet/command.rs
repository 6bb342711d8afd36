//! Text commands and their answers.

use super::message::datagram;
use super::{MessageId, Version, W};

/// What was asked, which alone tells how to read the answer: four bytes may be a status, a number or a text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pending {
    /// A command that is answered with a status.
    Status,
    /// A query that is answered with an `f32` (`FrameRate`, `UnitsToMillimeters`).
    Float,
    /// A query that is answered with an `i32` (`CurrentMode`).
    Integer,
    /// A query that is answered with a text.
    Text,
}

/// An answer.
#[derive(Debug, Clone, PartialEq)]
pub enum Response {
    /// 0 is success.
    Status(i32),
    /// A number.
    Float(f32),
    /// A whole number.
    Integer(i32),
    /// A text.
    Text(String),
}

impl Response {
    /// Reads the payload of RESPONSE as the answer to `pending`. Text, when it is not of the size expected.
    pub fn decode(payload: &[u8], pending: Pending) -> Self {
        let four: Option<[u8; 4]> = payload.try_into().ok();
        match (pending, four) {
            (Pending::Status, Some(b)) => Self::Status(i32::from_le_bytes(b)),
            (Pending::Float, Some(b)) => Self::Float(f32::from_le_bytes(b)),
            (Pending::Integer, Some(b)) => Self::Integer(i32::from_le_bytes(b)),
            _ => {
                let end = payload.iter().position(|&b| b == 0).unwrap_or(payload.len());
                Self::Text(String::from_utf8_lossy(&payload[..end]).into_owned())
            }
        }
    }

    /// The datagram.
    pub fn encode(&self) -> Vec<u8> {
        let mut w = W::new();
        match self {
            Self::Status(n) | Self::Integer(n) => w.i32(*n),
            Self::Float(v) => w.f32(*v),
            Self::Text(t) => w.c_text(t),
        }
        datagram(MessageId::Response, &w.0)
    }
}

/// The datagram of a text command, and how its answer is to be read.
pub(super) fn request(command: &str) -> (Vec<u8>, Pending) {
    let mut w = W::new();
    w.c_text(command);
    let pending = match command.split(',').next() {
        Some("FrameRate" | "UnitsToMillimeters") => Pending::Float,
        Some("CurrentMode") => Pending::Integer,
        Some("GetProperty" | "GetTakeProperty" | "CurrentSessionPath") => Pending::Text,
        Some("Bitstream") if command == "Bitstream" => Pending::Text,
        _ => Pending::Status,
    };
    (datagram(MessageId::Request, &w.0), pending)
}

/// `Bitstream,4.1` as a version.
pub(super) fn bitstream_of(command: &str) -> Option<Version> {
    Version::parse(command.strip_prefix("Bitstream,")?)
}
