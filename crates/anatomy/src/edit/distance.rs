//! Margins in millimetres, by exact distances between voxel centres.

use super::{EditError, Selection, check_positive_mm};
use crate::surface::distance::squared_distance;
use monro_geometry::Grid;

/// A box cut out of a selection, with a margin, as flags.
pub(super) struct Cut {
    pub(super) corner: [usize; 3],
    pub(super) dims: [usize; 3],
    pub(super) flags: Vec<bool>,
}

impl Cut {
    /// The box around a selection with `margin` voxels on each side, as far as the grid goes; `None` when empty.
    pub(super) fn new(selection: &Selection, margin: [usize; 3]) -> Option<Self> {
        let [low, high] = selection.bounds()?;
        let whole = selection.grid().dims();
        let corner: [usize; 3] = core::array::from_fn(|a| low[a].saturating_sub(margin[a]));
        let dims: [usize; 3] = core::array::from_fn(|a| (high[a] + margin[a]).min(whole[a] - 1) + 1 - corner[a]);
        let mut out = Self { corner, dims, flags: vec![false; dims.iter().product()] };
        for run in selection.runs() {
            let at = out.local(selection.grid().voxel(run.start));
            out.flags[at..at + run.end - run.start].fill(true);
        }
        Some(out)
    }

    /// Flat offset in the box of a voxel of the grid that lies in it.
    fn local(&self, voxel: [usize; 3]) -> usize {
        let [i, j, k] = [0, 1, 2].map(|a| voxel[a] - self.corner[a]);
        (k * self.dims[1] + j) * self.dims[0] + i
    }

    /// Flat offset in the grid of a flat offset in the box.
    pub(super) fn global(&self, grid: &Grid, local: usize) -> usize {
        let [i, j, k] =
            [local % self.dims[0], local / self.dims[0] % self.dims[1], local / (self.dims[0] * self.dims[1])];
        grid.index(i + self.corner[0], j + self.corner[1], k + self.corner[2])
    }

    /// The voxels of the box that pass a test on the flat offset in the box.
    pub(super) fn select(&self, grid: &Grid, test: impl Fn(usize) -> bool) -> Selection {
        let mut out = Selection::empty(*grid);
        for n in (0..self.flags.len()).filter(|&n| test(n)) {
            let voxel = self.global(grid, n);
            out.push(voxel, voxel + 1);
        }
        out
    }
}

/// Voxels to add on each side of a box so that `mm` fit in.
pub(super) fn margin(grid: &Grid, mm: f64) -> [usize; 3] {
    grid.spacing().map(|s| (mm / s).ceil() as usize + 1)
}

/// The voxels within `mm` of a selection (centre to centre), itself included.
///
/// # Errors
/// The margin is not positive.
pub fn grown(selection: &Selection, mm: f64) -> Result<Selection, EditError> {
    check_positive_mm("margin", mm)?;
    let grid = selection.grid();
    let Some(cut) = Cut::new(selection, margin(grid, mm)) else { return Ok(selection.clone()) };
    let square = squared_distance(&cut.flags, cut.dims, grid.spacing());
    Ok(cut.select(grid, |n| f64::from(square[n]) <= mm * mm * (1.0 + 1e-6)))
}

/// The voxels of a selection that are more than `mm` from every voxel outside it (centre to centre). The border of the
/// grid counts as inside.
///
/// # Errors
/// The margin is not positive.
pub fn shrunk(selection: &Selection, mm: f64) -> Result<Selection, EditError> {
    check_positive_mm("margin", mm)?;
    let grid = selection.grid();
    let Some(cut) = Cut::new(selection, [1; 3]) else { return Ok(selection.clone()) };
    let outside: Vec<bool> = cut.flags.iter().map(|&f| !f).collect();
    let square = squared_distance(&outside, cut.dims, grid.spacing());
    Ok(cut.select(grid, |n| f64::from(square[n]) > mm * mm * (1.0 + 1e-6)))
}
