//! From a chain of pixels to the edge itself: each point slides along the contour's normal to the peak of the gradient.

use super::filter::{cubic, gaussian};
use super::{Contour, LivewireError, SliceImage, check_option};

/// How a contour is refined.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RefineOptions {
    /// Width of the Gaussian before the gradient, pixels of the finer direction.
    pub sigma: f64,
    /// How far the edge is looked for on each side at first, pixels; half of it in the end.
    pub reach: f64,
    /// Width along the contour of the Gaussian that averages neighbouring shifts against noise, pixels.
    pub smoothing: f64,
    /// Values outside count as the nearer end.
    pub window: [f32; 2],
}

impl Default for RefineOptions {
    fn default() -> Self {
        // Half a brain window more on each side than the wire sees: clipped noise would move the edge.
        Self { sigma: 1.2, reach: 2.5, smoothing: 3.0, window: [-40.0, 120.0] }
    }
}

/// Distance between the points of a refined contour, pixels of the finer direction.
const STEP: f64 = 1.0;

/// Variance of the pixel's own box, square pixels: it blurs too.
const PIXEL_VARIANCE: f64 = 1.0 / 12.0;

/// Rounds of sliding and resampling.
const ROUNDS: usize = 4;

/// The refined contour: points about a pixel apart on the ridge of the gradient.
///
/// The position found is corrected for what smoothing does to a curved edge: under a Gaussian of width `sigma` (which
/// is the heat equation run for `sigma^2 / 2`) an edge of curvature `c` moves by `c sigma^2 / 2` towards its centre of
/// curvature, to first order in `c sigma`. The width includes the pixel's own box.
///
/// # Errors
/// Options out of range; a contour that encloses nothing, before or after.
pub fn refine(image: &SliceImage, rough: &Contour, options: &RefineOptions) -> Result<Contour, LivewireError> {
    options.check()?;
    rough.check()?;
    let finest = image.spacing()[0].min(image.spacing()[1]);
    let scale = image.spacing().map(|s| s / finest);
    let [low, high] = options.window;
    let windowed: Vec<f32> = image.data().iter().map(|v| v.clamp(low, high)).collect();
    let smooth = gaussian(&windowed, image.width(), scale.map(|s| options.sigma / s));
    let field = Field { smooth, width: image.width(), scale };
    // From here on in units of the finer pixel, in which both axes are alike.
    let mut points: Vec<[f64; 2]> = rough.points.iter().map(|p| [p[0] * scale[0], p[1] * scale[1]]).collect();
    points = resample(&points);
    points = smooth_cyclic(&points, 1.5 * options.smoothing);
    for round in 0..ROUNDS {
        let reach = options.reach * (1.0 - 0.5 * round as f64 / (ROUNDS - 1) as f64);
        points = resample(&slide(&field, &points, reach, options.smoothing));
    }
    points = uncurve(&points, options.sigma);
    let (w, h) = (image.width() as f64, image.height() as f64);
    let to_pixels = |p: &[f64; 2]| [(p[0] / scale[0]).clamp(-0.5, w - 0.5), (p[1] / scale[1]).clamp(-0.5, h - 0.5)];
    let out = Contour { points: points.iter().map(to_pixels).collect() };
    out.check()?;
    Ok(out)
}

impl RefineOptions {
    fn check(&self) -> Result<(), LivewireError> {
        let range = |name, v: f64| check_option(name, v, v > 0.0 && v <= 20.0, "above 0 and at most 20 pixels");
        range("refinement sigma", self.sigma)?;
        range("refinement reach", self.reach)?;
        range("refinement smoothing", self.smoothing)?;
        let width = f64::from(self.window[1]) - f64::from(self.window[0]);
        check_option("width of the window", width, width.is_finite() && width > 0.0, "positive")
    }
}

struct Field {
    smooth: Vec<f32>,
    width: usize,
    scale: [f64; 2],
}

impl Field {
    fn value(&self, p: [f64; 2]) -> f64 {
        cubic(&self.smooth, self.width, [p[0] / self.scale[0], p[1] / self.scale[1]])
    }
}

/// Points at equal steps along a closed polygon; at least eight.
fn resample(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let side = |n: usize| {
        let (a, b) = (points[n], points[(n + 1) % points.len()]);
        (b[0] - a[0]).hypot(b[1] - a[1])
    };
    let length: f64 = (0..points.len()).map(side).sum();
    let count = ((length / STEP).round() as usize).max(8);
    let step = length / count as f64;
    let (mut out, mut n, mut before) = (Vec::with_capacity(count), 0, 0.0);
    for k in 0..count {
        let at = k as f64 * step;
        while n + 1 < points.len() && before + side(n) < at {
            before += side(n);
            n += 1;
        }
        let t = if side(n) > 0.0 { ((at - before) / side(n)).clamp(0.0, 1.0) } else { 0.0 };
        let (a, b) = (points[n], points[(n + 1) % points.len()]);
        out.push([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]);
    }
    out
}

/// Gaussian weights from the centre outwards, for `count` points around a closed contour.
fn arc_weights(sigma: f64, count: usize) -> Vec<f64> {
    let reach = ((3.0 * sigma / STEP).ceil() as usize).min((count - 1) / 2);
    (0..=reach).map(|d| (-0.5 * (d as f64 * STEP / sigma).powi(2)).exp()).collect()
}

/// The points within reach of `n` around a closed contour of `count`, with their weights.
fn around(n: usize, count: usize, weights: &[f64]) -> impl Iterator<Item = (usize, f64)> + '_ {
    let both = move |(d, &w): (usize, &f64)| {
        let back = (d > 0).then_some(((n + count - d) % count, w));
        [Some(((n + d) % count, w)), back]
    };
    weights.iter().enumerate().flat_map(both).flatten()
}

