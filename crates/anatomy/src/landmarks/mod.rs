//! Anatomical landmarks for planning: nasion, Kocher's points and the foramina of Monro; falx and tentorium.
//!
//! All come from the labels, so that labels corrected by hand move them; the scan only refines the skin between voxels.

mod error;
mod face;
mod foramina;
mod profile;
mod septa;
mod surroundings;
mod vault;

pub use error::LandmarkError;
pub use septa::septa;

use crate::segment::Segmentation;
use monro_geometry::{Patient, Point, Vector, Volume};
use profile::{Profile, Skin, across};
use surroundings::Surroundings;

/// Along the midline skin from the nasion to the level of Kocher's points, mm.
const UP: f64 = 110.0;
/// Where the scan ends below Kocher's points, entries are sought lower in such steps, but not lower than this, mm: the
/// frontal sinus and the horn's own height lie below.
const LOWER: f64 = 2.0;
const LEAST_UP: f64 = 70.0;
/// Along the skin from the midline to Kocher's point, mm.
const ASIDE: f64 = 30.0;

/// The landmarks, LPS mm.
#[derive(Debug, Clone)]
pub struct Landmarks {
    /// Deepest point of the midline skin between forehead and nose.
    pub nasion: Point<Patient>,
    /// 110 mm from the nasion along the midsagittal skin, upwards; less where the scan ends below (see the findings).
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

/// Finds the landmarks of a segmented scan (on the grid of its labels; `ct` tells where the scan ends, and between
/// which voxels the skin lies).
///
/// # Errors
/// [`LandmarkError`]: no skin in the labels or none over the skull, nasion or vertex cut off, no intracranial space.
pub fn find(ct: &Volume<i16>, segmentation: &Segmentation) -> Result<Landmarks, LandmarkError> {
    let surroundings = Surroundings::new(&segmentation.labels, segmentation.midsagittal)?;
    let mut findings = Vec::new();
    let [monro_left, monro_right] = foramina::find(&surroundings, &mut findings);
    let skin = Skin::new(ct, &segmentation.labels)?;
    vault::check(&skin, &surroundings)?;
    let profile = Profile::new(&skin, &surroundings);
    let left = segmentation.midsagittal.normal;
    let bare = face::bare_finding(&skin, &profile, left);
    let nasion = profile.nasion(&mut findings)?;
    findings.extend(bare.or_else(|| face::nose_finding(&skin, &profile, left, nasion)));
    let [midline_110mm, kocher_left, kocher_right] = entries((&skin, &profile), nasion, left, &mut findings)?;
    let nasion = profile.point(nasion);
    Ok(Landmarks { nasion, midline_110mm, kocher_left, kocher_right, monro_left, monro_right, findings })
}

/// The midline point and Kocher's points; where the scan ends below them, the highest places of the same kind that it
/// shows, with a finding.
fn entries(
    (skin, profile): (&Skin<'_>, &Profile),
    nasion: f64,
    left: Vector<Patient>,
    findings: &mut Vec<String>,
) -> Result<[Point<Patient>; 3], LandmarkError> {
    let at = |way: f64| {
        let (midline, outward) = profile.along(nasion, way)?;
        let midline = profile.point(midline);
        let [of_left, of_right] = [left, -left].map(|side| across(skin, midline, outward, side, ASIDE));
        Ok([midline, of_left?, of_right?])
    };
    let cut = match at(UP) {
        Err(cut @ LandmarkError::SkinCut { .. }) => cut,
        found_or_not => return found_or_not,
    };
    let lower = (1..).map(|n| UP - LOWER * f64::from(n)).take_while(|way| *way >= LEAST_UP);
    let (way, found) = lower.filter_map(|way| at(way).ok().map(|found| (way, found))).next().ok_or(cut)?;
    findings.push(format!(
        "the scan ends below Kocher's points, {UP:.0} mm from the nasion: entry points were taken {way:.0} mm from it instead; \
         look at the path, or give one with --plan FILE.mrk.json"
    ));
    Ok(found)
}
