//! Blood in the ventricles: denser than brain where the model expects fluid.

use super::lattice::Lattice;
use super::tissue::median;
use crate::image::{Mask, Raster, label, open};

/// Clotted blood over brain, HU: grey nuclei stay below, calcium lies above.
const OVER_BRAIN: core::ops::Range<f32> = 15.0..75.0;
/// From here on it looks like blood fully, HU over brain.
const FULLY: f32 = 25.0;
/// Less than this deep in the brain is choroid plexus, a vein or the falx, mL.
const LEAST_ML: f64 = 2.0;
/// What is denser than brain so deep below the inner skull is no sinus, mm.
const DEEP: f32 = 14.0;
/// The model must fit better with blood than without by this.
const BETTER: f64 = 0.08;
/// Blood farther from the course of the ventricles is in the brain, mm at the model's size.
const REACH: f64 = 14.0;
/// Less in one ventricle is not worth a word, mL.
const LEAST_TOLD_ML: f64 = 0.5;

/// Blood deep in the brain.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Blood {
    /// mL.
    pub(crate) deep_ml: f64,
    /// Whether the ventricles' course runs through it.
    pub(crate) on_course: bool,
}

/// How much a value looks like blood: 0 brain, 1 blood.
pub(crate) fn like(hu: f32, brain: f32) -> f32 {
    if hu - brain > OVER_BRAIN.end {
        0.0
    } else {
        ((hu - brain - OVER_BRAIN.start) / (FULLY - OVER_BRAIN.start)).clamp(0.0, 1.0)
    }
}

/// Volume (mL) deep in the brain that may be blood, when it is enough to be told; `depth` in mm.
pub(crate) fn deep(hu: &Raster<f32>, depth: &Raster<f32>, lattice: Lattice, brain: f32) -> Option<f64> {
    let dense = hu.zip(depth, |v, d| d > DEEP && like(v, brain) > 0.0);
    // Plexus, veins and vessels are thinner than two voxels of 2 mm.
    let ml = open(&dense, 1.0).count() as f64 * lattice.step.powi(3) / 1000.0;
    (ml >= LEAST_ML).then_some(ml)
}

/// Less of it between bone and brain may be sinuses and what bone brightens, mL.
const LEAST_LAYER_ML: f64 = 25.0;
/// So near to the bone, beyond the length of a voxel, its brightness may be bone's, mm: the vault's slope runs through several
/// voxels of thick slices. And half the thickness of a layer that is no sinus wall or dura, mm.
const RIM: f32 = 1.0;
const HALF_LAYER: f32 = 2.0;

/// Volume (mL) of the largest piece between bone and brain that may be blood, when it is enough to be told; `depth` and the
/// longest side of the scan's voxels in mm.
pub(crate) fn layer(
    hu: &Raster<f32>,
    depth: &Raster<f32>,
    (lattice, longest): (Lattice, f64),
    brain: f32,
) -> Option<f64> {
    let rim = RIM + longest as f32;
    let dense = hu.zip(depth, |v, d| d > rim && d <= DEEP && like(v, brain) > 0.0);
    let parts = label(&open(&dense, HALF_LAYER / lattice.step as f32));
    let ml = parts.sizes.iter().skip(1).max().map_or(0.0, |&n| n as f64 * lattice.step.powi(3) / 1000.0);
    (ml >= LEAST_LAYER_ML).then_some(ml)
}

/// Whether the model's score with blood is worth more than that without.
pub(crate) fn better(with: f64, without: f64) -> bool {
    with > without + BETTER
}

/// Blood along the course of the ventricles, on the crop.
#[derive(Debug)]
pub(crate) struct Clot {
    pub(crate) mask: Mask,
    /// HU.
    pub(crate) level: f32,
}

/// The clot of voxels denser than half way from brain to it; `course` is the distance to the model's course (mm), `scale`
/// the model's size.
pub(crate) fn clot(hu: &Raster<f32>, cavity: &Mask, course: &Raster<f32>, (brain, scale): (f32, f64)) -> Option<Clot> {
    let reach = (REACH * scale) as f32;
    let near = course.zip(cavity, |d, c| c && d < reach);
    let mut values: Vec<f32> = (0..hu.data.len())
        .filter(|&n| near.data[n] && OVER_BRAIN.contains(&(hu.data[n] - brain)))
        .map(|n| hu.data[n])
        .collect();
    if values.is_empty() {
        return None;
    }
    let level = median(&mut values);
    let dense = (brain + level) / 2.0..brain + OVER_BRAIN.end;
    let mask = open(&near.zip(hu, |n, v| n && dense.contains(&v)), 1.0);
    Some(Clot { mask, level })
}

/// What the reader is told: the blood in each ventricle by its name and mL, or what is dense and in none.
pub(crate) fn findings(blood: Option<Blood>, level: f32, inside: &[(&str, f64)]) -> Vec<String> {
    let Some(blood) = blood else { return Vec::new() };
    let told = inside.iter().filter(|(_, ml)| *ml > LEAST_TOLD_ML);
    let told: Vec<String> = told
        .map(|(name, ml)| format!("hyperdense ({level:.0} HU, {ml:.1} mL): blood in the {name}? check its border"))
        .collect();
    if !told.is_empty() {
        return told;
    }
    let ml = blood.deep_ml;
    vec![format!("hyperdense ({ml:.0} mL deep in the brain): blood in or beside a ventricle? check left and right")]
}
