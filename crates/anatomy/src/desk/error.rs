//! Why the desk refused something.

use crate::edit::EditError;
use crate::livewire::LivewireError;
use thiserror::Error;

/// Why the desk refused something.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum DeskError {
    /// The wire refused.
    #[error(transparent)]
    Wire(#[from] LivewireError),
    /// A tool or the editor refused.
    #[error(transparent)]
    Edit(#[from] EditError),
    /// CT and labels do not share a grid.
    #[error("the labels have {labels:?} voxels, the scan {scan:?}; resample them first")]
    Grid {
        /// Dimensions of the labels.
        labels: [usize; 3],
        /// Dimensions of the scan.
        scan: [usize; 3],
    },
    /// A number that names no structure.
    #[error("label {0} names no structure; known are 0 outside to 7 third_ventricle")]
    Label(u8),
    /// Nothing to interpolate between.
    #[error("{label} was drawn on {slices} slices of this direction; draw it on at least two, then interpolate")]
    TooFewSlices {
        /// Name of the structure.
        label: &'static str,
        /// Slices that carry a drawing.
        slices: usize,
    },
    /// A wire is open on another slice.
    #[error("a wire is open on {view} slice {slice}: close it there (Enter) or give it up (Escape)")]
    WireElsewhere {
        /// Name of its direction.
        view: &'static str,
        /// Its slice.
        slice: usize,
    },
    /// Nothing would be left of a label.
    #[error("nothing would be left of {label}; take a smaller number")]
    NothingLeft {
        /// Name of the structure.
        label: &'static str,
    },
    /// Another preview than the one to apply.
    #[error(
        "what is shown is another preview, of {shown}, than the one of {wanted} to apply: another page or tool has replaced it; \
         preview again"
    )]
    OtherPreview {
        /// Name of the structure that is shown.
        shown: &'static str,
        /// Name of the structure to change.
        wanted: &'static str,
    },
    /// Nothing to apply.
    #[error("there is no preview to apply; choose a tool first")]
    NoPreview,
}
