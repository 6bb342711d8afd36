//! Where the scan ends above the brain: that end is no skull, and says nothing about how deep a place lies.

use super::lattice::Lattice;
use crate::image::{Mask, Raster, distance_to_false};

/// Smoothing across the end of the data makes the last layers look like air; bone with skin on it is thicker, voxels.
pub(crate) const LAST_LAYERS: usize = 2;
/// A smaller opening (mm2) hardly changes depths.
const LEAST_OPENING: f64 = 2000.0;
/// How high the missing vault may rise over the cut, mm: at the most as much as half a large head.
const RISES: [f64; 7] = [0.0, 12.0, 24.0, 36.0, 48.0, 60.0, 72.0];

/// The columns of a raster (`i + nx * j`) in which the scan ends before the brain does; `None` when they are few.
pub(crate) fn open_columns(cavity: &Mask, nodata: &Mask, step: f64) -> Option<Vec<bool>> {
    let sheet = cavity.dims[0] * cavity.dims[1];
    let open = |column: usize| {
        let top = (0..cavity.dims[2]).rev().find(|k| !nodata.data[k * sheet + column]);
        top.is_some_and(|k| (k.saturating_sub(LAST_LAYERS)..=k).any(|k| cavity.data[k * sheet + column]))
    };
    let columns: Vec<bool> = (0..sheet).map(open).collect();
    let area = columns.iter().filter(|o| **o).count() as f64 * step * step;
    (area >= LEAST_OPENING).then_some(columns)
}

/// The columns of blocks of `factor` voxels: open where any of the block is.
pub(crate) fn open_in_block(columns: &[bool], [nx, ny, _]: [usize; 3], factor: usize) -> Vec<bool> {
    let width = nx.div_ceil(factor);
    let mut out = vec![false; width * ny.div_ceil(factor)];
    for (n, _) in columns.iter().enumerate().filter(|(_, o)| **o) {
        out[n / nx / factor * width + n % nx / factor] = true;
    }
    out
}

/// Depth (voxels) in the space inside the skull, the open columns going on upwards without end.
pub(crate) fn depth(space: &Mask, open: Option<&[bool]>) -> Raster<f32> {
    match open {
        None => distance_to_false(space),
        Some(open) => distance_to_false(&raised(space, open, space.dims[2])).zip(space, |d, s| if s { d } else { 0.0 }),
    }
}

/// Depth (mm) in the space inside the skull, and the depths below vaults of several heights imagined over the cut; without
/// a cut, that depth alone.
pub(crate) fn depths(space: &Mask, open: Option<&[bool]>, lattice: Lattice) -> (Raster<f32>, Vec<Raster<f32>>) {
    let own = depth(space, open).map(|d| d * lattice.step as f32);
    let vaults = open.map_or_else(|| vec![own.clone()], |open| vaults(space, open, lattice));
    (own, vaults)
}

fn vaults(space: &Mask, open: &[bool], lattice: Lattice) -> Vec<Raster<f32>> {
    let in_mm = |mask: &Mask| distance_to_false(mask).map(|d| d * lattice.step as f32);
    let most = (RISES[RISES.len() - 1] / lattice.step).ceil() as usize + 1;
    let sheet = space.dims[0] * space.dims[1];
    let mut roomy = space.clone();
    roomy.dims[2] += most;
    roomy.data.resize(roomy.data.len() + most * sheet, false);
    RISES.iter().map(|rise| in_mm(&raised(&roomy, open, (rise / lattice.step) as usize))).collect()
}

/// The space with its open columns going on upwards by some voxels.
fn raised(space: &Mask, open: &[bool], by: usize) -> Mask {
    let (sheet, height) = (space.dims[0] * space.dims[1], space.dims[2]);
    let mut out = space.clone();
    for column in (0..sheet).filter(|c| open[*c]) {
        let Some(top) = (0..height).rev().find(|k| space.data[k * sheet + column]) else { continue };
        for k in top + 1..(top + 1).saturating_add(by).min(height) {
            out.data[k * sheet + column] = true;
        }
    }
    out
}
