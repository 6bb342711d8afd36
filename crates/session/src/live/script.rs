//! The scripted tracker (`sim:`): a hand that brings a catheter to the entry, pushes it along the plan, holds it at the
//! target, draws it back and starts again, as a tracking system would see it.

use super::{Calibration, Observation, Registration};
use core::f64::consts::TAU;
use monro_geometry::{Display, Patient, Point, Rigid, Tool, Tracker, Vector};
use monro_guidance::Plan;

/// Height of the tip above the entry at the start of a round, mm.
const START_MM: f64 = 40.0;
/// Speed of the approach and of the withdrawal, mm/s.
const FREE_SPEED_MM_S: f64 = 20.0;
/// Speed inside the head, mm/s.
const INSERTION_SPEED_MM_S: f64 = 8.0;
/// Rest at the target, s.
const HOLD_S: f64 = 4.0;
/// Angle between catheter and plan at the start, radians; it shrinks to nothing at the entry.
const START_ANGLE: f64 = 0.2;
/// Tip of the catheter in its tracked body, mm.
const TIP_MM: f64 = -180.0;
/// From the eye of the surgeon to the entry, mm.
const EYE_MM: f64 = 500.0;

/// The scripted hand and the tracker that watches it.
#[derive(Debug, Clone)]
pub struct Script {
    plan: Plan,
    patient_from_reference: Rigid<Patient, Tool>,
}

/// What calibration and registration would find for the scripted tools, exactly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScriptTruth {
    /// The catheter.
    pub calibration: Calibration,
    /// The patient. Its predicted error is 0: a scripted tracker measures nothing.
    pub registration: Registration,
    /// The glasses.
    pub display_from_glasses: Rigid<Display, Tool>,
}

impl Script {
    /// A hand that follows `plan`, again and again.
    pub fn new(plan: Plan) -> Self {
        // The reference sits askew on a head clamp: no frame is by accident the same as another.
        let askew = Rigid::from_axis_angle(Vector::new(0.3, -0.5, 0.8), 0.9, Vector::new(-60.0, 120.0, 40.0));
        Self { plan, patient_from_reference: askew.unwrap_or(Rigid::IDENTITY) }
    }

    /// Exact calibration and registration.
    pub fn truth(&self) -> ScriptTruth {
        let calibration = Calibration { tip: Point::new(0.0, 0.0, TIP_MM), axis: Vector::new(0.0, 0.0, -1.0) };
        let registration =
            Registration { patient_from_reference: self.patient_from_reference, predicted_tre_mm: Some(0.0) };
        ScriptTruth { calibration, registration, display_from_glasses: display_from_glasses() }
    }

    /// Time of one round, s.
    pub fn round_s(&self) -> f64 {
        let length = self.plan.length();
        START_MM / FREE_SPEED_MM_S + length / INSERTION_SPEED_MM_S + HOLD_S + (length + START_MM) / FREE_SPEED_MM_S
    }

    /// Depth of the tip under the entry at `time_s`, mm; negative above the skin.
    pub fn depth_mm(&self, time_s: f64) -> f64 {
        let length = self.plan.length();
        let t = time_s.rem_euclid(self.round_s());
        let (entry_at, inside) = (START_MM / FREE_SPEED_MM_S, length / INSERTION_SPEED_MM_S);
        let (target_at, leave_at) = (entry_at + inside, entry_at + inside + HOLD_S);
        if t < entry_at {
            (t - entry_at) * FREE_SPEED_MM_S
        } else if t < target_at {
            (t - entry_at) * INSERTION_SPEED_MM_S
        } else if t < leave_at {
            length
        } else {
            length - (t - leave_at) * FREE_SPEED_MM_S
        }
    }

    /// What the tracker sees at `time_s` (s): the catheter, the reference, and the glasses of a surgeon who looks along the
    /// path.
    pub fn observations(&self, time_s: f64) -> [Observation; 3] {
        let tracker_from_reference = reference(time_s);
        let patient_from_catheter = self.patient_from_catheter(time_s);
        let reference_from_catheter = self.patient_from_reference.inverse().after(&patient_from_catheter);
        let tracker_from_catheter = tracker_from_reference.after(&reference_from_catheter);
        let reference_from_display = self.patient_from_reference.inverse().after(&self.patient_from_display());
        let tracker_from_display = tracker_from_reference.after(&reference_from_display);
        let tracker_from_glasses = tracker_from_display.after(&display_from_glasses());
        let seen = [
            ("Reference", tracker_from_reference),
            ("Catheter", tracker_from_catheter),
            ("Glasses", tracker_from_glasses),
        ];
        seen.map(|(name, pose)| Observation { name: name.to_owned(), time_s, tracker_from_tool: Some(pose) })
    }

