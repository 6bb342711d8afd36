//! What can keep a landmark from being found.

use thiserror::Error;

/// Why no landmarks were found. A plan with entry and target replaces them, which who asked for them says.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum LandmarkError {
    /// Nothing but skull or less is labelled on the outside.
    #[error("no skin: the labels have no scalp, so neither nasion nor Kocher's points can be found")]
    NoSkin,
    /// Over most of the vault there is nothing but the blurred border of the bone.
    #[error(
        "no skin: half of the skull has less than {thickness_mm:.1} mm over it, as where a skull was cut out of its scan, so \
         neither nasion nor Kocher's points can be found"
    )]
    BareSkull {
        /// Median thickness of what is labelled scalp, mm.
        thickness_mm: f64,
    },
    /// The labels have no intracranial space or no ventricle to take bearings from.
    #[error("no {0} in the labels, so the landmarks have no bearings; complete the labels in the editor")]
    NoBearings(&'static str),
    /// No dip of the midline skin between forehead and nose.
    #[error(
        "nasion not found: the midline skin dips by only {depth_mm:.1} mm where it should lie (at least {needed_mm:.1} mm); \
         the scan may be cut above the nose"
    )]
    NoNasion {
        /// Deepest dip, mm.
        depth_mm: f64,
        /// Dip needed, mm.
        needed_mm: f64,
    },
    /// The skin leaves the scan before the point is reached.
    #[error(
        "the skin can be followed for {reached_mm:.0} mm of the {needed_mm:.0} mm from {from} that lead to Kocher's points: \
         there it leaves the scan, which is cut or in which the head lies turned"
    )]
    SkinCut {
        /// Where the way along the skin started.
        from: &'static str,
        /// Way covered, mm.
        reached_mm: f64,
        /// Way needed, mm.
        needed_mm: f64,
    },
}
