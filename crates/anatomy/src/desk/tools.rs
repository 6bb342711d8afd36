//! Tools that show what they would do before they do it.

use super::{Desk, DeskError, Target};
use crate::edit::{
    GrowthOptions, Selection, fill_holes, fill_holes_in_slices, grow, grown, islands, largest_island, shrunk, smoothed,
    threshold, without_small_islands,
};
use crate::livewire::Axis;
use monro_geometry::Structure;
use std::ops::RangeInclusive;

/// How the drawn label is combined with another one. A voxel has one label only, so the other is first grown by a
/// margin; without one, union absorbs it, and the others have nothing in common to work on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SetOperation {
    /// Voxels of either.
    Union,
    /// Voxels of both.
    Intersection,
    /// Voxels of the drawn label and not of the other.
    Difference,
    /// Voxels of exactly one.
    SymmetricDifference,
}

/// A tool and its numbers.
#[derive(Debug, Clone, PartialEq)]
pub enum Tool {
    /// All voxels with such values, HU.
    Threshold {
        /// The values.
        range: RangeInclusive<i16>,
    },
    /// The region around a seed voxel, with guards against leaks.
    Grow {
        /// The seed.
        seed: [usize; 3],
        /// The values, HU.
        range: RangeInclusive<i16>,
        /// Passages narrower than this are not entered, mm.
        neck_mm: f64,
        /// More than this is a leak, ml.
        most_ml: f64,
    },
    /// Keep the largest part.
    LargestIsland,
    /// Remove parts smaller than this, ml.
    SmallIslands {
        /// The least volume that stays.
        least_ml: f64,
    },
    /// All parts but the largest get another label.
    Split {
        /// That label.
        into: u8,
    },
    /// Fill enclosed holes, in space or on each slice of a direction.
    FillHoles {
        /// The direction.
        axis: Option<Axis>,
    },
    /// Smooth the border; the volume stays.
    Smooth {
        /// Width of the Gaussian, mm.
        sigma_mm: f64,
    },
    /// Grow the border outwards, or inwards with a negative number.
    Margin {
        /// How far, mm.
        mm: f64,
    },
    /// Combine with another label.
    Combine {
        /// How.
        operation: SetOperation,
        /// The other label.
        with: u8,
        /// How far the other is grown first, mm.
        margin_mm: f64,
    },
}

/// What a tool would do.
#[derive(Debug, Clone, PartialEq)]
pub struct Preview {
    /// The voxels that the label will have (or get).
    pub selection: Selection,
    /// Whether the label loses its other voxels.
    pub reshapes: bool,
    /// The label that the voxels get.
    pub label: u8,
    /// The label that it was asked for.
    pub asked: u8,
    /// Whether a guard stopped a growing region: it is a leak, not the structure.
    pub stopped: bool,
    /// Counts the previews of a desk, from 1: who applies one says which.
    pub number: u64,
}

impl Desk {
    /// Shows what a tool would do to a label; nothing changes yet.
    ///
    /// # Errors
    /// The tool refuses: an empty label, a number out of range, a seed out of range.
    pub fn preview(&mut self, tool: &Tool, target: &Target) -> Result<&Preview, DeskError> {
        self.end_stroke();
        self.preview = None;
        let made = self.made(tool, target)?;
        self.previews = made.number;
        Ok(self.preview.insert(made))
    }

    /// Does what the preview shows, in one step; returns the number of voxels changed. `number` says which preview was seen,
    /// where that is known: another user of the desk may have put theirs in its place.
    ///
    /// # Errors
    /// There is no preview, or it is another one, or of another label than `target`'s.
    pub fn apply(&mut self, target: &Target, number: Option<u64>) -> Result<usize, DeskError> {
        let shown = self.preview.as_ref().ok_or(DeskError::NoPreview)?;
        let name = |label| Structure::from_label(label).map_or("an unknown label", Structure::name);
        if number.is_some_and(|n| n != shown.number) || target.label != shown.asked {
            return Err(DeskError::OtherPreview { shown: name(shown.asked), wanted: name(target.label) });
        }
        let preview = self.preview.take().ok_or(DeskError::NoPreview)?;
        let target = Target { label: preview.label, ..target.clone() };
        self.as_one_step(|desk| {
            if preview.reshapes {
                let now = Selection::of_label(desk.labels(), target.label);
                desk.reshape(&now, &preview.selection, &target)
            } else {
                Ok(desk.change(&preview.selection, &target, false)?.count())
            }
        })
    }