    fn patient_from_display(&self) -> Rigid<Patient, Display> {
        let (ahead, path) = (Vector::<Patient>::new(0.0, 0.0, -1.0), self.plan.direction());
        let axis = ahead.cross(path).normalized().unwrap_or(Vector::new(1.0, 0.0, 0.0));
        let at = self.plan.at_depth(-EYE_MM) - Point::ORIGIN;
        Rigid::from_axis_angle(axis, ahead.angle(path), at).unwrap_or(Rigid::IDENTITY)
    }

    fn patient_from_catheter(&self, time_s: f64) -> Rigid<Patient, Tool> {
        let depth = self.depth_mm(time_s);
        let tip = self.plan.at_depth(depth);
        let direction = self.plan.direction();
        let sideways = direction.any_perpendicular().unwrap_or(direction);
        let angle = START_ANGLE * (-depth / START_MM).max(0.0);
        let turn = Rigid::<Patient, Patient>::from_axis_angle(sideways, angle, Vector::ZERO);
        let tilted = turn.map_or(direction, |r| r.vector(direction));
        // The tool's -z is the catheter's direction.
        let down = Vector::new(0.0, 0.0, -1.0);
        let axis = down.cross(tilted).normalized().unwrap_or(Vector::new(1.0, 0.0, 0.0));
        let rotation = Rigid::<Patient, Tool>::from_axis_angle(axis, down.angle(tilted), Vector::ZERO);
        let rotation = rotation.unwrap_or(Rigid::IDENTITY);
        let offset = tip - rotation.point(Point::new(0.0, 0.0, TIP_MM));
        Rigid::from_quaternion(rotation.quaternion_wxyz(), offset).unwrap_or(rotation)
    }
}

/// The tracked body sits beside the right temple, askew.
fn display_from_glasses() -> Rigid<Display, Tool> {
    let askew = Rigid::from_axis_angle(Vector::new(0.6, 0.2, -0.4), 0.7, Vector::new(70.0, 25.0, -10.0));
    askew.unwrap_or(Rigid::IDENTITY)
}

/// The patient's reference sways a little, far less than what counts as moved.
fn reference(time_s: f64) -> Rigid<Tracker, Tool> {
    let sway = Vector::new(0.2 * (time_s * TAU / 7.0).sin(), 0.1 * (time_s * TAU / 5.0).cos(), 0.0);
    let at = Vector::new(150.0, 900.0, -1200.0) + sway;
    let turn = 0.4 + 0.001 * (time_s * TAU / 11.0).sin();
    Rigid::from_axis_angle(Vector::new(0.1, 1.0, 0.2), turn, at).unwrap_or(Rigid::IDENTITY)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::session::tests::{navigating, plan};
    use monro_guidance::Reading;
    use proptest::prelude::*;

    proptest! {
        /// Through tracker, reference, calibration and registration the needle comes out where the script holds it.
        #[test]
        fn the_needle_is_where_the_script_holds_it(time in 0.0..60.0f64) {
            let script = Script::new(plan());
            let mut s = navigating(&script);
            for o in script.observations(time) {
                s.observe(&o);
            }
            let needle = s.needle(time).expect("live");
            let r = Reading::new(&plan(), &needle);
            let depth = script.depth_mm(time);
            prop_assert!((r.depth - depth).abs() < 1e-9 && r.lateral < 1e-9);
            prop_assert!((r.entry_angle - START_ANGLE * (-depth / START_MM).max(0.0)).abs() < 1e-7);
        }

        /// No jumps: the hand never moves faster than its free speed, also from round to round.
        #[test]
        fn the_hand_does_not_jump(time in 0.0..200.0f64) {
            let script = Script::new(plan());
            let step = (script.depth_mm(time + 0.01) - script.depth_mm(time)).abs();
            prop_assert!(step <= 0.01 * FREE_SPEED_MM_S + 1e-9, "{step}");
        }
    }

    #[test]
    fn a_round_reaches_the_target_and_rests_there() {
        let script = Script::new(plan());
        let arrival = START_MM / FREE_SPEED_MM_S + plan().length() / INSERTION_SPEED_MM_S;
        assert!((script.depth_mm(arrival) - plan().length()).abs() < 1e-9);
        assert!((script.depth_mm(arrival + HOLD_S) - plan().length()).abs() < 1e-9);
        assert!((script.depth_mm(0.0) + START_MM).abs() < 1e-9);
    }
}
