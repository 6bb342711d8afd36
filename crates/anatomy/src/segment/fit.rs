//! The surface of the ventricles, fitted to the scan's own voxels to a fraction of a voxel.
//!
//! The scan is modelled as `b - (b - f) cover(distance / blur) + noise`: the fluid's level `f`, the level `b` of the tissue
//! beside each place, and an edge that the voxel's own size and the scanner blur. Moving the surface by `d` along its
//! normal changes the model by `(b - f) density(distance / blur) d`, so least squares over a patch give
//! `d = sum(r g) / sum(g g)`, with `g` that density and `r` what the model leaves unexplained, in parts of the contrast.
//! A threshold of a smoothed scan uses the values on the surface only; this uses the whole profile across it, and moves
//! no curved border. Noise is alike in neighbouring pixels, so both sides are whitened by the autoregression that is
//! measured in the tissue beside. Nothing of it is known beforehand: level, noise and blur are the scan's.

use super::boundary;
use super::samples::Samples;
use super::tissue::median;
use crate::image::{Mask, Raster, signed_distance};

/// Rounds of displacement, and after how many the levels, the noise and the blur are measured again. The surface moves by
/// some hundredths of a mm in the last.
const ROUNDS: usize = 6;
const MEASURE_EVERY: usize = 3;
/// Standard deviation of the patch over which one displacement is estimated, mm. Noise falls with it, and what horns and
/// edges lose grows with its square.
const PATCH: f64 = 1.5;
/// Smoothing of the surface in each round, mm, by twicing, which moves curved parts little: what the patch cannot see is
/// noise of the first guess.
const SMOOTHING: f64 = 0.75;
/// Most of the scanner's blur, mm (a standard deviation of soft kernels); what is more blurred is no edge but a mean of
/// several.
const MOST_BLUR: f32 = 0.6;
/// Steps in which the blur is sought, mm, and the layer about the surface that tells it.
const BLUR_STEP: f32 = 0.05;
const BLUR_NEAR: f32 = 0.75;
/// The densities of grey and white matter differ by a quarter of the contrast between brain and fluid. Noise below that
/// is not whitened: the model is not exact to more.
const MODEL_ERROR: f32 = 0.25;
/// Largest correlation of neighbouring voxels that is believed: near 1, whitening is a second difference of the scan.
const MOST_CORRELATED: f32 = 0.7;
/// The layer whose tissue is measured, mm from the surface: beyond partial volume, and near; and where fluid is pure.
const BESIDE: core::ops::Range<f32> = -5.0..-1.5;
const DEEP: f32 = 2.5;
/// A hundred voxels have a median that noise moves by less than 1 HU.
const LEAST_DEEP: usize = 100;
/// The surface stays this near to the first guess, mm: there may be nothing to hold it where the scan shows no edge.
const MOST_SHIFT: f32 = 2.0;
/// Where the surface is seen less than by this part of the most, it stays.
const LEAST_SEEN: f32 = 0.01;
/// Far from the surface, mm.
const FAR: f32 = 8.0;
/// Least difference between tissue and fluid, HU.
const LEAST_CONTRAST: f32 = 8.0;

/// The scan around the ventricles, on voxels of 1 mm and its own.
#[derive(Debug)]
pub(super) struct Picture<'a> {
    /// Resampled, HU.
    pub(super) hu: &'a Raster<f32>,
    pub(super) samples: &'a Samples,
    /// Voxels that say something about the surface: not other fluid, bone, or what fills a ventricle.
    pub(super) counts: &'a Mask,
    /// Voxels that are tissue when outside.
    pub(super) tissue: &'a Mask,
    /// Modes of fluid and brain, HU.
    pub(super) fluid: f32,
    pub(super) brain: f32,
}

/// What is measured beside a surface; the rasters are samples.
struct Measured {
    /// How much of each sample is fluid, 0 to 1 with noise.
    seen: Raster<f32>,
    /// Correlation of neighbouring samples along each axis.
    correlation: [f32; 3],
    /// Variance of the scanner's blur, mm2.
    blur: f32,
}

