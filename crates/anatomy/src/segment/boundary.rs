//! Where between the voxels the surface of a ventricle runs.
//!
//! A voxel that is half fluid and half brain has half of their difference in HU. Two things push the half-way level off
//! the true surface. Brain and fluid are not the same everywhere, so both levels are measured nearby. And smoothing
//! pulls the level inwards where the surface is curved and narrow parts lose contrast; how much follows from smoothing
//! the shape itself, and is given back (the residual step of van Cittert's iterative deconvolution, applied to the
//! shape and not to the noise).

use crate::image::{Mask, Raster, distance_to, distance_to_false, gaussian};

/// Smoothing of the scan that the ventricles are found in, voxels of 1 mm.
pub(crate) const SMOOTHING: f64 = 1.0;
/// What is left of it after the correction: enough to keep noise out.
const REMAINS: f64 = 0.5;
const ROUNDS: usize = 2;
/// Slope of a smoothed step at its middle, parts of the step per voxel: 1 / (sqrt(2 pi) 1.25), with the scan's own blur.
const SLOPE: f32 = 0.32;
/// Brain that tells the local level lies this far from the ventricle, mm: beyond the partial volume.
const SHELL: std::ops::RangeInclusive<f32> = 2.5..=7.0;
/// Fluid that tells the local level lies at least this deep, mm.
const CORE: f32 = 2.0;
/// Reach of the local means (standard deviation, voxels), and the least weight that is trusted.
const REACH: f64 = 5.0;
const LEAST_WEIGHT: f32 = 0.01;

/// What the surface is sought in; all rasters have the same size.
#[derive(Debug)]
pub(crate) struct Evidence<'a> {
    /// The scan smoothed by [`SMOOTHING`], HU.
    pub(crate) hu: &'a Raster<f32>,
    pub(crate) cavity: &'a Mask,
    /// Number of the ventricle, or 0.
    pub(crate) classes: &'a Raster<u8>,
    /// Whether a voxel's fluid belongs to something that is no ventricle.
    pub(crate) elsewhere: &'a Mask,
    /// Modes of fluid and brain of the whole scan, HU.
    pub(crate) fluid: f32,
    pub(crate) brain: f32,
}

