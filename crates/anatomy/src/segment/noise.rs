//! The scan's noise, and the smoothing that it asks for.

use crate::image::{Mask, Raster};

/// Deep in the head, mm: neither bone nor most sulci.
const DEEP: f32 = 14.0;
/// Places that are compared, voxels apart: farther than the noise of the smoothed scan reaches, nearer than anatomy.
const APART: usize = 3;
/// A scan smoothed by a Gaussian of 1 mm keeps at most this much noise in the usual run, HU: an eighth of what parts
/// brain from fluid.
const MOST: f64 = 3.0;
/// The widest smoothing, mm: horns are some 4 mm wide.
const WIDEST: f64 = 2.2;
/// Noise (HU, voxels of 1 mm) that is worth a word.
const LOUD: f64 = 20.0;

/// The noise of the working scan.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Noise {
    /// Standard deviation in voxels of 1 mm, HU.
    pub(crate) raw: f64,
    /// The same in the smoothed scan that the ventricles are found in, HU.
    pub(crate) smooth: f64,
    /// The Gaussian of that smoothing, mm.
    pub(crate) sigma: f64,
}

impl Noise {
    /// Measures the scan and the scan smoothed by 1 mm; the smoothing becomes as wide as the noise demands: noise
    /// without correlation falls with its power of 3/2.
    pub(crate) fn of(hu: &Raster<f32>, smooth: &Raster<f32>, depth: &Raster<f32>) -> Self {
        let deep = depth.map(|d| d > DEEP);
        let (raw, at_1mm) = (deviation(hu, &deep), deviation(smooth, &deep));
        let sigma = (at_1mm / MOST).max(1.0).powf(2.0 / 3.0).min(WIDEST);
        Self { raw, smooth: at_1mm / sigma.powf(1.5), sigma }
    }

    /// The Gaussian that has to come before one of 1 mm, mm.
    pub(crate) fn before(&self) -> Option<f64> {
        (self.sigma > 1.0).then(|| (self.sigma * self.sigma - 1.0).sqrt())
    }

    /// The steepness that the noise alone gives a voxel of the smoothed scan, HU per mm: the mean length of a gradient
    /// of three central differences, each of noise with a correlation of `exp(-x^2 / 4 sigma^2)`.
    pub(crate) fn slope(&self) -> f64 {
        let difference = ((1.0 - (-1.0 / (self.sigma * self.sigma)).exp()) / 2.0).sqrt();
        self.smooth * difference * (8.0 / core::f64::consts::PI).sqrt()
    }

    /// A remark for the reader.
    pub(crate) fn finding(&self) -> Option<String> {
        let Self { raw, sigma, .. } = self;
        (*raw > LOUD).then(|| {
            format!(
                "very noisy: {raw:.0} HU in voxels of 1 mm, smoothed by {sigma:.1} mm; narrow horns may be lost: \
                 reconstruct with a softer kernel or thicker slices"
            )
        })
    }
}

/// Robust standard deviation from how far a voxel is from the mean of its neighbours to either side.
fn deviation(hu: &Raster<f32>, deep: &Mask) -> f64 {
    let strides = [1, hu.dims[0], hu.dims[0] * hu.dims[1]];
    let inside = |n: usize| deep.data[n] && hu.voxel(n).iter().zip(hu.dims).all(|(&c, d)| c >= APART && c + APART < d);
    let mut off: Vec<f32> = (0..hu.data.len())
        .step_by(5)
        .filter(|&n| inside(n))
        .flat_map(|n| strides.map(|s| (hu.data[n] - (hu.data[n - APART * s] + hu.data[n + APART * s]) / 2.0).abs()))
        .collect();
    // The median of a normal deviate's size is 0.6745; three independent values make it sqrt(1 + 1/4 + 1/4) wide.
    f64::from(super::tissue::quantile(&mut off, 0.5)) / (0.6745 * 1.5f64.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::gaussian;

    #[test]
    fn noise_is_measured_and_the_smoothing_brings_it_down() {
        // Sums of a linear congruence's high bits: nearly normal, SD 40, on a ramp.
        let mut state = 1u64;
        let mut uniform = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / 16_777_216.0 - 0.5
        };
        let mut hu = Raster::filled([60, 60, 60], 0f32);
        for n in 0..hu.data.len() {
            let noise: f32 = (0..12).map(|_| uniform()).sum();
            hu.data[n] = 30.0 + 0.3 * (n % 60) as f32 + 40.0 * noise;
        }
        let deep = Raster::filled(hu.dims, 100f32);
        let found = Noise::of(&hu, &gaussian(&hu, 1.0), &deep);
        assert!((found.raw / 40.0 - 1.0).abs() < 0.05, "{found:?}");
        let smooth = gaussian(&gaussian(&hu, found.before().expect("loud")), 1.0);
        let left = deviation(&smooth, &deep.map(|_| true));
        assert!((left / found.smooth - 1.0).abs() < 0.25 && left < 1.3 * MOST, "{left} {found:?}");
        assert!(found.finding().expect("told").contains("very noisy"), "{found:?}");
    }
}
