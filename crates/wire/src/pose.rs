//! What every tracker input becomes: a named pose with its times and its quality.

use monro_geometry::{Rigid, Tool, Tracker};

/// How far a pose can be trusted, as its source says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Quality {
    /// The source tracked the tool; its own mean marker error in mm where it tells one.
    Tracked {
        /// Mean marker error, mm.
        error: Option<f64>,
    },
    /// There is no pose to trust, and why.
    Missing(Missing),
}

/// Why there is no pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Missing {
    /// The source reports the tool as not seen or not valid in this frame.
    NotTracked,
    /// The tool is outside the tracked volume or the view.
    OutOfVolume,
    /// What is sent is further away than anything is tracked.
    TooFar,
    /// The source tells nothing more of the tool, or nothing at all.
    NotSent,
    /// The numbers sent are no rigid motion (not finite, sheared, mirrored).
    NotRigid,
    /// A place is sent, but no orientation.
    NoOrientation,
    /// What was measured does not fit the tool.
    Misfit,
    /// Several are sent for one tool.
    Ambiguous,
    /// The last pose is sent once more, with the time at which it was measured.
    Repeated,
}

/// Nothing is tracked further away than this, mm: what says so is garbled.
const FURTHEST_MM: f64 = 1e6;
/// A tool whose markers lie further than this from where its definition has them, on average, has no pose, mm: good ones are some tenths
/// off.
const MOST_ERROR_MM: f64 = 5.0;

impl Missing {
    /// For messages and JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotTracked => "not tracked",
            Self::OutOfVolume => "out of volume",
            Self::TooFar => "more than a kilometre away",
            Self::NotSent => "nothing sent",
            Self::NotRigid => "not a rigid motion",
            Self::NoOrientation => "no orientation",
            Self::Misfit => "its markers are more than 5 mm off",
            Self::Repeated => "the same pose of the same time again",
            Self::Ambiguous => "sent by two sources",
        }
    }
}

/// One tool in one frame of a tracking system.
#[derive(Debug, Clone, PartialEq)]
pub struct TimedPose {
    /// The tool's name, as the source calls it.
    pub name: String,
    /// When the pose was measured, in seconds of the source's own clock; `None` where the source does not say.
    pub source_time: Option<f64>,
    /// When its bytes arrived, in seconds of the receiver's clock.
    pub arrival_time: f64,
    /// How much later it came than poses of its source did lately, by their times on its clock, s; 0 where nothing says so.
    pub lag: f64,
    /// How far to trust it.
    pub quality: Quality,
    /// Where the tool is (mm); `None` unless tracked, so that a lost tool's last pose cannot be used by mistake.
    pub tracker_from_tool: Option<Rigid<Tracker, Tool>>,
}

impl TimedPose {
    /// A tracked pose (with its mean marker error in mm, if known), or the reason why there is none. A place more than a
    /// kilometre away is none.
    pub fn new(
        name: impl Into<String>,
        source_time: Option<f64>,
        arrival_time: f64,
        pose: Result<(Rigid<Tracker, Tool>, Option<f64>), Missing>,
    ) -> Self {
        let (quality, tracker_from_tool) = match pose {
            Ok((rigid, _)) if rigid.translation().norm() > FURTHEST_MM => (Quality::Missing(Missing::TooFar), None),
            Ok((_, Some(error))) if !(0.0..=MOST_ERROR_MM).contains(&error) => {
                (Quality::Missing(Missing::Misfit), None)
            }
            Ok((rigid, error)) => (Quality::Tracked { error }, Some(rigid)),
            Err(reason) => (Quality::Missing(reason), None),
        };
        Self { name: name.into(), source_time, arrival_time, lag: 0.0, quality, tracker_from_tool }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Vector;

    /// Bodies at 1e30 m, as from a garbled packet, passed as live.
    #[test]
    fn a_place_beyond_any_reach_is_no_pose() {
        let at = |x: f64| {
            let there = Rigid::from_quaternion([1.0, 0.0, 0.0, 0.0], Vector::new(x, 0.0, 0.0)).expect("rigid");
            TimedPose::new("tool", None, 0.0, Ok((there, None)))
        };
        assert_eq!(at(1e33).quality, Quality::Missing(Missing::TooFar));
        assert!(at(1e33).tracker_from_tool.is_none() && at(-9e5).tracker_from_tool.is_some());
    }

    /// Poses of bodies whose markers were 30 to 50 mm off were shown, and calibrated with, as good ones.
    #[test]
    fn a_body_that_does_not_fit_its_markers_has_no_pose() {
        let with = |error| TimedPose::new("tool", None, 0.0, Ok((Rigid::IDENTITY, error))).quality;
        for error in [None, Some(0.0), Some(0.4), Some(4.9)] {
            assert_eq!(with(error), Quality::Tracked { error });
        }
        for error in [5.1, 30.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(with(Some(error)), Quality::Missing(Missing::Misfit), "{error}");
        }
    }
}
