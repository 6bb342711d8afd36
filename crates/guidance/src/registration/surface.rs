//! Refinement on a traced surface: trimmed point-to-plane ICP (Chen and Medioni 1992, Chetverikov 2002) that weighs each
//! row by the noise along its normal (anisotropic ICP in the manner of Maier-Hein 2012), landmarks taking part.

use super::PoseUncertainty;
use super::landmarks::Landmark;
use super::normal::Normal;
use crate::Covariance;
use crate::linear::vec3;
use crate::serial::independent;
use monro_geometry::{Bvh, Frame, Patient, Point, Rigid, TriangleMesh, Vector};
use nalgebra::{Vector1, Vector3};
use thiserror::Error;

/// Why a refinement was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SurfaceError {
    /// Too few traced points.
    #[error("{0} surface points; trace at least 20, spread over forehead, temples and crown")]
    TooFew(usize),
    /// The surface has no triangles.
    #[error("the surface has no triangles")]
    Empty,
    /// The traced patch slides on itself.
    #[error(
        "the traced points do not fix the head in all directions (they slide on the surface); trace a wider and more curved area"
    )]
    Slides,
    /// Too many points were rejected.
    #[error(
        "only {used} of {total} surface points fit the surface; is the start more than 20 degrees off, or another patient's surface loaded?"
    )]
    Rejected {
        /// Points used in the end.
        used: usize,
        /// Points traced.
        total: usize,
    },
    /// A point is not finite.
    #[error("surface point {0} is not finite")]
    NotFinite(usize),
}

/// The surface to be met.
#[derive(Debug, Clone)]
pub struct Surface {
    bvh: Bvh,
    normals: Vec<Vector<Patient>>,
}

impl Surface {
    /// From a mesh (mm).
    ///
    /// # Errors
    /// When it has no triangles.
    pub fn new(mesh: &TriangleMesh) -> Result<Self, SurfaceError> {
        if mesh.triangles.is_empty() {
            return Err(SurfaceError::Empty);
        }
        let normals = (0..mesh.triangles.len()).map(|t| mesh.area_vector(t).normalized().unwrap_or(Vector::ZERO));
        Ok(Self { bvh: Bvh::new(mesh), normals: normals.collect() })
    }
}

/// One traced point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceSample<From: Frame> {
    /// Where the tip was, mm.
    pub point: Point<From>,
    /// Its noise, mm2.
    pub noise: Covariance<From>,
}

/// How to refine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RefineOptions {
    /// Fraction of the points that is trusted while the start is still far off.
    pub keep: f64,
    /// Points further off than this many standard deviations are left out, when they are not within `keep`.
    pub reject: f64,
    /// Standard deviation of the surface itself (segmentation, skin pressed by the tip), mm.
    pub surface_sigma: f64,
    /// How far all of a trace may lie off the surface evenly (hair, thickness of the tip, where the skin was found), mm,
    /// standard deviation. It is estimated along; 0 takes none for granted.
    pub offset_sigma: f64,
    /// Most iterations.
    pub iterations: usize,
}

impl Default for RefineOptions {
    fn default() -> Self {
        Self { keep: 0.8, reject: 3.5, surface_sigma: 0.3, offset_sigma: 1.0, iterations: 150 }
    }
}

/// One traced point after refinement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceResidual {
    /// Signed distance from the surface along its normal, less the even offset, mm.
    pub distance: f64,
    /// The same over its standard deviation.
    pub normalized: f64,
    /// Whether it took part; the others are outliers.
    pub used: bool,
}

/// A registration refined on the surface.
#[derive(Debug, Clone)]
pub struct Refined<From: Frame> {
    /// The registration.
    pub patient_from: Rigid<Patient, From>,
    /// Each traced point, in the order given.
    pub residuals: Vec<SurfaceResidual>,
    /// Covariance of the registration, as the noise makes it.
    pub uncertainty: PoseUncertainty<Patient>,
    /// Sum of squared normalized residuals over their expectation: near 1 when the noise given is the real one.
    pub variance_ratio: f64,
    /// How far all of the trace lies off the surface evenly, mm, positive outside; the registration has taken it out.
    pub offset: f64,
    /// Standard deviation of `offset`, mm.
    pub offset_sigma: f64,
    /// Iterations done.
    pub iterations: usize,
    /// How far the last iteration still moved the points, mm.
    pub last_step: f64,
    /// Normalized residual from which points were left out.
    reject: f64,
}

