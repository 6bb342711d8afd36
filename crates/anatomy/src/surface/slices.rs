//! The shape between thick slices, interpolated through their signed distances (Raya and Udupa 1990).
//!
//! A part that the next slice has nothing of, the tip of a horn, ends half way to it, as its voxels do. Interpolated to a
//! slice whose outline is somewhere else, or that is empty, it would end right behind its own.

use super::even::Tap;
use super::outline::Outline;
use super::runs::kept;
use monro_geometry::DisjointSets;
use rayon::prelude::*;
use std::ops::Range;

/// One slice: signed distances in mm, positive inside, exact where the field depends on them, and where parts of it end before
/// the slice below and above.
struct Slice {
    distance: Vec<f32>,
    ends: [Vec<bool>; 2],
}

/// A stack of slices of partial values.
pub(super) struct Slices {
    slices: Vec<Slice>,
    step: f32,
    thickness: f32,
}

impl Slices {
    /// From the values of each slice, on cells of edge `step` (mm); slices are `thickness` mm apart.
    pub(super) fn new(planes: Vec<Vec<f32>>, dims: [usize; 2], step: f64, thickness: f64) -> Self {
        let outlines: Vec<Outline> = planes.into_par_iter().map(|plane| Outline::new(plane, dims)).collect();
        let parts: Vec<Vec<Run>> = outlines.par_iter().map(|outline| parts(outline.inside(), dims)).collect();
        let slices = (0..outlines.len()).into_par_iter().map(|k| {
            let beside = [k.wrapping_sub(1), k + 1].map(|n| outlines.get(n));
            Slice {
                distance: outlines[k].distances(beside, step, thickness),
                ends: beside.map(|other| ends(&parts[k], other.map(Outline::inside), dims)),
            }
        });
        let slices = slices.collect();
        Self { slices, step: step as f32, thickness: thickness as f32 }
    }

    /// The field between two slices by the weights of `tap`, whose first slice is number `tap.first - low`.
    pub(super) fn between(&self, tap: &Tap, low: usize, out: &mut [f32]) {
        let slice = |i: isize| usize::try_from(tap.first + i - low as isize).ok().and_then(|at| self.slices.get(at));
        let (step, t) = (self.step, tap.weights.get(1).copied().unwrap_or(0.0));
        let field = |below: f32, above: f32| (0.5 + (below + (above - below) * t) / step).clamp(0.0, 1.0);
        let nearest = [slice(0), slice(1)];
        if let [Some(below), Some(above)] = nearest
            && below.ends[1].is_empty()
            && above.ends[0].is_empty()
        {
            let both = below.distance.iter().zip(&above.distance);
            out.iter_mut().zip(both).for_each(|(o, (&b, &a))| *o = field(b, a));
            return;
        }
        let [below, above] = nearest;
        let ends =
            |slice: Option<&Slice>, side: usize, n: usize| slice.is_some_and(|s| s.ends[side].get(n) == Some(&true));
        for (n, out) in out.iter_mut().enumerate() {
            let mut d = nearest.map(|s| s.map_or(-self.thickness, |s| s.distance[n]));
            match [ends(below, 1, n), ends(above, 0, n)] {
                [true, false] => d[1] = -d[0].abs(),
                [false, true] => d[0] = -d[1].abs(),
                _ => {}
            }
            *out = field(d[0], d[1]);
        }
    }
}

/// Cells of a row side by side, by their places in the slice, and the part that they are of.
type Run = (Range<usize>, usize);

