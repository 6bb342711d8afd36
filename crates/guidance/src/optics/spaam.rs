//! Optical see-through: single point active alignment (Tuceryan, Genc and Navab 2002). The wearer moves the head until a
//! cross on the display covers a tracked point, again and again; the pairs give the display's projection.

use super::camera::{CameraError, Correspondence, checked};
use super::dlt::{Projection, apply, projection, split};
use super::least_squares::minimise;
use super::lens::CameraFrame;
use crate::linear::rigid_of;
use monro_geometry::{Display, Frame, Point, Rigid};
use nalgebra::DVector;

/// A calibrated display of one eye. `F` is the frame of the tracked body on the wearer's head.
#[derive(Debug, Clone, PartialEq)]
pub struct DisplayCalibration<F: Frame> {
    projection: Projection,
    /// Where the eye is: the display's frame has its origin in it.
    pub display_from: Rigid<Display, F>,
    /// Focal lengths and principal point of the display, pixels: fx, fy, cx, cy.
    pub intrinsics: [f64; 4],
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
/// When the alignments are too few, lie on a plane, or contradict each other by more than `allowed` pixels.
pub fn calibrate_display<F: Frame>(
    alignments: &[Correspondence<F>],
    allowed: f64,
) -> Result<DisplayCalibration<F>, CameraError> {
    let pairs = checked(alignments, 12)?;
    let linear = projection(&pairs).ok_or(CameraError::Undetermined)?;
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
    let fit = minimise(start, &residuals).ok_or(CameraError::Undetermined)?;
    let residual = (fit.cost / pairs.len() as f64).sqrt();
    if residual > allowed {
        return Err(CameraError::Residual { found: residual, allowed });
    }
    let projection = Projection::from_column_slice(fit.x.as_slice());
    let (k, r, t) = split(&projection).ok_or(CameraError::Undetermined)?;
    let camera_from = rigid_of::<CameraFrame, F>(&r, &t).ok_or(CameraError::Undetermined)?;
    let display_from = CameraFrame::display_from_camera().after(&camera_from);
    Ok(DisplayCalibration {
        projection,
        display_from,
        intrinsics: [k[(0, 0)], k[(1, 1)], k[(0, 2)], k[(1, 2)]],
        residual,
    })
}
