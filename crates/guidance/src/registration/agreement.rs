//! Whether a traced skin and the landmarks say the same: a reference bumped between touching and tracing, a trace over hair.
//!
//! The trace weighs so much more than the landmarks that it carries the pose along wherever it lies, while its own residuals
//! stay small. What tells is how much worse both fit together than each by itself: where they are right, the sum of their
//! squared normalized residuals grows by a chi-square of six degrees of freedom (Hausman, Econometrica 46 (1978)). Both are
//! needed: a head turned a little hides half of a shift of the trace from the landmarks, and shows it in the trace.

use super::landmarks::chi_square;
use super::{Landmark, LandmarkRegistration, Refined};
use crate::Covariance;
use monro_geometry::{Frame, Patient, Point, Rigid, Vector};
use nalgebra::Matrix3;

/// Excess that noise hardly explains: chance alone does that once in 300 times.
const DOUBTFUL: f64 = 1.8;
/// Excess that no unsteady hand explains, either: chance does that once in 10^9 times, and of hands twice as unsteady as was
/// said, with four landmarks, one in a hundred (their own residuals are taken into account).
const FAR: f64 = 3.0;

/// How a registration refined on the skin agrees with the landmarks.
#[derive(Debug, Clone, Copy)]
pub struct Agreement<From: Frame> {
    by_landmarks: Rigid<Patient, From>,
    refined: Rigid<Patient, From>,
    /// How far landmarks and skin are apart, as a multiple of what the noise of both explains: 1 is expected.
    pub excess: f64,
}

impl<From: Frame> Agreement<From> {
    /// Of `landmarks`, their own registration, that refined on the skin with them, and that on the skin alone, where it is
    /// enough for one.
    pub fn new(
        landmarks: &[Landmark<Patient, From>],
        by_landmarks: &LandmarkRegistration<Patient, From>,
        refined: &Refined<From>,
        by_skin: Option<&Refined<From>>,
    ) -> Self {
        let (alone, with) = (by_landmarks.to_from, refined.patient_from);
        let of_landmarks = (chi_square(landmarks, &with) - chi_square(landmarks, &alone)).max(0.0);
        let of_skin = by_skin.map_or(0.0, |s| (refined.chi_square() - s.chi_square()).max(0.0));
        // Noise larger than was said shows in their own residuals.
        let skin_ratio = by_skin.map_or(1.0, |s| s.variance_ratio.max(1.0));
        let growth = of_landmarks / by_landmarks.variance_ratio.max(1.0) + of_skin / skin_ratio;
        Self { by_landmarks: alone, refined: with, excess: (growth / 6.0).sqrt() }
    }

    /// Whether landmarks and skin are further apart than noise explains.
    pub fn is_doubtful(&self) -> bool {
        self.excess > DOUBTFUL
    }

    /// Whether they contradict each other so much that neither must be used.
    pub fn is_contradiction(&self) -> bool {
        self.excess > FAR
    }

    /// From where the landmarks alone put a point to where the skin puts it, mm.
    pub fn apart(&self, at: Point<Patient>) -> Vector<Patient> {
        self.refined.point(self.by_landmarks.inverse().point(at)) - at
    }

    /// The predicted error `tre` at a point, with the disagreement where there is one: nobody knows which of the two is right.
    #[must_use]
    pub fn widened(&self, tre: Covariance<Patient>, at: Point<Patient>) -> Covariance<Patient> {
        if !self.is_doubtful() {
            return tre;
        }
        let d = nalgebra::Vector3::from(self.apart(at).to_array());
        let both: Matrix3<f64> = d * d.transpose();
        tre.plus(&Covariance::of(&both))
    }
}
