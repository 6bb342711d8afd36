//! Registration of touched landmarks: Horn's closed form, then refined with the noise that each point really has.

use super::PoseUncertainty;
use super::normal::Normal;
use crate::Covariance;
use crate::linear::{mat3, rigid_of, vec3};
use monro_geometry::{Frame, Point, Rigid};
use nalgebra::{Matrix3, Matrix4, Vector3};
use thiserror::Error;

/// Why a registration was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RegistrationError {
    /// Too few pairs.
    #[error("{found} landmark pairs; at least {needed} are needed")]
    TooFew {
        /// Pairs given.
        found: usize,
        /// Pairs needed.
        needed: usize,
    },
    /// Touched and marked points differ in size by a power of ten: not the same unit.
    #[error(
        "the touched landmarks span {touched:.3}, the marked ones {marked:.3}: {} times as much; both must be in mm",
        (marked / touched).round().max((touched / marked).round())
    )]
    Unit {
        /// Root mean square distance of the touched points from their centre, in their unit.
        touched: f64,
        /// The same of the marked ones.
        marked: f64,
    },
    /// The points lie on a line or in one place.
    #[error("the landmarks are only {width:.1} mm wide across their longest line; touch points further apart")]
    OnALine {
        /// Root mean square distance from the best line, mm.
        width: f64,
    },
    /// A coordinate or a covariance is not usable.
    #[error("landmark '{0}' has a coordinate or a covariance that is not finite, or a covariance that is singular")]
    NotFinite(String),
    /// The refinement did not settle.
    #[error("the registration did not settle; are the pairs in the right order?")]
    NotSettled,
}

/// A landmark touched in frame `From` and marked in frame `To`.
#[derive(Debug, Clone, PartialEq)]
pub struct Landmark<To: Frame, From: Frame> {
    /// Name, as asked of the user.
    pub name: String,
    /// Where it was touched, mm.
    pub touched: Point<From>,
    /// Where it is marked, mm.
    pub marked: Point<To>,
    /// Noise of the touch (tracking and hand together), mm2.
    pub noise: Covariance<From>,
}

/// How far one landmark is off after registration.
#[derive(Debug, Clone, PartialEq)]
pub struct LandmarkResidual {
    /// Name.
    pub name: String,
    /// Distance between mark and registered touch, mm.
    pub distance: f64,
    /// The same, with this landmark left out of the registration, mm; `None` when too few others are left.
    pub left_out: Option<f64>,
    /// What is to be expected of `left_out` by noise alone (root mean square), mm.
    pub expected: Option<f64>,
}

impl LandmarkResidual {
    /// How many times larger than expected this landmark is off, seen from the others.
    pub fn excess(&self) -> Option<f64> {
        Some(self.left_out? / self.expected?)
    }
}

/// A registration by landmarks.
#[derive(Debug, Clone)]
pub struct LandmarkRegistration<To: Frame, From: Frame> {
    /// The registration.
    pub to_from: Rigid<To, From>,
    /// Each landmark's residual, in the order given. Their size says nothing about the error at the target.
    pub residuals: Vec<LandmarkResidual>,
    /// The landmark that the others contradict (more than three times what noise explains), if any.
    pub outlier: Option<usize>,
    /// Covariance of the registration, as the noise of the landmarks makes it.
    pub uncertainty: PoseUncertainty<To>,
    /// Sum of squared residuals over their expectation: near 1 when the noise given is the real one.
    pub variance_ratio: f64,
}

impl<To: Frame, From: Frame> LandmarkRegistration<To, From> {
    /// Predicted target registration error at a point of `To`. Where the residuals show more noise than was assumed, it
    /// grows with them; it never shrinks below what the noise makes.
    pub fn tre(&self, target: Point<To>) -> Covariance<To> {
        self.uncertainty.scaled(self.variance_ratio.max(1.0)).at(target)
    }
}

/// A point of one frame, its place in the other, and the weight of the pair.
pub type Pair<To, From> = (Point<From>, Point<To>, f64);

