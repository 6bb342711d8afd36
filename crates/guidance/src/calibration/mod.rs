//! Calibration of tools: where the tip is, and which way the shaft points.

mod axis;
mod pivot;

use monro_geometry::Rigid;

pub use axis::{AxisCalibration, AxisError, axis_through, calibrate_axis};
pub use pivot::{PivotCalibration, PivotError, PivotOptions, calibrate_pivot};

/// Poses without those that only came again: a server that repeats its last pose until there is a new one measures nothing
/// anew, and would make a calibration look more certain than it is.
pub fn distinct<To, From>(mut poses: Vec<Rigid<To, From>>) -> Vec<Rigid<To, From>> {
    poses.dedup();
    poses
}
