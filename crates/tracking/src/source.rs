//! What all sources of poses have in common.

use crate::{Clock, Recorder, TrackerUrl, TrackingError, igtl, natnet, replay, sim};
use monro_guidance::clock::Offset;
use monro_wire::TimedPose;
use monro_wire::natnet::RigidBodyDefinition;
use std::fmt;
use std::time::Duration;

/// The poses of one frame or message.
#[derive(Debug, Clone, Default)]
pub struct Batch {
    /// The poses; empty when nothing came in time.
    pub poses: Vec<TimedPose>,
    /// The source's clock against ours, where it is known.
    pub clock: Option<Offset>,
    /// What the source has said of its bodies since the frame before, if it does: their markers in the frames of their poses.
    pub bodies: Vec<RigidBodyDefinition>,
}

/// How a source is, for people.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Health {
    /// Whether poses come as they should.
    pub well: bool,
    /// What is wrong and what to do about it, or that nothing is.
    pub words: String,
}

impl Health {
    /// Nothing is wrong.
    pub fn well(words: impl Into<String>) -> Self {
        Self { well: true, words: words.into() }
    }

    /// Something is.
    pub fn ill(words: impl Into<String>) -> Self {
        Self { well: false, words: words.into() }
    }
}

impl fmt::Display for Health {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.words)
    }
}

/// A source of poses.
pub trait Source: Send {
    /// The next frame, or an empty batch when none comes within `wait`. `None` when the source has ended (a replay).
    ///
    /// # Errors
    /// When the source cannot go on.
    fn next(&mut self, wait: Duration) -> Result<Option<Batch>, TrackingError>;

    /// The time, s, on the clock of the poses' arrival.
    fn now(&self) -> f64;

    /// What is wrong, or that nothing is; `wanted` are the names of tools that should be there.
    fn diagnosis(&self, wanted: &[&str]) -> Health;

    /// What is known of the other side, a line a fact.
    fn facts(&self) -> Vec<String>;
}

/// Opens a source. What it receives goes to `recorder` too, if there is one.
///
/// # Errors
/// When sockets or files cannot be opened.
pub fn open(url: &TrackerUrl, clock: Clock, recorder: Option<Recorder>) -> Result<Box<dyn Source>, TrackingError> {
    Ok(match url {
        TrackerUrl::NatNet(address) => Box::new(natnet::NatNetSource::open(address, clock, recorder)?),
        TrackerUrl::OpenIgtLink(address) => Box::new(igtl::IgtlSource::open(address, clock, recorder)?),
        TrackerUrl::Replay(address) => Box::new(replay::Replay::open(address)?),
        TrackerUrl::Sim => Box::new(sim::SimSource::new(clock)),
    })
}