/// The rigid map that takes the first points of `pairs` to the second with least weighted squares (Horn 1987, the
/// largest eigenvector of a 4 x 4 matrix). `None` for no weight at all.
pub fn rigid_from_pairs<To, From>(pairs: &[Pair<To, From>]) -> Option<Rigid<To, From>> {
    let total: f64 = pairs.iter().map(|p| p.2).sum();
    if total.is_nan() || total <= 0.0 {
        return None;
    }
    let a = pairs.iter().map(|p| p.2 * vec3(p.0.to_array())).sum::<Vector3<f64>>() / total;
    let b = pairs.iter().map(|p| p.2 * vec3(p.1.to_array())).sum::<Vector3<f64>>() / total;
    let m: Matrix3<f64> =
        pairs.iter().map(|p| p.2 * (vec3(p.0.to_array()) - a) * (vec3(p.1.to_array()) - b).transpose()).sum();
    let rotation = Rigid::<To, From>::from_quaternion(largest_quaternion(&m)?, monro_geometry::Vector::ZERO)?;
    let r = mat3(&rotation.rotation());
    rigid_of(&r, &(b - r * a))
}

fn largest_quaternion(m: &Matrix3<f64>) -> Option<[f64; 4]> {
    let t = m.trace();
    let [yz, zx, xy] = [m[(1, 2)] - m[(2, 1)], m[(2, 0)] - m[(0, 2)], m[(0, 1)] - m[(1, 0)]];
    let s = m + m.transpose() - Matrix3::identity() * t;
    #[rustfmt::skip]
    let n = Matrix4::new(
        t,  yz,        zx,        xy,
        yz, s[(0, 0)], s[(0, 1)], s[(0, 2)],
        zx, s[(1, 0)], s[(1, 1)], s[(1, 2)],
        xy, s[(2, 0)], s[(2, 1)], s[(2, 2)],
    );
    let eigen = n.try_symmetric_eigen(1e-15, 1000)?;
    let q = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
    Some([q[0], q[1], q[2], q[3]])
}

/// Registers touched landmarks to marked ones.
///
/// # Errors
/// For fewer than three pairs, pairs on a line, or pairs that are not finite.
pub fn register_landmarks<To: Frame, From: Frame>(
    landmarks: &[Landmark<To, From>],
) -> Result<LandmarkRegistration<To, From>, RegistrationError> {
    check(landmarks)?;
    let (to_from, uncertainty) = fit(landmarks)?;
    let residuals: Vec<LandmarkResidual> = (0..landmarks.len()).map(|i| residual(landmarks, i, &to_from)).collect();
    let excess = |i: usize| residuals[i].excess().unwrap_or(0.0);
    let worst = (0..residuals.len()).fold(0, |w, i| if excess(i) > excess(w) { i } else { w });
    let outlier = (excess(worst) > 3.0).then_some(worst);
    let variance_ratio = chi_square(landmarks, &to_from) / freedom(landmarks).max(1.0);
    Ok(LandmarkRegistration { to_from, residuals, outlier, uncertainty, variance_ratio })
}

fn check<To: Frame, From: Frame>(landmarks: &[Landmark<To, From>]) -> Result<(), RegistrationError> {
    if landmarks.len() < 3 {
        return Err(RegistrationError::TooFew { found: landmarks.len(), needed: 3 });
    }
    for l in landmarks {
        let inverse = l.noise.inner().try_inverse();
        let usable = inverse.is_some_and(|i| i.iter().all(|v| v.is_finite()) && i.trace() > 0.0);
        if !(l.touched.is_finite() && l.marked.is_finite() && usable) {
            return Err(RegistrationError::NotFinite(l.name.clone()));
        }
    }
    let (touched, marked) = (
        span(landmarks.iter().map(|l| vec3(l.touched.to_array()))),
        span(landmarks.iter().map(|l| vec3(l.marked.to_array()))),
    );
    let width = width(landmarks.iter().map(|l| vec3(l.marked.to_array())));
    let touched_width = self::width(landmarks.iter().map(|l| vec3(l.touched.to_array())));
    let narrow = width.min(touched_width);
    // In one place or on a line in any unit: metres for millimetres leave a head 0.05 wide.
    let in_any_unit = narrow < 1e-3;
    if !in_any_unit && (marked > 5.0 * touched || touched > 5.0 * marked) {
        return Err(RegistrationError::Unit { touched, marked });
    }
    // A line leaves the turn about itself open; 5 mm of width already makes any noise a turn of many degrees.
    if narrow < 5.0 { Err(RegistrationError::OnALine { width: narrow }) } else { Ok(()) }
}

