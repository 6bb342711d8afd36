//! Implicit shapes: functions that are negative inside, and close to the distance in mm near their surface.

use super::Head;
use monro_geometry::{Point, Vector};

/// A point of the head's own frame.
pub(super) type At = Point<Head>;

/// The point `(x, y, z)` of the head's frame.
pub(super) const fn at(x: f64, y: f64, z: f64) -> At {
    Point::new(x, y, z)
}

/// Ellipsoid with half axes `r`: exact sign, first-order distance near the surface.
pub(super) fn ellipsoid(p: At, centre: At, r: [f64; 3]) -> f64 {
    let d = p - centre;
    first_order([d.x, d.y, d.z], r)
}

/// Ellipse in a plane, first-order as [`ellipsoid`].
pub(super) fn ellipse(d: [f64; 2], r: [f64; 2]) -> f64 {
    first_order([d[0], d[1], 0.0], [r[0], r[1], 1.0])
}

/// `f (f - 1) / |grad|` of the scaled radius `f`, which is the distance to first order.
fn first_order(d: [f64; 3], r: [f64; 3]) -> f64 {
    let (x, y, z) = (d[0] / r[0], d[1] / r[1], d[2] / r[2]);
    let scaled = (x * x + y * y + z * z).sqrt();
    let (gx, gy, gz) = (x / r[0], y / r[1], z / r[2]);
    let gradient = (gx * gx + gy * gy + gz * gz).sqrt();
    if gradient < 1e-9 {
        return -r[0].min(r[1]).min(r[2]);
    }
    scaled * (scaled - 1.0) / gradient
}

/// Capsule whose radius runs from `ra` at `a` to `rb` at `b`.
pub(super) fn capsule(p: At, (a, ra): (At, f64), (b, rb): (At, f64)) -> f64 {
    let axis = b - a;
    let t = ((p - a).dot(axis) / axis.norm_squared()).clamp(0.0, 1.0);
    p.distance(a + axis * t) - (ra + (rb - ra) * t)
}

/// Box with half sizes `h` and edges rounded by `round`; exact.
pub(super) fn rounded_box(p: At, centre: At, h: [f64; 3], round: f64) -> f64 {
    let d = p - centre;
    let q = [d.x.abs() - h[0] + round, d.y.abs() - h[1] + round, d.z.abs() - h[2] + round];
    let out = q.map(|v| v.max(0.0));
    (out[0] * out[0] + out[1] * out[1] + out[2] * out[2]).sqrt() + q[0].max(q[1]).max(q[2]).min(0.0) - round
}

/// Union whose seam is rounded over a width `k`.
pub(super) fn join(a: f64, b: f64, k: f64) -> f64 {
    let h = (k - (a - b).abs()).max(0.0) / k;
    a.min(b) - h * h * k * 0.25
}

/// Intersection whose edge is rounded over a width `k`.
pub(super) fn meet(a: f64, b: f64, k: f64) -> f64 {
    -join(-a, -b, k)
}

/// `a` without `b`, edge rounded over a width `k`.
pub(super) fn without(a: f64, b: f64, k: f64) -> f64 {
    meet(a, -b, k)
}

/// The mirror image on the patient's left of a point of either side.
pub(super) fn folded(p: At) -> At {
    at(p.x.abs(), p.y, p.z)
}

/// A station of a tube: its centre, and the half axes of its elliptical section (across the body, and the other way).
#[derive(Debug, Clone, Copy)]
pub(super) struct Station {
    pub(super) centre: At,
    pub(super) across: f64,
    pub(super) along: f64,
}

/// A curved tube of elliptical section through its stations.
#[derive(Debug, Clone)]
pub(super) struct Tube {
    pieces: Vec<Piece>,
    low: [f64; 3],
    high: [f64; 3],
}

#[derive(Debug, Clone, Copy)]
struct Piece {
    from: Station,
    to: Station,
    axis: Vector<Head>,
    length: f64,
    across: Vector<Head>,
    along: Vector<Head>,
}