/// The connected parts of what is inside of a slice (cells that share an edge or a corner), run by run.
fn parts(inside: &[bool], dims: [usize; 2]) -> Vec<Run> {
    let mut sets = DisjointSets::new(0);
    // All runs, and where those of the row before begin.
    let (mut all, mut before) = (Vec::<Run>::new(), 0);
    for (j, row) in inside.chunks(dims[0]).enumerate() {
        let (here, first) = (all.len(), j * dims[0]);
        for run in kept(row, |inside| inside) {
            let (cells, own) = (first + run.start..first + run.end, sets.add());
            let meets = |b: &&Run| b.0.start <= cells.end - dims[0] && cells.start <= b.0.end + dims[0];
            all[before..here].iter().filter(meets).for_each(|b| sets.join(b.1 as u32, own));
            all.push((cells, own as usize));
        }
        before = here;
    }
    all.iter_mut().for_each(|run| run.1 = sets.root(run.1 as u32) as usize);
    all
}

/// Cells of parts that touch nothing that is inside of the next slice, and those beside them; empty where there are none.
fn ends(own: &[Run], next: Option<&[bool]>, dims: [usize; 2]) -> Vec<bool> {
    let mut goes_on = vec![false; own.len()];
    if let Some(next) = next {
        own.iter().for_each(|(cells, part)| goes_on[*part] |= next[cells.clone()].contains(&true));
    }
    if own.iter().all(|(_, part)| goes_on[*part]) {
        return Vec::new();
    }
    let (mut is_part, mut ending) = (vec![false; dims[0] * dims[1]], vec![false; dims[0] * dims[1]]);
    for (cells, part) in own {
        is_part[cells.clone()].fill(true);
        ending[cells.clone()].fill(!goes_on[*part]);
    }
    (0..ending.len()).map(|n| ending[n] || (!is_part[n] && around(n, dims).any(|m| ending[m]))).collect()
}

fn around(n: usize, [nx, ny]: [usize; 2]) -> impl Iterator<Item = usize> {
    let (i, j) = (n % nx, n / nx);
    let (across, along) = (i.saturating_sub(1)..=(i + 1).min(nx - 1), j.saturating_sub(1)..=(j + 1).min(ny - 1));
    along.flat_map(move |j| across.clone().map(move |i| j * nx + i))
}

#[cfg(test)]
mod tests {
    use crate::surface::even::{even, extent};
    use monro_geometry::{Grid, Point, Volume};

    /// The field of two rods along z side by side, one of which ends after half of eight slices of 6 mm.
    #[test]
    fn a_part_that_the_next_slice_has_nothing_of_ends_half_way_to_it() {
        let grid = Grid::axis_aligned([60, 20, 8], [1.0, 1.0, 6.0], [-29.5, -9.5, -21.0]).expect("grid");
        let rod = |p: Point<monro_geometry::Patient>, x: f64| (p.x - x).hypot(p.y) < 5.0;
        let inside = |at: usize| {
            let [i, j, k] = grid.voxel(at);
            let p = grid.centre(i, j, k);
            u8::from(rod(p, -18.0) || (rod(p, 18.0) && k < 4))
        };
        let labels = Volume::new(grid, (0..grid.len()).map(inside).collect()).expect("count");
        let keep = |l: u8| l == 1;
        let made = even(&labels, &keep, &extent(&labels, &keep).expect("some"), 1.2, 3).expect("field").field;
        let top = |x: f64| {
            let inner = |z: &f64| made.trilinear(Point::new(x, 0.0, *z)) > Some(0.5);
            (-300..300).map(|z| f64::from(z) * 0.1).filter(inner).fold(f64::NEG_INFINITY, f64::max)
        };
        // The short one ended at -2.8 mm, .2 above its last slice at -3 mm; its voxels end at 0.
        assert!((top(18.0) - 0.0).abs() < 0.7, "{}", top(18.0));
        assert!((top(-18.0) - 24.0).abs() < 0.7, "{}", top(-18.0));
        let sum: f64 = made.data().iter().map(|&v| f64::from(v)).sum::<f64>() * 1.2f64.powi(3);
        let voxels = labels.data().iter().filter(|&&l| l == 1).count() as f64 * 6.0;
        assert!((sum / voxels - 1.0).abs() < 0.03, "{sum} for {voxels}");
    }
}
