//! Why no case was made.

use monro_anatomy::landmarks::LandmarkError;
use monro_anatomy::segment::SegmentError;
use monro_anatomy::surface::SurfaceError;
use monro_anatomy::tetra::MeshError;
use monro_case::CaseError;
use monro_guidance::PlanError;
use thiserror::Error;

const HINT: &str = "does the file belong to this patient, is its coordinate system (RAS or LPS) right, are entry and target exchanged?";

/// Why no case was made. Lengths are mm, positions LPS mm.
#[derive(Debug, Error)]
pub enum PrepareError {
    /// The automatic segmentation gave up.
    #[error("the automatic segmentation failed: {0}")]
    Segment(#[source] SegmentError),
    /// Given labels do not make a head.
    #[error("the labels cannot be used: {0}")]
    Labels(#[source] SegmentError),
    /// Given labels have a number that no structure has.
    #[error("label {0} is unknown; a case has 0 (outside) to 7 (third ventricle)")]
    UnknownLabel(u16),
    /// A structure has no surface.
    #[error("no surface of the {name}: {error}")]
    Surface {
        /// The structure.
        name: &'static str,
        /// The reason.
        error: SurfaceError,
    },
    /// Without landmarks there is no automatic plan.
    #[error(
        "no path can be planned: {0}; give it yourself with --plan FILE.mrk.json (a line from entry to target, drawn in 3D Slicer)"
    )]
    Landmarks(#[source] LandmarkError),
    /// The path has no length.
    #[error("the plan is not usable: {0}")]
    Plan(#[from] PlanError),
    /// The wanted side is not that of the given entry.
    #[error("--side {wanted} contradicts --plan, whose entry lies on the patient's {found}")]
    Side {
        /// The side asked for.
        wanted: &'static str,
        /// The side of the entry.
        found: &'static str,
    },
    /// The given target is not in the head.
    #[error("the target {0:.1?} (LPS mm) of --plan is not inside the skull; {HINT}")]
    Target([f64; 3]),
    /// The given entry is not near the head.
    #[error(
        "the entry {entry:.1?} (LPS mm) of --plan is {off:.1} mm from the skin, at most {most:.1} mm are taken; {HINT}"
    )]
    Entry {
        /// The entry.
        entry: [f64; 3],
        /// Its distance from the skin.
        off: f64,
        /// The largest that is taken.
        most: f64,
    },
    /// No simulation mesh.
    #[error("the tetrahedra cannot be made: {0}")]
    Tetrahedra(#[from] MeshError),
    /// The folder was not written.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// The observer asked to stop.
    #[error("stopped as asked; nothing was written")]
    Cancelled,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_out_was_told_twice_and_a_turned_head_was_called_cut() {
        let cut = LandmarkError::SkinCut { from: "the nasion", reached_mm: 0.0, needed_mm: 110.0 };
        let told = PrepareError::Landmarks(cut).to_string();
        assert_eq!(told.matches("--plan").count(), 1, "{told}");
        assert!(told.contains("0 mm of the 110 mm from the nasion") && told.contains("turned"), "{told}");
    }
}
