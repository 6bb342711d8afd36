//! OpenIGTLink, header versions 1 and 2: messages to bytes and back, and a parser for the TCP stream.

mod bodies;
mod content;
mod crc;
mod error;
mod matrix;
mod message;
mod poses;
mod stream;
#[cfg(test)]
mod tests;

pub use bodies::{
    Attribute, AttributeKind, ByteOrder, Cells, Command, Image, ImageAxes, InstrumentKind, PointElement, PolyData,
    Position, QuaternionElement, ScalarType, Status, StatusCode, StreamRequest, Text, TextEncoding, TrackingElement,
    Trajectory, TrajectoryKind,
};
pub use content::{Content, Verb};
pub use crc::crc64;
pub use error::IgtlError;
pub use matrix::{Matrix34, Ras, patient_of, ras_from_patient, ras_of};
pub use message::{HEADER_SIZE, HeaderVersion, Message, Metadata, Timestamp};
pub use poses::{ToolStatus, poses};
pub use stream::{DEFAULT_BODY_LIMIT, Parser};

/// The default TCP port.
pub const DEFAULT_PORT: u16 = 18944;

/// OpenIGTLink is big-endian throughout.
type R<'a> = crate::bytes::Reader<'a, true>;
type W = crate::bytes::Writer<true>;
