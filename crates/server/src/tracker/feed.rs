//! The door for poses of a tracker that somebody else listens to.

use crate::live::Live;
use monro_session::live::Observation;
use monro_wire::TimedPose;
use std::sync::Arc;

/// Takes poses into the session.
#[derive(Debug)]
pub struct Feed(Arc<Live>);

impl Feed {
    pub(crate) const fn new(live: Arc<Live>) -> Self {
        Self(live)
    }

    /// Takes the poses of one frame or message. `now` is the present on the clock of their arrival times (s), whatever
    /// that clock started from.
    pub fn take(&self, poses: &[TimedPose], now: f64) {
        let here = self.0.clock.now();
        let observation = |p: &TimedPose| Observation {
            name: p.name.clone(),
            time_s: here - (now - p.arrival_time),
            tracker_from_tool: p.tracker_from_tool,
        };
        self.0.observe(&poses.iter().map(observation).collect::<Vec<_>>());
    }

    /// Whether the server stops, so that the source should too.
    pub fn is_stopping(&self) -> bool {
        self.0.is_stopping()
    }
}
