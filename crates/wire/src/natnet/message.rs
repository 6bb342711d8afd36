//! The header of a datagram.

use super::{NatNetError, W};

macro_rules! ids {
    ($($(#[$doc:meta])* $name:ident = $n:literal;)*) => {
        /// Kind of a datagram.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum MessageId {
            $($(#[$doc])* $name,)*
            /// A number not in the list; to be ignored.
            Other(u16),
        }

        impl MessageId {
            /// From the number on the wire.
            pub const fn from_number(n: u16) -> Self {
                match n { $($n => Self::$name,)* n => Self::Other(n) }
            }

            /// The number on the wire.
            pub const fn number(self) -> u16 {
                match self { $(Self::$name => $n,)* Self::Other(n) => n }
            }
        }
    };
}

ids! {
    /// Client to server: who are you?
    Connect = 0;
    /// Server to client: name, versions, clock.
    ServerInfo = 1;
    /// A text command.
    Request = 2;
    /// Its answer.
    Response = 3;
    /// Ask for definitions.
    RequestModelDefinition = 4;
    /// Definitions of what is streamed.
    ModelDefinition = 5;
    /// Ask for one frame.
    RequestFrame = 6;
    /// One frame of data.
    Frame = 7;
    /// A text for people.
    Text = 8;
    /// Client leaves.
    Disconnect = 9;
    /// Client is still there.
    KeepAlive = 10;
    /// Server has dropped the client.
    TimedOut = 11;
    /// Clock question.
    EchoRequest = 12;
    /// Clock answer.
    EchoResponse = 13;
    /// Is any server there?
    Discovery = 14;
    /// The server did not understand a command.
    Unrecognized = 100;
}

/// The first four bytes of a datagram.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// Kind.
    pub id: MessageId,
    /// Payload size as announced; the datagram's own length is what counts.
    pub declared: u16,
}

/// Splits a datagram into its header and its real payload.
///
/// # Errors
/// When it has less than four bytes.
pub fn split(datagram: &[u8]) -> Result<(Header, &[u8]), NatNetError> {
    let Some((&[a, b, c, d], payload)) = datagram.split_first_chunk() else {
        return Err(NatNetError::NoHeader(datagram.len()));
    };
    let id = MessageId::from_number(u16::from_le_bytes([a, b]));
    Ok((Header { id, declared: u16::from_le_bytes([c, d]) }, payload))
}

/// A datagram from its kind and payload (at most 65 503 bytes; the declared size of a longer one is cut).
pub(super) fn datagram(id: MessageId, payload: &[u8]) -> Vec<u8> {
    let mut w = W::new();
    w.u16(id.number());
    w.u16(u16::try_from(payload.len()).unwrap_or(u16::MAX));
    w.bytes(payload);
    w.0
}
