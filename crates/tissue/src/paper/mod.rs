//! Paper mode: position-based dynamics with the constraints of Koo et al. 2023, section II.4.
//!
//! Three slips of the paper are corrected, each where it is used: equation (2) must multiply the velocity by the time step
//! (it adds it), equation (9) lacks the factor 1/6 of a tetrahedron's volume, and equation (8) is a bending constraint of a
//! vertex towards the centroid of the triangle it forms with two neighbours (Kelager et al. 2010), not a triangle's own
//! shape. Each constraint is a plain function that returns its value and its gradients (`constraints`, the truth of the
//! tests) and one that moves sixteen of them at once (`lanes`).

mod batches;
#[cfg(test)]
mod constraints;
mod damping;
mod global_volume;
mod lanes;
mod matching;
mod parts;
mod predicted;
mod solver;
mod surface;
mod sweep;

pub(crate) use damping::{Inertia, Predict, kept_motion};
pub(crate) use predicted::WHOLE_EVERY;
pub(crate) use solver::{Extent, PaperModel, PaperScratch, Shape};

#[cfg(test)]
use crate::vec3::{V3, dot, shift};

/// The share of a constraint to satisfy in each of `n` iterations so that `coefficient` of it is satisfied after all of
/// them, equation (4): `k' = 1 - (1 - k)^(1/n)`.
pub(crate) fn per_iteration(coefficient: f64, n: u32) -> f32 {
    // Accurate for small coefficients: 1 - exp(ln(1 - k) / n).
    (-((-coefficient).ln_1p() / f64::from(n)).exp_m1()) as f32
}

/// Moves the vertices along the mass-weighted gradient until the share `k` of the constraint is satisfied (Müller et al.
/// 2007, equation 9), which keeps linear and angular momentum. Returns the largest motion.
#[cfg(test)]
pub(crate) fn project<const N: usize>(
    positions: &mut [[f32; 4]],
    nodes: [u32; N],
    value: f32,
    gradients: [V3; N],
    k: f32,
) -> f32 {
    let weight: f32 = (0..N).map(|i| positions[nodes[i] as usize][3] * dot(gradients[i], gradients[i])).sum();
    let s = -k * value / weight;
    // No free vertex or no gradient: nothing to do. The test is one of existence, not of size: thresholds are relative.
    if !s.is_finite() {
        return 0.0;
    }
    let mut most = 0f32;
    for i in 0..N {
        let p = &mut positions[nodes[i] as usize];
        let step = s * p[3];
        shift(p, step, gradients[i]);
        most = most.max(step * step * dot(gradients[i], gradients[i]));
    }
    most
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn n_iterations_of_the_corrected_share_make_the_whole_share() {
        for k in [0.0, 1e-6, 0.1, 0.5, 0.9, 1.0] {
            for n in [1u32, 2, 5, 10, 100] {
                let left = (1.0 - f64::from(per_iteration(k, n))).powi(n as i32);
                assert!((1.0 - left - k).abs() < 1e-5, "k {k}, n {n}: {left}");
            }
        }
    }
}
