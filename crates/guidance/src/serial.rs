//! Errors that follow each other are alike: a tracker's wander slowly, a hand or a guide that gives way does so for a while, hair
//! and skin are alike along a stroke. So many poses or points tell less than as many independent ones.

use nalgebra::{SMatrix, SVector};

/// Poses that are looked back on at most: some seconds of a quick camera system.
const MOST_LAGS: usize = 600;
/// What is alike over more of the series than this is not told from a mean of it.
const SHARE: usize = 3;

/// A likeness counts for more than chance from so many of its own standard deviations on.
const CHANCE: f64 = 3.0;
/// Largest likeness of neighbours: what wanders more slowly is not told from a mean.
const MOST: f64 = 0.98;

/// Correlation of each with the one `lag` later, of series whose means are zero.
fn correlation<const N: usize>(series: &[SVector<f64, N>], lag: usize) -> f64 {
    let squares: f64 = series.iter().map(SVector::norm_squared).sum();
    let products: f64 = series.iter().zip(&series[lag.min(series.len())..]).map(|(a, b)| a.dot(b)).sum();
    if squares > 0.0 { products / squares } else { 0.0 }
}

/// How many independent ones say as much as a series: of an error that lasts, with one beside it that does not (an
/// autoregressive moving average of first order, whose correlation at the second lag tells how long it lasts). One at least.
pub(crate) fn independent<const N: usize>(series: &[SVector<f64, N>]) -> f64 {
    let n = series.len() as f64;
    let [first, second] = [1, 2].map(|lag| correlation(series, lag));
    let first = first.clamp(0.0, MOST);
    let lasts = if first > CHANCE / n.sqrt() { (second / first).clamp(first, MOST) } else { first };
    (n / (1.0 + 2.0 * first / (1.0 - lasts))).max(1.0)
}

/// Covariance of the sum of a series whose members are alike when they are near: products with those that follow count the
/// less the further these are (Newey and West 1987), as far as the likeness asks for (Andrews 1991, for Bartlett's weights).
pub(crate) fn covariance_of_sum<const N: usize>(series: &[SVector<f64, N>]) -> SMatrix<f64, N, N> {
    let (n, rho) = (series.len(), correlation(series, 1).clamp(0.0, MOST));
    let alpha = (2.0 * rho / (1.0 - rho * rho)).powi(2);
    let wanted = 1.1447 * (alpha * n as f64).cbrt();
    let lags = (wanted as usize).min(n / SHARE).min(MOST_LAGS);
    let product = |k: usize| series.iter().zip(&series[k.min(n)..]).map(|(a, b)| a * b.transpose());
    (1..=lags).fold(product(0).sum(), |sum: SMatrix<f64, N, N>, k| {
        let gamma: SMatrix<f64, N, N> = product(k).sum();
        sum + (gamma + gamma.transpose()) * (1.0 - k as f64 / (lags + 1) as f64)
    })
}

#[cfg(test)]
pub(crate) mod tests {
    use crate::random::Random;

    /// Errors of standard deviation 1 that last: `likeness` of each is that of the one before.
    pub(crate) struct Lasting {
        likeness: f64,
        last: Option<[f64; 3]>,
    }

    impl Lasting {
        pub(crate) const fn new(likeness: f64) -> Self {
            Self { likeness, last: None }
        }

        pub(crate) fn next(&mut self, random: &mut Random) -> [f64; 3] {
            let new = random.normal3();
            let a = self.likeness;
            let mixed = |before: [f64; 3]| core::array::from_fn(|i| a * before[i] + (1.0 - a * a).sqrt() * new[i]);
            *self.last.insert(self.last.map_or(new, mixed))
        }
    }
}
