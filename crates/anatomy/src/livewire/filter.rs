//! Smoothing and derivatives of small 2D images in `f32`; borders are continued by their last value.

/// Weights of a Gaussian of `sigma` pixels from its centre outwards (to three sigma), normalised over both sides.
fn gaussian_weights(sigma: f64) -> Vec<f32> {
    let radius = (3.0 * sigma).ceil() as usize;
    let raw: Vec<f64> = (0..=radius).map(|i| (-0.5 * (i as f64 / sigma.max(1e-9)).powi(2)).exp()).collect();
    let sum = raw[0] + 2.0 * raw[1..].iter().sum::<f64>();
    raw.iter().map(|w| (w / sum) as f32).collect()
}

/// A Gaussian of `sigma` pixels along columns and along rows; 0 leaves that direction as it is.
pub(super) fn gaussian(data: &[f32], width: usize, sigma: [f64; 2]) -> Vec<f32> {
    let mut out = data.to_vec();
    if sigma[0] > 0.0 {
        along_rows(&mut out, width, &gaussian_weights(sigma[0]));
    }
    if sigma[1] > 0.0 {
        out = across_rows(&out, width, &gaussian_weights(sigma[1]));
    }
    out
}

/// Filters each row in place: the row is copied with its ends continued, then added up tap by tap (which vectorises).
fn along_rows(data: &mut [f32], width: usize, weights: &[f32]) {
    let radius = weights.len() - 1;
    let mut padded = vec![0.0; width + 2 * radius];
    for row in data.chunks_exact_mut(width) {
        padded[..radius].fill(row[0]);
        padded[radius..radius + width].copy_from_slice(row);
        padded[radius + width..].fill(row[width - 1]);
        for (out, &v) in row.iter_mut().zip(&padded[radius..]) {
            *out = v * weights[0];
        }
        for (tap, &w) in weights.iter().enumerate().skip(1) {
            let pairs = padded[radius - tap..].iter().zip(&padded[radius + tap..]);
            for (out, (&a, &b)) in row.iter_mut().zip(pairs) {
                *out += w * (a + b);
            }
        }
    }
}

fn across_rows(data: &[f32], width: usize, weights: &[f32]) -> Vec<f32> {
    let height = data.len() / width;
    let row = |y: usize| &data[y * width..(y + 1) * width];
    let mut out = vec![0.0; data.len()];
    for (y, line) in out.chunks_exact_mut(width).enumerate() {
        for (o, &v) in line.iter_mut().zip(row(y)) {
            *o = v * weights[0];
        }
        for (tap, &w) in weights.iter().enumerate().skip(1) {
            let pairs = row(y.saturating_sub(tap)).iter().zip(row((y + tap).min(height - 1)));
            for (o, (&a, &b)) in line.iter_mut().zip(pairs) {
                *o += w * (a + b);
            }
        }
    }
    out
}

/// Value at a continuous pixel index by cubic convolution (Keys 1981, a = -1/2), which unlike linear reading adds no
/// blur; outside, the values of the border go on.
pub(super) fn cubic(data: &[f32], width: usize, at: [f64; 2]) -> f64 {
    let height = data.len() / width;
    let taps = |v: f64, n: usize| {
        let c = v.clamp(0.0, (n - 1) as f64);
        let base = c as usize;
        let t = c - base as f64;
        let cells = [base.saturating_sub(1), base, (base + 1).min(n - 1), (base + 2).min(n - 1)];
        let weights = [
            ((-0.5 * t + 1.0) * t - 0.5) * t,
            (1.5 * t - 2.5) * t * t + 1.0,
            ((-1.5 * t + 2.0) * t + 0.5) * t,
            (0.5 * t - 0.5) * t * t,
        ];
        (cells, weights)
    };
    let (xs, wx) = taps(at[0], width);
    let (ys, wy) = taps(at[1], height);
    let line = |y: usize| (0..4).map(|a| wx[a] * f64::from(data[y * width + xs[a]])).sum::<f64>();
    (0..4).map(|a| wy[a] * line(ys[a])).sum()
}

/// The rows above, at and below each row, with the first and last repeated.
pub(super) fn row_triples(data: &[f32], width: usize) -> impl Iterator<Item = [&[f32]; 3]> {
    let height = data.len() / width;
    let row = move |y: usize| &data[y * width..(y + 1) * width];
    (0..height).map(move |y| [row(y.saturating_sub(1)), row(y), row((y + 1).min(height - 1))])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gaussian_keeps_constants_and_spreads_an_impulse_by_its_sigma() {
        let flat = gaussian(&[7.0; 30], 6, [1.5, 0.7]);
        assert!(flat.iter().all(|v| (v - 7.0).abs() < 1e-5));
        let mut impulse = vec![0.0; 41 * 41];
        impulse[20 * 41 + 20] = 1.0;
        let g = gaussian(&impulse, 41, [2.0, 1.0]);
        let moment = |along: usize| -> f64 {
            (0..g.len()).map(|n| f64::from(g[n]) * ([n % 41, n / 41][along] as f64 - 20.0).powi(2)).sum()
        };
        // The cut at three sigma takes 2.7 % off the variance.
        assert!((moment(0) - 4.0).abs() < 0.04 * 4.0 && (moment(1) - 1.0).abs() < 0.04, "{} {}", moment(0), moment(1));
    }

    #[test]
    fn one_pixel_is_a_valid_image() {
        assert_eq!(gaussian(&[3.0], 1, [2.0, 2.0]).len(), 1);
        assert!((cubic(&[3.0], 1, [5.0, -1.0]) - 3.0).abs() < 1e-12);
        assert_eq!(row_triples(&[3.0], 1).count(), 1);
    }

    #[test]
    fn cubic_reading_is_exact_for_parabolas_inside() {
        let f = |x: f64, y: f64| 2.0 + x - 0.5 * y + 0.25 * x * x - 0.125 * y * y + x * y;
        let data: Vec<f32> = (0..80).map(|n| f(f64::from(n % 10), f64::from(n / 10)) as f32).collect();
        for p in [[3.3, 4.7], [1.0, 1.0], [6.9, 5.5]] {
            assert!((cubic(&data, 10, p) - f(p[0], p[1])).abs() < 1e-4, "{p:?}");
        }
    }
}
