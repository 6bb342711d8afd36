//! A whole message: header, extended header, content, metadata.

use super::bodies::TextEncoding;
use super::content::{Content, Fault, field, fits};
use super::{IgtlError, R, W, crc64};

/// Bytes of the header that every message begins with.
pub const HEADER_SIZE: usize = 58;

/// Bytes of the extended header of version 2.
const EXTENDED_SIZE: usize = 12;

/// The layout of a message. (This is not the protocol's version: protocol 3 uses header version 2.)
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HeaderVersion {
    /// Content only.
    V1,
    /// Content with a message number and metadata.
    V2,
}

/// Seconds since 1970 (UTC) as a 32.32 fixed-point number; zero on the wire means "no time".
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Timestamp(pub u64);

impl Timestamp {
    /// From seconds since 1970; `None` for a time that does not fit (before 1970, after 2106, not finite).
    pub fn from_seconds(seconds: f64) -> Option<Self> {
        let fits = seconds > 0.0 && seconds < f64::from(u32::MAX);
        // The whole seconds and the fraction apart: one product would lose the last bits of the fraction.
        fits.then(|| Self(((seconds.trunc() as u64) << 32) | (seconds.fract() * 4_294_967_296.0) as u64))
    }

    /// Seconds since 1970.
    pub fn seconds(self) -> f64 {
        (self.0 >> 32) as f64 + (self.0 & 0xffff_ffff) as f64 / 4_294_967_296.0
    }
}

/// One metadata item of a version 2 message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Metadata {
    /// Key.
    pub key: String,
    /// Encoding of the value.
    pub encoding: TextEncoding,
    /// Value.
    pub value: String,
}

/// An OpenIGTLink message.
#[derive(Debug, Clone, PartialEq)]
pub struct Message {
    /// Header version.
    pub version: HeaderVersion,
    /// Device name, at most 20 bytes.
    pub device: String,
    /// When its content was acquired.
    pub time: Option<Timestamp>,
    /// Message number, 0 for none (version 2 only).
    pub id: u32,
    /// Metadata (version 2 only).
    pub metadata: Vec<Metadata>,
    /// What it says.
    pub content: Content,
}

/// The fixed header, read.
#[derive(Debug, Clone)]
pub(super) struct Header {
    pub(super) version: u16,
    pub(super) type_name: String,
    pub(super) device: String,
    pub(super) time: u64,
    pub(super) body_size: u64,
    pub(super) checksum: u64,
}

impl Header {
    pub(super) fn decode(bytes: &[u8]) -> Result<Self, IgtlError> {
        let mut r = R::new(bytes);
        let read = |r: &mut R<'_>| -> Result<Self, crate::ReadError> {
            Ok(Self {
                version: r.u16("header version")?,
                type_name: r.fixed_text(12, "type name")?,
                device: r.fixed_text(20, "device name")?,
                time: r.u64("timestamp")?,
                body_size: r.u64("body size")?,
                checksum: r.u64("checksum")?,
            })
        };
        read(&mut r).map_err(|e| Fault::Read(e).named("header", ""))
    }
}

impl Message {
    /// A version 1 message: no number, no metadata.
    pub fn v1(device: impl Into<String>, time: Option<Timestamp>, content: Content) -> Self {
        let (version, device) = (HeaderVersion::V1, device.into());
        Self { version, device, time, id: 0, metadata: Vec::new(), content }
    }

    /// A version 2 message with a number, and no metadata yet.
    pub fn v2(device: impl Into<String>, time: Option<Timestamp>, id: u32, content: Content) -> Self {
        Self { version: HeaderVersion::V2, id, ..Self::v1(device, time, content) }
    }

    /// The same with one more metadata item.
    #[must_use]
    pub fn with(mut self, key: &str, value: impl Into<String>) -> Self {
        let value = value.into();
        self.metadata.push(Metadata { key: key.to_owned(), encoding: TextEncoding::of(&value), value });
        self
    }

    /// The value of a metadata key, compared without regard to case.
    pub fn meta(&self, key: &str) -> Option<&str> {
        self.metadata.iter().find(|m| m.key.eq_ignore_ascii_case(key)).map(|m| m.value.as_str())
    }

    /// The bytes of the message.
    ///
    /// # Errors
    /// When a name is too long for its field or the content contradicts itself.
    pub fn encode(&self) -> Result<Vec<u8>, IgtlError> {
        let type_name = self.content.type_name();
        let mut body = W::new();
        let content = self.content.encode()?;
        match self.version {
            HeaderVersion::V1 => body.bytes(&content),
            HeaderVersion::V2 => self.encode_v2(&mut body, &content)?,
        }
        let mut w = W::new();
        w.u16(if self.version == HeaderVersion::V1 { 1 } else { 2 });
        field(&mut w, "type name", &type_name, 12)?;
        field(&mut w, "device name", &self.device, 20)?;
        w.u64(self.time.map_or(0, |t| t.0));
        w.u64(body.0.len() as u64);
        w.u64(crc64(&body.0));
        w.bytes(&body.0);
        Ok(w.0)
    }

