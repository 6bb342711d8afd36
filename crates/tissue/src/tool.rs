//! Rigid tools.

use crate::step::{MOST_SUBSTEPS, STRIDE};
use crate::vec3::{V3, axpy, norm, scale, sub};
use monro_geometry::{Patient, Point};

/// A straight rigid rod with a shaped tip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tool {
    /// Shape of the end.
    pub tip: TipShape,
    /// Radius of the shaft, mm.
    pub radius_mm: f64,
}

impl Tool {
    /// How far it may go in a frame without having been put elsewhere, mm (see [`ToolMotion`]).
    pub fn farthest_mm(&self) -> f64 {
        STRIDE * self.radius_mm * f64::from(MOST_SUBSTEPS)
    }
}

/// Shape of the end of a tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TipShape {
    /// A hemisphere: the tool is a capsule.
    Round,
    /// A cone whose side makes this angle with the axis, radians.
    Cone {
        /// Half of the opening angle, radians, above 0 and below a right angle; from 0.05 to 1.5 it is taken as it is.
        half_angle: f64,
    },
}

/// Where a tool is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToolPose {
    /// Its foremost point.
    pub tip: Point<Patient>,
    /// The other end of its axis.
    pub tail: Point<Patient>,
}

/// A tool and its motion during one frame. The position of a tool in the list is its identity from frame to frame.
///
/// A tool whose tip or tail goes further in a frame than 32 of its radii ([`Tool::farthest_mm`]) has not moved there, it has been put there: it lets
/// go of the tissue and starts anew from its last pose, however much tissue lies on its way. Where its tip is then deeper in
/// the tissue than the membrane dimples it is inside, as is a tool that is seen there for the first time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToolMotion {
    /// The tool.
    pub tool: Tool,
    /// Pose at the start of the frame.
    pub from: ToolPose,
    /// Pose at its end.
    pub to: ToolPose,
}

/// A pose in the model's own frame: an axis with a radius that may taper towards the tip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rod {
    /// Foremost point, mm from the model's origin.
    pub(crate) tip: V3,
    /// Unit vector from the tip towards the tail.
    pub(crate) back: V3,
    /// Length from tip to tail, mm.
    pub(crate) length: f32,
    /// Radius of the shaft, mm.
    pub(crate) radius: f32,
    /// Where the swept axis starts behind the tip, mm: one radius for a hemisphere, 0 for a cone.
    pub(crate) start: f32,
    /// Growth of the radius per mm behind the tip (infinite for a hemisphere).
    slope: f32,
}

impl Rod {
    /// The rod a share `t` of the way through a motion; `None` when a pose is not finite or has no length, or the tool
    /// no radius or its cone no angle.
    pub(crate) fn between(motion: &ToolMotion, origin: Point<Patient>, t: f64) -> Option<Self> {
        let at = |a: Point<Patient>, b: Point<Patient>| (a.lerp(b, t) - origin).to_array().map(|v| v as f32);
        let tip = at(motion.from.tip, motion.to.tip);
        let axis = sub(at(motion.from.tail, motion.to.tail), tip);
        let (length, radius) = (norm(axis), motion.tool.radius_mm as f32);
        let (start, slope) = match motion.tool.tip {
            TipShape::Round => (radius.min(length), f32::INFINITY),
            TipShape::Cone { half_angle } => (0.0, half_angle.clamp(0.05, 1.5).tan() as f32),
        };
        let pointed = match motion.tool.tip {
            TipShape::Round => true,
            TipShape::Cone { half_angle } => half_angle > 0.0 && half_angle < core::f64::consts::FRAC_PI_2,
        };
        let usable = pointed && tip.iter().all(|v| v.is_finite()) && length.is_finite() && radius.is_finite();
        (usable && radius > 0.0 && length > 0.0).then(|| Self {
            tip,
            back: scale(axis, 1.0 / length),
            length,
            radius,
            start,
            slope,
        })
    }

    /// The point of the axis `arc` mm behind the tip.
    pub(crate) fn at(&self, arc: f32) -> V3 {
        axpy(self.tip, arc, self.back)
    }

    /// How far behind the tip what touches the rod touches its end, mm.
    pub(crate) fn tip_end(&self) -> f32 {
        let shaped = if self.slope.is_finite() { self.radius / self.slope } else { self.start };
        shaped + 0.5 * self.radius
    }

    /// Radius around the axis `arc` mm behind the tip.
    pub(crate) fn radius_at(&self, arc: f32) -> f32 {
        if self.slope.is_finite() { (arc * self.slope).min(self.radius) } else { self.radius }
    }
}

/// Largest distance that a point of the tool moves in the motion, mm; 0 when a pose is not finite.
pub(crate) fn travel(motion: &ToolMotion) -> f64 {
    let far = motion.from.tip.distance(motion.to.tip).max(motion.from.tail.distance(motion.to.tail));
    if far.is_finite() { far } else { 0.0 }
}
