//! The lens: focal lengths, principal point, distortion, in the convention of `OpenCV`.

use monro_geometry::{Display, Frame, Point, Rigid, Vector};

/// A camera's frame: x right, y down, z into the picture, mm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CameraFrame;

impl Frame for CameraFrame {
    const NAME: &'static str = "camera";
}

impl CameraFrame {
    /// The half turn about x to the display's frame (x right, y up, z towards the viewer).
    pub fn display_from_camera() -> Rigid<Display, Self> {
        // A quaternion of length one is never refused.
        Rigid::from_quaternion([0.0, 1.0, 0.0, 0.0], Vector::ZERO).unwrap_or(Rigid::IDENTITY)
    }
}

/// A pinhole with radial and tangential distortion (Brown 1966).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// Focal lengths, pixels.
    pub focal: [f64; 2],
    /// Principal point, pixels.
    pub centre: [f64; 2],
    /// k1, k2, k3.
    pub radial: [f64; 3],
    /// p1, p2.
    pub tangential: [f64; 2],
}

impl Lens {
    /// The pixel of a point in the camera's frame; `None` behind the camera.
    pub fn project(&self, p: Point<CameraFrame>) -> Option<[f64; 2]> {
        if p.z <= 0.0 || p.z.is_nan() {
            return None;
        }
        let (x, y) = (p.x / p.z, p.y / p.z);
        let r2 = x * x + y * y;
        let [k1, k2, k3] = self.radial;
        let [p1, p2] = self.tangential;
        let stretch = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let dx = 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
        let dy = p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
        Some([self.focal[0] * (x * stretch + dx) + self.centre[0], self.focal[1] * (y * stretch + dy) + self.centre[1]])
    }
}
