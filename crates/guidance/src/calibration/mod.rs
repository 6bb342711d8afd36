//! Calibration of tools: where the tip is, and which way the shaft points.

mod axis;
mod pivot;

use monro_geometry::Rigid;
use std::collections::HashSet;

pub use axis::{AxisCalibration, AxisError, axis_through, calibrate_axis};
pub use pivot::{PivotCalibration, PivotError, PivotOptions, calibrate_pivot};

/// Poses without those that only came again: a server that repeats its last pose until there is a new one, or plays a recording in
/// a loop, measures nothing anew, and would make a calibration look more certain than it is.
pub fn distinct<To, From>(mut poses: Vec<Rigid<To, From>>) -> Vec<Rigid<To, From>> {
    let mut seen = HashSet::with_capacity(poses.len());
    let bits = |pose: &Rigid<To, From>| {
        (pose.quaternion_wxyz().map(f64::to_bits), pose.translation().to_array().map(f64::to_bits))
    };
    poses.retain(|pose| seen.insert(bits(pose)));
    poses
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Random;
    use crate::simulation::swing;
    use monro_geometry::Point;

    #[test]
    fn a_recording_that_is_played_in_a_loop_counts_once() {
        let once = swing(40, 0.6, Point::new(3.0, -2.0, -150.0), Point::new(50.0, 60.0, 70.0), &mut Random::new(6));
        let looped = [&once[..], &once[..], &once[..7]].concat();
        assert_eq!(distinct(looped), once);
        let held: Vec<_> = once.iter().flat_map(|p| [*p; 3]).collect();
        assert_eq!(distinct(held), once);
    }
}
