//! Camera calibration from points whose places in space are tracked: DLT, then all parameters with distortion.

use super::dlt::{Pair, projection, split};
use super::least_squares::minimise;
use super::lens::{CameraFrame, Lens};
use crate::linear::{rigid_of, vec3};
use monro_geometry::{Display, Frame, Point, Rigid};
use nalgebra::{DVector, Matrix3, Rotation3, Vector3};
use std::collections::HashMap;
use thiserror::Error;

/// Why a camera calibration was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum CameraError {
    /// Too few corners.
    #[error("{found} points; at least {needed} are needed")]
    TooFew {
        /// Corners given.
        found: usize,
        /// Corners needed.
        needed: usize,
    },
    /// A corner is not finite.
    #[error("point {0} is not finite")]
    NotFinite(usize),
    /// A line twice: it looks like more than was measured.
    #[error(
        "points {} and {} of the list are the same, pixel and all: a line that comes again measures nothing anew, and would make the \
         result look more certain than it is; leave copies out",
        first + 1, second + 1
    )]
    Repeated {
        /// Index of one.
        first: usize,
        /// Index of its copy.
        second: usize,
    },
    /// The points are not in mm.
    #[error("the points span {0:.3} mm in all: are they in metres? they must be in mm")]
    Unit(f64),
    /// A corner lies outside of the picture.
    #[error("point {} at pixel ({x:.0}, {y:.0}) lies outside of a picture of {width} x {height}", corner + 1)]
    Outside {
        /// Its index.
        corner: usize,
        /// Its column.
        x: f64,
        /// Its row.
        y: f64,
        /// Of the picture, pixels.
        width: u32,
        /// Of the picture, pixels.
        height: u32,
    },
    /// The camera that explains the corners would see them behind it.
    #[error(
        "the points would lie behind the viewer, mirrored: are columns and rows exchanged (the fourth number is the column u, the fifth \
         the row v), are rows counted upwards (v = height - v turns them), or are the points in a left-handed frame?"
    )]
    Behind,
    /// The corners do not fix the view.
    #[error(
        "the middle of the view is known to {found:.2} degrees only (one standard deviation), {allowed:.2} are allowed: align over the whole display, near and far"
    )]
    Uncertain {
        /// Degrees.
        found: f64,
        /// Degrees.
        allowed: f64,
    },
    /// The corners lie on a plane, or in some other way do not determine a camera.
    #[error(
        "the points do not determine the view: they lie on one plane, or nearly; take points nearer and farther (a board: also tilted)"
    )]
    Undetermined,
    /// The corners fill too little of the picture.
    #[error(
        "the points cover {found:.0} % of the picture, at least {needed:.0} % are needed: take points up to its edges"
    )]
    Coverage {
        /// Covered, percent of an 8 by 6 raster.
        found: f64,
        /// Needed, percent.
        needed: f64,
    },
    /// The camera does not explain the corners.
    #[error(
        "the pixels are off by {found:.1} (root mean square), {allowed:.1} are allowed; the worst is point {} of the list, by {worst_by:.1}: is it a mistake, or does each point stand beside another's pixel?",
        worst + 1
    )]
    Residual {
        /// Index of the point that is off most.
        worst: usize,
        /// By how many pixels.
        worst_by: f64,
        /// Root mean square reprojection error, pixels.
        found: f64,
        /// Allowed, pixels.
        allowed: f64,
    },
}

/// A point of space and where it is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correspondence<F: Frame> {
    /// The point, mm.
    pub point: Point<F>,
    /// Pixel: column, row.
    pub pixel: [f64; 2],
}

/// What is demanded of a camera calibration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraOptions {
    /// Picture size, pixels.
    pub size: [u32; 2],
    /// Least part of the picture's raster (8 by 6) that has a corner.
    pub coverage: f64,
    /// Largest root mean square reprojection error, pixels.
    pub residual: f64,
    /// Whether the third radial coefficient is estimated too (only for very wide lenses).
    pub k3: bool,
}

impl CameraOptions {
    /// The usual demands for a picture of `width` by `height` pixels.
    pub const fn new(width: u32, height: u32) -> Self {
        Self { size: [width, height], coverage: 0.4, residual: 2.0, k3: false }
    }
}

/// A camera in space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera<F: Frame> {
    /// Its lens.
    pub lens: Lens,
    /// Where it is.
    pub camera_from: Rigid<CameraFrame, F>,
}

impl<F: Frame> Camera<F> {
    /// The pixel of a point; `None` behind the camera.
    pub fn project(&self, p: Point<F>) -> Option<[f64; 2]> {
        self.lens.project(self.camera_from.point(p))
    }