impl Evidence<'_> {
    fn edge(&self) -> f32 {
        (self.fluid + self.brain) / 2.0
    }

    /// A field whose zero is the surface: 0.5 or more deep inside, negative outside.
    pub(crate) fn field(&self) -> Raster<f32> {
        let near = distance_to(&self.classes.map(|c| c > 0));
        let dark = self.darkness(&near);
        let mut field = dark.clone();
        for _ in 0..ROUNDS {
            let shape = field.zip(self.classes, |f, _| (0.5 + f / SLOPE).clamp(0.0, 1.0));
            let shape = self.limited(&shape, &near);
            let (sharp, blurred) = (gaussian(&shape, REMAINS), gaussian(&shape, SMOOTHING));
            for n in 0..field.data.len() {
                field.data[n] = dark.data[n] + sharp.data[n] - blurred.data[n];
            }
        }
        for n in 0..field.data.len() {
            let inside = self.classes.data[n] > 0;
            field.data[n] = if inside && self.hu.data[n] >= self.edge() {
                // Filled choroid plexus is inside although bright.
                0.5
            } else if inside || near.data[n] <= 1.5 && self.cavity.data[n] && !self.elsewhere.data[n] {
                (2.0 * field.data[n]).clamp(-0.5, 1.0)
            } else {
                -0.5
            };
        }
        field
    }

    /// Part of fluid in each voxel, less a half.
    fn darkness(&self, near: &Raster<f32>) -> Raster<f32> {
        let deep = distance_to_false(&self.classes.map(|c| c > 0));
        let edge = self.edge();
        let shell = |n: usize| {
            self.cavity.data[n] && self.classes.data[n] == 0 && SHELL.contains(&near.data[n]) && self.hu.data[n] > edge
        };
        let core = |n: usize| deep.data[n] >= CORE && self.hu.data[n] < edge;
        let brain = self.local(shell, self.brain);
        let fluid = self.local(core, self.fluid);
        let mut out = self.hu.clone();
        for n in 0..out.data.len() {
            let (b, f) = (brain.data[n], fluid.data[n]);
            out.data[n] = ((b - out.data[n]) / (b - f).max(0.5 * (self.brain - self.fluid))).clamp(-0.5, 1.5) - 0.5;
        }
        out
    }

    /// Mean of the voxels of a set around each voxel; `usual` where there are too few.
    fn local(&self, belongs: impl Fn(usize) -> bool, usual: f32) -> Raster<f32> {
        let mut weights = Raster::filled(self.hu.dims, 0f32);
        let mut sums = weights.clone();
        for n in (0..weights.data.len()).filter(|&n| belongs(n)) {
            (weights.data[n], sums.data[n]) = (1.0, self.hu.data[n]);
        }
        let (weights, sums) = (gaussian(&weights, REACH), gaussian(&sums, REACH));
        sums.zip(&weights, |s, w| if w > LEAST_WEIGHT { s / w } else { usual })
    }

    /// The shape without fluid that is no ventricle's; filled choroid counts.
    fn limited(&self, shape: &Raster<f32>, near: &Raster<f32>) -> Raster<f32> {
        let mut out = shape.clone();
        for n in 0..out.data.len() {
            let inside = self.classes.data[n] > 0;
            if inside && self.hu.data[n] >= self.edge() {
                out.data[n] = 1.0;
            } else if !inside && near.data[n] > 1.5 {
                out.data[n] = 0.0;
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A capsule of fluid beside brain whose HU rises from left to right, smoothed as the scan is; and its true volume.
    fn capsule(radius: f64) -> (Raster<f32>, f64) {
        const FINE: i32 = 4;
        let mut hu = Raster::filled([48, 30, 30], 0f32);
        for n in 0..hu.data.len() {
            let v = hu.voxel(n).map(|c| c as f64);
            let brain = 28.0 + 6.0 * v[0] / 48.0;
            let mut share = 0.0;
            for s in 0..FINE.pow(3) {
                let sub = |d: i32| (f64::from(s / FINE.pow(d as u32) % FINE) + 0.5) / f64::from(FINE) - 0.5;
                let x = (v[0] + sub(0)).clamp(14.0, 34.0) - (v[0] + sub(0));
                let off = x.hypot(v[1] + sub(1) - 14.6).hypot(v[2] + sub(2) - 15.3);
                share += if off < radius { 1.0 / f64::from(FINE.pow(3)) } else { 0.0 };
            }
            hu.data[n] = (brain + share * (6.0 - brain)) as f32;
        }
        let volume = core::f64::consts::PI * radius * radius * (20.0 + 4.0 / 3.0 * radius);
        (gaussian(&hu, SMOOTHING), volume)
    }

    /// Volume of a field's inside by fine sampling.
    fn volume(field: &Raster<f32>) -> f64 {
        const FINE: usize = 3;
        let mut count = 0usize;
        for n in 0..field.data.len() {
            let v = field.voxel(n);
            for s in 0..FINE.pow(3) {
                let at = core::array::from_fn(|a| {
                    v[a] as f64 + ((s / FINE.pow(a as u32) % FINE) as f64 + 0.5) / FINE as f64 - 0.5
                });
                count += usize::from(field.linear(at) > 0.0);
            }
        }
        count as f64 / FINE.pow(3) as f64
    }

    #[test]
    fn narrow_ventricles_keep_their_volume_where_a_plain_threshold_loses_it() {
        for radius in [2.0, 3.0, 5.0] {
            let (hu, truth) = capsule(radius);
            let (fluid, brain) = (6.0, 31.0);
            let edge = (fluid + brain) / 2.0;
            let classes = hu.map(|v| u8::from(v < edge));
            let nothing = Mask::filled(hu.dims, false);
            let everything = nothing.not();
            let evidence =
                Evidence { hu: &hu, cavity: &everything, classes: &classes, elsewhere: &nothing, fluid, brain };
            let (plain, found) = (volume(&hu.map(|v| edge - v)) / truth, volume(&evidence.field()) / truth);
            assert!((found - 1.0).abs() < 0.06, "radius {radius}: {found} of the volume (threshold {plain})");
            assert!((found - 1.0).abs() < (plain - 1.0).abs(), "radius {radius}: {found}, threshold {plain}");
        }
    }
}