    /// Takes the preview away; false when there is none.
    pub fn discard(&mut self) -> bool {
        self.preview.take().is_some()
    }

    fn made(&self, tool: &Tool, target: &Target) -> Result<Preview, DeskError> {
        let (label, number) = (target.label, self.previews + 1);
        let structure = Structure::from_label(label).ok_or(DeskError::Label(label))?;
        let now = Selection::of_label(self.labels(), label);
        let reshaped = |shape: Selection| {
            let selection = self.allowed_shape(&now, &shape, target)?;
            Ok(Preview { selection, reshapes: true, label, asked: label, stopped: false, number })
        };
        let added = |selection, into, stopped| {
            Ok(Preview { selection, reshapes: false, label: into, asked: label, stopped, number })
        };
        let needs_voxels = !matches!(tool, Tool::Threshold { .. } | Tool::Grow { .. } | Tool::Combine { .. });
        if needs_voxels && now.is_empty() {
            return Err(crate::edit::EditError::Empty { what: structure.name(), verb: "work on" }.into());
        }
        match tool {
            Tool::Threshold { range } => {
                added(self.permitted(&threshold(&self.ct, range.clone(), None)?, target), label, false)
            }
            Tool::Grow { seed, range, neck_mm, most_ml } => {
                let options =
                    GrowthOptions { range: range.clone(), within: None, neck_mm: *neck_mm, most_mm3: 1000.0 * most_ml };
                let growth = grow(&self.ct, &[*seed], &options)?;
                added(self.permitted(&growth.selection, target), label, growth.stopped_at.is_some())
            }
            Tool::LargestIsland => reshaped(largest_island(&now)?),
            Tool::SmallIslands { least_ml } => reshaped(without_small_islands(&now, 1000.0 * least_ml)?),
            Tool::Split { into } => {
                Structure::from_label(*into).ok_or(DeskError::Label(*into))?;
                let rest: Vec<usize> = islands(&now).iter().skip(1).flat_map(Selection::voxels).collect();
                added(Selection::from_voxels(*now.grid(), rest), *into, false)
            }
            Tool::FillHoles { axis: None } => reshaped(fill_holes(&now)),
            Tool::FillHoles { axis: Some(axis) } => reshaped(fill_holes_in_slices(&now, *axis)),
            Tool::Smooth { sigma_mm } => reshaped(smoothed(&now, *sigma_mm)?),
            Tool::Margin { mm } if *mm < 0.0 => {
                let left = shrunk(&now, -mm)?;
                if left.is_empty() { Err(DeskError::NothingLeft { label: structure.name() }) } else { reshaped(left) }
            }
            Tool::Margin { mm } => reshaped(grown(&now, *mm)?),
            Tool::Combine { operation, with, margin_mm } => {
                reshaped(self.combined(&now, *operation, (*with, *margin_mm))?)
            }
        }
    }

    fn combined(
        &self,
        now: &Selection,
        operation: SetOperation,
        (with, mm): (u8, f64),
    ) -> Result<Selection, DeskError> {
        let name = Structure::from_label(with).ok_or(DeskError::Label(with))?.name();
        let other = Selection::of_label(self.labels(), with);
        if other.is_empty() {
            return Err(crate::edit::EditError::Empty { what: name, verb: "combine with" }.into());
        }
        let other = if mm == 0.0 { other } else { grown(&other, mm)? };
        Ok(match operation {
            SetOperation::Union => now.union(&other),
            SetOperation::Intersection => now.intersection(&other),
            SetOperation::Difference => now.difference(&other),
            SetOperation::SymmetricDifference => now.symmetric_difference(&other),
        }?)
    }

    /// What a label would be after [`Desk::apply`]: of a new shape what may be gained, and what may not be lost.
    fn allowed_shape(&self, now: &Selection, shape: &Selection, target: &Target) -> Result<Selection, DeskError> {
        let gained = self.permitted(&shape.difference(now)?, target);
        let lost = self.in_range(&now.difference(shape)?, target);
        Ok(now.difference(&lost)?.union(&gained)?)
    }

    /// What the target's limits leave of a selection, so that a preview does not promise more than comes.
    fn permitted(&self, selection: &Selection, target: &Target) -> Selection {
        let limited = self.in_range(selection, target);
        let Some(over) = &target.over else { return limited };
        let fits = |n: &usize| over.contains(&self.labels().data()[*n]) || self.labels().data()[*n] == target.label;
        Selection::from_voxels(*limited.grid(), limited.voxels().filter(fits).collect())
    }
}
