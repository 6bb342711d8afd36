//! Where the needle is with respect to the plan: the numbers a surgeon steers by.

use crate::Plan;
use monro_geometry::{Patient, Point, Rigid, Tool, Vector};
use thiserror::Error;

/// Why a needle pose was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum NeedleError {
    /// The tip is not a place.
    #[error("the needle tip {0:?} is not finite; was the pose valid?")]
    Tip([f64; 3]),
    /// The axis has no direction.
    #[error("the needle axis {0:?} has no direction; calibrate the tool's axis first")]
    Axis([f64; 3]),
}

/// The tip of a straight needle and the direction in which it is pushed, in the patient frame (mm).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NeedlePose {
    tip: Point<Patient>,
    axis: Vector<Patient>,
}

impl NeedlePose {
    /// From the tip and a vector of any length from the hub towards the tip.
    ///
    /// # Errors
    /// When the tip is not finite or the axis is zero or not finite.
    pub fn new(tip: Point<Patient>, axis: Vector<Patient>) -> Result<Self, NeedleError> {
        if !tip.is_finite() {
            return Err(NeedleError::Tip(tip.to_array()));
        }
        let axis = axis.normalized().ok_or_else(|| NeedleError::Axis(axis.to_array()))?;
        Ok(Self { tip, axis })
    }

    /// From a calibrated tool (tip and axis in the tool's frame) and where that tool is in the patient.
    ///
    /// # Errors
    /// As [`NeedlePose::new`].
    pub fn of_tool(
        patient_from_tool: &Rigid<Patient, Tool>,
        tip: Point<Tool>,
        axis: Vector<Tool>,
    ) -> Result<Self, NeedleError> {
        Self::new(patient_from_tool.point(tip), patient_from_tool.vector(axis))
    }

    /// The tip.
    pub const fn tip(&self) -> Point<Patient> {
        self.tip
    }

    /// Unit vector from the hub towards the tip.
    pub const fn axis(&self) -> Vector<Patient> {
        self.axis
    }
}

/// The needle against the plan, with the target where the image shows it (rigid anatomy).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Shortest distance from the planned entry to the needle's line, mm.
    pub entry_offset: f64,
    /// Angle between the needle and the planned path, radians in `0..=pi`.
    pub entry_angle: f64,
    /// Signed length of the tip's projection on the path, from the entry towards the target, mm; negative before entry.
    pub depth: f64,
    /// Distance of the tip from the line of the path, mm.
    pub lateral: f64,
    /// The needle against the planned target.
    pub target: TargetReading,
}

/// The needle against one target point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetReading {
    /// Distance from tip to target, mm.
    pub distance: f64,
    /// How far to push on along the needle's own axis until the tip is nearest to the target, mm; negative when past it.
    pub advance: f64,
    /// How near the needle's line comes to the target, mm: what is left after a perfect push without steering.
    pub miss: f64,
}

impl TargetReading {
    /// The needle against a target point, wherever that is now (pass the displaced target for deformed anatomy).
    pub fn new(needle: &NeedlePose, target: Point<Patient>) -> Self {
        let to_target = target - needle.tip;
        Self {
            distance: to_target.norm(),
            advance: to_target.dot(needle.axis),
            miss: to_target.cross(needle.axis).norm(),
        }
    }
}

impl Reading {
    /// The needle against the plan.
    pub fn new(plan: &Plan, needle: &NeedlePose) -> Self {
        let (path, from_entry) = (plan.direction(), needle.tip - plan.entry());
        Self {
            entry_offset: from_entry.cross(needle.axis).norm(),
            entry_angle: path.angle(needle.axis),
            depth: from_entry.dot(path),
            lateral: from_entry.cross(path).norm(),
            target: TargetReading::new(needle, plan.target()),
        }
    }
}

