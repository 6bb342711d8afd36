//! Cameras and see-through displays: from a point in space to a place in the picture.

mod camera;
mod dlt;
mod least_squares;
mod lens;
mod spaam;
#[cfg(test)]
mod tests;

pub use camera::{Camera, CameraCalibration, CameraError, CameraOptions, Correspondence, calibrate_camera};
pub use lens::{CameraFrame, Lens};
pub use spaam::{DisplayCalibration, calibrate_display};
