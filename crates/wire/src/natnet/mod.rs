//! OptiTrack's NatNet, bitstream versions 2.0 to 4.3, and newer ones as far as their section sizes allow.
//!
//! Numbers stay as they are on the wire (metres, seconds, server ticks) in [`Frame`] and [`Definition`]; [`Client`]
//! turns frames into [`crate::TimedPose`]s in millimetres. [`Client`] and [`Server`] are state machines without
//! sockets: datagrams and the time go in, datagrams and values come out.

mod client;
mod command;
mod connect;
mod decode;
mod diagnosis;
mod encode;
mod error;
mod frame;
mod message;
mod model;
mod poses;
mod server;
#[cfg(test)]
mod tests;
mod version;

pub use client::{Client, ClientOptions, Counters, EchoExchange, Event};
pub use command::{Pending, Response};
pub use connect::{Clock, ConnectOptions, Sender, ServerInfo};
pub use diagnosis::Diagnosis;
pub use error::NatNetError;
pub use frame::{
    Asset, BodyMarker, ChannelData, Fault, Frame, LabeledMarker, MarkerSet, RigidBody, Skeleton, Suffix, Vec3,
};
pub use message::{Header, MessageId, split};
pub use model::{Definition, MarkerDefinition, RigidBodyDefinition, definitions};
pub use poses::UpAxis;
pub use server::{BodyPose, Server, ServerOptions};
pub use version::Version;

/// Port on which a server takes commands.
pub const COMMAND_PORT: u16 = 1510;
/// Port on which data arrive.
pub const DATA_PORT: u16 = 1511;
/// Multicast group of the data.
pub const MULTICAST_GROUP: [u8; 4] = [239, 255, 42, 99];

/// NatNet is little-endian throughout.
type R<'a> = crate::bytes::Reader<'a, false>;
type W = crate::bytes::Writer<false>;
