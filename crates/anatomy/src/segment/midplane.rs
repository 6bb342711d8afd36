//! The mid-sagittal plane from the symmetry of skull and brain.

use super::lattice::Lattice;
use crate::image::{Mask, Raster, distance_to, distance_to_false, gaussian};
use monro_geometry::{Patient, Plane, Point, Vector};
use rayon::prelude::*;

/// Differences above this count as this: a lesion on one side must not turn the plane.
const LARGEST: f32 = 20.0;
/// Depth below the inner skull, mm, up to which its shape counts, and its weight in HU per mm.
const SHAPE_DEPTH: f32 = 15.0;
const SHAPE_WEIGHT: f32 = 2.0;
/// Samples every so many voxels of the coarse raster.
const STRIDE: usize = 3;

/// Yaw and roll in radians, offset in mm from the centroid.
type Turn = [f64; 3];

/// What is compared with its mirror image.
struct Symmetry {
    lattice: Lattice,
    brightness: Raster<f32>,
    shape: Raster<f32>,
    points: Vec<[f64; 3]>,
    centroid: [f64; 3],
}

/// Finds the plane of best mirror symmetry within 50 degrees of yaw and 40 of roll of the scan's x axis; its normal points to
/// the patient's left. `hu` and `cavity` lie on `lattice`, whose voxels should be about 2 mm.
pub(crate) fn midplane(hu: &Raster<f32>, cavity: &Mask, lattice: Lattice) -> Option<Plane<Patient>> {
    let symmetry = Symmetry::new(hu, cavity, lattice)?;
    let degrees = |from: i32, step: i32, count: i32| (0..count).map(move |n| f64::from(from + n * step).to_radians());
    let starts: Vec<Turn> = degrees(-50, 5, 21)
        .flat_map(|yaw| degrees(-40, 5, 17).map(move |roll| (yaw, roll)))
        .flat_map(|(yaw, roll)| [-8.0, -4.0, 0.0, 4.0, 8.0].map(|offset| [yaw, roll, offset]))
        .collect();
    let costs: Vec<f64> = starts.par_iter().map(|t| symmetry.cost(*t)).collect();
    let best = (0..costs.len()).fold(0, |best, n| if costs[n] < costs[best] { n } else { best });
    let turn = refine(starts[best], costs[best], |t| symmetry.cost(t));
    let normal = normal(turn);
    let point: [f64; 3] = core::array::from_fn(|a| symmetry.centroid[a] + normal[a] * turn[2]);
    Plane::new(Point::from_array(point), Vector::from_array(normal))
}

fn normal([yaw, roll, _]: Turn) -> [f64; 3] {
    [yaw.cos() * roll.cos(), yaw.sin() * roll.cos(), roll.sin()]
}

/// Pattern search with halving steps.
fn refine(mut turn: Turn, mut cost: f64, f: impl Fn(Turn) -> f64) -> Turn {
    let mut step = [2.5f64.to_radians(), 2.5f64.to_radians(), 2.0];
    while step[2] > 0.05 {
        let mut better = false;
        for (a, sign) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)] {
            let mut next = turn;
            next[a] += sign * step[a];
            let c = f(next);
            if c < cost {
                (turn, cost, better) = (next, c, true);
            }
        }
        if !better {
            step = step.map(|s| s / 2.0);
        }
    }
    turn
}

impl Symmetry {
    fn new(hu: &Raster<f32>, cavity: &Mask, lattice: Lattice) -> Option<Self> {
        let step = lattice.step as f32;
        let brightness = gaussian(&hu.map(|v| v.clamp(-20.0, 120.0)), 2.0 / lattice.step);
        let shape = distance_to_false(cavity)
            .zip(&distance_to(cavity), |i, o| SHAPE_WEIGHT * ((i - o) * step).clamp(-SHAPE_DEPTH, SHAPE_DEPTH));
        let points: Vec<[f64; 3]> = (0..cavity.data.len())
            .filter(|&n| cavity.data[n] && cavity.voxel(n).iter().all(|c| c % STRIDE == 0))
            .map(|n| lattice.point(cavity.voxel(n).map(|c| c as f64)).to_array())
            .collect();
        if points.is_empty() {
            return None;
        }
        let centroid = core::array::from_fn(|a| points.iter().map(|p| p[a]).sum::<f64>() / points.len() as f64);
        Some(Self { lattice, brightness, shape, points, centroid })
    }

    fn cost(&self, turn: Turn) -> f64 {
        let n = normal(turn);
        let mut sum = 0f64;
        for p in &self.points {
            let s: f64 = (0..3).map(|a| (p[a] - self.centroid[a]) * n[a]).sum::<f64>() - turn[2];
            // Each pair is compared once, from its left member.
            if s < 0.0 {
                continue;
            }
            let mirrored = Point::from_array(core::array::from_fn(|a| p[a] - 2.0 * s * n[a]));
            let (here, there) = (self.lattice.index(Point::from_array(*p)), self.lattice.index(mirrored));
            let light = (self.brightness.linear(here) - self.brightness.linear(there)).abs().min(LARGEST);
            let shape = (self.shape.linear(here) - self.shape.linear(there)).abs().min(LARGEST);
            sum += f64::from(light + shape);
        }
        sum / self.points.len() as f64 * 2.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turned_egg_shows_its_plane() {
        // By 12 and by 45 degrees of yaw.
        for normal in [[0.97, -0.2, 0.1], [0.68, 0.7, -0.2]] {
            shows_its_plane(Vector::from_array(normal));
        }
    }

    fn shows_its_plane(normal: Vector<Patient>) {
        let lattice = Lattice { origin: [-90.0, -100.0, -80.0], step: 2.0 };
        let truth = Plane::<Patient>::new(Point::new(3.0, 0.0, 0.0), normal).expect("plane");
        let forwards = Vector::new(-normal.y, normal.x, 0.0).normalized().expect("not upright");
        let mut hu = Raster::filled([90, 100, 80], -1000f32);
        let mut cavity = Mask::filled(hu.dims, false);
        for n in 0..hu.data.len() {
            let p = lattice.point(hu.voxel(n).map(|c| c as f64));
            let s = truth.signed_distance(p);
            let along = (p - truth.point) - truth.normal * s;
            // An egg, wider at the back, with one dark spot on one side only.
            let y = along.dot(forwards);
            let r = (s / 56.0).hypot(y / (77.0 + 0.1 * y)).hypot(along.z / 66.0);
            cavity.data[n] = r < 1.0;
            let spot = (s - 30.0).hypot(y).hypot(along.z) < 12.0;
            hu.data[n] = if r < 1.0 {
                if spot { 5.0 } else { 30.0 }
            } else if r < 1.1 {
                900.0
            } else {
                -1000.0
            };
        }
        let found = midplane(&hu, &cavity, lattice).expect("plane");
        assert!(found.normal.angle(truth.normal).to_degrees() < 1.0, "{found:?}");
        assert!(truth.signed_distance(found.project(Point::new(3.0, 0.0, 0.0))).abs() < 0.7);
    }
}
