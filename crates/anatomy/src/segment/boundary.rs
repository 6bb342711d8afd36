//! The surface of the ventricles to a fraction of a voxel.
//!
//! Where a smoothed scan crosses a threshold lies inside the true surface of a convex body (smoothing alone moves it by
//! `sigma^2 H`), moves with the grey matter beside it, and wobbles with the noise. So the scan is modelled instead:
//!
//! `I = b - (b - f) (PSF * inside) + noise`
//!
//! with the fluid's mean `f`, the mean `b` of the tissue next to each place, and partial volume by a Gaussian PSF. The
//! surface moves along its normal until nothing of the surface's own pattern is left in the residual: for a
//! displacement `d` the model changes by `(b - f) delta_PSF(distance) d`, so the least-squares estimate over a window is
//! `d = <r g> / <g g>` with `g = delta_PSF` (a matched filter). Scanner noise is correlated over neighbouring voxels;
//! both sides are prewhitened with the simultaneous autoregression (Whittle 1954) measured beside the ventricles. The estimate averages over a window of the surface, the
//! displacement and never the shape is smoothed, so that volumes are kept.

use super::tissue::median;
use crate::image::{Mask, Raster, gaussian, signed_distance};

/// Rounds of displacement; the surface moves less than 0.02 mm in the last.
const ROUNDS: usize = 10;
/// Rounds after which the tissue's mean and the noise are measured again.
const MEASURE_EVERY: usize = 4;
/// Window of the estimate in mm, for noise as large as the contrast. Averaging over a window `w` leaves an error of the
/// noise that falls with `1 / w` and makes one of the shape that grows with `w^2`: the best `w` grows with the cube root
/// of the noise. The factor is that of a head's ventricles (radii from 2 to 10 mm).
const WINDOW: f64 = 2.7;
/// Smoothing of the surface per round, and of the first guess, in parts of the window.
const SMOOTHING: f64 = 0.25;
const FIRST_SMOOTHING: f64 = 0.5;
/// Standard deviation of the PSF on voxels of 1 mm. A scan that is blurred more leaves a residual that is odd about the
/// surface, so that the surface stays where it is half way.
const PSF: f64 = 0.6;
/// Least window, mm.
const LEAST_WINDOW: f64 = 0.7;
/// Window of the tissue's mean, mm, and the layer that it is taken from: beyond partial volume, near the ventricle.
const TISSUE_WINDOW: f64 = 4.0;
const TISSUE_NEAR: f32 = 1.5;
const TISSUE_FAR: f32 = 5.0;
/// The surface stays this near to the first guess, mm: there may be nothing to hold it where the scan shows no edge.
const MOST_SHIFT: f32 = 2.0;
/// Largest correlation of neighbouring voxels that counts as noise; beyond it is anatomy or interpolated slices.
const MOST_CORRELATED: f32 = 0.6;
/// Far from the surface, voxels.
const FAR: f32 = 8.0;
/// Least difference between tissue and fluid, HU.
const LEAST_CONTRAST: f32 = 8.0;

/// The scan around the ventricles on voxels of 1 mm.
#[derive(Debug)]
pub(super) struct Picture<'a> {
    /// Not smoothed, HU.
    pub(super) hu: &'a Raster<f32>,
    /// Voxels that say something about the surface: not other fluid, bone, or what fills a ventricle.
    pub(super) counts: &'a Mask,
    /// Voxels that are tissue when outside.
    pub(super) tissue: &'a Mask,
    /// Modes of fluid and brain, HU.
    pub(super) fluid: f32,
    pub(super) brain: f32,
}

/// What is measured beside the surface.
struct Measured {
    tissue: Raster<f32>,
    fluid: f32,
    /// Correlation of neighbouring voxels along each axis.
    correlation: [f32; 3],
    window: f64,
}

/// Signed distance (mm, positive inside) to the ventricles' surface from a first guess, positive inside.
pub(super) fn refine(guess: &Raster<f32>, picture: &Picture<'_>) -> Raster<f32> {
    let start = signed_distance(guess, FAR);
    let mut measured = picture.measure(&start);
    // Twice smoothed and the loss added back: noise goes, roundness stays.
    let sigma = FIRST_SMOOTHING * measured.window;
    let once = gaussian(&start, sigma);
    let mut surface = signed_distance(&once.zip(&gaussian(&once, sigma), |a, b| 2.0 * a - b), FAR);
    for round in 0..ROUNDS {
        if round % MEASURE_EVERY == 0 {
            measured = picture.measure(&surface);
        }
        let shift = picture.shift(&surface, &measured);
        let moved = surface.zip(&shift, |s, d| s + d).zip(&start, |s, f| s.clamp(f - MOST_SHIFT, f + MOST_SHIFT));
        surface = signed_distance(&gaussian(&moved, SMOOTHING * measured.window), FAR);
    }
    surface
}

/// The inside, blurred by the PSF. A voxel that the surface cuts counts by its part, itself a blur over a voxel.
fn blurred(surface: &Raster<f32>) -> Raster<f32> {
    let part = surface.map(|d| (0.5 + d).clamp(0.0, 1.0));
    gaussian(&part, (PSF * PSF - 1.0 / 12.0).sqrt())
}

