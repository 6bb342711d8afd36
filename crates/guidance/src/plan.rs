//! The planned path of the catheter.

use monro_geometry::{Bvh, Patient, Point, Vector};
use thiserror::Error;

/// Side of the patient.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The patient's left (+x in LPS).
    Left,
    /// The patient's right (-x in LPS).
    Right,
}

impl Side {
    /// `left` or `right`, as in files and on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
        }
    }
}

/// Why a plan was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PlanError {
    /// Entry and target coincide or are not finite.
    #[error("entry and target are {0} mm apart; a path needs two different, finite points")]
    Length(f64),
}

/// A straight path from the entry on the skin to the target, in the patient frame (mm).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plan {
    side: Side,
    entry: Point<Patient>,
    target: Point<Patient>,
}

impl Plan {
    /// A path from its two ends.
    ///
    /// # Errors
    /// When the ends coincide (closer than 1e-6 mm) or are not finite.
    pub fn new(side: Side, entry: Point<Patient>, target: Point<Patient>) -> Result<Self, PlanError> {
        let length = entry.distance(target);
        if !(length.is_finite() && length > 1e-6) {
            return Err(PlanError::Length(length));
        }
        Ok(Self { side, entry, target })
    }

    /// Side of the entry.
    pub const fn side(&self) -> Side {
        self.side
    }

    /// Where the catheter enters the skin.
    pub const fn entry(&self) -> Point<Patient> {
        self.entry
    }

    /// Where the tip shall end.
    pub const fn target(&self) -> Point<Patient> {
        self.target
    }

    /// Distance from entry to target, mm.
    pub fn length(&self) -> f64 {
        self.entry.distance(self.target)
    }

    /// Unit vector from entry to target.
    pub fn direction(&self) -> Vector<Patient> {
        (self.target - self.entry) / self.length()
    }

    /// The point a given depth (mm) along the path from the entry.
    pub fn at_depth(&self, depth: f64) -> Point<Patient> {
        self.entry + self.direction() * depth
    }

    /// Depths (mm) and places along the path, from the entry in steps of `step_mm` as far as whole ones go.
    pub fn every(&self, step_mm: f64) -> impl Iterator<Item = (f64, Point<Patient>)> {
        let steps = (self.length() / step_mm) as usize;
        (0..=steps).map(move |i| i as f64 * step_mm).map(|depth| (depth, self.at_depth(depth)))
    }

    /// The depth (mm) at which the path first goes through a surface, from either side, if it does before its end.
    pub fn first_through(&self, surface: &Bvh) -> Option<f64> {
        surface.ray(self.entry, self.direction()).map(|hit| hit.t).filter(|depth| *depth < self.length())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::TriangleMesh;

    #[test]
    fn a_path_goes_through_a_surface_from_either_side_or_ends_before_it() {
        let sheet = |z: f64, triangle| {
            let vertices = [[-9.0, -9.0], [9.0, -9.0], [0.0, 9.0]].map(|[x, y]| Point::new(x, y, z)).to_vec();
            Bvh::new(&TriangleMesh { vertices, triangles: vec![triangle] })
        };
        let plan = Plan::new(Side::Left, Point::new(0.0, 0.0, 50.0), Point::new(0.0, 0.0, 10.0)).expect("a plan");
        for triangle in [[0, 1, 2], [0, 2, 1]] {
            assert_eq!(plan.first_through(&sheet(20.0, triangle)), Some(30.0));
            assert_eq!(plan.first_through(&sheet(5.0, triangle)), None);
            assert_eq!(plan.first_through(&sheet(60.0, triangle)), None);
        }
    }
}
