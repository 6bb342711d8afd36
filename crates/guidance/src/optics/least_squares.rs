//! Nonlinear least squares by Levenberg (1944) and Marquardt (1963), for a handful of unknowns.

use nalgebra::{DMatrix, DVector};

pub(super) struct Fit {
    pub(super) x: DVector<f64>,
    /// Sum of squared residuals.
    pub(super) cost: f64,
    /// `J^T J` at the solution.
    pub(super) normal: DMatrix<f64>,
}

/// Minimises the squared length of `residuals(x)` from `x`. `None` when the start itself has no finite residuals.
pub(super) fn minimise(x: DVector<f64>, residuals: &dyn Fn(&DVector<f64>) -> Option<DVector<f64>>) -> Option<Fit> {
    let cost_of = |x: &DVector<f64>| residuals(x).map(|r| r.norm_squared()).filter(|c| c.is_finite());
    let (mut x, mut damping) = (x, 1e-3);
    let mut cost = cost_of(&x)?;
    for _ in 0..200 {
        let r = residuals(&x)?;
        let j = jacobian(&x, r.len(), residuals)?;
        let (normal, gradient) = (j.transpose() * &j, j.transpose() * &r);
        let before = cost;
        while damping < 1e12 {
            let mut damped = normal.clone();
            for i in 0..x.len() {
                damped[(i, i)] += damping * normal[(i, i)].max(1e-12);
            }
            let trial = damped.cholesky().map(|c| &x - c.solve(&gradient));
            let trial = trial.and_then(|t| cost_of(&t).map(|c| (t, c)));
            match trial.filter(|(_, c)| *c < cost) {
                Some((better, c)) => {
                    (x, cost, damping) = (better, c, damping * 0.3);
                    break;
                }
                None => damping *= 4.0,
            }
        }
        if damping >= 1e12 || before - cost <= 1e-14 * before {
            break;
        }
    }
    let rows = residuals(&x)?.len();
    let j = jacobian(&x, rows, residuals)?;
    Some(Fit { cost, normal: j.transpose() * &j, x })
}

/// Central differences; the unknowns are scaled so that a relative step is meant.
fn jacobian(
    x: &DVector<f64>,
    rows: usize,
    residuals: &dyn Fn(&DVector<f64>) -> Option<DVector<f64>>,
) -> Option<DMatrix<f64>> {
    let mut j = DMatrix::zeros(rows, x.len());
    for i in 0..x.len() {
        let h = 1e-6 * x[i].abs().max(1e-2);
        let at = |d: f64| {
            let mut moved = x.clone();
            moved[i] += d;
            residuals(&moved)
        };
        j.set_column(i, &((at(h)? - at(-h)?) / (2.0 * h)));
    }
    Some(j)
}
