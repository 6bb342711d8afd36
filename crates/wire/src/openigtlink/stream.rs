//! A parser for the TCP stream: bytes in as they come, messages out as they are complete.

use super::message::{HEADER_SIZE, Header};
use super::{IgtlError, Message};

/// Bytes of a body that are held at most, unless asked otherwise. Larger ones (volumes, mostly) are skipped.
pub const DEFAULT_BODY_LIMIT: usize = 64 << 20;
/// No message has a larger body, bytes: what announces one is no message.
const LARGEST_BODY: u64 = 1 << 40;

/// Collects the bytes of one connection and cuts messages from them. It holds what has arrived and no more: a body's
/// announced size is never allocated ahead of its bytes.
#[derive(Debug)]
pub struct Parser {
    buffer: Vec<u8>,
    /// Bytes at the front of the buffer that are done with.
    done: usize,
    header: Option<Header>,
    /// Bytes to come of a body that is too large to be held.
    skip: u64,
    limit: usize,
    broken: Option<IgtlError>,
}

impl Default for Parser {
    fn default() -> Self {
        Self::new(DEFAULT_BODY_LIMIT)
    }
}

impl Parser {
    /// A parser that skips bodies above `limit` bytes.
    pub const fn new(limit: usize) -> Self {
        Self { buffer: Vec::new(), done: 0, header: None, skip: 0, limit, broken: None }
    }

    /// Takes bytes as they came. After a fatal error they are ignored.
    pub fn push(&mut self, bytes: &[u8]) {
        if self.broken.is_none() {
            self.buffer.drain(..self.done);
            self.done = 0;
            self.buffer.extend_from_slice(bytes);
            self.pass();
        }
    }

    /// Passes over what has come of a body that is not held.
    fn pass(&mut self) {
        let passed = self.skip.min(self.pending() as u64);
        self.skip -= passed;
        // No more than is pending.
        self.done += passed as usize;
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
            match Header::decode(bytes).and_then(possible) {
                Ok(header) if header.body_size > self.limit as u64 => return Some(Err(self.skipped(header))),
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

    /// Begins to skip a message.
    fn skipped(&mut self, header: Header) -> IgtlError {
        self.done += HEADER_SIZE;
        self.skip = header.body_size;
        self.pass();
        IgtlError::BodySkipped { type_name: header.type_name, size: header.body_size, limit: self.limit }
    }

    fn break_off(&mut self, e: IgtlError) -> IgtlError {
        self.buffer = Vec::new();
        self.done = 0;
        self.broken = Some(e.clone());
        e
    }
}

/// A header that may be that of a message.
fn possible(header: Header) -> Result<Header, IgtlError> {
    if header.body_size > LARGEST_BODY {
        return Err(IgtlError::BodyTooLarge { type_name: header.type_name, size: header.body_size });
    }
    Ok(header)
}