impl<From: Frame> Refined<From> {
    /// Predicted target registration error at a point. It grows with residuals larger than assumed, never below the noise.
    pub fn tre(&self, target: Point<Patient>) -> Covariance<Patient> {
        self.uncertainty.scaled(self.variance_ratio.max(1.0)).at(target)
    }

    /// Sum of squared normalized residuals, of those left out what is just not.
    pub(super) fn chi_square(&self) -> f64 {
        self.residuals.iter().map(|r| r.normalized.abs().min(self.reject).powi(2)).sum()
    }
}

/// What is refined.
struct Fit<From: Frame> {
    pose: Rigid<Patient, From>,
    /// Even distance of the trace from the surface, mm.
    offset: f64,
}

/// A traced point against the surface, for one pose.
struct Row {
    y: Vector3<f64>,
    normal: Vector3<f64>,
    distance: f64,
    sigma: f64,
}

/// Refines a registration from `start` with traced points and, if any, the landmarks that it came from.
///
/// # Errors
/// When there are too few points, they slide on the surface, or most of them do not fit it.
pub fn refine_on_surface<From: Frame>(
    start: &Rigid<Patient, From>,
    samples: &[SurfaceSample<From>],
    landmarks: &[Landmark<Patient, From>],
    surface: &Surface,
    options: &RefineOptions,
) -> Result<Refined<From>, SurfaceError> {
    if samples.len() < 20 {
        return Err(SurfaceError::TooFew(samples.len()));
    }
    if let Some(i) = samples.iter().position(|s| !s.point.is_finite()) {
        return Err(SurfaceError::NotFinite(i));
    }
    let problem = Problem { samples, landmarks, surface, options };
    let (mut fit, mut iterations, mut last_step) = (Fit { pose: *start, offset: 0.0 }, 0, f64::INFINITY);
    while iterations < options.iterations && last_step > 1e-4 {
        let rows = problem.rows(&fit);
        let extra = spread(&rows);
        let (normal, radius) = problem.equations(&fit, &rows, extra, problem.cut(&rows, extra), 1.0);
        let (motion, size, further) = normal.solve::<Patient>(radius).ok_or(SurfaceError::Slides)?;
        fit = Fit { pose: motion.after(&fit.pose), offset: fit.offset + further };
        (iterations, last_step) = (iterations + 1, size.max(further.abs()));
    }
    problem.finish(&fit, iterations, last_step)
}

struct Problem<'a, From: Frame> {
    samples: &'a [SurfaceSample<From>],
    landmarks: &'a [Landmark<Patient, From>],
    surface: &'a Surface,
    options: &'a RefineOptions,
}

