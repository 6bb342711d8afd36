//! A parser for the TCP stream: bytes in as they come, messages out as they are complete.

use super::message::{HEADER_SIZE, Header};
use super::{IgtlError, Message};

/// Default bound of a body, bytes.
pub const DEFAULT_BODY_LIMIT: usize = 64 << 20;

/// Collects the bytes of one connection and cuts messages from them. It holds what has arrived and no more: a body's
/// announced size is never allocated ahead of its bytes.
#[derive(Debug)]
pub struct Parser {
    buffer: Vec<u8>,
    /// Bytes at the front of the buffer that are done with.
    done: usize,
    header: Option<Header>,
    limit: usize,
    broken: Option<IgtlError>,
}

impl Default for Parser {
    fn default() -> Self {
        Self::new(DEFAULT_BODY_LIMIT)
    }
}

impl Parser {
    /// A parser that refuses bodies above `limit` bytes.
    pub const fn new(limit: usize) -> Self {
        Self { buffer: Vec::new(), done: 0, header: None, limit, broken: None }
    }

    /// Takes bytes as they came. After a fatal error they are ignored.
    pub fn push(&mut self, bytes: &[u8]) {
        if self.broken.is_none() {
            self.buffer.drain(..self.done);
            self.done = 0;
            self.buffer.extend_from_slice(bytes);
        }
    }

    /// Bytes held that belong to an unfinished message.
    pub const fn pending(&self) -> usize {
        self.buffer.len() - self.done
    }

    /// Whether the stream cannot be followed any more, so that the connection must be closed.
    pub const fn is_broken(&self) -> bool {
        self.broken.is_some()
    }

    /// The next complete message, `None` when more bytes are needed. An error concerns that one message and the stream
    /// goes on, but for [`IgtlError::BodyTooLarge`], which ends it.
    pub fn next_message(&mut self) -> Option<Result<Message, IgtlError>> {
        if let Some(e) = &self.broken {
            return Some(Err(e.clone()));
        }
        if self.header.is_none() {
            let bytes = self.buffer[self.done..].get(..HEADER_SIZE)?;
            match Header::decode(bytes).and_then(|h| self.within_limit(h)) {
                Ok(header) => self.header = Some(header),
                Err(e) => return Some(Err(self.break_off(e))),
            }
            self.done += HEADER_SIZE;
        }
        // The size fits: it is within the limit, which is a usize.
        let size = self.header.as_ref()?.body_size as usize;
        let body = self.buffer[self.done..].get(..size)?;
        let message = Message::decode(self.header.as_ref()?, body);
        self.done += size;
        self.header = None;
        Some(message)
    }

    fn within_limit(&self, header: Header) -> Result<Header, IgtlError> {
        if header.body_size > self.limit as u64 {
            let (type_name, size) = (header.type_name, header.body_size);
            return Err(IgtlError::BodyTooLarge { type_name, size, limit: self.limit });
        }
        Ok(header)
    }

    fn break_off(&mut self, e: IgtlError) -> IgtlError {
        self.buffer = Vec::new();
        self.done = 0;
        self.broken = Some(e.clone());
        e
    }
}
