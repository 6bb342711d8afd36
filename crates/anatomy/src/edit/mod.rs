//! Editing of label volumes: selections, tools, and a journal that undoes, redoes and survives a kill.
//!
//! A tool ([`threshold`], [`stroke`], [`grow`], [`islands`], [`fill_holes`], [`smoothed`], ...) makes a [`Selection`] and
//! changes nothing, so that it can be previewed. Selections combine by set operations. An [`Editor`] writes them into
//! the labels, within limits ([`Rule`]), keeps undo and redo, and gives bytes to append to a file at each step, from
//! which [`Editor::replay`] restores labels and history.

mod brush;
mod diff;
mod distance;
mod editor;
mod grow;
mod holes;
mod islands;
mod journal;
mod selection;
mod smooth;
mod threshold;

pub use brush::stroke;
pub use diff::Diff;
pub use distance::{grown, shrunk};
pub use editor::{Drawn, Editor, Rule};
pub use grow::{Growth, GrowthOptions, grow};
pub use holes::{fill_holes, fill_holes_in_slices};
pub use islands::{islands, largest_island, without_small_islands};
pub use journal::{Recovery, ReplayError};
pub use selection::Selection;
pub use smooth::smoothed;
pub use threshold::threshold;

use thiserror::Error;

/// Why an edit was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum EditError {
    /// Two things on different grids.
    #[error("a selection or volume of {found:?} voxels does not fit the labels of {expected:?}; resample it first")]
    Grid {
        /// Dimensions of the labels.
        expected: [usize; 3],
        /// Dimensions given.
        found: [usize; 3],
    },
    /// A tool got nothing to work on.
    #[error("{what} is empty; there is nothing to {verb}")]
    Empty {
        /// What is empty.
        what: &'static str,
        /// What was to be done with it.
        verb: &'static str,
    },
    /// A number is out of its range.
    #[error("{name} is {value}, but must be {wanted}")]
    Option {
        /// The number's name.
        name: &'static str,
        /// What was given.
        value: f64,
        /// The range.
        wanted: &'static str,
    },
    /// The seed's value is not in the range to be grown in.
    #[error(
        "the seed at voxel {voxel:?} has {value} HU, outside the range {low} to {high}; widen the range or move the seed"
    )]
    Seed {
        /// The seed.
        voxel: [usize; 3],
        /// Its value.
        value: i16,
        /// Lowest value of the range.
        low: i16,
        /// Highest value of the range.
        high: i16,
    },
    /// A voxel outside the volume.
    #[error("voxel {voxel:?} is outside the volume of {dims:?} voxels")]
    Outside {
        /// The voxel.
        voxel: [usize; 3],
        /// The volume.
        dims: [usize; 3],
    },
    /// The volume has no such slice.
    #[error("slice {index} does not exist; this direction has slices 0 to {last}")]
    Slice {
        /// What was asked for.
        index: usize,
        /// The last slice.
        last: usize,
    },
}

fn check(name: &'static str, value: f64, ok: bool, wanted: &'static str) -> Result<(), EditError> {
    if ok { Ok(()) } else { Err(EditError::Option { name, value, wanted }) }
}

fn check_positive_mm(name: &'static str, value: f64) -> Result<(), EditError> {
    check(name, value, value > 0.0 && value <= 1000.0, "above 0 and at most 1000 mm")
}

#[cfg(test)]
mod tests;
