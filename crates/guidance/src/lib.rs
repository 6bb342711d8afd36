//! Plan, needle pose, angles and distances, calibration and registration, each with its error.
//!
//! Pure functions; time, where it matters, is an argument. Lengths in mm, angles in radians. The linear algebra library
//! stays inside: no type of it is in a public signature.

pub mod calibration;
pub mod clock;
mod covariance;
mod eye;
mod kakarla;
mod lag;
mod linear;
mod needle;
pub mod optics;
mod plan;
mod random;
pub mod reference;
pub mod registration;
mod serial;
pub mod simulation;

pub use covariance::Covariance;
pub use eye::TargetEye;
pub use kakarla::{Kakarla, TipSite};
pub use lag::Lag;
pub use needle::{NeedleError, NeedlePose, Reading, TargetReading, skull_angle};
pub use plan::{Plan, PlanError, Side};
pub use random::Random;
