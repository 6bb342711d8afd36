//! The check after registration, and at any time: touch a known landmark again.

use crate::Covariance;
use monro_geometry::{Frame, Point};

/// What touching a known landmark again tells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Recheck {
    /// Distance between the mark and the touch, mm.
    pub distance: f64,
    /// What registration and touch together explain with 95 % probability, mm.
    pub limit: f64,
}

impl Recheck {
    /// Whether the registration still holds, as far as this point can tell.
    pub fn holds(&self) -> bool {
        self.distance <= self.limit
    }

    /// Whether it rules out that the point was moved so far (mm) since the registration: beside such a motion, registration
    /// and touch do not explain the distance.
    pub fn excludes(&self, motion: f64) -> bool {
        self.distance + self.limit <= motion
    }
}

/// Compares a touch with its mark. `tre` is the predicted error of the registration there, `noise` that of the touch.
pub fn recheck<F: Frame>(marked: Point<F>, touched: Point<F>, tre: &Covariance<F>, noise: &Covariance<F>) -> Recheck {
    Recheck { distance: marked.distance(touched), limit: tre.plus(noise).percentile_95() }
}
