//! Heads that end in a plane oblique to the slices: cut, turned and filled with air by another program.
//!
//! No skin is flat over as much as a palm: a ball of 140 mm radius, the flattest of a head, lies within [`THICK_MM`] on
//! both sides of a plane over 44 cm2.

use crate::check::TISSUE_HU;
use monro_geometry::{Patient, Point, Vector, Volume};

/// Cells of the search, mm.
const CELL_MM: f64 = 3.0;
/// What is seen in a cut through brain or muscle.
const SOFT_HU: core::ops::RangeInclusive<i16> = 0..=100;
/// The surface lies this near to its plane, mm, and faces this much the same way.
const THICK_MM: f64 = 2.5;
const ALIKE: f64 = 0.94;
/// A flat face of a head, mm2, and the share of soft tissue right behind one that is cut.
const LEAST_MM2: f64 = 7000.0;
const LEAST_SOFT: f64 = 0.3;
/// So far behind, mm.
const BEHIND_MM: f64 = 6.0;
/// Places that are tried, and rounds of fitting a plane to what lies near it.
const TRIED: usize = 400;
const ROUNDS: usize = 4;
/// What lies within this of a place tells which way its surface faces, mm.
const ABOUT_MM: f64 = 9.0;

/// Says so where the head ends in a large plane although the scan goes on.
pub(crate) fn finding(volume: &Volume<i16>) -> Option<String> {
    let cells = Cells::new(volume);
    let surface = cells.surface();
    let step = (surface.len() / TRIED).max(1);
    let planes = surface.iter().step_by(step).filter_map(|seed| face(&surface, seed));
    let largest = planes.filter(|f| cells.shows_soft_tissue(f)).max_by(|a, b| a.mm2.total_cmp(&b.mm2))?;
    let [x, y, z] = largest.middle.to_array();
    Some(format!(
        "the head ends in a flat face of {:.0} cm2 about ({x:.0}, {y:.0}, {z:.0}) mm, though the scan goes on: it seems to be \
         cut and filled with air by another program. Skin, landmarks and entry points near it are not to be trusted; take the \
         scan as it was before, or give the path with --plan",
        largest.mm2 / 100.0
    ))
}

/// A place of the surface, and the way out.
#[derive(Debug, Clone, Copy)]
struct Place {
    at: Point<Patient>,
    out: Vector<Patient>,
    mm2: f64,
}

/// A flat part of the surface.
#[derive(Debug, Clone)]
struct Face {
    middle: Point<Patient>,
    out: Vector<Patient>,
    mm2: f64,
    places: Vec<Point<Patient>>,
}

/// The flat part about a place, if it is large.
fn face(surface: &[Place], seed: &Place) -> Option<Face> {
    let (mut middle, mut out, mut found) = (seed.at, seed.out, Vec::new());
    for _ in 0..ROUNDS {
        let near = |p: &&Place| (p.at - middle).dot(out).abs() < THICK_MM && p.out.dot(out) > ALIKE;
        found = surface.iter().filter(near).collect();
        let all: f64 = found.iter().map(|p| p.mm2).sum();
        if all < LEAST_MM2 / 4.0 {
            return None;
        }
        middle = seed.at + found.iter().fold(Vector::ZERO, |s, p| s + (p.at - seed.at) * p.mm2) / all;
        out = tilted(out, found.iter().map(|p| p.at - middle))?;
    }
    let mm2: f64 = found.iter().map(|p| p.mm2).sum();
    (mm2 >= LEAST_MM2).then(|| Face { middle, out, mm2, places: found.iter().map(|p| p.at).collect() })
}

/// The normal of the plane that fits best to places about its middle, which `out` points at roughly: the ways out of single
/// places are drawn towards the axes.
fn tilted(out: Vector<Patient>, places: impl Iterator<Item = Vector<Patient>>) -> Option<Vector<Patient>> {
    let u = out.any_perpendicular()?;
    let v = out.cross(u);
    let [mut uu, mut uv, mut vv, mut uh, mut vh] = [0.0; 5];
    for p in places {
        let (a, b, height) = (p.dot(u), p.dot(v), p.dot(out));
        (uu, uv, vv, uh, vh) = (uu + a * a, uv + a * b, vv + b * b, uh + a * height, vh + b * height);
    }
    let all = uu * vv - uv * uv;
    let (slope_u, slope_v) = ((uh * vv - vh * uv) / all, (vh * uu - uh * uv) / all);
    (out - u * slope_u - v * slope_v).normalized()
}

/// The volume seen in cells of about [`CELL_MM`].
struct Cells<'a> {
    volume: &'a Volume<i16>,
    /// Voxels from cell to cell, and that in mm.
    stride: [usize; 3],
    size: [f64; 3],
    dims: [usize; 3],
    tissue: Vec<bool>,
}

impl<'a> Cells<'a> {
    fn new(volume: &'a Volume<i16>) -> Self {
        let (all, spacing) = (volume.grid().dims(), volume.grid().spacing());
        let stride = spacing.map(|s| ((CELL_MM / s).round() as usize).max(1));
        let dims: [usize; 3] = core::array::from_fn(|a| all[a].div_ceil(stride[a]));
        let mut tissue = Vec::with_capacity(dims.iter().product());
        for k in (0..all[2]).step_by(stride[2]) {
            for j in (0..all[1]).step_by(stride[1]) {
                tissue.extend((0..all[0]).step_by(stride[0]).map(|i| volume.at(i, j, k) > TISSUE_HU));
            }
        }
        let size = core::array::from_fn(|a| spacing[a] * stride[a] as f64);
        Self { volume, stride, size, dims, tissue }
    }

