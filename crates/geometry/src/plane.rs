//! An oriented plane.

use crate::{Point, Vector};

/// The plane through `point` with unit `normal`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane<F: crate::Frame> {
    /// A point of the plane.
    pub point: Point<F>,
    /// Unit normal; for the mid-sagittal plane it points to the patient's left.
    pub normal: Vector<F>,
}

impl<F: crate::Frame> Plane<F> {
    /// A plane from a point and any non-zero normal; `None` for a zero or non-finite normal.
    pub fn new(point: Point<F>, normal: Vector<F>) -> Option<Self> {
        Some(Self { point, normal: normal.normalized()? })
    }

    /// Signed distance (mm), positive on the side that the normal points to.
    pub fn signed_distance(&self, p: Point<F>) -> f64 {
        (p - self.point).dot(self.normal)
    }

    /// The nearest point of the plane.
    pub fn project(&self, p: Point<F>) -> Point<F> {
        p - self.normal * self.signed_distance(p)
    }

    /// The mirror image of a point.
    pub fn mirror(&self, p: Point<F>) -> Point<F> {
        p - self.normal * (2.0 * self.signed_distance(p))
    }
}
