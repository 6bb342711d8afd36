//! What an OpenIGTLink server has told of a tool: which of its poses are none, and how late they come.

use crate::late::{Late, Stamps};
use monro_geometry::{Rigid, Tool, Tracker};
use monro_wire::{Missing, Quality, TimedPose};

/// What was last told of a tool; times in s on our clock.
#[derive(Debug, Clone)]
pub(crate) struct Told {
    /// When it was told of, and when it was last told of anew.
    pub(crate) at: f64,
    pub(crate) anew: f64,
    /// When it was last sent as seen, and why it is not now.
    pub(crate) seen: f64,
    pub(crate) unseen: Option<Missing>,
    pub(crate) late: Late,
    /// Its time on the server's clock and its pose.
    last: (Option<f64>, Option<Rigid<Tracker, Tool>>),
    /// Whether it was ever elsewhere than at the tracker's origin.
    has_left: bool,
}

impl Told {
    /// Of a tool that is told of for the first time.
    pub(crate) fn new(at: f64, stamps: Stamps) -> Self {
        Self { at, anew: at, seen: at, unseen: None, late: Late::new(stamps), last: (None, None), has_left: false }
    }

    /// Takes a pose, and away what is none. One that comes again with the time that it was measured at is no new one: of a tool
    /// that is out of view, or of a server that hangs. Nor is the identity one, to the last bit, of a tool that was elsewhere: it
    /// is what servers send that have no other word for what is out of view (a `Reference` to which all poses are may stay there).
    pub(crate) fn take(&mut self, pose: &mut TimedPose) {
        let is_identity = pose.tracker_from_tool == Some(Rigid::IDENTITY);
        if is_identity && self.has_left {
            (pose.tracker_from_tool, pose.quality) = (None, Quality::Missing(Missing::NotTracked));
        }
        self.has_left |= pose.tracker_from_tool.is_some() && !is_identity;
        self.at = pose.arrival_time;
        match pose.quality {
            Quality::Tracked { .. } => (self.seen, self.unseen) = (self.at, None),
            Quality::Missing(why) => self.unseen = Some(why),
        }
        let new = (pose.source_time, pose.tracker_from_tool);
        if new.0.is_some() && new.1.is_some() && self.last == new {
            (pose.tracker_from_tool, pose.quality) = (None, Quality::Missing(Missing::Repeated));
        } else {
            (self.anew, self.last) = (self.at, new);
            pose.lag = self.late.take(pose.source_time, self.at);
        }
    }
}
