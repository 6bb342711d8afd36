//! Plan, needle pose, angles and distances, calibration and registration, each with its error.
//!
//! Pure functions; time, where it matters, is an argument. Lengths in mm, angles in radians.

mod kakarla;
mod needle;
mod plan;

pub use kakarla::{Kakarla, TipSite};
pub use needle::{NeedleError, NeedlePose, Reading, TargetReading, skull_angle};
pub use plan::{Plan, PlanError, Side};