    /// Where things are in the display's frame (x right, y up, z towards the viewer), for rendering.
    pub fn display_from(&self) -> Rigid<Display, F> {
        CameraFrame::display_from_camera().after(&self.camera_from)
    }
}

/// A calibrated camera.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraCalibration<F: Frame> {
    /// The camera.
    pub camera: Camera<F>,
    /// Root mean square reprojection error, pixels.
    pub residual: f64,
    /// Reprojection error of each corner, pixels.
    pub residuals: Vec<f64>,
    /// Standard deviation of the two focal lengths, pixels.
    pub focal_sigma: [f64; 2],
    /// Part of the picture's raster (8 by 6) that has a corner.
    pub coverage: f64,
}

/// Calibrates a camera from at least eight tracked corners that do not lie on one plane.
///
/// # Errors
/// When the corners are too few, on a plane, cover too little of the picture, or are not explained by a camera.
pub fn calibrate_camera<F: Frame>(
    corners: &[Correspondence<F>],
    options: &CameraOptions,
) -> Result<CameraCalibration<F>, CameraError> {
    let pairs = checked(corners, 8)?;
    inside(corners, options.size)?;
    let coverage = coverage(corners, options.size);
    if coverage < options.coverage {
        return Err(CameraError::Coverage { found: 100.0 * coverage, needed: 100.0 * options.coverage });
    }
    let p = projection(&pairs).ok_or(CameraError::Undetermined)?;
    let start = start(&p).ok_or(CameraError::Undetermined)?;
    in_front(&p, &pairs)?;
    let free = if options.k3 { 15 } else { 14 };
    let residuals = |x: &DVector<f64>| {
        let (lens, r, t) = unpack(x);
        let mut out = DVector::zeros(2 * pairs.len());
        for (i, (point, pixel)) in pairs.iter().enumerate() {
            let seen = lens.project(crate::linear::point(&(r * point + t)))?;
            (out[2 * i], out[2 * i + 1]) = (seen[0] - pixel[0], seen[1] - pixel[1]);
        }
        Some(out)
    };
    let start = DVector::from_column_slice(&start.as_slice()[..free]);
    let fit = minimise(start, &residuals).ok_or(CameraError::Undetermined)?;
    let residual = (fit.cost / pairs.len() as f64).sqrt();
    if residual > options.residual {
        let off = residuals(&fit.x).unwrap_or_else(|| DVector::zeros(0));
        return Err(CameraError::residual(off.as_slice(), options.residual));
    }
    let (lens, r, t) = unpack(&fit.x);
    let camera_from = rigid_of(&r, &t).ok_or(CameraError::Undetermined)?;
    let camera = Camera { lens, camera_from };
    let inverse = fit.normal.try_inverse().ok_or(CameraError::Undetermined)?;
    let variance = fit.cost / (2 * pairs.len()).saturating_sub(free).max(1) as f64;
    let sigma = |i: usize| (inverse[(i, i)] * variance).max(0.0).sqrt();
    let off = |c: &Correspondence<F>| {
        camera.project(c.point).map_or(f64::INFINITY, |s| (s[0] - c.pixel[0]).hypot(s[1] - c.pixel[1]))
    };
    let residuals = corners.iter().map(off).collect();
    Ok(CameraCalibration { camera, residual, residuals, focal_sigma: [sigma(0), sigma(1)], coverage })
}

pub(super) fn checked<F: Frame>(corners: &[Correspondence<F>], needed: usize) -> Result<Vec<Pair>, CameraError> {
    if corners.len() < needed {
        return Err(CameraError::TooFew { found: corners.len(), needed });
    }
    let finite = |c: &Correspondence<F>| c.point.is_finite() && c.pixel.iter().all(|v| v.is_finite());
    if let Some(i) = corners.iter().position(|c| !finite(c)) {
        return Err(CameraError::NotFinite(i));
    }
    if let Some((first, second)) = repeated(corners) {
        return Err(CameraError::Repeated { first, second });
    }
    let pairs: Vec<Pair> = corners.iter().map(|c| (vec3(c.point.to_array()), c.pixel)).collect();
    let span = pairs.iter().map(|(x, _)| (x - pairs[0].0).norm()).fold(0.0, f64::max);
    if span < LEAST_SPAN { Err(CameraError::Unit(span)) } else { Ok(pairs) }
}

