//! The target's-eye view: what one sees along the needle, from its hub, with the needle as a point in the middle.

use crate::NeedlePose;
use monro_geometry::{Patient, Point, Vector};

/// Sine of the least angle between needle and front for which the patient's front can be up.
const LEAST: f64 = 0.25;

/// A view along a needle. Up is the patient's front as nearly as the needle allows (the patient lies on the back, the
/// surgeon stands at the head); for a needle that points to the front or back, up is the head.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetEye {
    tip: Point<Patient>,
    right: Vector<Patient>,
    up: Vector<Patient>,
}

impl TargetEye {
    /// The view along `needle`.
    pub fn new(needle: &NeedlePose) -> Self {
        let forward = needle.axis();
        let across = |v: Vector<Patient>| v - forward * v.dot(forward);
        let front = across(Vector::new(0.0, -1.0, 0.0));
        let up = if front.norm() < LEAST { across(Vector::new(0.0, 0.0, 1.0)) } else { front };
        // Front and head cannot both be along the needle.
        let up = up.normalized().unwrap_or(front);
        Self { tip: needle.tip(), right: forward.cross(up), up }
    }

    /// Unit vector to the right of the view.
    pub const fn right(&self) -> Vector<Patient> {
        self.right
    }

    /// Unit vector upwards in the view.
    pub const fn up(&self) -> Vector<Patient> {
        self.up
    }

    /// How far right of and above the needle's line a point is seen, mm: where to steer to reach it.
    pub fn see(&self, p: Point<Patient>) -> [f64; 2] {
        [(p - self.tip).dot(self.right), (p - self.tip).dot(self.up)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TargetReading;
    use proptest::prelude::*;

    fn needle(axis: [f64; 3]) -> NeedlePose {
        NeedlePose::new(Point::new(1.0, -2.0, 3.0), Vector::from_array(axis)).expect("needle")
    }

    #[test]
    fn from_above_the_front_is_up_and_the_patients_right_is_right() {
        let eye = TargetEye::new(&needle([0.0, 0.0, -1.0]));
        assert_eq!(eye.see(Point::new(-4.0, -2.0, -50.0)), [5.0, 0.0]);
        assert_eq!(eye.see(Point::new(1.0, -9.0, 70.0)), [0.0, 7.0]);
    }

    #[test]
    fn from_the_front_the_head_is_up() {
        let eye = TargetEye::new(&needle([0.0, 1.0, 0.0]));
        assert_eq!(eye.see(Point::new(1.0, 40.0, 8.0)), [0.0, 5.0]);
    }

    proptest! {
        /// What is seen beside the line is as far from it as the line misses it, whichever way the needle points.
        #[test]
        fn the_offset_seen_is_the_miss(x in -1.0..1.0f64, y in -1.0..1.0f64, z in -1.0..1.0f64, p in -90.0..90.0f64) {
            prop_assume!(Vector::<Patient>::new(x, y, z).norm() > 0.1);
            let (needle, target) = (needle([x, y, z]), Point::new(p, 0.3 * p, -p));
            let eye = TargetEye::new(&needle);
            let [right, up] = eye.see(target);
            prop_assert!((right.hypot(up) - TargetReading::new(&needle, target).miss).abs() < 1e-9);
            prop_assert!(eye.right().cross(eye.up()).dot(needle.axis()) < -1.0 + 1e-9);
        }
    }
}
