//! Where the last label, which has what the others leave, has no voxel near, the others share all there is.
//!
//! Fields of labels that are smoothed alike leave nothing there. But thin parts stay as the voxels have them, and where three or
//! four labels meet their wedges are thin: what is missing there counted as the last label's, up to its whole distance off.
//! So did a cleft as thin as a voxel, which stays in the field of the label around it and is closed in that of everything kept.

use super::fields::{ABSENT, COMMON, Field};
use monro_geometry::{Grid, Volume};
use rayon::prelude::*;
use std::ops::RangeInclusive;

/// Voxels of the last label within this many cells of the fields are near,
const NEAR: f64 = 2.0;
/// and so are those within this many voxels, where these are longer than cells.
const NEAR_VOXELS: f64 = 1.5;

/// What becomes of a cell in which something is left that is not the last label's.
#[derive(Debug, Clone, Copy)]
enum Left {
    /// The parts that have something there share it: what to multiply them by.
    Shared(f32),
    /// So much of it is a cleft that smoothing closed: it is filled by the part that has most in a cell beside it.
    Cleft { left: f32, beside: f32, part: usize },
}

/// A cell of the field of everything kept.
type Cell = ([isize; 3], Left);

impl Left {
    /// What one part shares is no cleft to another; of those beside a cleft the one with most is first.
    fn rank(self) -> (f32, usize) {
        match self {
            Self::Shared(_) => (f32::NEG_INFINITY, 0),
            Self::Cleft { beside, part, .. } => (-beside, part),
        }
    }

    /// What part `l` has there afterwards of what it had.
    fn of(self, l: usize, own: f32) -> f32 {
        match self {
            Self::Shared(factor) => own * factor,
            Self::Cleft { left, part, .. } if part == l => own + left,
            Self::Cleft { .. } => own,
        }
    }
}

