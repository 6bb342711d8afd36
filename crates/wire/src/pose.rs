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
    /// The source tells nothing more of the tool, or nothing at all.
    NotSent,
    /// The numbers sent are no rigid motion (not finite, sheared, mirrored).
    NotRigid,
}

impl Missing {
    /// For messages and JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotTracked => "not tracked",
            Self::OutOfVolume => "out of volume",
            Self::NotSent => "nothing sent",
            Self::NotRigid => "not a rigid motion",
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
    /// How far to trust it.
    pub quality: Quality,
    /// Where the tool is (mm); `None` unless tracked, so that a lost tool's last pose cannot be used by mistake.
    pub tracker_from_tool: Option<Rigid<Tracker, Tool>>,
}

impl TimedPose {
    /// A tracked pose (with its mean marker error in mm, if known), or the reason why there is none.
    pub fn new(
        name: impl Into<String>,
        source_time: Option<f64>,
        arrival_time: f64,
        pose: Result<(Rigid<Tracker, Tool>, Option<f64>), Missing>,
    ) -> Self {
        let (quality, tracker_from_tool) = match pose {
            Ok((rigid, error)) => (Quality::Tracked { error }, Some(rigid)),
            Err(reason) => (Quality::Missing(reason), None),
        };
        Self { name: name.into(), source_time, arrival_time, quality, tracker_from_tool }
    }
}
