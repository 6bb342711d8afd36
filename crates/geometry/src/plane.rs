//! An oriented plane.

use crate::{Point, Vector};

/// Points whose spread in one direction is less than the root of this of that in the other are on a line.
const THIN: f64 = 1e-10;

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

    /// The plane through `middle` nearest to points about it in their heights along `out`, a unit vector near its normal;
    /// `None` where they lie on a line, or are none.
    pub fn fitted(middle: Point<F>, out: Vector<F>, points: impl IntoIterator<Item = Point<F>>) -> Option<Self> {
        let u = out.any_perpendicular()?;
        let v = out.cross(u);
        let [mut uu, mut uv, mut vv, mut uh, mut vh] = [0.0; 5];
        for p in points {
            let way = p - middle;
            let (a, b, height) = (way.dot(u), way.dot(v), way.dot(out));
            (uu, uv, vv, uh, vh) = (uu + a * a, uv + a * b, vv + b * b, uh + a * height, vh + b * height);
        }
        let all = uu * vv - uv * uv;
        if all <= THIN * (uu + vv).powi(2) {
            return None;
        }
        let (slope_u, slope_v) = ((uh * vv - vh * uv) / all, (vh * uu - uh * uv) / all);
        Self::new(middle, out - u * slope_u - v * slope_v)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Patient;
    use proptest::prelude::*;

    fn vector(parts: [f64; 3]) -> Vector<Patient> {
        Vector::from_array(parts)
    }

    proptest! {
        #[test]
        fn a_plane_is_found_from_its_points_and_a_rough_normal(
            middle in prop::array::uniform3(-100.0..100.0f64),
            normal in prop::array::uniform3(-1.0..1.0f64),
            other in prop::array::uniform3(-1.0..1.0f64),
            flat in prop::collection::vec(prop::array::uniform2(-50.0..50.0f64), 6..40),
        ) {
            let (Some(normal), Some(other)) = (vector(normal).normalized(), vector(other).normalized()) else {
                return Ok(());
            };
            prop_assume!(normal.dot(other) > 0.5);
            let (middle, u) = (Point::<Patient>::from_array(middle), normal.any_perpendicular().expect("a unit"));
            let v = normal.cross(u);
            let points: Vec<_> = flat.iter().map(|[a, b]| middle + u * *a + v * *b).collect();
            let area: f64 = points.iter().map(|p| (points[0] - middle).cross(*p - middle).norm()).sum();
            prop_assume!(area > 100.0);
            let found = Plane::fitted(middle, other, points).expect("a plane");
            prop_assert!(found.normal.angle(normal) < 1e-6, "{found:?} for {normal:?}");
        }
    }

    #[test]
    fn points_on_a_line_or_none_have_no_plane() {
        let (middle, out) = (Point::<Patient>::new(1.0, 2.0, 3.0), vector([0.0, 0.0, 1.0]));
        assert_eq!(Plane::fitted(middle, out, []), None);
        let line = (0..9).map(|n| middle + vector([0.5, -0.25, 2.0]) * f64::from(n));
        assert_eq!(Plane::fitted(middle, out, line), None);
    }
}