/// Signed distance (mm, positive inside) to the ventricles' surface from a first guess, positive inside.
pub(super) fn fitted(guess: &Raster<f32>, picture: &Picture<'_>) -> Raster<f32> {
    let start = signed_distance(guess, FAR);
    let counts = picture.counting();
    let mut surface = signed_distance(&boundary::twiced(&start, SMOOTHING), FAR);
    let mut measured = picture.measure(&surface, &counts);
    for round in 0..ROUNDS {
        if round > 0 && round % MEASURE_EVERY == 0 {
            measured = picture.measure(&surface, &counts);
        }
        let shift = picture.shift(&surface, &measured, &counts);
        let moved = surface.zip(&shift, |s, d| s + d).zip(&start, |s, f| s.clamp(f - MOST_SHIFT, f + MOST_SHIFT));
        surface = signed_distance(&boundary::twiced(&moved, SMOOTHING), FAR);
    }
    surface
}

impl Picture<'_> {
    /// 1 for samples that count, 0 for others.
    fn counting(&self) -> Raster<f32> {
        self.share(self.counts)
    }

    /// 1 for samples in the mask, 0 for others.
    fn share(&self, mask: &Mask) -> Raster<f32> {
        self.samples.at_samples(&mask.map(|m| if m { 1.0 } else { 0.0 })).map(|v| if v > 0.5 { 1.0 } else { 0.0 })
    }

    fn measure(&self, surface: &Raster<f32>, counts: &Raster<f32>) -> Measured {
        let layer = surface.zip(self.tissue, |d, t| t && BESIDE.contains(&d)).and(self.counts);
        let tissue = self.samples.at_samples(&boundary::tissue(self.hu, &layer, self.brain));
        let fluid = self.fluid(surface);
        let seen = tissue.zip(&self.samples.hu, |t, v| (t - v) / (t - fluid).max(LEAST_CONTRAST));
        let correlation = correlation(&seen, &self.share(&layer));
        let blur = self.blur(surface, &seen, counts);
        Measured { seen, correlation, blur }
    }

    /// Median of what is deep inside; the mode where nothing is.
    fn fluid(&self, surface: &Raster<f32>) -> f32 {
        let deep = |n: &usize| surface.data[*n] > DEEP && self.counts.data[*n];
        let mut inside: Vec<f32> = (0..surface.data.len()).filter(deep).map(|n| self.hu.data[n]).collect();
        if inside.len() < LEAST_DEEP { self.fluid } else { median(&mut inside) }
    }

    /// Variance of the voxel's own extent across the surface, mm2, at the samples.
    fn extent(&self, surface: &Raster<f32>) -> Raster<f32> {
        let mut extent = surface.map(|_| 0.0);
        for n in 0..extent.data.len() {
            if surface.data[n].abs() < FAR {
                extent.data[n] = self.samples.box_variance(normal(surface, n));
            }
        }
        self.samples.at_samples(&extent)
    }

    /// Variance of the blur that leaves least unexplained next to the surface, mm2.
    fn blur(&self, surface: &Raster<f32>, seen: &Raster<f32>, counts: &Raster<f32>) -> f32 {
        let (distance, extent) = (self.samples.at_samples(surface), self.extent(surface));
        let near: Vec<usize> =
            (0..seen.data.len()).filter(|&n| counts.data[n] > 0.0 && distance.data[n].abs() < BLUR_NEAR).collect();
        let left = |blur: f32| -> f64 {
            let off = |n: usize| seen.data[n] - cover(distance.data[n] / (extent.data[n] + blur).sqrt());
            near.iter().map(|&n| f64::from(off(n)).powi(2)).sum()
        };
        let steps = (MOST_BLUR / BLUR_STEP).round() as u16;
        let tried = (0..=steps).map(|s| (f32::from(s) * BLUR_STEP).powi(2)).map(|blur| (blur, left(blur)));
        tried.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0.0, |(blur, _)| blur)
    }

    /// The displacement along the normal, mm.
    fn shift(&self, surface: &Raster<f32>, m: &Measured, counts: &Raster<f32>) -> Raster<f32> {
        let (distance, extent) = (self.samples.at_samples(surface), self.extent(surface));
        let (mut residual, mut pattern) = (m.seen.clone(), m.seen.clone());
        for n in 0..residual.data.len() {
            let width = (extent.data[n] + m.blur).max(BLUR_STEP * BLUR_STEP).sqrt();
            let z = distance.data[n] / width;
            residual.data[n] = counts.data[n] * (m.seen.data[n] - cover(z)).clamp(-1.0, 1.0);
            pattern.data[n] = counts.data[n] * density(z) / width;
        }
        for axis in 0..3 {
            whiten(&mut residual, axis, m.correlation[axis]);
            whiten(&mut pattern, axis, m.correlation[axis]);
        }
        let over_patch = |r: &Raster<f32>| self.samples.on_lattice(&self.samples.smoothed(r, PATCH));
        let agreement = over_patch(&residual.zip(&pattern, |r, g| r * g));
        let strength = over_patch(&pattern.map(|g| g * g));
        let floor = LEAST_SEEN * strength.data.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
        agreement.zip(&strength, |a, s| (a / (s + floor)).clamp(-1.0, 1.0))
    }
}

