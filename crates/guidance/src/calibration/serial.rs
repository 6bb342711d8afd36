//! Errors of poses that follow each other are alike: a tracker's wander slowly, and a hand or a guide that gives way does so for
//! a while. So many poses tell less than as many independent ones.

use nalgebra::{SMatrix, SVector};

/// Poses that are looked back on at most: some seconds of a quick camera system.
const MOST_LAGS: usize = 600;
/// What is alike over more of the series than this is not told from a mean of it.
const SHARE: usize = 3;

/// Correlation of each with the next, of series whose means are zero; from 0 (independent) to below 1.
pub(super) fn likeness<const N: usize>(series: &[SVector<f64, N>]) -> f64 {
    let squares: f64 = series.iter().map(SVector::norm_squared).sum();
    let products: f64 = series.windows(2).map(|w| w[0].dot(&w[1])).sum();
    if squares > 0.0 { (products / squares).clamp(0.0, 0.999) } else { 0.0 }
}

/// How many independent ones say as much as `n` of this likeness (of a first-order autoregressive series); one at least.
pub(super) fn independent(n: usize, likeness: f64) -> f64 {
    (n as f64 * (1.0 - likeness) / (1.0 + likeness)).max(1.0)
}

/// Covariance of the sum of a series whose members are alike when they are near: products with those that follow count the
/// less the further these are (Newey and West 1987), as far as the likeness asks for (Andrews 1991, equations 5.3 and 6.2).
pub(super) fn covariance_of_sum<const N: usize>(series: &[SVector<f64, N>]) -> SMatrix<f64, N, N> {
    let (n, rho) = (series.len(), likeness(series));
    let alpha = (2.0 * rho / (1.0 - rho * rho)).powi(2);
    let wanted = 1.1447 * (alpha * n as f64).cbrt();
    let lags = (wanted as usize).min(n / SHARE).min(MOST_LAGS);
    let product = |k: usize| series.iter().zip(&series[k.min(n)..]).map(|(a, b)| a * b.transpose());
    (1..=lags).fold(product(0).sum(), |sum: SMatrix<f64, N, N>, k| {
        let gamma: SMatrix<f64, N, N> = product(k).sum();
        sum + (gamma + gamma.transpose()) * (1.0 - k as f64 / (lags + 1) as f64)
    })
}
