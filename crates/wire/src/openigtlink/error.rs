//! Why an OpenIGTLink message was refused.

use crate::ReadError;
use thiserror::Error;

/// Why an OpenIGTLink message could not be read or written.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum IgtlError {
    /// A field ran over the end of its message.
    #[error("OpenIGTLink {type_name} from '{device}': {source}")]
    Read {
        /// Message type.
        type_name: String,
        /// Device name.
        device: String,
        /// What went wrong.
        source: ReadError,
    },
    /// A header version that we do not know. The message was skipped.
    #[error("OpenIGTLink {type_name} has header version {version}; only 1 and 2 are known, so it was skipped")]
    HeaderVersion {
        /// Message type.
        type_name: String,
        /// Version found.
        version: u16,
    },
    /// A body larger than is held. The message is skipped, the stream goes on.
    #[error("OpenIGTLink {type_name} with a body of {size} bytes was skipped: more than {limit} are not taken")]
    BodySkipped {
        /// Message type.
        type_name: String,
        /// Bytes announced.
        size: u64,
        /// Bytes taken at most.
        limit: usize,
    },
    /// A body larger than any message has. The stream cannot be followed any further: close the connection.
    #[error(
        "a message of type '{type_name}' announces a body of {size} bytes, which no OpenIGTLink message has: is it an OpenIGTLink server that sends there?"
    )]
    BodyTooLarge {
        /// Message type.
        type_name: String,
        /// Bytes announced.
        size: u64,
    },
    /// The checksum does not match; the message was dropped, the stream goes on.
    #[error(
        "OpenIGTLink {type_name}: checksum {found:016x} of the body, {expected:016x} in the header; message dropped"
    )]
    Checksum {
        /// Message type.
        type_name: String,
        /// In the header.
        expected: u64,
        /// Of the body.
        found: u64,
    },
    /// The parts of a version 2 body are larger than the body.
    #[error(
        "OpenIGTLink {type_name}: extended header {extended}, metadata header {header} and metadata {metadata} bytes do not fit into a body of {body}"
    )]
    Sections {
        /// Message type.
        type_name: String,
        /// Extended header size.
        extended: usize,
        /// Metadata header size.
        header: usize,
        /// Metadata size.
        metadata: usize,
        /// Body size.
        body: usize,
    },
    /// The content has not the size that its type or its own counts demand.
    #[error("OpenIGTLink {type_name}: content of {size} bytes, expected {expected}")]
    ContentSize {
        /// Message type.
        type_name: String,
        /// Bytes present.
        size: usize,
        /// What was expected, in words.
        expected: String,
    },
    /// A cell names a point that does not exist.
    #[error("OpenIGTLink POLYDATA: a cell uses point {index}, but there are {points}")]
    Index {
        /// The point named.
        index: u32,
        /// Points present.
        points: usize,
    },
    /// A field has a value outside its list.
    #[error("OpenIGTLink {type_name}: {field} is {value}, which is not one of the known values")]
    Value {
        /// Message type.
        type_name: String,
        /// The field.
        field: &'static str,
        /// Its value.
        value: u64,
    },
    /// A text that does not fit into its field when sending.
    #[error("OpenIGTLink {field} '{text}' has {size} bytes, at most {limit} fit; choose a shorter one")]
    TooLong {
        /// The field.
        field: &'static str,
        /// The text (its beginning).
        text: String,
        /// Bytes it has.
        size: usize,
        /// Bytes that fit.
        limit: usize,
    },
}
