//! Cerebrospinal fluid outside the ventricles: cisterns, fissures, the space under the skull, wide sulci.

use super::tissue::brain_mode;
use crate::image::{Mask, Raster, distance_to_false, gaussian, label};

/// Voxels this near to the wall of the cavity hold bone or dura too and say nothing about fluid, mm.
const DIMMED: f32 = 1.0;
/// Smoothing against noise, voxels of 1 mm, little, since sulci are narrow; only over voxels inside the cavity that bone
/// does not dim. Islands of what noise is left are too small to be kept.
const SMOOTHING: f64 = 0.7;
/// Depth below the bone at which the cortex lies, mm.
const CORTEX: core::ops::Range<f32> = 3.0..8.0;
/// It is brighter than the brain's mode by no more than this, HU: what is lies on the brain and is blood.
const MOST_OVER_BRAIN: f32 = 8.0;
/// Islands smaller than this (voxels of 1 mm) are noise or sulci too narrow to be told from it.
const LEAST_ISLAND: usize = 60;

/// A field whose inside (positive) is fluid: what is nearer in HU to fluid than to the cortex, which is brighter than the
/// brain's mode `brain`; `edge` is half way to that. Right under the bone the
/// nearest voxels that bone does not dim decide; what bone brightens to the level of brain is lost. Scraps of brain that fluid cuts off are counted to it.
pub(crate) fn csf(hu: &Raster<f32>, cavity: &Mask, (fluid, edge, brain): (f32, f32, f32)) -> Raster<f32> {
    let depth = distance_to_false(cavity);
    let cortex = brain_mode(&gaussian(hu, 1.0), |n| cavity.data[n] && CORTEX.contains(&depth.data[n]));
    let edge = edge.max((fluid + cortex.min(brain + MOST_OVER_BRAIN)) / 2.0);
    let value = undimmed(hu, cavity, &depth);
    let dark = value.zip(cavity, |v, c| c && v < edge);
    let parts = label(&dark);
    let kept = parts.keep(|l| parts.sizes[l as usize] >= LEAST_ISLAND);
    let pieces = label(&cavity.minus(&kept));
    let main = (1..pieces.sizes.len()).max_by_key(|&l| pieces.sizes[l]).unwrap_or(0);
    let scraps = pieces.keep(|l| l as usize != main && pieces.sizes[l as usize] < LEAST_ISLAND);
    let mut field = value.map(|v| ((edge - v) / (edge - fluid)).clamp(-0.5, 1.0));
    for n in 0..field.data.len() {
        if scraps.data[n] {
            field.data[n] = 0.5;
        } else if !kept.data[n] {
            field.data[n] = field.data[n].min(0.0);
        }
    }
    field
}

/// The smoothed scan from voxels that bone does not dim; where there are none near, very bright.
fn undimmed(hu: &Raster<f32>, cavity: &Mask, depth: &Raster<f32>) -> Raster<f32> {
    const BRIGHT: f32 = 1000.0;
    let counts = |n: usize| cavity.data[n] && depth.data[n] > DIMMED;
    let mut weights = Raster::filled(hu.dims, 0f32);
    let mut sums = weights.clone();
    for n in (0..weights.data.len()).filter(|&n| counts(n)) {
        (weights.data[n], sums.data[n]) = (1.0, hu.data[n]);
    }
    let (weights, sums) = (gaussian(&weights, SMOOTHING), gaussian(&sums, SMOOTHING));
    sums.zip(&weights, |s, w| if w > 0.02 { s / w } else { BRIGHT })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Brain in a ball of bone with a layer of fluid between them.
    fn head(layer: f64) -> (Raster<f32>, Mask) {
        let mut hu = Raster::filled([60, 60, 60], 0f32);
        for n in 0..hu.data.len() {
            let [i, j, k] = hu.voxel(n).map(|c| c as f64 - 29.7);
            let r = i.hypot(j).hypot(k);
            hu.data[n] = if r > 25.0 {
                900.0
            } else if r > 25.0 - layer {
                6.0
            } else {
                30.0
            };
        }
        let hu = gaussian(&hu, 0.6);
        let mut cavity = Mask::filled(hu.dims, false);
        for n in 0..cavity.data.len() {
            let [i, j, k] = cavity.voxel(n).map(|c| c as f64 - 29.7);
            cavity.data[n] = i.hypot(j).hypot(k) < 25.0;
        }
        (hu, cavity)
    }

    #[test]
    fn a_wide_space_under_the_skull_is_found_and_none_where_there_is_none() {
        let (hu, cavity) = head(6.0);
        let found = csf(&hu, &cavity, (6.0, 18.0, 30.0)).map(|f| f > 0.0).and(&cavity).count() as f64;
        let truth = 4.0 / 3.0 * core::f64::consts::PI * (25f64.powi(3) - 19f64.powi(3));
        // The film next to the bone is as bright as brain and is lost; nothing is made up.
        assert!((0.6..1.02).contains(&(found / truth)), "{found} of {truth}");
        let (hu, cavity) = head(0.0);
        assert_eq!(csf(&hu, &cavity, (6.0, 18.0, 30.0)).map(|f| f > 0.0).count(), 0);
    }

    #[test]
    fn blood_under_the_skull_was_taken_for_cortex_and_the_brain_for_fluid() {
        let (mut hu, cavity) = head(8.0);
        // Blood of 65 HU where the fluid was, and brain of 24 to 36 HU.
        for n in 0..hu.data.len() {
            let v = &mut hu.data[n];
            *v = if *v < 18.0 {
                65.0
            } else if *v < 100.0 {
                24.0 + (n % 13) as f32
            } else {
                *v
            };
        }
        assert_eq!(csf(&hu, &cavity, (6.0, 18.0, 30.0)).map(|f| f > 0.0).and(&cavity).count(), 0);
    }
}
