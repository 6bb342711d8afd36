//! Normal equations of a small rigid motion: the common core of landmark and surface registration.

use super::PoseUncertainty;
use crate::linear::{cross_matrix, small_motion};
use monro_geometry::{Frame, Rigid};
use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3, Vector6};

/// Sums for the motion `y -> y - [y - c]x omega + shift` that best removes weighted residuals, and for one more unknown: a
/// distance that all planes have in common (an even offset of a trace). That one is eliminated (Schur complement), so that
/// what is left is the motion with all that the offset leaves open.
pub(super) struct Normal {
    centre: Vector3<f64>,
    h: Matrix6<f64>,
    g: Vector6<f64>,
    offset: Offset,
}

/// The row of the common offset in the normal equations.
struct Offset {
    /// With the motion.
    coupling: Vector6<f64>,
    /// With itself; infinite for an offset that is known.
    own: f64,
    right: f64,
}

impl Normal {
    /// Without an offset.
    pub(super) fn new(centre: Vector3<f64>) -> Self {
        Self::with_offset(centre, 0.0, 0.0)
    }

    /// With a common offset, so far `offset` (mm, no longer in the residuals), that is `sigma` mm by experience; 0 for none.
    pub(super) fn with_offset(centre: Vector3<f64>, offset: f64, sigma: f64) -> Self {
        let (own, right) = if sigma > 0.0 { (sigma.powi(-2), offset / (sigma * sigma)) } else { (f64::INFINITY, 0.0) };
        Self {
            centre,
            h: Matrix6::zeros(),
            g: Vector6::zeros(),
            offset: Offset { coupling: Vector6::zeros(), own, right },
        }
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
        self.offset.coupling -= w * row;
        self.offset.own += w;
        self.offset.right -= w * residual;
    }

    /// The motion, its size in mm at a distance `radius` from the centre, and by how much the offset grows, mm; `None` when
    /// the rows do not determine them.
    pub(super) fn solve<F: Frame>(&self, radius: f64) -> Option<(Rigid<F, F>, f64, f64)> {
        let o = &self.offset;
        let step = -self.inverse(radius)? * (self.g - o.coupling * (o.right / o.own));
        let (omega, shift) = (step.fixed_rows::<3>(0).into_owned(), step.fixed_rows::<3>(3).into_owned());
        let motion = small_motion(&self.centre, &omega, &shift)?;
        let offset = -(o.right + o.coupling.dot(&step)) / o.own;
        Some((motion, omega.norm() * radius + shift.norm(), offset))
    }

    /// Standard deviation of the offset, mm: 0 where there is none.
    pub(super) fn offset_sigma(&self, radius: f64) -> Option<f64> {
        let o = &self.offset;
        let toward = o.coupling / o.own;
        Some((1.0 / o.own + toward.dot(&(self.inverse(radius)? * toward))).max(0.0).sqrt())
    }

    /// The covariance of the motion, when the weights are true inverse covariances.
    pub(super) fn uncertainty<F>(&self, radius: f64) -> Option<PoseUncertainty<F>> {
        Some(PoseUncertainty::of(self.centre, self.inverse(radius)?))
    }

    /// Inverse of the normal matrix; `None` when it is singular. Rotations are scaled by `radius` so that all six
    /// unknowns are in mm and the ratio of the extreme eigenvalues has a meaning.
    fn inverse(&self, radius: f64) -> Option<Matrix6<f64>> {
        let s = Matrix6::from_diagonal(&Vector6::new(1.0 / radius, 1.0 / radius, 1.0 / radius, 1.0, 1.0, 1.0));
        let o = &self.offset;
        let scaled = s * (self.h - o.coupling * (o.coupling / o.own).transpose()) * s;
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
