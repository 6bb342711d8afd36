//! The content of a message, by type.

use super::bodies::{
    Command, Image, PointElement, PolyData, Position, QuaternionElement, Status, StreamRequest, Text, TrackingElement,
    Trajectory,
};
use super::matrix::Matrix34;
use super::{IgtlError, R, W};

/// Verb of a query message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verb {
    /// `GET_x`: send one `x`.
    Get,
    /// `STT_x`: start sending.
    Start,
    /// `STP_x`: stop sending.
    Stop,
}

impl Verb {
    const ALL: [(Self, &'static str); 3] = [(Self::Get, "GET_"), (Self::Start, "STT_"), (Self::Stop, "STP_")];

    const fn prefix(self) -> &'static str {
        match self {
            Self::Get => "GET_",
            Self::Start => "STT_",
            Self::Stop => "STP_",
        }
    }
}

/// What a message says.
#[derive(Debug, Clone, PartialEq)]
pub enum Content {
    /// `TRANSFORM`.
    Transform(Matrix34),
    /// `POSITION` (also received under its older name `QTRANS`).
    Position(Position),
    /// `TDATA`.
    TrackingData(Vec<TrackingElement>),
    /// `QTDATA`.
    QuaternionTrackingData(Vec<QuaternionElement>),
    /// `STATUS`.
    Status(Status),
    /// `STRING`.
    Text(Text),
    /// `POINT`.
    Points(Vec<PointElement>),
    /// `TRAJ`.
    Trajectories(Vec<Trajectory>),
    /// `POLYDATA`.
    PolyData(PolyData),
    /// `IMAGE`.
    Image(Image),
    /// `CAPABILITY`: the type names understood.
    Capability(Vec<String>),
    /// `COMMAND`.
    Command(Command),
    /// `RTS_COMMAND`, the answer to a command.
    CommandAnswer(Command),
    /// `GET_x`, `STT_x`, `STP_x`.
    Query {
        /// What is asked.
        verb: Verb,
        /// The `x`, perhaps shortened to eight bytes (`TRANS`).
        of: String,
        /// Rate and coordinate system, in `STT_TDATA` and `STT_QTDATA` only.
        stream: Option<StreamRequest>,
    },
    /// `RTS_x`: whether a query was accepted.
    Answer {
        /// The `x`.
        of: String,
        /// Accepted (0 on the wire) or refused.
        accepted: bool,
    },
    /// A type that we do not know; its content was skipped.
    Unknown {
        /// The type name.
        type_name: String,
        /// Bytes of content.
        size: usize,
    },
}

impl Content {
    /// The type name in the header.
    pub fn type_name(&self) -> String {
        let fixed = match self {
            Self::Transform(_) => "TRANSFORM",
            Self::Position(_) => "POSITION",
            Self::TrackingData(_) => "TDATA",
            Self::QuaternionTrackingData(_) => "QTDATA",
            Self::Status(_) => "STATUS",
            Self::Text(_) => "STRING",
            Self::Points(_) => "POINT",
            Self::Trajectories(_) => "TRAJ",
            Self::PolyData(_) => "POLYDATA",
            Self::Image(_) => "IMAGE",
            Self::Capability(_) => "CAPABILITY",
            Self::Command(_) => "COMMAND",
            Self::CommandAnswer(_) => "RTS_COMMAND",
            Self::Query { verb, of, .. } => return format!("{}{of}", verb.prefix()),
            Self::Answer { of, .. } => return format!("RTS_{of}"),
            Self::Unknown { type_name, .. } => type_name,
        };
        fixed.to_owned()
    }

    /// Reads the content of a message of type `type_name`.
    pub(super) fn decode(type_name: &str, bytes: &[u8]) -> Result<Self, Fault> {
        Ok(match type_name {
            "TRANSFORM" => Self::Transform(Matrix34::decode(&mut exactly(bytes, 48)?)?),
            "POSITION" | "QTRANS" => Self::Position(Position::decode(bytes)?),
            "TDATA" => Self::TrackingData(elements(bytes, 70, TrackingElement::decode)?),
            "QTDATA" => Self::QuaternionTrackingData(elements(bytes, 50, QuaternionElement::decode)?),
            "STATUS" => Self::Status(Status::decode(bytes)?),
            "STRING" => Self::Text(Text::decode(bytes)?),
            "POINT" => Self::Points(elements(bytes, 136, PointElement::decode)?),
            "TRAJ" => Self::Trajectories(elements(bytes, 150, Trajectory::decode)?),
            "POLYDATA" => Self::PolyData(PolyData::decode(bytes)?),
            "IMAGE" => Self::Image(Image::decode(bytes)?),
            "CAPABILITY" => Self::Capability(elements(bytes, 12, |r| Ok(r.fixed_text(12, "type name")?))?),
            "COMMAND" => Self::Command(Command::decode(bytes)?),
            "RTS_COMMAND" => Self::CommandAnswer(Command::decode(bytes)?),
            _ => return Self::decode_query(type_name, bytes),
        })
    }