/// Unit vector along which a signed distance grows (voxels of 1 mm).
fn normal(surface: &Raster<f32>, n: usize) -> [f32; 3] {
    let v = surface.voxel(n);
    let strides = [1, surface.dims[0], surface.dims[0] * surface.dims[1]];
    let slope = [0, 1, 2].map(|a| {
        let low = if v[a] > 0 { n - strides[a] } else { n };
        let high = if v[a] + 1 < surface.dims[a] { n + strides[a] } else { n };
        surface.data[high] - surface.data[low]
    });
    let length = slope.iter().map(|s| s * s).sum::<f32>().sqrt().max(1e-6);
    slope.map(|s| s / length)
}

/// Correlation of neighbours along each axis within a layer, beside an error of the model that has none.
fn correlation(seen: &Raster<f32>, layer: &Raster<f32>) -> [f32; 3] {
    let members: Vec<usize> = (0..layer.data.len()).filter(|&n| layer.data[n] > 0.0).collect();
    let mean = |values: &mut dyn Iterator<Item = f64>| {
        let (sum, count) = values.fold((0f64, 0f64), |(s, c), v| (s + v, c + 1.0));
        if count > 0.0 { sum / count } else { 0.0 }
    };
    let bias = mean(&mut members.iter().map(|&n| f64::from(seen.data[n])));
    let off = |n: usize| f64::from(seen.data[n]) - bias;
    let variance = mean(&mut members.iter().map(|&n| off(n).powi(2)));
    let strides = [1, seen.dims[0], seen.dims[0] * seen.dims[1]];
    [0, 1, 2].map(|axis| {
        let stride = strides[axis];
        let pairs = members.iter().filter(|&&n| seen.voxel(n)[axis] > 0 && layer.data[n - stride] > 0.0);
        let product = mean(&mut pairs.map(|&n| off(n) * off(n - stride)));
        let noise = (product / variance.max(1e-9)).clamp(0.0, f64::from(MOST_CORRELATED));
        (noise * variance / (variance + f64::from(MODEL_ERROR).powi(2))) as f32
    })
}

/// The part of a blurred edge that is inside, `z` deviations of the blur within it: the normal distribution, by
/// Abramowitz and Stegun's 26.2.17 (error below 1e-7).
fn cover(z: f32) -> f32 {
    let t = 1.0 / (1.0 + 0.231_641_9 * z.abs());
    let series = t * (0.319_381_53 + t * (-0.356_563_78 + t * (1.781_477_9 + t * (-1.821_255_9 + t * 1.330_274_4))));
    let tail = density(z) * series;
    if z > 0.0 { 1.0 - tail } else { tail }
}

fn density(z: f32) -> f32 {
    (-0.5 * z * z).exp() / (2.0 * core::f32::consts::PI).sqrt()
}

