//! On-the-fly training: which gradients and values belong to *this* edge, learnt from the wire drawn last.

use super::features::Pixel;

/// Samples at which learnt and untrained cost weigh the same.
const HALF_TRUST: f64 = 32.0;

/// Exponents that make everything but a clear edge dear, so that the wire makes a detour along the edge rather than cut
/// across. MB95 and MB98 are linear here; on slices with noise the linear cost of a fair edge is a third of that of no
/// edge at all, and with few clicks the wire cuts corners.
const UNTRAINED_POWER: i32 = 4;
const LEARNT_POWER: i32 = 3;

/// Width (bins of 256) of the Gaussian that smooths a histogram of few samples.
const HISTOGRAM_SIGMA: f64 = 10.0;

/// Cost of each quantised feature value, 0 (an edge like the trained ones) to 1.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Training {
    pub(super) gradient: [f32; 256],
    pub(super) value: [f32; 256],
    pub(super) bright: [f32; 256],
    pub(super) dark: [f32; 256],
}

impl Training {
    /// Before any path: the gradient cost of MB95 (sharpened), nothing known about values.
    pub(super) fn untrained() -> Self {
        let gradient = core::array::from_fn(|g| (1.0 - g as f32 / 255.0).powi(UNTRAINED_POWER));
        Self { gradient, value: [0.0; 256], bright: [0.0; 256], dark: [0.0; 256] }
    }

    /// Learnt from path pixels, oldest first: later ones count linearly more (the on-the-fly training of MB95 and MB98), histograms are
    /// smoothed, and few samples change little.
    pub(super) fn learnt(path: &[Pixel]) -> Self {
        let mut out = Self::untrained();
        let trust = (path.len() as f64 / (path.len() as f64 + HALF_TRUST)) as f32;
        blend(&mut out.gradient, path, trust, |p| p.gradient);
        blend(&mut out.value, path, trust, |p| p.value);
        blend(&mut out.bright, path, trust, |p| p.bright);
        blend(&mut out.dark, path, trust, |p| p.dark);
        out
    }
}

fn blend(table: &mut [f32; 256], path: &[Pixel], trust: f32, feature: impl Fn(&Pixel) -> u8) {
    let mut histogram = [0.0f64; 256];
    for (age, p) in path.iter().enumerate() {
        histogram[usize::from(feature(p))] += (age + 1) as f64;
    }
    let smooth = smoothed(&histogram);
    let most = smooth.iter().copied().fold(0.0, f64::max);
    if most > 0.0 {
        for (cost, count) in table.iter_mut().zip(smooth) {
            let learnt = (1.0 - count / most).powi(LEARNT_POWER) as f32;
            *cost += trust * (learnt - *cost);
        }
    }
}

fn smoothed(histogram: &[f64; 256]) -> [f64; 256] {
    let reach = (3.0 * HISTOGRAM_SIGMA) as usize;
    let weights: Vec<f64> = (0..=reach).map(|d| (-0.5 * (d as f64 / HISTOGRAM_SIGMA).powi(2)).exp()).collect();
    let mut out = [0.0; 256];
    for (bin, &count) in histogram.iter().enumerate().filter(|&(_, &count)| count > 0.0) {
        for (to, value) in out.iter_mut().enumerate() {
            *value += count * weights.get(bin.abs_diff(to)).copied().unwrap_or(0.0);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_path_teaches_nothing_and_a_path_makes_its_kind_cheap() {
        assert_eq!(Training::learnt(&[]), Training::untrained());
        let seen = Pixel { gradient: 90, value: 60, bright: 110, dark: 20, ..Pixel::default() };
        let t = Training::learnt(&[seen; 64]);
        assert!(t.gradient[90] < 0.1 && t.gradient[250] > 0.6, "{} {}", t.gradient[90], t.gradient[250]);
        assert!(t.bright[110] < 1e-6 && t.bright[20] > 0.6 && t.dark[20] < 1e-6);
    }
}
