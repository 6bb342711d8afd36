//! Anatomical landmarks for planning: nasion, Kocher's points and the foramina of Monro.
//!
//! All come from the labels alone, so that labels corrected by hand move them.

mod error;
mod foramina;
mod profile;
mod surroundings;

pub use error::LandmarkError;

use crate::segment::Segmentation;
use monro_geometry::{Patient, Point, Volume};
use profile::{Profile, across};
use surroundings::Surroundings;

/// Along the midline skin from the nasion to the level of Kocher's points, mm.
const UP: f64 = 110.0;
/// Along the skin from the midline to Kocher's point, mm.
const ASIDE: f64 = 30.0;

/// The landmarks, LPS mm.
#[derive(Debug, Clone)]
pub struct Landmarks {
    /// Deepest point of the midline skin between forehead and nose.
    pub nasion: Point<Patient>,
    /// 110 mm from the nasion along the midsagittal skin, upwards.
    pub midline_110mm: Point<Patient>,
    /// 30 mm along the skin from there, on the patient's left.
    pub kocher_left: Point<Patient>,
    /// The same on the patient's right.
    pub kocher_right: Point<Patient>,
    /// Foramen of Monro of the left lateral ventricle.
    pub monro_left: Point<Patient>,
    /// Foramen of Monro of the right lateral ventricle.
    pub monro_right: Point<Patient>,
    /// Remarks: what was estimated, and from what.
    pub findings: Vec<String>,
}

/// Finds the landmarks of a segmented scan (on the grid of its labels; `ct` only tells where the scan ends).
///
/// # Errors
/// [`LandmarkError`]: no skin in the labels, nasion or vertex cut off, no intracranial space.
pub fn find(ct: &Volume<i16>, segmentation: &Segmentation) -> Result<Landmarks, LandmarkError> {
    let surroundings = Surroundings::new(&segmentation.labels, segmentation.midsagittal)?;
    let mut findings = Vec::new();
    let [monro_left, monro_right] = foramina::find(&surroundings, &mut findings);
    let skin = profile::Skin::new(ct.grid(), &segmentation.labels)?;
    let profile = Profile::new(&skin, &surroundings);
    let nasion = profile.nasion()?;
    let (midline, outward) = profile.along(nasion, UP)?;
    let left = segmentation.midsagittal.normal;
    let midline_110mm = profile.point(midline);
    let kocher_left = across(&skin, midline_110mm, outward, left, ASIDE)?;
    let kocher_right = across(&skin, midline_110mm, outward, -left, ASIDE)?;
    Ok(Landmarks {
        nasion: profile.point(nasion),
        midline_110mm,
        kocher_left,
        kocher_right,
        monro_left,
        monro_right,
        findings,
    })
}
