//! Bytes to timed poses and meshes and back: OptiTrack's NatNet and OpenIGTLink, sans-I/O.
//!
//! Nothing here opens a socket or reads a clock: bytes and times are arguments, bytes and values are results. Every
//! decoder survives any input with a named error and never allocates from a count that the bytes present do not cover.
//!
//! Units on the wire differ (NatNet: metres, OpenIGTLink: millimetres); a [`TimedPose`] is always in millimetres in the
//! tracker frame.

mod bytes;
pub mod natnet;
pub mod openigtlink;
mod pose;
pub mod recording;

pub use bytes::ReadError;
pub use pose::{Missing, Quality, TimedPose};
