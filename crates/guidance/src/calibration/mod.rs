//! Calibration of tools: where the tip is, and which way the shaft points.

mod axis;
mod pivot;

pub use axis::{AxisCalibration, AxisError, axis_through, calibrate_axis};
pub use pivot::{PivotCalibration, PivotError, PivotOptions, calibrate_pivot};
