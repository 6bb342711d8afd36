//! The space in which a catheter may meet the tissue: whatever is outside of it is in the air.

use crate::schedule::CATHETER_LENGTH_MM;
use monro_geometry::{Patient, Point, Vector};

/// How far from its place at rest tissue may be and still be reached, mm.
const MARGIN_MM: f64 = 15.0;
/// Directions of the slabs: axes, edge diagonals and corner diagonals of a cube. A head is nearly convex, and fills half of
/// its box.
const DIRECTIONS: [[f64; 3]; 13] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 1.0, 0.0],
    [1.0, -1.0, 0.0],
    [1.0, 0.0, 1.0],
    [1.0, 0.0, -1.0],
    [0.0, 1.0, 1.0],
    [0.0, 1.0, -1.0],
    [1.0, 1.0, 1.0],
    [1.0, 1.0, -1.0],
    [1.0, -1.0, 1.0],
    [-1.0, 1.0, 1.0],
];

/// The tissue with room to move: the polytope of 26 planes around it (a k-DOP, Klosowski et al. 1998).
#[derive(Debug)]
pub(super) struct Room([Slab; 13]);

/// What lies between two planes.
#[derive(Debug)]
struct Slab {
    normal: Vector<Patient>,
    low: f64,
    high: f64,
}

impl Room {
    /// The room around nodes at rest.
    pub(super) fn new(nodes: &[Point<Patient>]) -> Self {
        Self(DIRECTIONS.map(|d| {
            let normal = Vector::from_array(d) / Vector::<Patient>::from_array(d).norm();
            let at = |p: &Point<Patient>| (*p - Point::ORIGIN).dot(normal);
            let low = nodes.iter().map(at).fold(f64::INFINITY, f64::min) - MARGIN_MM;
            Slab { normal, low, high: nodes.iter().map(at).fold(f64::NEG_INFINITY, f64::max) + MARGIN_MM }
        }))
    }

    /// Whether a point is in it.
    pub(super) fn holds(&self, p: Point<Patient>) -> bool {
        self.0.iter().all(|slab| (slab.low..=slab.high).contains(&(p - Point::ORIGIN).dot(slab.normal)))
    }

    /// How far it is from `start` along the unit vector `direction` until the room is left for good, mm; 0 when it is not
    /// met by a catheter's length (slabs, Kay and Kajiya 1986).
    pub(super) fn way_out(&self, start: Point<Patient>, direction: Vector<Patient>) -> f64 {
        let (mut enter, mut leave) = (0f64, f64::INFINITY);
        for slab in &self.0 {
            let (at, way) = ((start - Point::ORIGIN).dot(slab.normal), direction.dot(slab.normal));
            if way.abs() < 1e-12 {
                if at < slab.low || at > slab.high {
                    return 0.0;
                }
                continue;
            }
            let (s, t) = ((slab.low - at) / way, (slab.high - at) / way);
            (enter, leave) = (enter.max(s.min(t)), leave.min(s.max(t)));
        }
        if leave > enter && leave.is_finite() && enter < CATHETER_LENGTH_MM { leave } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ball of 60 mm, as nodes on its surface.
    fn ball() -> Vec<Point<Patient>> {
        let place = |n: usize| {
            let (z, turn) = (1.0 - 2.0 * (n as f64 + 0.5) / 4000.0, n as f64 * 2.399_963);
            let r = (1.0 - z * z).sqrt();
            Point::ORIGIN + Vector::new(r * turn.cos(), r * turn.sin(), z) * 60.0
        };
        (0..4000).map(place).collect()
    }

    #[test]
    fn the_way_out_of_a_cube_is_that_of_its_box() {
        let corners = (0..8).map(|c| Point::new(f64::from(c & 1), f64::from(c >> 1 & 1), f64::from(c >> 2)));
        let room = Room::new(&corners.map(|p| Point::ORIGIN + (p - Point::ORIGIN) * 60.0).collect::<Vec<_>>());
        let up = Vector::new(0.0, 0.0, 1.0);
        assert!((room.way_out(Point::new(30.0, 30.0, 20.0), up) - 55.0).abs() < 1e-9);
        assert!(room.way_out(Point::new(30.0, 30.0, 90.0), up) <= 0.0);
        assert!(room.way_out(Point::new(300.0, 30.0, 20.0), up) <= 0.0);
        let aslant = Vector::new(0.6, 0.0, 0.8);
        assert!(room.way_out(Point::new(30.0, 30.0, 20.0), aslant) >= 55.0 / 0.8 - 12.0);
    }

    /// Its ray backwards met the head, and it was driven through the brain.
    #[test]
    fn a_catheter_far_off_with_its_hub_towards_the_head_is_in_the_air() {
        let room = Room::new(&ball());
        let back = Vector::new(-1.0, 0.0, 0.0);
        for (x, is_met) in [(600.0, false), (330.0, false), (200.0, true), (0.0, true)] {
            let tip = Point::new(x, 0.0, 0.0);
            assert_eq!((room.way_out(tip, back) > 0.0, room.holds(tip)), (is_met, x < 70.0), "{x}");
        }
    }

    /// Above Kocher's point a catheter is inside the box around the head long before it is near it.
    #[test]
    fn a_catheter_in_a_corner_of_the_box_is_in_the_air() {
        let room = Room::new(&ball());
        let out = Vector::new(1.0, -0.7, 0.8).normalized().expect("direction");
        assert!(room.way_out(Point::ORIGIN + out * 85.0, out) <= 0.0);
        // No node's margin is cut off.
        for p in ball() {
            let back = (p - Point::ORIGIN).normalized().expect("direction");
            assert!(room.way_out(p, back) >= MARGIN_MM - 1e-9);
        }
    }
}