/// Positions averaged along the contour; takes the pixel stairs away.
fn smooth_cyclic(points: &[[f64; 2]], sigma: f64) -> Vec<[f64; 2]> {
    let weights = arc_weights(sigma, points.len());
    let total: f64 = around(0, points.len(), &weights).map(|(_, w)| w).sum();
    let mean =
        |n: usize, a: usize| around(n, points.len(), &weights).map(|(m, w)| w * points[m][a]).sum::<f64>() / total;
    (0..points.len()).map(|n| [mean(n, 0), mean(n, 1)]).collect()
}

/// Unit normals, to the right of the direction of travel (x turned to y is "left" in a right-handed picture).
fn normals(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let n = points.len();
    let normal = |k: usize| {
        let (a, b) = (points[(k + n - 1) % n], points[(k + 1) % n]);
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let length = dx.hypot(dy).max(1e-12);
        [dy / length, -dx / length]
    };
    (0..n).map(normal).collect()
}

/// One round: measure each point's shift to the edge, drop outliers, average along the contour, move.
fn slide(field: &Field, points: &[[f64; 2]], reach: f64, smoothing: f64) -> Vec<[f64; 2]> {
    let normals = normals(points);
    let slope = |p: [f64; 2], n: [f64; 2], at: f64| {
        let value = |o: f64| field.value([p[0] + (at + o) * n[0], p[1] + (at + o) * n[1]]);
        value(0.5) - value(-0.5)
    };
    // Which side is brighter, by vote of all points weighted with their slope.
    let vote: f64 = points.iter().zip(&normals).map(|(&p, &n)| slope(p, n, 0.0)).sum();
    let sign = if vote < 0.0 { -1.0 } else { 1.0 };
    let shifts: Vec<(f64, f64)> =
        points.iter().zip(&normals).map(|(&p, &n)| peak(reach, |at| sign * slope(p, n, at))).collect();
    let shifts = drop_outliers(&shifts);
    let weights = arc_weights(smoothing, points.len());
    let moved = |k: usize| {
        let mut sum = (0.0, 0.0);
        for (m, w) in around(k, points.len(), &weights) {
            sum = (sum.0 + w * shifts[m].1 * shifts[m].0, sum.1 + w * shifts[m].1);
        }
        let shift = if sum.1 > 0.0 { sum.0 / sum.1 } else { 0.0 };
        [points[k][0] + shift * normals[k][0], points[k][1] + shift * normals[k][1]]
    };
    (0..points.len()).map(moved).collect()
}

/// Where the slope peaks within reach, by a parabola through the best sample and its neighbours, and how strong it is.
/// Far samples count less, so that a parallel stronger edge does not win; a maximum at the end of the reach is none.
fn peak(reach: f64, slope: impl Fn(f64) -> f64) -> (f64, f64) {
    const FINE: f64 = 0.25;
    let half = (reach / FINE).ceil() as i32;
    let samples: Vec<f64> = (-half..=half).map(|s| slope(f64::from(s) * FINE)).collect();
    let nearness = |s: usize| 1.0 - 0.5 * (f64::from(s as i32 - half) / f64::from(half)).powi(2);
    let mut best: Option<usize> = None;
    for s in 1..samples.len() - 1 {
        let top = samples[s] > 0.0 && samples[s] >= samples[s - 1] && samples[s] > samples[s + 1];
        if top && best.is_none_or(|b| samples[s] * nearness(s) > samples[b] * nearness(b)) {
            best = Some(s);
        }
    }
    let Some(s) = best else { return (0.0, 0.0) };
    let (left, mid, right) = (samples[s - 1], samples[s], samples[s + 1]);
    let bend = left - 2.0 * mid + right;
    let sub = if bend < 0.0 { (0.5 * (left - right) / bend).clamp(-0.5, 0.5) } else { 0.0 };
    ((f64::from(s as i32 - half) + sub) * FINE, mid)
}

/// Takes the weight from shifts that lie more than a pixel from the median of their neighbours (five on each side).
fn drop_outliers(shifts: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let n = shifts.len();
    let keep = |k: usize| {
        let mut near: Vec<f64> =
            (0..11).map(|d| shifts[(k + n * 11 + d - 5) % n]).filter(|s| s.1 > 0.0).map(|s| s.0).collect();
        near.sort_by(f64::total_cmp);
        match near.get(near.len() / 2) {
            Some(median) if (shifts[k].0 - median).abs() <= 1.0 => shifts[k],
            _ => (0.0, 0.0),
        }
    };
    (0..n).map(keep).collect()
}

/// Moves each point against the shift that smoothing gave a curved edge.
fn uncurve(points: &[[f64; 2]], sigma: f64) -> Vec<[f64; 2]> {
    const HALF_CHORD: usize = 4;
    let n = points.len();
    let span = HALF_CHORD.min(n / 4).max(1);
    let square = sigma * sigma + PIXEL_VARIANCE;
    let normals = normals(points);
    let moved = |k: usize| {
        let (a, b, c) = (points[(k + n - span) % n], points[k], points[(k + span) % n]);
        let cross = (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]);
        let sides = |p: [f64; 2], q: [f64; 2]| (q[0] - p[0]).hypot(q[1] - p[1]);
        // Curvature of the circle through three points (Menger); positive turns towards the left normal.
        let product = sides(a, b) * sides(b, c) * sides(a, c);
        let curvature = if product > 0.0 { 2.0 * cross / product } else { 0.0 };
        // First order only: beyond half a radius of the kernel the formula means nothing.
        let shift = 0.5 * square * curvature.clamp(-0.5 / sigma, 0.5 / sigma);
        [b[0] + shift * normals[k][0], b[1] + shift * normals[k][1]]
    };
    (0..n).map(moved).collect()
}