/// Root mean square distance of points from their centre.
fn span(points: impl Iterator<Item = Vector3<f64>> + Clone) -> f64 {
    let n = points.clone().count() as f64;
    let centre = points.clone().sum::<Vector3<f64>>() / n;
    (points.map(|p| (p - centre).norm_squared()).sum::<f64>() / n).sqrt()
}

/// Root mean square distance of points from their best line.
fn width(points: impl Iterator<Item = Vector3<f64>> + Clone) -> f64 {
    let n = points.clone().count() as f64;
    let centre = points.clone().sum::<Vector3<f64>>() / n;
    let spread: Matrix3<f64> = points.map(|p| (p - centre) * (p - centre).transpose()).sum();
    ((spread.trace() - spread.symmetric_eigenvalues().max()).max(0.0) / n).sqrt()
}

/// Closed form with scalar weights, then Gauss-Newton with the full covariances.
pub(super) fn fit<To: Frame, From: Frame>(
    landmarks: &[Landmark<To, From>],
) -> Result<(Rigid<To, From>, PoseUncertainty<To>), RegistrationError> {
    let pairs: Vec<_> = landmarks.iter().map(|l| (l.touched, l.marked, 3.0 / l.noise.inner().trace())).collect();
    let mut pose = rigid_from_pairs(&pairs).ok_or(RegistrationError::NotSettled)?;
    let n = landmarks.len() as f64;
    let centre = landmarks.iter().map(|l| vec3(l.marked.to_array())).sum::<Vector3<f64>>() / n;
    let radius = landmarks.iter().map(|l| (vec3(l.marked.to_array()) - centre).norm()).sum::<f64>() / n;
    for _ in 0..30 {
        let normal = equations(landmarks, &pose, centre);
        let (motion, size, _) = normal.solve::<To>(radius).ok_or(RegistrationError::NotSettled)?;
        pose = motion.after(&pose);
        if size < 1e-9 {
            break;
        }
    }
    let uncertainty = equations(landmarks, &pose, centre).uncertainty(radius).ok_or(RegistrationError::NotSettled)?;
    Ok((pose, uncertainty))
}

fn equations<To: Frame, From: Frame>(
    landmarks: &[Landmark<To, From>],
    pose: &Rigid<To, From>,
    centre: Vector3<f64>,
) -> Normal {
    let mut normal = Normal::new(centre);
    for l in landmarks {
        let y = pose.point(l.touched);
        if let Some(w) = l.noise.seen_from(pose).inner().try_inverse() {
            normal.add_point(&vec3(y.to_array()), &vec3((y - l.marked).to_array()), &w);
        }
    }
    normal
}

pub(super) fn chi_square<To: Frame, From: Frame>(landmarks: &[Landmark<To, From>], pose: &Rigid<To, From>) -> f64 {
    let one = |l: &Landmark<To, From>| {
        let e = vec3((pose.point(l.touched) - l.marked).to_array());
        l.noise.seen_from(pose).inner().try_inverse().map_or(0.0, |w| e.dot(&(w * e)))
    };
    landmarks.iter().map(one).sum()
}

/// How many coordinates there are more than a rigid motion has.
pub(super) fn freedom<To: Frame, From: Frame>(landmarks: &[Landmark<To, From>]) -> f64 {
    (3 * landmarks.len()).saturating_sub(6) as f64
}

fn residual<To: Frame, From: Frame>(
    landmarks: &[Landmark<To, From>],
    i: usize,
    pose: &Rigid<To, From>,
) -> LandmarkResidual {
    let l = &landmarks[i];
    let others: Vec<_> = landmarks.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, l)| l.clone()).collect();
    let without = check(&others).and_then(|()| fit(&others)).ok();
    let seen = without.map(|(pose, uncertainty)| {
        let own = l.noise.seen_from(&pose);
        (pose.point(l.touched).distance(l.marked), uncertainty.at(l.marked).plus(&own).rms())
    });
    LandmarkResidual {
        name: l.name.clone(),
        distance: pose.point(l.touched).distance(l.marked),
        left_out: seen.map(|s| s.0),
        expected: seen.map(|s| s.1),
    }
}
