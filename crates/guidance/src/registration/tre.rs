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

    /// The same with all variances multiplied, as when the residuals are larger than assumed.
    #[must_use]
    pub fn scaled(&self, variance_factor: f64) -> Self {
        Self::of(self.centre, self.covariance * variance_factor)
    }
}