/// Gives what is left in cells without any voxel near that `is_last` to the parts there, in proportion to what they have, and
/// where none has anything to the part beside them.
pub(super) fn give_away<T: Copy + Sync>(
    (labels, is_last): (&Volume<T>, &(impl Fn(T) -> bool + Sync)),
    union: &Field,
    (parts, fronts): (&mut [Field], &mut [Field]),
    step: f64,
) {
    let reach = labels.grid().spacing().map(|s| (NEAR * step / s).max(NEAR_VOXELS));
    let lookup = Lookup { labels, is_last, reach };
    let each = parts.par_iter().zip(&*fronts).enumerate();
    let mut cells: Vec<Cell> = each.map(|(l, field)| lookup.cells_without(union, l, field)).flatten_iter().collect();
    cells.sort_unstable_by(|(a, left), (b, other)| {
        let ((most, l), (next, m)) = (left.rank(), other.rank());
        a.cmp(b).then(most.total_cmp(&next)).then(l.cmp(&m))
    });
    cells.dedup_by_key(|c| c.0);
    parts.par_iter_mut().zip(fronts).enumerate().for_each(|(l, (own, front))| {
        let (offset, grid) = (union.offset_of(own), *own.volume().grid());
        for &(cell, left) in &cells {
            let Some(at) = inside(&grid, cell, offset) else { continue };
            let value = left.of(l, own.volume().data()[at]);
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
    /// Cells in which something is left although no voxel of the last label is near.
    fn cells_without(&self, union: &Field, part: usize, (own, front): (&Field, &Field)) -> Vec<Cell> {
        let (grid, offset) = (own.volume().grid(), union.offset_of(own));
        let values = own.volume().data().iter().zip(front.volume().data());
        let values = values.zip(beside(own));
        let left = values
            .map(|((&own, &front), beside)| (beside && own - front > ABSENT as f32).then_some((own, own - front)));
        let cell = |(at, left): (usize, Option<(f32, f32)>)| {
            let ((has, left), [i, j, k]) = (left?, grid.voxel(at));
            let p = self.labels.grid().voxel_from_patient().point(grid.centre(i, j, k)).to_array();
            if self.is_near(p) {
                return None;
            }
            let place = [i, j, k].map(|x| x as isize);
            let cell: [isize; 3] = std::array::from_fn(|a| place[a] + offset[a]);
            let whole = union.volume().data()[inside(union.volume().grid(), cell, [0; 3])?];
            let shared = Left::Shared(whole / (whole - left));
            let cleft = || Left::Cleft { left, beside: most_beside(own, [i, j, k]), part };
            Some((cell, if has > COMMON { shared } else { cleft() }))
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

/// Cells in which a field has a part, or in one beside: a superset at the borders of the box, where nothing is.
fn beside(own: &Field) -> Vec<bool> {
    let [nx, ny, _] = own.volume().grid().dims();
    let mut cells: Vec<bool> = own.volume().data().iter().map(|&v| v > COMMON).collect();
    for stride in [1, nx, nx * ny] {
        let before = cells.clone();
        let (low, high) = (&before[..before.len() - stride], &before[stride..]);
        cells[stride..].iter_mut().zip(low).for_each(|(c, &b)| *c |= b);
        cells.iter_mut().zip(high).for_each(|(c, &b)| *c |= b);
    }
    cells
}

/// The most that a field has in a cell and those around it.
fn most_beside(own: &Field, [i, j, k]: [usize; 3]) -> f32 {
    let (grid, data) = (own.volume().grid(), own.volume().data());
    let [is, js, ks] = [i, j, k].map(|x| x.saturating_sub(1)..=x + 1);
    let d = grid.dims();
    let within = |x: &usize, a: usize| *x < d[a];
    let rows = ks.filter(|k| within(k, 2)).flat_map(|k| js.clone().filter(|j| within(j, 1)).map(move |j| (j, k)));
    let cells = rows.flat_map(|(j, k)| is.clone().filter(|i| within(i, 0)).map(move |i| grid.index(i, j, k)));
    cells.map(|at| data[at]).fold(0.0, f32::max)
}

/// Voxels within `reach` of a place along an axis, in a row of `count`; at the ends the last ones.
fn around(at: f64, reach: f64, count: usize) -> RangeInclusive<usize> {
    let end = |x: f64| x.round().clamp(0.0, (count - 1) as f64) as usize;
    end(at - reach)..=end(at + reach)
}

#[cfg(test)]
mod tests {
    use crate::tetra::fields::LabelFields;
    use monro_geometry::{Grid, Volume};

    /// Where label 2, a block with a cleft of one voxel, lay 30 mm from label 1, the larger one, the cleft was the latter's.
    #[test]
    fn a_cleft_of_one_voxel_was_filled_with_a_label_far_away() {
        let grid = Grid::axis_aligned([70, 24, 24], [1.0; 3], [0.0; 3]).expect("grid");
        let label = |[i, j, k]: [usize; 3]| {
            let within = (4..20).contains(&j) && (4..20).contains(&k);
            match i {
                2..26 if within => 1u16,
                50..66 if within && (i != 58 || j < 8) => 2,
                _ => 0,
            }
        };
        let data = (0..grid.len()).map(|at| label(grid.voxel(at))).collect();
        let fields = LabelFields::new(&Volume::new(grid, data).expect("count"), &[1, 2]).expect("fields");
        assert_eq!(fields.labels, [2, 1]);
        for at in 0..grid.len() * 4 {
            let [i, j, k] = grid.voxel(at / 4);
            let p = [i as f64 + 0.25 * (at % 4) as f64, j as f64, k as f64];
            let found = fields.label_at(p).map(|l| fields.labels[l]);
            assert!(i < 40 || found != Some(1), "at {p:?}");
        }
        // What stays of the cleft is filled by what is around it.
        assert_eq!(fields.label_at([58.0, 7.0, 12.0]).map(|l| fields.labels[l]), Some(2));
    }
}