    fn decode_query(type_name: &str, bytes: &[u8]) -> Result<Self, Fault> {
        for (verb, prefix) in Verb::ALL {
            if let Some(of) = type_name.strip_prefix(prefix) {
                let streams = verb == Verb::Start && matches!(of, "TDATA" | "QTDATA") && !bytes.is_empty();
                let stream = if streams { Some(StreamRequest::decode(&mut exactly(bytes, 36)?)?) } else { None };
                return Ok(Self::Query { verb, of: of.to_owned(), stream });
            }
        }
        if let Some(of) = type_name.strip_prefix("RTS_") {
            let accepted = exactly(bytes, 1)?.u8("status")? == 0;
            return Ok(Self::Answer { of: of.to_owned(), accepted });
        }
        Ok(Self::Unknown { type_name: type_name.to_owned(), size: bytes.len() })
    }

    pub(super) fn encode(&self) -> Result<Vec<u8>, IgtlError> {
        let mut w = W::new();
        match self {
            Self::Transform(m) => m.encode(&mut w),
            Self::Position(p) => p.encode(&mut w),
            Self::TrackingData(list) => each(list, &mut w, TrackingElement::encode)?,
            Self::QuaternionTrackingData(list) => each(list, &mut w, QuaternionElement::encode)?,
            Self::Status(s) => s.encode(&mut w)?,
            Self::Text(t) => t.encode(&mut w)?,
            Self::Points(list) => each(list, &mut w, PointElement::encode)?,
            Self::Trajectories(list) => each(list, &mut w, Trajectory::encode)?,
            Self::PolyData(p) => p.encode(&mut w)?,
            Self::Image(i) => i.encode(&mut w)?,
            Self::Capability(names) => each(names, &mut w, |name, w| field(w, "type name", name, 12))?,
            Self::Command(c) | Self::CommandAnswer(c) => c.encode(&mut w)?,
            Self::Query { stream: Some(stream), .. } => stream.encode(&mut w)?,
            Self::Query { .. } | Self::Unknown { .. } => {}
            Self::Answer { accepted, .. } => w.u8(u8::from(!accepted)),
        }
        Ok(w.0)
    }
}

/// A fault in a content, before the message that it belongs to is named.
#[derive(Debug)]
pub(super) enum Fault {
    Read(crate::ReadError),
    Size { size: usize, expected: String },
    Index { index: u32, points: usize },
    Value { field: &'static str, value: u64 },
}

impl From<crate::ReadError> for Fault {
    fn from(e: crate::ReadError) -> Self {
        Self::Read(e)
    }
}

impl Fault {
    pub(super) fn named(self, type_name: &str, device: &str) -> IgtlError {
        let type_name = type_name.to_owned();
        match self {
            Self::Read(source) => IgtlError::Read { type_name, device: device.to_owned(), source },
            Self::Size { size, expected } => IgtlError::ContentSize { type_name, size, expected },
            Self::Index { index, points } => IgtlError::Index { index, points },
            Self::Value { field, value } => IgtlError::Value { type_name, field, value },
        }
    }
}

pub(super) fn exactly(bytes: &[u8], size: usize) -> Result<R<'_>, Fault> {
    if bytes.len() != size {
        return Err(Fault::Size { size: bytes.len(), expected: size.to_string() });
    }
    Ok(R::new(bytes))
}

fn elements<T>(bytes: &[u8], size: usize, item: impl FnMut(&mut R<'_>) -> Result<T, Fault>) -> Result<Vec<T>, Fault> {
    if !bytes.len().is_multiple_of(size) {
        return Err(Fault::Size { size: bytes.len(), expected: format!("a multiple of {size}") });
    }
    R::new(bytes).many(bytes.len() / size, item)
}

fn each<T>(list: &[T], w: &mut W, mut item: impl FnMut(&T, &mut W) -> Result<(), IgtlError>) -> Result<(), IgtlError> {
    list.iter().try_for_each(|e| item(e, w))
}

/// Writes a fixed text field, refusing what does not fit: a name cut silently is a wrong name.
pub(super) fn field(w: &mut W, name: &'static str, text: &str, limit: usize) -> Result<(), IgtlError> {
    fits(name, text, limit)?;
    w.fixed_text(text, limit);
    Ok(())
}

/// Refuses a text longer than `limit` bytes.
pub(super) fn fits(name: &'static str, text: &str, limit: usize) -> Result<(), IgtlError> {
    if text.len() > limit {
        let shown = text[..text.floor_char_boundary(60)].to_owned();
        return Err(IgtlError::TooLong { field: name, text: shown, size: text.len(), limit });
    }
    Ok(())
}