/// The first point that comes again, and where it came first.
fn repeated<F: Frame>(corners: &[Correspondence<F>]) -> Option<(usize, usize)> {
    let mut seen = HashMap::new();
    let key = |c: &Correspondence<F>| (c.point.to_array().map(f64::to_bits), c.pixel.map(f64::to_bits));
    corners.iter().enumerate().find_map(|(i, c)| seen.insert(key(c), i).map(|first| (first, i)))
}

/// No board and no series of alignments is smaller, mm.
const LEAST_SPAN: f64 = 10.0;

fn inside<F: Frame>(corners: &[Correspondence<F>], [width, height]: [u32; 2]) -> Result<(), CameraError> {
    let is_out = |v: f64, size: u32| !(-0.5..=f64::from(size) + 0.5).contains(&v);
    let out = corners.iter().position(|c| is_out(c.pixel[0], width) || is_out(c.pixel[1], height));
    out.map_or(Ok(()), |corner| {
        let [x, y] = corners[corner].pixel;
        Err(CameraError::Outside { corner, x, y, width, height })
    })
}

impl CameraError {
    /// Of differences of columns and rows in turns, pixels.
    pub(super) fn residual(off: &[f64], allowed: f64) -> Self {
        let lengths: Vec<f64> = off.as_chunks::<2>().0.iter().map(|[u, v]| u.hypot(*v)).collect();
        let worst = (0..lengths.len()).fold(0, |w, i| if lengths[i] > lengths[w] { i } else { w });
        let found = (lengths.iter().map(|l| l * l).sum::<f64>() / lengths.len().max(1) as f64).sqrt();
        Self::Residual { worst, worst_by: lengths.get(worst).copied().unwrap_or(f64::NAN), found, allowed }
    }
}

/// A linear projection that misses its points by so many pixels (root mean square) is no mirrored picture but none at all: no
/// lens bends a picture by more.
const NO_PICTURE: f64 = 50.0;

/// Refuses a projection that sees most of its points behind it: its picture is mirrored.
pub(super) fn in_front(p: &super::dlt::Projection, pairs: &[Pair]) -> Result<(), CameraError> {
    let (_, r, t) = split(p).ok_or(CameraError::Undetermined)?;
    let behind = pairs.iter().filter(|(x, _)| (r * x + t).z <= 0.0).count();
    if 2 * behind <= pairs.len() {
        return Ok(());
    }
    let off = pairs.iter().flat_map(|(x, pixel)| {
        let seen = super::dlt::apply(p, x).unwrap_or([f64::INFINITY; 2]);
        [seen[0] - pixel[0], seen[1] - pixel[1]]
    });
    let off: Vec<f64> = off.collect();
    match CameraError::residual(&off, NO_PICTURE) {
        e @ CameraError::Residual { found, .. } if found > NO_PICTURE => Err(e),
        _ => Err(CameraError::Behind),
    }
}

/// The part of an 8 by 6 raster over the picture that has a corner.
fn coverage<F: Frame>(corners: &[Correspondence<F>], size: [u32; 2]) -> f64 {
    let mut cells = [false; 48];
    for c in corners {
        let (x, y) = (c.pixel[0] / f64::from(size[0]) * 8.0, c.pixel[1] / f64::from(size[1]) * 6.0);
        if (0.0..8.0).contains(&x) && (0.0..6.0).contains(&y) {
            cells[6 * x as usize + y as usize] = true;
        }
    }
    cells.iter().filter(|c| **c).count() as f64 / 48.0
}

/// fx fy cx cy, rotation vector, translation, k1 k2 p1 p2 k3. The skew of the linear solution is dropped.
fn start(p: &super::dlt::Projection) -> Option<DVector<f64>> {
    let (k, r, t) = split(p)?;
    let turn = Rotation3::from_matrix(&r).scaled_axis();
    let mut x = DVector::zeros(15);
    x.rows_mut(0, 4).copy_from_slice(&[k[(0, 0)], k[(1, 1)], k[(0, 2)], k[(1, 2)]]);
    x.rows_mut(4, 3).copy_from(&turn);
    x.rows_mut(7, 3).copy_from(&t);
    Some(x)
}

fn unpack(x: &DVector<f64>) -> (Lens, Matrix3<f64>, Vector3<f64>) {
    let lens = Lens {
        focal: [x[0], x[1]],
        centre: [x[2], x[3]],
        radial: [x[10], x[11], x.get(14).copied().unwrap_or(0.0)],
        tangential: [x[12], x[13]],
    };
    let r = Rotation3::from_scaled_axis(Vector3::new(x[4], x[5], x[6])).into_inner();
    (lens, r, Vector3::new(x[7], x[8], x[9]))
}
