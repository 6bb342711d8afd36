//! Where the last label, which has what the others leave, has no voxel near, the others share all there is.
//!
//! Fields of labels that are smoothed alike leave nothing there. But thin parts stay as the voxels have them, and where three or
//! four labels meet their wedges are thin: what is missing there counted as the last label's, up to its whole distance off.

use super::fields::{ABSENT, COMMON, Field};
use monro_geometry::{Grid, Volume};
use rayon::prelude::*;
use std::ops::RangeInclusive;

/// Voxels of the last label within this many cells of the fields are near,
const NEAR: f64 = 2.0;
/// and so are those within this many voxels, where these are longer than cells.
const NEAR_VOXELS: f64 = 1.5;

/// A cell of the field of everything kept, and what to multiply the parts by that have something there.
type Cell = ([isize; 3], f32);

/// Gives what is left in cells without any voxel near that `is_last` to the parts there, in proportion to what they have.
pub(super) fn give_away<T: Copy + Sync>(
    (labels, is_last): (&Volume<T>, &(impl Fn(T) -> bool + Sync)),
    union: &Field,
    (parts, fronts): (&mut [Field], &mut [Field]),
    step: f64,
) {
    let lookup = Lookup { labels, is_last, reach: labels.grid().spacing().map(|s| (NEAR * step / s).max(NEAR_VOXELS)) };
    let each = parts.par_iter().zip(&*fronts).map(|(own, front)| lookup.cells_without(union, own, front));
    let mut cells: Vec<Cell> = each.flatten_iter().collect();
    cells.sort_unstable_by_key(|c| c.0);
    cells.dedup_by_key(|c| c.0);
    parts.par_iter_mut().zip(fronts).for_each(|(own, front)| {
        let (offset, grid) = (union.offset_of(own), *own.volume().grid());
        for &(cell, factor) in &cells {
            let Some(at) = inside(&grid, cell, offset) else { continue };
            let value = own.volume().data()[at] * factor;
            own.volume_mut().data_mut()[at] = value;
            // Nothing remains there.
            front.volume_mut().data_mut()[at] = value;
        }
    });
}

/// Index in a grid of a cell of the field of everything kept, given where the grid begins in that; `None` outside.
fn inside(grid: &Grid, cell: [isize; 3], offset: [isize; 3]) -> Option<usize> {
    let d = grid.dims();
    let [i, j, k] = [0, 1, 2].map(|a| usize::try_from(cell[a] - offset[a]).ok().filter(|&x| x < d[a]));
    Some(grid.index(i?, j?, k?))
}

struct Lookup<'a, T, F> {
    labels: &'a Volume<T>,
    is_last: &'a F,
    /// How many voxels along each axis are near.
    reach: [f64; 3],
}

impl<T: Copy, F: Fn(T) -> bool> Lookup<'_, T, F> {
    /// Cells in which a part has something, and something is left although no voxel of the last label is near.
    fn cells_without(&self, union: &Field, own: &Field, front: &Field) -> Vec<Cell> {
        let (grid, offset) = (own.volume().grid(), union.offset_of(own));
        let values = own.volume().data().iter().zip(front.volume().data());
        let left = values.map(|(&own, &front)| (own > COMMON && own - front > ABSENT as f32).then_some(own - front));
        let cell = |(at, left): (usize, Option<f32>)| {
            let (left, [i, j, k]) = (left?, grid.voxel(at));
            let place = [i, j, k].map(|x| x as isize);
            let cell: [isize; 3] = std::array::from_fn(|a| place[a] + offset[a]);
            let whole = union.volume().data()[inside(union.volume().grid(), cell, [0; 3])?];
            let p = self.labels.grid().voxel_from_patient().point(grid.centre(i, j, k)).to_array();
            (!self.is_near(p)).then_some((cell, whole / (whole - left)))
        };
        left.enumerate().filter_map(cell).collect()
    }

    /// Whether a voxel of the last label is near a place in the volume, in voxels.
    fn is_near(&self, p: [f64; 3]) -> bool {
        let (grid, data) = (self.labels.grid(), self.labels.data());
        let [is, js, ks] = [0, 1, 2].map(|a| around(p[a], self.reach[a], grid.dims()[a]));
        ks.into_iter().any(|k| {
            js.clone().any(|j| {
                data[grid.index(*is.start(), j, k)..=grid.index(*is.end(), j, k)].iter().any(|&l| (self.is_last)(l))
            })
        })
    }
}

/// Voxels within `reach` of a place along an axis, in a row of `count`; at the ends the last ones.
fn around(at: f64, reach: f64, count: usize) -> RangeInclusive<usize> {
    let end = |x: f64| x.round().clamp(0.0, (count - 1) as f64) as usize;
    end(at - reach)..=end(at + reach)
}