/// Takes from each voxel what its neighbours on the axis foretell: the simultaneous autoregression (Whittle 1954)
/// `e(n) = q (e(n - 1) + e(n + 1)) + white` with `2 q` the correlation of neighbours.
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
    use super::super::lattice::Lattice;
    use super::super::working::Binned;
    use super::*;
    use monro_geometry::{Affine, Grid, Matrix3, Volume};

    /// Noise that is correlated over neighbours in the plane, as after a reconstruction filter; standard deviation 1.
    fn noise(dims: [usize; 3]) -> Vec<f32> {
        let mut state = 7u32;
        let mut draw = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32 - 0.5
        };
        // The sum of four has the variance 1/3.
        let white: Vec<f32> =
            (0..dims.iter().product()).map(|_| 3f32.sqrt() * (0..4).map(|_| draw()).sum::<f32>()).collect();
        let nx = dims[0];
        let at = |n: usize| white[n % white.len()];
        let line = |n: usize| at(n + white.len() - 1) + 2.0 * at(n) + at(n + 1);
        // The binomial kernel has the norm 6.
        (0..white.len()).map(|n| (line(n + white.len() - nx) + 2.0 * line(n) + line(n + nx)) / 6.0).collect()
    }

    /// An ellipsoid of fluid (5 HU) in brain (30 HU).
    struct Body {
        lattice: Lattice,
        hu: Raster<f32>,
        samples: Samples,
        truth: Raster<f32>,
    }

    /// Distance to the ellipsoid's surface at a point in mm, exact in sign.
    fn inside(p: [f64; 3]) -> f64 {
        let r = (p[0] / 6.0).hypot(p[1] / 8.0).hypot(p[2] / 14.0);
        let slope = (p[0] / 36.0).hypot(p[1] / 64.0).hypot(p[2] / 196.0).max(1e-3);
        (1.0 - r) * r.max(0.1) / slope
    }

    /// Scans the ellipsoid on voxels of `spacing` mm whose axes are turned by `turn` about z, an edge blurred by 0.4 mm.
    fn scanned(spacing: [f64; 3], turn: f64, deviation: f32) -> Body {
        let dims = spacing.map(|s| (70.0 / s) as usize);
        let (sin, cos) = turn.to_radians().sin_cos();
        let axes = [
            [cos * spacing[0], -sin * spacing[1], 0.0],
            [sin * spacing[0], cos * spacing[1], 0.0],
            [0.0, 0.0, spacing[2]],
        ];
        let middle = dims.map(|d| d as f64 / 2.0);
        let shift = axes.map(|row| -(0..3).map(|a| row[a] * middle[a]).sum::<f64>());
        let grid = Grid::new(dims, Affine::new(Matrix3 { rows: axes }, shift)).expect("grid");
        let grain = noise(dims);
        let value = |n: usize| {
            let [i, j, k] = grid.voxel(n);
            // Voxels average over their thickness.
            let layers = 9;
            let part = |l: usize| {
                let dz = ((f64::from(l as u8) + 0.5) / f64::from(layers as u8) - 0.5) * spacing[2];
                let p = grid.centre(i, j, k).to_array();
                cover((inside([p[0], p[1], p[2] + dz]) / 0.4) as f32)
            };
            30.0 - 25.0 * (0..layers).map(part).sum::<f32>() / layers as f32 + deviation * grain[n]
        };
        let ct = Volume::new(grid, (0..grid.len()).map(|n| value(n).round() as i16).collect()).expect("volume");
        let lattice = Lattice { origin: [-17.3, -19.6, -25.1], step: 1.0 };
        let box_dims = [36, 40, 51];
        let binned = Binned::new(&ct);
        let samples = Samples::new(&binned, &lattice, box_dims).expect("samples");
        let mut truth = Raster::filled(box_dims, 0f32);
        for n in 0..truth.data.len() {
            truth.data[n] = inside(lattice.point(truth.voxel(n).map(|c| c as f64)).to_array()) as f32;
        }
        let hu = samples.on_lattice(&samples.hu);
        Body { lattice, hu, samples, truth }
    }

    impl Body {
        fn fit(&self, counts: &Mask) -> Raster<f32> {
            let smooth = boundary::smoothed(&self.hu);
            let tissue = smooth.map(|v| v > 17.5);
            let picture =
                Picture { hu: &self.hu, samples: &self.samples, counts, tissue: &tissue, fluid: 4.0, brain: 30.0 };
            fitted(&smooth.map(|v| 17.5 - v), &picture)
        }

        fn dice(&self, field: &Raster<f32>) -> f64 {
            let (a, b) = (field.map(|d| d > 0.0), self.truth.map(|d| d > 0.0));
            2.0 * a.and(&b).count() as f64 / (a.count() + b.count()) as f64
        }

        fn volume(&self, field: &Raster<f32>) -> f64 {
            let step = self.lattice.step.powi(3);
            let wanted = 4.0 / 3.0 * core::f64::consts::PI * 6.0 * 8.0 * 14.0;
            field.data.iter().map(|d| f64::from((0.5 + d).clamp(0.0, 1.0))).sum::<f64>() * step / wanted
        }
    }

    /// Where a smoothed scan crosses half way, the ellipsoid is some percent too small and follows the noise.
    #[test]
    fn an_ellipsoid_in_noise_keeps_its_volume_and_is_found_better_than_half_way() {
        for (spacing, turn) in [([0.9, 0.9, 1.25], 0.0), ([0.45, 0.45, 2.0], 20.0), ([1.3; 3], 35.0)] {
            let body = scanned(spacing, turn, 8.0);
            let half_way = boundary::smoothed(&body.hu).map(|v| 17.5 - v);
            let found = body.fit(&body.truth.map(|_| true));
            let (volume, dice, before) = (body.volume(&found), body.dice(&found), body.dice(&half_way));
            assert!((volume - 1.0).abs() < 0.02, "{spacing:?}: {volume} of the volume");
            assert!(dice > 0.955 && dice > before + 0.002, "{spacing:?}: {dice}, half way {before}");
        }
    }

    #[test]
    fn without_noise_the_surface_is_within_a_tenth_of_a_voxel() {
        let body = scanned([0.9, 0.9, 1.25], 10.0, 0.0);
        let found = body.fit(&body.truth.map(|_| true));
        let near: Vec<f32> = (0..found.data.len())
            .filter(|&n| body.truth.data[n].abs() < 0.5)
            .map(|n| (found.data[n] - body.truth.data[n]).abs())
            .collect();
        let mean = near.iter().sum::<f32>() / near.len() as f32;
        // The ellipsoid's tips (radius 2.6 mm) are rounder after a patch of 1.5 mm; distances of both are good to 0.05.
        assert!(mean < 0.1, "{mean} mm over {} voxels", near.len());
    }

    #[test]
    fn voxels_that_do_not_count_do_not_pull() {
        let mut body = scanned([1.0; 3], 0.0, 0.0);
        let mut counts = body.truth.map(|_| true);
        // Other fluid lies against the ellipsoid on one side.
        for n in 0..counts.data.len() {
            counts.data[n] = body.truth.data[n] > 0.0 || body.truth.voxel(n)[0] <= 21;
        }
        let beyond = body.samples.at_samples(&counts.map(|c| if c { 1.0 } else { 0.0 }));
        for (value, c) in body.samples.hu.data.iter_mut().zip(&beyond.data) {
            *value = if *c > 0.5 { *value } else { 5.0 };
        }
        let smooth = boundary::smoothed(&body.hu);
        let tissue = smooth.map(|v| v > 17.5);
        let picture =
            Picture { hu: &body.hu, samples: &body.samples, counts: &counts, tissue: &tissue, fluid: 5.0, brain: 30.0 };
        let found = fitted(&smooth.map(|v| 17.5 - v), &picture);
        let near = (0..found.data.len()).filter(|&n| body.truth.data[n].abs() < 0.3);
        let worst = near.map(|n| (found.data[n] - body.truth.data[n]).abs()).fold(0f32, f32::max);
        assert!(worst < 0.6, "{worst}");
    }

    #[test]
    fn the_part_inside_is_the_normal_distribution() {
        for (z, wanted) in [(0.0, 0.5), (1.0, 0.841_344_7), (-1.96, 0.024_997_9), (3.0, 0.998_650_1)] {
            assert!((cover(z) - wanted).abs() < 1e-6, "{z}: {}", cover(z));
        }
    }
}