/// Angle in radians between the path, seen from inside out, and the outward normal of the surface it crosses: 0 is a
/// perpendicular entry, as for a twist drill held upright on the skull. `None` for a normal without direction.
pub fn skull_angle(plan: &Plan, outward_normal: Vector<Patient>) -> Option<f64> {
    outward_normal.normalized().map(|n| (-plan.direction()).angle(n))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Side;
    use core::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};
    use proptest::prelude::*;

    /// From (0, 0, 100) straight down to (0, 0, 40).
    fn plan() -> Plan {
        Plan::new(Side::Right, Point::new(0.0, 0.0, 100.0), Point::new(0.0, 0.0, 40.0)).expect("plan")
    }

    fn needle(tip: [f64; 3], axis: [f64; 3]) -> NeedlePose {
        NeedlePose::new(Point::from_array(tip), Vector::from_array(axis)).expect("needle")
    }

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-9
    }

    #[test]
    fn a_needle_on_the_path_reads_zero_errors() {
        let r = Reading::new(&plan(), &needle([0.0, 0.0, 70.0], [0.0, 0.0, -3.0]));
        assert!(close(r.entry_offset, 0.0) && close(r.entry_angle, 0.0) && close(r.lateral, 0.0));
        assert!(close(r.depth, 30.0) && close(r.target.distance, 30.0));
        assert!(close(r.target.advance, 30.0) && close(r.target.miss, 0.0));
    }

    #[test]
    fn a_parallel_needle_keeps_its_offset_everywhere() {
        let r = Reading::new(&plan(), &needle([3.0, 4.0, 40.0], [0.0, 0.0, -1.0]));
        assert!(close(r.entry_offset, 5.0) && close(r.lateral, 5.0) && close(r.target.miss, 5.0));
        assert!(close(r.depth, 60.0) && close(r.target.distance, 5.0) && close(r.target.advance, 0.0));
    }

    #[test]
    fn a_tilted_needle_through_the_entry_has_an_angle_but_no_entry_offset() {
        let r = Reading::new(&plan(), &needle([10.0, 0.0, 90.0], [1.0, 0.0, -1.0]));
        assert!(close(r.entry_offset, 0.0) && close(r.entry_angle, FRAC_PI_4));
        assert!(close(r.depth, 10.0) && close(r.lateral, 10.0));
        assert!(close(r.target.miss, 60.0 * FRAC_PI_4.sin()));
    }

    #[test]
    fn above_the_skin_depth_is_negative_and_past_the_target_advance_is() {
        assert!(close(Reading::new(&plan(), &needle([0.0, 0.0, 130.0], [0.0, 0.0, -1.0])).depth, -30.0));
        let past = Reading::new(&plan(), &needle([0.0, 0.0, 35.0], [0.0, 0.0, -1.0]));
        assert!(close(past.depth, 65.0) && close(past.target.advance, -5.0));
    }

    #[test]
    fn a_displaced_target_moves_the_distance_and_not_the_path() {
        let n = needle([0.0, 0.0, 45.0], [0.0, 0.0, -1.0]);
        let deformed = TargetReading::new(&n, Point::new(0.0, 3.0, 41.0));
        assert!(close(deformed.distance, 5.0) && close(deformed.advance, 4.0) && close(deformed.miss, 3.0));
        assert!(close(Reading::new(&plan(), &n).target.distance, 5.0));
    }

    #[test]
    fn the_skull_angle_is_zero_for_a_perpendicular_entry() {
        assert!(close(skull_angle(&plan(), Vector::new(0.0, 0.0, 2.0)).expect("normal"), 0.0));
        assert!(close(skull_angle(&plan(), Vector::new(0.0, 1.0, 1.0)).expect("normal"), FRAC_PI_4));
        assert!(close(skull_angle(&plan(), Vector::new(0.0, 0.0, -1.0)).expect("normal"), PI));
        assert!(skull_angle(&plan(), Vector::ZERO).is_none());
    }

    #[test]
    fn a_pose_without_place_or_direction_is_refused() {
        let axis = Vector::new(0.0, 0.0, 1.0);
        assert!(matches!(NeedlePose::new(Point::new(f64::NAN, 0.0, 0.0), axis), Err(NeedleError::Tip(_))));
        assert!(matches!(NeedlePose::new(Point::ORIGIN, Vector::ZERO), Err(NeedleError::Axis(_))));
    }

    #[test]
    fn a_calibrated_tool_gives_its_tip_and_axis_in_the_patient() {
        let pose =
            Rigid::from_axis_angle(Vector::new(1.0, 0.0, 0.0), FRAC_PI_2, Vector::new(5.0, 6.0, 7.0)).expect("pose");
        let n = NeedlePose::of_tool(&pose, Point::new(0.0, 0.0, -100.0), Vector::new(0.0, 0.0, -1.0)).expect("needle");
        assert!(n.tip().distance(Point::new(5.0, 106.0, 7.0)) < 1e-9);
        assert!((n.axis() - Vector::new(0.0, 1.0, 0.0)).norm() < 1e-9);
    }

    proptest! {
        /// Readings are made of distances and angles: a common rigid motion of plan and needle changes none of them.
        #[test]
        fn readings_do_not_depend_on_the_frame(
            q in proptest::array::uniform4(-1.0..1.0f64), t in proptest::array::uniform3(-300.0..300.0f64),
            tip in proptest::array::uniform3(-100.0..100.0f64), axis in proptest::array::uniform3(-1.0..1.0f64),
        ) {
            prop_assume!(q.iter().map(|v| v * v).sum::<f64>() > 1e-2);
            prop_assume!(axis.iter().map(|v| v * v).sum::<f64>() > 1e-2);
            let m = Rigid::<Patient, Patient>::from_quaternion(q, Vector::from_array(t)).expect("rigid");
            let (p, n) = (plan(), needle(tip, axis));
            let moved_plan = Plan::new(p.side(), m.point(p.entry()), m.point(p.target())).expect("plan");
            let moved = NeedlePose::new(m.point(n.tip()), m.vector(n.axis())).expect("needle");
            let (a, b) = (Reading::new(&p, &n), Reading::new(&moved_plan, &moved));
            prop_assert!((a.entry_offset - b.entry_offset).abs() < 1e-8 && (a.entry_angle - b.entry_angle).abs() < 1e-8);
            prop_assert!((a.depth - b.depth).abs() < 1e-8 && (a.lateral - b.lateral).abs() < 1e-8);
            prop_assert!((a.target.distance - b.target.distance).abs() < 1e-8);
            prop_assert!((a.target.distance - a.target.advance.hypot(a.target.miss)).abs() < 1e-8);
        }
    }
}