impl Picture<'_> {
    fn measure(&self, surface: &Raster<f32>) -> Measured {
        let layer = surface.zip(self.tissue, |d, t| t && (-TISSUE_FAR..-TISSUE_NEAR).contains(&d));
        let layer = layer.and(self.counts);
        let tissue = self.tissue_mean(&layer);
        let deep = |n: &usize| surface.data[*n] > 2.5 && self.counts.data[*n];
        let mut inside: Vec<f32> = (0..surface.data.len()).filter(deep).map(|n| self.hu.data[n]).collect();
        // A hundred voxels have a median that noise moves by less than 1 HU.
        let fluid = if inside.len() < 100 { self.fluid } else { median(&mut inside) };
        let (variance, correlation) = self.noise(&layer, &tissue);
        let part = variance.sqrt() / f64::from((self.brain - fluid).max(LEAST_CONTRAST));
        Measured { tissue, fluid, correlation, window: (WINDOW * part.cbrt()).clamp(LEAST_WINDOW, WINDOW) }
    }

    /// The mean of the tissue in a layer about the surface. Where it is darker than the brain's mode it stays at that:
    /// thick slices and thin walls dim what is next to a ventricle, and a dim rim is not half fluid.
    fn tissue_mean(&self, layer: &Mask) -> Raster<f32> {
        let weight = layer.map(|l| if l { 1.0 } else { 0.0 });
        let sum = gaussian(&weight.zip(self.hu, |w, v| w * v), TISSUE_WINDOW);
        // A little of the brain's mode where there is no tissue near.
        let mean = sum.zip(&gaussian(&weight, TISSUE_WINDOW), |s, w| (s + 0.02 * self.brain) / (w + 0.02));
        mean.map(|v| v.max(self.brain))
    }

    /// Variance of the deviation from the local mean in the layer, HU2, and its correlation between neighbours.
    fn noise(&self, layer: &Mask, tissue: &Raster<f32>) -> (f64, [f32; 3]) {
        let members: Vec<usize> = (0..layer.data.len()).filter(|&n| layer.data[n]).collect();
        let mean = |values: &mut dyn Iterator<Item = f64>| {
            let (sum, count) = values.fold((0f64, 0f64), |(s, c), v| (s + v, c + 1.0));
            if count > 0.0 { sum / count } else { 0.0 }
        };
        let off = |n: usize| f64::from(self.hu.data[n] - tissue.data[n]);
        let bias = mean(&mut members.iter().map(|&n| off(n)));
        let variance = mean(&mut members.iter().map(|&n| (off(n) - bias).powi(2)));
        let strides = [1, layer.dims[0], layer.dims[0] * layer.dims[1]];
        let correlation = strides.map(|stride| {
            let pairs = members.iter().filter(|&&n| n >= stride && layer.data[n - stride]);
            let product = mean(&mut pairs.map(|&n| (off(n) - bias) * (off(n - stride) - bias)));
            ((product / variance.max(1e-9)) as f32).clamp(0.0, MOST_CORRELATED)
        });
        (variance, correlation)
    }

    /// What the model leaves unexplained, in parts of the contrast; positive where there is more fluid.
    fn residual(&self, surface: &Raster<f32>, m: &Measured) -> Raster<f32> {
        let mut left = blurred(surface);
        for (n, value) in left.data.iter_mut().enumerate() {
            let contrast = (m.tissue.data[n] - m.fluid).max(LEAST_CONTRAST);
            let seen = (m.tissue.data[n] - self.hu.data[n]) / contrast;
            *value = if self.counts.data[n] { (seen - *value).clamp(-1.0, 1.0) } else { 0.0 };
        }
        left
    }

    /// The displacement along the normal, mm.
    fn shift(&self, surface: &Raster<f32>, m: &Measured) -> Raster<f32> {
        let mut residual = self.residual(surface, m);
        let mut pattern = surface.map(|d| normal_density(d, PSF as f32));
        for (value, counts) in pattern.data.iter_mut().zip(&self.counts.data) {
            *value = if *counts { *value } else { 0.0 };
        }
        for axis in 0..3 {
            whiten(&mut residual, axis, m.correlation[axis]);
            whiten(&mut pattern, axis, m.correlation[axis]);
        }
        let agreement = gaussian(&residual.zip(&pattern, |r, g| r * g), m.window);
        let strength = gaussian(&pattern.map(|g| g * g), m.window);
        // Where next to nothing of the surface is seen, it stays.
        let floor = 1e-2 * strength.data.iter().copied().fold(0f32, f32::max);
        agreement.zip(&strength, |a, s| (a / (s + floor)).clamp(-1.0, 1.0))
    }
}

fn normal_density(d: f32, sigma: f32) -> f32 {
    (-0.5 * (d / sigma).powi(2)).exp() / (sigma * (2.0 * core::f32::consts::PI).sqrt())
}

