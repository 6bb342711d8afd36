//! Cerebrospinal fluid outside the ventricles.

use super::ventricles::Ventricles;
use crate::image::{Mask, Raster, distance_to_false, label};

/// Dura and the thinnest film of fluid under the bone, mm.
const FILM: f32 = 1.0;
/// Islands smaller than this (voxels of 1 mm) are noise or sulci too narrow to matter.
const LEAST_ISLAND: usize = 60;

/// Clear fluid spaces: darker than the edge in the scan smoothed by 1.5 voxels, without small islands; the film under the
/// bone; and scraps of brain cut off by fluid. The rest of the cavity is brain (or ventricle).
pub(crate) fn csf(smoother: &Raster<f32>, cavity: &Mask, ventricles: &Ventricles) -> Mask {
    let dark = smoother.zip(cavity, |v, c| c && v < ventricles.edge);
    let parts = label(&dark);
    let depth = distance_to_false(cavity);
    let mut fluid = parts.keep(|l| parts.sizes[l as usize] >= LEAST_ISLAND);
    for n in 0..fluid.data.len() {
        fluid.data[n] |= cavity.data[n] && depth.data[n] <= FILM;
    }
    let brain = cavity.minus(&fluid);
    let pieces = label(&brain);
    let main = (1..pieces.sizes.len()).max_by_key(|&l| pieces.sizes[l]).unwrap_or(0);
    let scraps = pieces.keep(|l| l as usize != main && pieces.sizes[l as usize] < LEAST_ISLAND);
    fluid.or(&scraps)
}
