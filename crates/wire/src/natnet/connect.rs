//! Who is talking to whom: CONNECT, SERVERINFO, DISCOVERY.

use super::message::datagram;
use super::{MessageId, NatNetError, R, Version, W};
use crate::ReadError;

/// Name and versions of one side, 264 bytes on the wire.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sender {
    /// Application name, such as `Motive`.
    pub name: String,
    /// Application version: major, minor, build, revision.
    pub application: [u8; 4],
    /// NatNet version: major, minor, build, revision.
    pub natnet: [u8; 4],
}

impl Sender {
    /// Its bitstream version.
    pub const fn version(&self) -> Version {
        Version::new(self.natnet[0], self.natnet[1])
    }

    fn decode(r: &mut R<'_>) -> Result<Self, ReadError> {
        Ok(Self {
            name: r.fixed_text(256, "application name")?,
            application: r.array("application version")?,
            natnet: r.array("NatNet version")?,
        })
    }

    fn encode(&self, w: &mut W) {
        // The last byte stays NUL, as a receiver may demand.
        w.fixed_text(&self.name[..self.name.floor_char_boundary(255)], 256);
        w.bytes(&self.application);
        w.bytes(&self.natnet);
    }
}

/// The server's clock and where it sends its data (since 3.0).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Clock {
    /// Ticks per second.
    pub frequency: u64,
    /// Port of the data.
    pub data_port: u16,
    /// Multicast (true) or unicast.
    pub multicast: bool,
    /// Multicast group.
    pub group: [u8; 4],
}

/// SERVERINFO.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ServerInfo {
    /// Name and versions.
    pub sender: Sender,
    /// Clock and data address; `None` before 3.0.
    pub clock: Option<Clock>,
}

impl ServerInfo {
    /// Reads the payload.
    ///
    /// # Errors
    /// When it is too short.
    pub fn decode(payload: &[u8]) -> Result<Self, NatNetError> {
        let mut r = R::new(payload);
        let mut version = Version::OLDEST;
        let mut read = || -> Result<Self, ReadError> {
            let sender = Sender::decode(&mut r)?;
            version = sender.version();
            if !version.since(3, 0) {
                return Ok(Self { sender, clock: None });
            }
            let frequency = r.u64("clock frequency")?;
            let data_port = r.u16("data port")?;
            let multicast = r.u8("multicast flag")? != 0;
            Ok(Self { sender, clock: Some(Clock { frequency, data_port, multicast, group: r.array("group")? }) })
        };
        read().map_err(|source| NatNetError::Read { message: "server info", version, source })
    }

    /// The datagram.
    pub fn encode(&self) -> Vec<u8> {
        let mut w = W::new();
        self.sender.encode(&mut w);
        if let Some(c) = self.clock.filter(|_| self.sender.version().since(3, 0)) {
            w.u64(c.frequency);
            w.u16(c.data_port);
            w.u8(u8::from(c.multicast));
            w.bytes(&c.group);
        }
        datagram(MessageId::ServerInfo, &w.0)
    }
}

/// What a CONNECT asks for.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ConnectOptions {
    /// Who asks; `None` for the empty, minimal form.
    pub sender: Option<Sender>,
    /// Since 4.0: the bitstream version wanted (unicast only); `None` for the server's own.
    pub bitstream: Option<Version>,
}

impl ConnectOptions {
    /// Reads the payload of CONNECT or DISCOVERY; anything shorter than a sender block counts as the empty form.
    pub fn decode(payload: &[u8]) -> Self {
        let mut r = R::new(payload);
        let Ok(sender) = Sender::decode(&mut r) else { return Self::default() };
        let wanted = r.u8("subscribed only").and_then(|_| r.array::<4>("bitstream")).ok();
        let bitstream = wanted.filter(|v| v[0] != 0).map(|v| Version::new(v[0], v[1]));
        Self { sender: Some(sender), bitstream }
    }

    /// The datagram, as CONNECT or DISCOVERY.
    pub fn encode(&self, id: MessageId) -> Vec<u8> {
        let mut w = W::new();
        if let Some(sender) = &self.sender {
            sender.encode(&mut w);
            if let Some(v) = self.bitstream {
                w.bytes(&[0, v.major, v.minor, 0, 0, 0]);
            }
        }
        datagram(id, &w.0)
    }
}