/// Takes from each voxel what its neighbours on the axis foretell: the simultaneous autoregression
/// `e(n) = q (e(n - 1) + e(n + 1)) + white`, whose neighbours have the correlation `2 q`.
fn whiten(raster: &mut Raster<f32>, axis: usize, correlation: f32) {
    let stride = [1, raster.dims[0], raster.dims[0] * raster.dims[1]][axis];
    let source = raster.data.clone();
    for n in 0..source.len() {
        let c = n / stride % raster.dims[axis];
        let low = if c > 0 { source[n - stride] } else { 0.0 };
        let high = if c + 1 < raster.dims[axis] { source[n + stride] } else { 0.0 };
        raster.data[n] -= 0.5 * correlation * (low + high);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Noise of deviation 8 HU that is correlated over neighbours in the plane, as after a reconstruction filter.
    fn noise(dims: [usize; 3]) -> Raster<f32> {
        let mut state = 7u32;
        let mut white = Raster::filled(dims, 0f32);
        for value in &mut white.data {
            let mut sum = 0f32;
            for _ in 0..4 {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                sum += (state >> 8) as f32 / (1 << 24) as f32 - 0.5;
            }
            *value = sum;
        }
        let mut out = white.clone();
        let nx = dims[0];
        for n in nx + 1..out.data.len() - nx - 1 {
            let line = |m: usize| white.data[m - 1] + 2.0 * white.data[m] + white.data[m + 1];
            // The sum of four has the variance 1/3, the kernel the norm 6.
            out.data[n] = 8.0 * 3f32.sqrt() / 6.0 * (line(n - nx) + 2.0 * line(n) + line(n + nx));
        }
        out
    }

    /// Where a smoothed scan crosses half way, the ellipsoid is some percent too small.
    #[test]
    fn an_ellipsoid_keeps_its_volume_where_a_threshold_loses_some() {
        let dims = [36, 40, 50];
        let distance = |v: [f64; 3]| {
            let r = ((v[0] - 17.7) / 6.0).hypot((v[1] - 19.6) / 8.0).hypot((v[2] - 24.3) / 14.0);
            (1.0 - r) * 7.0
        };
        let mut hu = Raster::filled(dims, 0f32);
        let mut truth = Mask::filled(dims, false);
        for n in 0..hu.data.len() {
            let d = distance(hu.voxel(n).map(|c| c as f64));
            truth.data[n] = d > 0.0;
            hu.data[n] = 30.0 - 25.0 * (d as f32 + 0.5).clamp(0.0, 1.0);
        }
        let hu = gaussian(&hu, 0.53).zip(&noise(dims), |v, e| v + e);
        let smooth = gaussian(&hu, 1.0);
        let all = truth.map(|_| true);
        let tissue = smooth.map(|v| v > 17.5);
        let picture = Picture { hu: &hu, counts: &all, tissue: &tissue, fluid: 4.0, brain: 30.0 };
        let guess = smooth.map(|v| 17.5 - v);
        let found = refine(&guess, &picture);
        let volume = 4.0 / 3.0 * core::f64::consts::PI * 6.0 * 8.0 * 14.0;
        let dice = |field: &Raster<f32>| {
            let inside = field.map(|d| d > 0.0);
            2.0 * inside.and(&truth).count() as f64 / (inside.count() + truth.count()) as f64
        };
        let ml = |field: &Raster<f32>| field.map(|d| d > 0.0).count() as f64 / volume;
        assert!((ml(&found) - 1.0).abs() < 0.015, "{} of the volume, guess {}", ml(&found), ml(&guess));
        assert!(dice(&found) > 0.97 && dice(&found) > dice(&guess) + 0.01, "{} {}", dice(&found), dice(&guess));
    }

    #[test]
    fn voxels_that_do_not_count_do_not_pull() {
        let dims = [30, 30, 30];
        let ball = |n: usize, r: &Raster<f32>| {
            7.0 - r.voxel(n).map(|c| c as f32 - 14.6).iter().map(|c| c * c).sum::<f32>().sqrt()
        };
        let mut hu = Raster::filled(dims, 30f32);
        let mut guess = hu.clone();
        let mut counts = Mask::filled(dims, true);
        for n in 0..hu.data.len() {
            guess.data[n] = ball(n, &hu);
            hu.data[n] = 30.0 - 25.0 * (guess.data[n] + 0.5).clamp(0.0, 1.0);
            // Other fluid lies against the ball on one side.
            if guess.data[n] < 0.0 && hu.voxel(n)[0] > 19 {
                hu.data[n] = 5.0;
                counts.data[n] = false;
            }
        }
        let tissue = hu.map(|v| v > 17.5);
        let picture = Picture { hu: &hu, counts: &counts, tissue: &tissue, fluid: 5.0, brain: 30.0 };
        let found = refine(&guess, &picture);
        let off =
            (0..hu.data.len()).filter(|&n| ball(n, &hu).abs() < 0.3).map(|n| (found.data[n] - ball(n, &hu)).abs());
        let worst = off.fold(0f32, f32::max);
        assert!(worst < 0.5, "{worst}");
    }
}
