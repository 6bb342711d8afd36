//! Optical see-through: single point active alignment (Tuceryan, Genc and Navab 2002). The wearer moves the head until a
//! cross on the display covers a tracked point, again and again; the pairs give the display's projection.

use super::camera::{CameraError, Correspondence, checked, in_front};
use super::dlt::{Pair, Projection, apply, projection, split};
use super::least_squares::minimise;
use super::lens::CameraFrame;
use crate::linear::rigid_of;
use monro_geometry::{Display, Frame, Point, Rigid};
use nalgebra::{DVector, Matrix3};

/// A calibrated display of one eye. `F` is the frame of the tracked body on the wearer's head.
#[derive(Debug, Clone, PartialEq)]
pub struct DisplayCalibration<F: Frame> {
    projection: Projection,
    /// Where the eye is: the display's frame has its origin in it.
    pub display_from: Rigid<Display, F>,
    /// Focal lengths and principal point of the display, pixels: fx, fy, cx, cy.
    pub intrinsics: [f64; 4],
    /// Their standard deviations, pixels (jackknife).
    pub intrinsics_sigma: [f64; 4],
    /// Root mean square distance between cross and projection, pixels.
    pub residual: f64,
}

impl<F: Frame> DisplayCalibration<F> {
    /// The pixel that covers a point; `None` at infinity.
    pub fn project(&self, p: Point<F>) -> Option<[f64; 2]> {
        apply(&self.projection, &crate::linear::vec3(p.to_array()))
    }
}

/// Calibrates a see-through display from at least twelve alignments at different distances.
///
/// # Errors
/// When the alignments are too few, lie on a plane, contradict each other by more than `allowed` pixels, lie behind the eye, or
/// cover too little to fix the middle of the view to a degree.
pub fn calibrate_display<F: Frame>(
    alignments: &[Correspondence<F>],
    allowed: f64,
) -> Result<DisplayCalibration<F>, CameraError> {
    let pairs = checked(alignments, 12)?;
    let (projection, cost) = fit(&pairs).ok_or(CameraError::Undetermined)?;
    let residual = (cost / pairs.len() as f64).sqrt();
    if residual > allowed {
        let of = |(point, pixel): &Pair| {
            let seen = apply(&projection, point).unwrap_or([f64::INFINITY; 2]);
            [seen[0] - pixel[0], seen[1] - pixel[1]]
        };
        return Err(CameraError::residual(&pairs.iter().flat_map(of).collect::<Vec<_>>(), allowed));
    }
    in_front(&projection, &pairs)?;
    let (k, r, t) = split(&projection).ok_or(CameraError::Undetermined)?;
    let camera_from = rigid_of::<CameraFrame, F>(&r, &t).ok_or(CameraError::Undetermined)?;
    let display_from = CameraFrame::display_from_camera().after(&camera_from);
    let (intrinsics, intrinsics_sigma) = (four(&k), jackknife(&pairs).ok_or(CameraError::Undetermined)?);
    let found = (0..2).map(|a| (intrinsics_sigma[2 + a] / intrinsics[a]).atan().to_degrees()).fold(0.0, f64::max);
    if found.is_nan() || found > MIDDLE_DEGREES {
        return Err(CameraError::Uncertain { found, allowed: MIDDLE_DEGREES });
    }
    Ok(DisplayCalibration { projection, display_from, intrinsics, intrinsics_sigma, residual })
}

/// How well the middle of the view must be known, degrees: half a metre away a degree is nine millimetres.
const MIDDLE_DEGREES: f64 = 1.0;

fn four(k: &Matrix3<f64>) -> [f64; 4] {
    [k[(0, 0)], k[(1, 1)], k[(0, 2)], k[(1, 2)]]
}

/// The projection with the least squares of pixel distances, and their sum.
fn fit(pairs: &[Pair]) -> Option<(Projection, f64)> {
    let linear = projection(pairs)?;
    // Divided by its length along the view, the matrix has well-scaled entries for the refinement.
    let scale = linear.fixed_view::<1, 3>(2, 0).norm();
    let start = DVector::from_iterator(12, (linear / scale).iter().copied());
    let residuals = |x: &DVector<f64>| {
        let p = Projection::from_column_slice(x.as_slice());
        let mut out = DVector::zeros(2 * pairs.len());
        for (i, (point, pixel)) in pairs.iter().enumerate() {
            let seen = apply(&p, point)?;
            (out[2 * i], out[2 * i + 1]) = (seen[0] - pixel[0], seen[1] - pixel[1]);
        }
        Some(out)
    };
    let fit = minimise(start, &residuals)?;
    Some((Projection::from_column_slice(fit.x.as_slice()), fit.cost))
}

/// Standard deviations of the intrinsics, from leaving out each alignment once (Tukey 1958): no noise level need be known.
fn jackknife(pairs: &[Pair]) -> Option<[f64; 4]> {
    let without = |i: usize| {
        let others: Vec<Pair> = (0..pairs.len()).filter(|j| *j != i).map(|j| pairs[j]).collect();
        Some(four(&split(&fit(&others)?.0)?.0))
    };
    let all: Vec<[f64; 4]> = (0..pairs.len()).map(without).collect::<Option<_>>()?;
    let n = all.len() as f64;
    Some(core::array::from_fn(|a| {
        let mean = all.iter().map(|k| k[a]).sum::<f64>() / n;
        let squares: f64 = all.iter().map(|k| (k[a] - mean).powi(2)).sum();
        ((n - 1.0) / n * squares).sqrt()
    }))
}