    /// Whether a cell is tissue; `None` beyond the volume.
    fn at(&self, v: [isize; 3]) -> Option<bool> {
        let mut place = [0; 3];
        for a in 0..3 {
            place[a] = usize::try_from(v[a]).ok().filter(|i| *i < self.dims[a])?;
        }
        Some(self.tissue[(place[2] * self.dims[1] + place[1]) * self.dims[0] + place[0]])
    }

    fn centre(&self, v: [isize; 3]) -> Point<Patient> {
        let grid = self.volume.grid();
        let index: [f64; 3] = core::array::from_fn(|a| v[a] as f64 * self.stride[a] as f64);
        grid.patient_from_voxel().point(Point::from_array(index))
    }

    /// Tissue beside air within the volume.
    fn surface(&self) -> Vec<Place> {
        let [nx, ny, nz] = self.dims.map(|d| d as isize);
        let sides = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];
        let mut out = Vec::new();
        for v in (0..nz).flat_map(|k| (0..ny).flat_map(move |j| (0..nx).map(move |i| [i, j, k]))) {
            let beside = |s: &[isize; 3]| self.at([v[0] + s[0], v[1] + s[1], v[2] + s[2]]) == Some(false);
            if self.at(v) == Some(true) && sides.iter().any(beside) {
                out.extend(self.place(v));
            }
        }
        out
    }

    /// The way out of the tissue about a cell: towards air, away from tissue.
    fn place(&self, v: [isize; 3]) -> Option<Place> {
        let own = self.centre(v);
        let mut sum = Vector::<Patient>::ZERO;
        let side = |a: usize| {
            let reach = (ABOUT_MM / self.size[a]).ceil() as isize;
            -reach..=reach
        };
        for d in side(2).flat_map(|k| side(1).flat_map(move |j| side(0).map(move |i| [i, j, k]))) {
            let other = [v[0] + d[0], v[1] + d[1], v[2] + d[2]];
            // Beyond the volume nothing is known: neither side.
            let way = self.centre(other) - own;
            match self.at(other) {
                _ if way.norm() > ABOUT_MM => {}
                Some(true) => sum -= way,
                Some(false) => sum += way,
                None => {}
            }
        }
        let out = sum.normalized()?;
        // A plane leaves of each cell that it crosses its cross-section: the most of it along one axis.
        let axes = [0, 1, 2].map(|a| {
            let axis = Vector::<Patient>::from_array(self.volume.grid().patient_from_voxel().linear.column(a));
            (axis.dot(out) / axis.norm()).abs()
        });
        let steepest = (0..3).fold(0, |best, a| if axes[a] > axes[best] { a } else { best });
        let mm2 = self.size.iter().product::<f64>() / self.size[steepest] / axes[steepest];
        Some(Place { at: own, out, mm2 })
    }

    /// Whether a face looks like a cut: soft tissue right behind it. Behind a table or a cushion there is none.
    fn shows_soft_tissue(&self, face: &Face) -> bool {
        let behind = |p: &&Point<Patient>| {
            self.volume.nearest(**p - face.out * BEHIND_MM).is_some_and(|hu| SOFT_HU.contains(&hu))
        };
        face.places.iter().filter(behind).count() as f64 >= LEAST_SOFT * face.places.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Grid;

    /// An ellipsoid of soft tissue with semi-axes of 70, 95 and 75 mm under 4 mm of skull, in air; on a table 150 mm wide.
    fn head(hidden: impl Fn([f64; 3]) -> bool, table: i16) -> Volume<i16> {
        let spacing = [1.1, 1.1, 2.5];
        let grid = Grid::axis_aligned(spacing.map(|s| (230.0 / s) as usize), spacing, [-115.0; 3]).expect("a grid");
        let hu = |n: usize| {
            let [i, j, k] = grid.voxel(n);
            let p = grid.centre(i, j, k).to_array();
            let r =
                |less: f64| -> f64 { p.iter().zip([70.0, 95.0, 75.0]).map(|(x, r)| (x / (r - less)).powi(2)).sum() };
            match () {
                () if hidden(p) => -1024,
                () if p[1] > 97.0 && p[1] < 105.0 && p[0].abs() < 75.0 => table,
                () if r(0.0) > 1.0 => -1000,
                () if r(5.0) > 1.0 || r(9.0) < 1.0 => 35,
                () => 900,
            }
        };
        Volume::new(grid, (0..grid.len()).map(hu).collect()).expect("as many values")
    }

    #[test]
    fn a_whole_head_on_a_table_has_no_flat_face() {
        assert_eq!(finding(&head(|_| false, -900)), None);
        assert_eq!(finding(&head(|_| false, -120)), None);
    }

    #[test]
    fn a_cut_oblique_to_the_slices_and_filled_with_air_was_taken_for_skin() {
        for out in [[0.3, 0.2, 0.93], [0.0, -0.6, -0.8], [0.1, 0.7, 0.7]] {
            let length = f64::hypot(f64::hypot(out[0], out[1]), out[2]);
            let depth = |p: [f64; 3]| p.iter().zip(out).map(|(x, o)| x * o).sum::<f64>() / length;
            let said =
                finding(&head(|p| depth(p) > 45.0, -900)).unwrap_or_else(|| panic!("no flat face towards {out:?}"));
            assert!(said.contains("flat face of"), "{said}");
        }
    }
}
