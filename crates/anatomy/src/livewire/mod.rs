//! Livewire: contours on slices by shortest paths along edges, filled and interpolated between slices.
//!
//! The wire of Mortensen and Barrett ("Intelligent Scissors for Image Composition", SIGGRAPH 1995, below *MB95*;
//! "Interactive Segmentation with Intelligent Scissors", Graphical Models and Image Processing 60, 1998, below *MB98*):
//! a slice becomes a graph of pixels whose links are cheap along edges, and the wire between two clicks is the shortest
//! path. [`Livewire`] is one such session on one [`SliceImage`]; [`ContourStack`] turns masks on some slices into one on
//! every slice between them.
//!
//! The terms (link costs, cursor snap, boundary cooling, on-the-fly training) are theirs; what differs from them is said
//! where it does.
//!
//! Positions are continuous pixel indices `[column, row]` with pixel centres at whole numbers, as voxel indices are.

mod contour;
mod features;
mod filter;
mod image;
mod links;
mod refine;
mod session;
mod stack;
mod training;
mod wavefront;

pub use contour::{Contour, Mask, fill};
pub use features::FeatureOptions;
pub use image::{Axis, SliceImage};
pub use links::Weights;
pub use refine::{RefineOptions, refine};
pub use session::{Anchor, Cooling, Livewire, LivewireOptions, Origin};
pub use stack::ContourStack;

use thiserror::Error;

/// Why a livewire operation was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum LivewireError {
    /// The image has no pixels, or not as many values as pixels.
    #[error("{values} values for an image of {width} x {height} pixels; both sides must be at least 1 and match")]
    Size {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Values given.
        values: usize,
    },
    /// A value is NaN or infinite.
    #[error("{count} pixels are not finite, the first at column {column}, row {row}; fill them before drawing")]
    NotFinite {
        /// How many.
        count: usize,
        /// Column of the first.
        column: usize,
        /// Row of the first.
        row: usize,
    },
    /// An option is out of its range.
    #[error("{name} is {value}, but must be {wanted}")]
    Option {
        /// The option.
        name: &'static str,
        /// What was given.
        value: f64,
        /// The range.
        wanted: &'static str,
    },
    /// The volume has no such slice.
    #[error("slice {index} does not exist; this direction has slices 0 to {last}")]
    Slice {
        /// What was asked for.
        index: usize,
        /// The last slice.
        last: usize,
    },
    /// A position is outside the image or not a number.
    #[error("position ({x}, {y}) is outside the image of {width} x {height} pixels; click inside it")]
    Outside {
        /// Column.
        x: f64,
        /// Row.
        y: f64,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// There is no anchor yet.
    #[error("the wire has no anchor yet; click once on the edge to start it")]
    NotStarted,
    /// The contour is closed already.
    #[error("the contour is closed; undo the closing, or start a new contour")]
    Closed,
    /// An anchor that does not exist.
    #[error("there is no anchor {index}; the contour has {count}")]
    NoAnchor {
        /// What was asked for.
        index: usize,
        /// Anchors there are.
        count: usize,
    },
    /// The contour encloses nothing.
    #[error(
        "a contour of {points} points and {area_px:.2} square pixels encloses nothing; add clicks around the structure"
    )]
    Degenerate {
        /// Corners.
        points: usize,
        /// Enclosed area, square pixels.
        area_px: f64,
    },
    /// Masks of different sizes were mixed.
    #[error("a mask of {found:?} pixels does not fit slices of {expected:?}")]
    MaskSize {
        /// Columns and rows of the slices.
        expected: [usize; 2],
        /// Columns and rows given.
        found: [usize; 2],
    },
}

/// Refuses an option outside its range.
fn check_option(name: &'static str, value: f64, ok: bool, wanted: &'static str) -> Result<(), LivewireError> {
    if ok { Ok(()) } else { Err(LivewireError::Option { name, value, wanted }) }
}

#[cfg(test)]
mod tests;
