//! Predicted target registration error.
//!
//! The first-order covariance of the registration, carried to a point. For equal isotropic errors it is the formula of
//! Fitzpatrick, West and Maurer, IEEE TMI 17 (1998), eq. (46); with anisotropic errors it is the general form of
//! Danilchenko and Fitzpatrick, IEEE TMI 30 (2011). What it cannot know: brain shift, and landmarks that are wrong
//! rather than noisy.

use super::normal::jacobian;
use crate::Covariance;
use crate::linear::{point, vec3};
use core::marker::PhantomData;
use monro_geometry::{Frame, Point};
use nalgebra::{Matrix6, Vector3};

/// Covariance of a small rigid motion (rotation about `centre` in rad, then shift in mm) in frame `F`.
pub struct PoseUncertainty<F> {
    centre: Vector3<f64>,
    covariance: Matrix6<f64>,
    frame: PhantomData<F>,
}

impl<F> Clone for PoseUncertainty<F> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<F> Copy for PoseUncertainty<F> {}
impl<F> PartialEq for PoseUncertainty<F> {
    fn eq(&self, o: &Self) -> bool {
        self.centre == o.centre && self.covariance == o.covariance
    }
}
impl<F: Frame> core::fmt::Debug for PoseUncertainty<F> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "PoseUncertainty<{}> about {:?}", F::NAME, self.centre())
    }
}

impl<F> PoseUncertainty<F> {
    pub(crate) const fn of(centre: Vector3<f64>, covariance: Matrix6<f64>) -> Self {
        Self { centre, covariance, frame: PhantomData }
    }

    /// Where it is smallest, roughly: the centre of what was registered.
    pub fn centre(&self) -> Point<F> {
        point(&self.centre)
    }

    /// Predicted error of the registration at a point: its target registration error, with direction.
    pub fn at(&self, target: Point<F>) -> Covariance<F> {
        let j = jacobian(&(vec3(target.to_array()) - self.centre));
        Covariance::of(&(j * self.covariance * j.transpose()))
    }

    /// Standard deviation of the rotation about its worst axis, rad.
    pub fn worst_rotation(&self) -> f64 {
        self.covariance.fixed_view::<3, 3>(0, 0).symmetric_eigenvalues().max().max(0.0).sqrt()
    }

    /// The same with all variances multiplied, as when the residuals are larger than assumed.
    #[must_use]
    pub fn scaled(&self, variance_factor: f64) -> Self {
        Self::of(self.centre, self.covariance * variance_factor)
    }
}

/// Root mean square target registration error (mm) for `fle` mm root mean square localisation error, equal and isotropic
/// at all `landmarks`, by the closed formula `fle^2 / N * (1 + 1/3 sum_k d_k^2 / f_k^2)`: `d_k` the distance of the target
/// from principal axis `k` of the landmarks, `f_k` their root mean square distance from it. `None` for fewer than three
/// landmarks or landmarks on a line.
pub fn fitzpatrick_tre<F>(landmarks: &[Point<F>], target: Point<F>, fle: f64) -> Option<f64> {
    let n = landmarks.len() as f64;
    let centre = landmarks.iter().map(|p| vec3(p.to_array())).sum::<Vector3<f64>>() / n;
    let arms: Vec<Vector3<f64>> = landmarks.iter().map(|p| vec3(p.to_array()) - centre).collect();
    let spread = arms.iter().map(|a| a * a.transpose()).sum::<nalgebra::Matrix3<f64>>();
    let axes = spread.symmetric_eigen().eigenvectors;
    let to_target = vec3(target.to_array()) - centre;
    let mut sum = 0.0;
    for k in 0..3 {
        let axis = axes.column(k).into_owned();
        let f2 = arms.iter().map(|a| a.cross(&axis).norm_squared()).sum::<f64>() / n;
        if landmarks.len() < 3 || f2 <= 1e-9 * spread.trace() / n {
            return None;
        }
        sum += to_target.cross(&axis).norm_squared() / f2;
    }
    Some((fle * fle / n * (1.0 + sum / 3.0)).sqrt())
}