    fn encode_v2(&self, body: &mut W, content: &[u8]) -> Result<(), IgtlError> {
        for m in &self.metadata {
            fits("metadata key", &m.key, usize::from(u16::MAX))?;
        }
        // Empty metadata: the header of size 2, as the reference library sends it.
        let header = 2 + 8 * self.metadata.len();
        let size: usize = self.metadata.iter().map(|m| m.key.len() + m.value.len()).sum();
        body.u16(EXTENDED_SIZE as u16);
        body.u16(header as u16);
        body.u32(size as u32);
        body.u32(self.id);
        body.bytes(content);
        body.u16(self.metadata.len() as u16);
        for m in &self.metadata {
            body.u16(m.key.len() as u16);
            body.u16(m.encoding.number());
            body.u32(m.value.len() as u32);
        }
        for m in &self.metadata {
            body.bytes(m.key.as_bytes());
            body.bytes(m.value.as_bytes());
        }
        Ok(())
    }

    /// Reads a message from its header and its body; the checksum is checked here.
    pub(super) fn decode(header: &Header, body: &[u8]) -> Result<Self, IgtlError> {
        let type_name = header.type_name.as_str();
        let found = crc64(body);
        if found != header.checksum {
            return Err(IgtlError::Checksum { type_name: type_name.to_owned(), expected: header.checksum, found });
        }
        let parts = match header.version {
            1 => Parts { version: HeaderVersion::V1, id: 0, metadata: Vec::new(), content: body },
            2 => Parts::decode_v2(header, body)?,
            version => return Err(IgtlError::HeaderVersion { type_name: type_name.to_owned(), version }),
        };
        let content = Content::decode(type_name, parts.content).map_err(|f| f.named(type_name, &header.device))?;
        Ok(Self {
            version: parts.version,
            device: header.device.clone(),
            time: (header.time != 0).then_some(Timestamp(header.time)),
            id: parts.id,
            metadata: parts.metadata,
            content,
        })
    }

    /// Reads one whole message, to the last byte.
    ///
    /// # Errors
    /// Whatever is wrong with it.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, IgtlError> {
        let header = Header::decode(bytes)?;
        let body = &bytes[HEADER_SIZE..];
        if body.len() as u64 != header.body_size {
            let expected = format!("a body of {}", header.body_size);
            return Err(IgtlError::ContentSize { type_name: header.type_name, size: body.len(), expected });
        }
        Self::decode(&header, body)
    }
}

struct Parts<'a> {
    version: HeaderVersion,
    id: u32,
    metadata: Vec<Metadata>,
    content: &'a [u8],
}

impl<'a> Parts<'a> {
    fn decode_v2(header: &Header, body: &'a [u8]) -> Result<Self, IgtlError> {
        let named = |e: crate::ReadError| Fault::Read(e).named(&header.type_name, &header.device);
        let mut r = R::new(body);
        let extended = usize::from(r.u16("extended header size").map_err(named)?);
        let meta_header = usize::from(r.u16("metadata header size").map_err(named)?);
        let metadata = r.u32("metadata size").map_err(named)? as usize;
        let id = r.u32("message id").map_err(named)?;
        let content_end = body.len().checked_sub(meta_header).and_then(|n| n.checked_sub(metadata));
        let content = content_end.filter(|_| extended >= EXTENDED_SIZE).and_then(|end| body.get(extended..end));
        let (Some(content), Some(end)) = (content, content_end) else {
            let (type_name, header) = (header.type_name.clone(), meta_header);
            return Err(IgtlError::Sections { type_name, extended, header, metadata, body: body.len() });
        };
        let metadata = items(&body[end..], meta_header).map_err(named)?;
        Ok(Self { version: HeaderVersion::V2, id, metadata, content })
    }
}

fn items(bytes: &[u8], header_size: usize) -> Result<Vec<Metadata>, crate::ReadError> {
    if header_size == 0 {
        return Ok(Vec::new());
    }
    let mut head = R::new(&bytes[..header_size]);
    let mut text = R::new(&bytes[header_size..]);
    let n = usize::from(head.u16("metadata count")?);
    head.many(n, |head| {
        let key = usize::from(head.u16("metadata key size")?);
        let encoding = TextEncoding::from_number(head.u16("metadata encoding")?);
        let value = head.u32("metadata value size")? as usize;
        let lossy = |b: &[u8]| String::from_utf8_lossy(b).into_owned();
        let key = lossy(text.take(key, "metadata key")?);
        Ok(Metadata { key, encoding, value: lossy(text.take(value, "metadata value")?) })
    })
}