impl<From: Frame> Problem<'_, From> {
    fn rows(&self, fit: &Fit<From>) -> Vec<Row> {
        let row = |s: &SurfaceSample<From>| {
            let y = fit.pose.point(s.point);
            let near = self.surface.bvh.nearest(y)?;
            let n = self.surface.normals[near.triangle];
            let along = s.noise.seen_from(&fit.pose).sigma_along(n);
            let sigma = along.hypot(self.options.surface_sigma);
            let distance = (y - near.point).dot(n) - fit.offset;
            Some(Row { y: vec3(y.to_array()), normal: vec3(n.to_array()), distance, sigma })
        };
        self.samples.iter().filter_map(row).collect()
    }

    /// The largest normalized residual that still takes part.
    fn cut(&self, rows: &[Row], extra: f64) -> f64 {
        let mut z: Vec<f64> = rows.iter().map(|r| r.distance.abs() / r.sigma.hypot(extra)).collect();
        z.sort_by(f64::total_cmp);
        let at = ((z.len() as f64 * self.options.keep) as usize).min(z.len().saturating_sub(1));
        z.get(at).copied().unwrap_or(0.0).max(self.options.reject)
    }

    /// Of the rows within `cut`, of which each counts as `share` of an independent one.
    fn equations(&self, fit: &Fit<From>, rows: &[Row], extra: f64, cut: f64, share: f64) -> (Normal, f64) {
        let n = rows.len() as f64;
        let centre = rows.iter().map(|r| r.y).sum::<Vector3<f64>>() / n;
        let radius = (rows.iter().map(|r| (r.y - centre).norm_squared()).sum::<f64>() / n).sqrt().max(1.0);
        let mut normal = Normal::with_offset(centre, fit.offset, self.options.offset_sigma);
        for r in rows {
            let sigma = r.sigma.hypot(extra);
            if r.distance.abs() <= cut * sigma {
                normal.add_plane(&r.y, &r.normal, r.distance, share / (sigma * sigma));
            }
        }
        for l in self.landmarks {
            let y = fit.pose.point(l.touched);
            if let Some(w) = l.noise.seen_from(&fit.pose).inner().try_inverse() {
                normal.add_point(&vec3(y.to_array()), &vec3((y - l.marked).to_array()), &w);
            }
        }
        (normal, radius)
    }

    fn finish(&self, fit: &Fit<From>, iterations: usize, last_step: f64) -> Result<Refined<From>, SurfaceError> {
        let rows = self.rows(fit);
        let reject = self.options.reject;
        let residuals: Vec<SurfaceResidual> = rows
            .iter()
            .map(|r| {
                let normalized = r.distance / r.sigma;
                SurfaceResidual { distance: r.distance, normalized, used: normalized.abs() <= reject }
            })
            .collect();
        let used = residuals.iter().filter(|r| r.used).count();
        if used < 20 || 2 * used < self.samples.len() {
            return Err(SurfaceError::Rejected { used, total: self.samples.len() });
        }
        // Hair, skin and surface are alike along a stroke: so many points count as fewer that are independent.
        let in_order: Vec<_> = residuals.iter().filter(|r| r.used).map(|r| Vector1::new(r.normalized)).collect();
        let share = independent(&in_order) / used as f64;
        let (normal, radius) = self.equations(fit, &rows, 0.0, reject, share);
        let uncertainty = normal.uncertainty(radius).ok_or(SurfaceError::Slides)?;
        let offset_sigma = normal.offset_sigma(radius).ok_or(SurfaceError::Slides)?;
        let chi: f64 = residuals.iter().filter(|r| r.used).map(|r| r.normalized.powi(2)).sum();
        let freedom = if self.landmarks.len() >= 2 { used } else { used - 6 };
        let variance_ratio = chi / freedom as f64;
        let (patient_from, offset) = (fit.pose, fit.offset);
        Ok(Refined {
            patient_from,
            residuals,
            uncertainty,
            variance_ratio,
            offset,
            offset_sigma,
            iterations,
            last_step,
            reject,
        })
    }
}

/// How much more the points are off than their noise explains, mm: added to the noise while the pose is still wrong, so
/// that landmarks lead at first and the surface at the end.
fn spread(rows: &[Row]) -> f64 {
    let mut d: Vec<f64> = rows.iter().map(|r| r.distance.abs()).collect();
    let mut s: Vec<f64> = rows.iter().map(|r| r.sigma).collect();
    d.sort_by(f64::total_cmp);
    s.sort_by(f64::total_cmp);
    let middle = rows.len() / 2;
    // 1.4826 makes a median of absolute values a standard deviation.
    let (found, noise) = (1.4826 * d.get(middle).copied().unwrap_or(0.0), s.get(middle).copied().unwrap_or(0.0));
    let excess = (found * found - noise * noise).max(0.0).sqrt();
    if excess > noise { excess } else { 0.0 }
}
