//! Why a NatNet datagram was refused.

use super::Version;
use crate::ReadError;
use thiserror::Error;

/// Why a NatNet datagram could not be read.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum NatNetError {
    /// A field ran over the end of the datagram or of its section.
    #[error("NatNet {message} (version {version}): {source}; is the version right?")]
    Read {
        /// Kind of message.
        message: &'static str,
        /// Version it was read with.
        version: Version,
        /// What went wrong.
        source: ReadError,
    },
    /// A section's announced size exceeds the datagram.
    #[error("NatNet frame: section {section} announces {size} bytes, but {left} are left")]
    Section {
        /// The section.
        section: &'static str,
        /// Bytes announced.
        size: i32,
        /// Bytes present.
        left: usize,
    },
    /// The frame does not end with four zero bytes where its version says that it ends.
    #[error("NatNet frame does not end as version {version} should (end marker {found:#010x}); is the version right?")]
    End {
        /// Version it was read with.
        version: Version,
        /// What stands where zero should.
        found: i32,
    },
    /// A datagram too short for the four bytes of a header.
    #[error("a datagram of {0} bytes is no NatNet message (its header alone has 4)")]
    NoHeader(usize),
    /// A frame came before the server told its version.
    #[error(
        "a NatNet frame came before the server told its version; it cannot be read (send CONNECT, or force a version)"
    )]
    NoVersion,
    /// A version older than any that we know.
    #[error("NatNet version {0} is older than 2.0, the oldest that is understood")]
    TooOld(Version),
}