impl Tube {
    /// A tube through at least two different stations.
    pub(super) fn new(stations: &[Station]) -> Self {
        let pieces: Vec<Piece> = stations.windows(2).map(|s| Piece::new(s[0], s[1])).collect();
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for s in stations {
            let r = s.across.max(s.along);
            for (a, c) in s.centre.to_array().into_iter().enumerate() {
                (low[a], high[a]) = (low[a].min(c - r), high[a].max(c + r));
            }
        }
        Self { pieces, low, high }
    }

    /// Distance (negative inside); beyond 8 mm from the tube's box, the distance to that box.
    pub(super) fn distance(&self, p: At) -> f64 {
        let c = p.to_array();
        let gap = (0..3).fold(0f64, |g, a| g.max(self.low[a] - c[a]).max(c[a] - self.high[a]));
        if gap > 8.0 {
            return gap;
        }
        self.pieces.iter().fold(f64::INFINITY, |d, piece| join(d, piece.distance(p), 2.5))
    }
}

impl Piece {
    fn new(from: Station, to: Station) -> Self {
        let span = to.centre - from.centre;
        let length = span.norm();
        let axis = span / length;
        let x = Vector::new(1.0, 0.0, 0.0);
        let across = x - axis * axis.dot(x);
        let across = across / across.norm();
        Self { from, to, axis, length, across, along: axis.cross(across) }
    }

    fn distance(&self, p: At) -> f64 {
        let d = p - self.from.centre;
        let reach = d.dot(self.axis);
        let t = (reach / self.length).clamp(0.0, 1.0);
        let across = self.from.across + (self.to.across - self.from.across) * t;
        let along = self.from.along + (self.to.along - self.from.along) * t;
        let beyond = reach - t * self.length;
        first_order([d.dot(self.across), d.dot(self.along), beyond], [across, along, across.min(along)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_its_surface_an_ellipsoid_gives_the_distance() {
        let r = [10.0, 20.0, 30.0];
        for (p, d) in [([12.0, 0.0, 0.0], 2.0), ([0.0, 19.0, 0.0], -1.0), ([0.0, 0.0, 30.5], 0.5)] {
            assert!((ellipsoid(Point::from_array(p), Point::ORIGIN, r) - d).abs() < 0.06 * d.abs() + 1e-9);
        }
        assert_eq!(ellipsoid(Point::ORIGIN, Point::ORIGIN, r), -10.0);
    }

    #[test]
    fn a_round_tube_is_a_capsule() {
        let station = |z| Station { centre: at(1.0, 2.0, z), across: 4.0, along: 4.0 };
        let tube = Tube::new(&[station(0.0), station(10.0)]);
        for p in [at(7.0, 2.0, 5.0), at(1.0, 2.0, 17.0), at(2.0, 2.0, 3.0)] {
            let expected = capsule(p, (at(1.0, 2.0, 0.0), 4.0), (at(1.0, 2.0, 10.0), 4.0));
            assert!((tube.distance(p) - expected).abs() < 1e-9);
        }
    }

    #[test]
    fn a_rounded_box_is_exact_at_face_and_corner() {
        let d = |p| rounded_box(p, Point::ORIGIN, [10.0, 10.0, 10.0], 3.0);
        assert!((d(at(12.0, 0.0, 0.0)) - 2.0).abs() < 1e-12);
        assert!((d(at(0.0, 0.0, 0.0)) + 10.0).abs() < 1e-12);
        let corner = 7.0 + 3.0 / 3f64.sqrt();
        assert!(d(at(corner, corner, corner)).abs() < 1e-12);
    }

    #[test]
    fn soft_joins_keep_what_is_far_from_the_seam() {
        assert_eq!(join(1.0, 9.0, 4.0), 1.0);
        assert!(join(1.0, 1.0, 4.0) < 1.0);
        assert_eq!(without(-5.0, 20.0, 4.0), -5.0);
        assert_eq!(meet(-5.0, 3.0, 4.0), 3.0);
    }
}
