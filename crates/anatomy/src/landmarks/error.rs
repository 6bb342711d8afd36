//! What can keep a landmark from being found.

use thiserror::Error;

/// Why no landmarks were found. A plan file (`--plan FILE.mrk.json`) with entry and target replaces them.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum LandmarkError {
    /// Nothing but skull or less is labelled on the outside.
    #[error(
        "no skin: the labels have no scalp, so neither nasion nor Kocher's points can be found; give entry and target with \
         --plan FILE.mrk.json"
    )]
    NoSkin,
    /// The labels have no intracranial space or no ventricle to take bearings from.
    #[error("no {0} in the labels, so the landmarks have no bearings; complete the labels in the editor")]
    NoBearings(&'static str),
    /// No dip of the midline skin between forehead and nose.
    #[error(
        "nasion not found: the midline skin dips by only {depth_mm:.1} mm where it should lie (at least {needed_mm:.1} mm); \
         is the scan cut above the nose? Give entry and target with --plan FILE.mrk.json"
    )]
    NoNasion {
        /// Deepest dip, mm.
        depth_mm: f64,
        /// Dip needed, mm.
        needed_mm: f64,
    },
    /// The skin leaves the scan before the point is reached.
    #[error(
        "the skin leaves the scan {reached_mm:.0} mm from {from} ({needed_mm:.0} mm needed): the scan is cut there; give \
         entry and target with --plan FILE.mrk.json"
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
