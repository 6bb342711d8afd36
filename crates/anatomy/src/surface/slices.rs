//! The shape between thick slices, interpolated through their signed distances (Raya and Udupa 1990).
//!
//! A part that the next slice has nothing of, the tip of a horn, ends half way to it, as its voxels do. Interpolated to a
//! slice whose outline is somewhere else, or that is empty, it would end right behind its own.

use super::distance::squared_distance;
use super::even::Tap;
use rayon::prelude::*;

/// Distances are limited to this many slice thicknesses.
const FARTHEST: f32 = 4.0;

/// One slice: signed distances in mm, positive inside, and where parts of it end before the slice below and above.
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
        let parts: Vec<Vec<u32>> = planes.par_iter().map(|plane| parts(plane, dims)).collect();
        let none: Vec<u32> = Vec::new();
        let slices = planes.par_iter().enumerate().map(|(k, plane)| Slice {
            distance: signed_distance(plane, dims, step, thickness),
            ends: [k.wrapping_sub(1), k + 1].map(|n| ends(&parts[k], parts.get(n).unwrap_or(&none), dims)),
        });
        Self { slices: slices.collect(), step: step as f32, thickness: thickness as f32 }
    }

    /// The field between two slices by the weights of `tap`, whose first slice is number `tap.first - low`.
    pub(super) fn between(&self, tap: &Tap, low: usize) -> Vec<f32> {
        let slice = |i: isize| usize::try_from(tap.first + i - low as isize).ok().and_then(|at| self.slices.get(at));
        let field = |d: f32| (0.5 + d / self.step).clamp(0.0, 1.0);
        let ([below, above], t) = ([slice(0), slice(1)], tap.weights.get(1).copied().unwrap_or(0.0));
        let mix = |n: usize| {
            let mut d = [below, above].map(|s| s.map_or(-self.thickness, |s| s.distance[n]));
            let ending = [below.is_some_and(|s| s.ends[1][n]), above.is_some_and(|s| s.ends[0][n])];
            match ending {
                [true, false] => d[1] = -d[0].abs(),
                [false, true] => d[0] = -d[1].abs(),
                _ => {}
            }
            field(d[0] + (d[1] - d[0]) * t)
        };
        let size = self.slices.first().map_or(0, |s| s.distance.len());
        (0..size).map(mix).collect()
    }
}

/// The connected parts of a slice (cells that share an edge or a corner), numbered from 1; 0 outside.
fn parts(plane: &[f32], dims: [usize; 2]) -> Vec<u32> {
    let mut number = vec![0; plane.len()];
    let (mut count, mut stack) = (0, Vec::new());
    for first in 0..plane.len() {
        if plane[first] < 0.5 || number[first] != 0 {
            continue;
        }
        count += 1;
        number[first] = count;
        stack.push(first);
        while let Some(n) = stack.pop() {
            for m in around(n, dims).filter(|&m| plane[m] >= 0.5) {
                if number[m] == 0 {
                    number[m] = count;
                    stack.push(m);
                }
            }
        }
    }
    number
}

/// Cells of parts that touch nothing of the next slice's, and those beside them.
fn ends(own: &[u32], next: &[u32], dims: [usize; 2]) -> Vec<bool> {
    let count = own.iter().copied().max().unwrap_or(0) as usize;
    let mut goes_on = vec![false; count + 1];
    own.iter().zip(next).filter(|(_, n)| **n != 0).for_each(|(&o, _)| goes_on[o as usize] = true);
    let ending = |n: usize| own[n] != 0 && !goes_on[own[n] as usize];
    if goes_on[1..].iter().all(|&g| g) {
        return vec![false; own.len()];
    }
    (0..own.len()).map(|n| ending(n) || (own[n] == 0 && around(n, dims).any(ending))).collect()
}

fn around(n: usize, [nx, ny]: [usize; 2]) -> impl Iterator<Item = usize> {
    let (i, j) = (n % nx, n / nx);
    let (across, along) = (i.saturating_sub(1)..=(i + 1).min(nx - 1), j.saturating_sub(1)..=(j + 1).min(ny - 1));
    along.flat_map(move |j| across.clone().map(move |i| j * nx + i))
}

/// Signed distance in mm (positive inside) to the outline of a slice of partial values; in a slice without the set minus
/// one thickness.
fn signed_distance(plane: &[f32], dims: [usize; 2], step: f64, thickness: f64) -> Vec<f32> {
    let inside: Vec<bool> = plane.iter().map(|&m| m >= 0.5).collect();
    if !inside.contains(&true) {
        // What little is there (below half a cell everywhere) keeps its partial value near the outline.
        return plane.iter().map(|&m| if m > 0.0 { (m - 0.5) * step as f32 } else { -thickness as f32 }).collect();
    }
    let outside: Vec<bool> = inside.iter().map(|&i| !i).collect();
    let dims3 = [dims[0], dims[1], 1];
    let (to_in, to_out) = (squared_distance(&inside, dims3, [step; 3]), squared_distance(&outside, dims3, [step; 3]));
    let limit = FARTHEST * thickness as f32;
    let (one, half) = ((step * step * 1.01) as f32, 0.5 * step as f32);
    let value = |n: usize| {
        let (sign, squared) = if inside[n] { (1.0, to_out[n]) } else { (-1.0, to_in[n]) };
        // Next to the outline the partial value says where in the cell it runs.
        let d = if squared <= one { (plane[n] - 0.5) * step as f32 } else { sign * (squared.sqrt() - half) };
        d.clamp(-limit, limit)
    };
    (0..plane.len()).map(value).collect()
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
