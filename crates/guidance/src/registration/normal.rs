//! Normal equations of a small rigid motion: the common core of landmark and surface registration.

use super::PoseUncertainty;
use crate::linear::{cross_matrix, small_motion};
use monro_geometry::{Frame, Rigid};
use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3, Vector6};

/// Sums for the motion `y -> y - [y - c]x omega + shift` that best removes weighted residuals.
pub(super) struct Normal {
    centre: Vector3<f64>,
    h: Matrix6<f64>,
    g: Vector6<f64>,
}

impl Normal {
    pub(super) fn new(centre: Vector3<f64>) -> Self {
        Self { centre, h: Matrix6::zeros(), g: Vector6::zeros() }
    }

    /// Three rows: the point `y` shall move by `-residual`, weighted by the inverse covariance `w`.
    pub(super) fn add_point(&mut self, y: &Vector3<f64>, residual: &Vector3<f64>, w: &Matrix3<f64>) {
        let j = jacobian(&(y - self.centre));
        self.h += j.transpose() * w * j;
        self.g += j.transpose() * w * residual;
    }

    /// One row: the point `y` shall move by `-residual` along the unit vector `n`, weighted by the inverse variance `w`.
    pub(super) fn add_plane(&mut self, y: &Vector3<f64>, n: &Vector3<f64>, residual: f64, w: f64) {
        let row = jacobian(&(y - self.centre)).transpose() * n;
        self.h += w * row * row.transpose();
        self.g += w * residual * row;
    }

    /// The motion, and its size in mm at a distance `radius` from the centre; `None` when the rows do not determine it.
    pub(super) fn solve<F: Frame>(&self, radius: f64) -> Option<(Rigid<F, F>, f64)> {
        let step = -self.inverse(radius)? * self.g;
        let (omega, shift) = (step.fixed_rows::<3>(0).into_owned(), step.fixed_rows::<3>(3).into_owned());
        let motion = small_motion(&self.centre, &omega, &shift)?;
        Some((motion, omega.norm() * radius + shift.norm()))
    }

    /// The covariance of the motion, when the weights are true inverse covariances.
    pub(super) fn uncertainty<F>(&self, radius: f64) -> Option<PoseUncertainty<F>> {
        Some(PoseUncertainty::of(self.centre, self.inverse(radius)?))
    }

    /// Inverse of the normal matrix; `None` when it is singular. Rotations are scaled by `radius` so that all six
    /// unknowns are in mm and the ratio of the extreme eigenvalues has a meaning.
    fn inverse(&self, radius: f64) -> Option<Matrix6<f64>> {
        let s = Matrix6::from_diagonal(&Vector6::new(1.0 / radius, 1.0 / radius, 1.0 / radius, 1.0, 1.0, 1.0));
        let scaled = s * self.h * s;
        let eigen = scaled.symmetric_eigenvalues();
        let determined = eigen.min() > 1e-7 * eigen.max();
        Some(s * scaled.try_inverse().filter(|_| determined)? * s)
    }
}

/// How a point at `arm` from the centre moves with (omega, shift).
pub(super) fn jacobian(arm: &Vector3<f64>) -> SMatrix<f64, 3, 6> {
    let mut j = SMatrix::<f64, 3, 6>::zeros();
    j.fixed_view_mut::<3, 3>(0, 0).copy_from(&-cross_matrix(arm));
    j.fixed_view_mut::<3, 3>(0, 3).copy_from(&Matrix3::identity());
    j
}
