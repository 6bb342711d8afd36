//! The editing desk: a scan, its labels under edit, one wire in the user's hand and one preview.
//!
//! Everything that a person does in the editor is a method here, so that a test can do it without a browser. Positions
//! on a slice are continuous pixel indices `[column, row]` as in [`crate::livewire`]; slices are named by their [`Axis`]
//! and number. What is changed goes through an [`Editor`], whose journal the caller appends to a file.

mod error;
mod tools;
mod view;
mod wire;

pub use error::DeskError;
pub use tools::{Preview, SetOperation, Tool};
pub use view::{View, views};
pub use wire::{Closed, Fill, Hover, OpenWire, WireOptions};

use crate::edit::{Diff, Drawn, EditError, Editor, Rule, Selection, stroke};
use crate::livewire::{Axis, Mask};
use monro_geometry::{Point, Structure, Volume};
use std::ops::RangeInclusive;

/// What is drawn, and where that may change anything.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// The label being drawn.
    pub label: u8,
    /// Only voxels that carry one of these labels now (or the drawn one); `None`: any.
    pub over: Option<Vec<u8>>,
    /// Only voxels with such values, HU.
    pub range: Option<RangeInclusive<i16>>,
}

impl Target {
    /// A label without limits.
    pub const fn of(label: u8) -> Self {
        Self { label, over: None, range: None }
    }

    fn rule(&self) -> Rule {
        self.over
            .as_ref()
            .map_or_else(Rule::anything, |over| Rule::only_over(&[over.as_slice(), &[self.label]].concat()))
    }

    /// What takes the place of the drawn label where nothing else is around.
    fn fallback(&self) -> u8 {
        let inside = Structure::from_label(self.label).is_some_and(Structure::is_intracranial);
        if inside && self.label != Structure::Brain.label() { Structure::Brain.label() } else { 0 }
    }
}

/// Scan, labels, wire, preview.
#[derive(Debug)]
pub struct Desk {
    ct: Volume<i16>,
    editor: Editor,
    wire: Option<wire::Wire>,
    /// Answers the mouse on other slices while the wire is open on its own.
    scout: Option<wire::Wire>,
    wire_options: WireOptions,
    preview: Option<Preview>,
    /// Previews made so far.
    previews: u64,
    stroke: Option<Stroke>,
}

/// A brush stroke that has begun.
#[derive(Debug)]
struct Stroke {
    target: Target,
    /// Slices on which it has changed something, when it is flat.
    slices: Vec<(Axis, usize)>,
}

impl Desk {
    /// Opens a scan with an editor on labels of the same grid.
    ///
    /// # Errors
    /// The dimensions differ.
    pub fn new(ct: Volume<i16>, editor: Editor) -> Result<Self, DeskError> {
        let (labels, scan) = (editor.labels().grid().dims(), ct.grid().dims());
        if labels != scan {
            return Err(DeskError::Grid { labels, scan });
        }
        let wire_options = WireOptions::default();
        Ok(Self { ct, editor, wire: None, scout: None, wire_options, preview: None, previews: 0, stroke: None })
    }

    /// The scan.
    pub const fn ct(&self) -> &Volume<i16> {
        &self.ct
    }

    /// The labels now.
    pub const fn labels(&self) -> &Volume<u8> {
        self.editor.labels()
    }

    /// Bytes to append to the journal since the last call.
    pub fn take_journal(&mut self) -> Vec<u8> {
        self.editor.take_journal()
    }

    /// Steps that can be undone and redone.
    pub const fn steps(&self) -> (usize, usize) {
        self.editor.steps()
    }

    /// Volume of each structure, ml, by label.
    pub fn volumes_ml(&self) -> [f64; 8] {
        crate::segment::remarks::volumes_ml(self.labels())
    }

    /// Values of a slice, row by row, HU.
    ///
    /// # Errors
    /// There is no such slice.
    pub fn slice_hu(&self, axis: Axis, index: usize) -> Result<Vec<i16>, DeskError> {
        let voxels = self.slice_voxels(axis, index)?;
        Ok(voxels.map(|n| self.ct.data()[n]).collect())
    }

    /// Labels of a slice, row by row; the highest bit marks the preview.
    ///
    /// # Errors
    /// There is no such slice.
    pub fn slice_labels(&self, axis: Axis, index: usize) -> Result<Vec<u8>, DeskError> {
        let shown = self.preview.as_ref().map(|p| &p.selection);
        let marked = |n: usize| u8::from(shown.is_some_and(|s| s.contains(n))) << 7;
        let voxels = self.slice_voxels(axis, index)?;
        Ok(voxels.map(|n| self.labels().data()[n] | marked(n)).collect())
    }

    fn check_slice(&self, axis: Axis, index: usize) -> Result<(), DeskError> {
        let count = self.ct.grid().dims()[axis.number()];
        if index < count { Ok(()) } else { Err(EditError::Slice { index, last: count - 1 }.into()) }
    }

    fn slice_voxels(&self, axis: Axis, index: usize) -> Result<impl Iterator<Item = usize> + '_, DeskError> {
        self.check_slice(axis, index)?;
        let dims = self.ct.grid().dims();
        let [w, h] = axis.in_plane().map(|a| dims[a]);
        Ok((0..w * h).map(move |n| {
            let [i, j, k] = axis.voxel(index, n % w, n / w);
            self.ct.grid().index(i, j, k)
        }))
    }

    /// Takes the last thing back: a click of the open wire, else the last edit. False when there is nothing.
    pub fn undo(&mut self) -> bool {
        self.end_stroke();
        if self.wire.as_mut().is_some_and(wire::Wire::undo) {
            return true;
        }
        // Clicks that were taken back before an edit is, are gone: redo brings edits back in their own order.
        self.wire = None;
        self.preview = None;
        self.editor.undo()
    }

    /// Does the last thing taken back again. False when there is nothing.
    pub fn redo(&mut self) -> bool {
        self.end_stroke();
        if self.wire.as_mut().is_some_and(wire::Wire::redo) {
            return true;
        }
        self.preview = None;
        self.editor.redo()
    }

    /// One piece of a brush stroke through positions on a slice; all pieces until [`Desk::end_stroke`] are one step.
    /// With `flat` it stays on the slice, else it is a ball. `erase` takes the label away instead.
    ///
    /// # Errors
    /// No position; a radius that is not positive; no such slice.
    pub fn brush(
        &mut self,
        target: &Target,
        (axis, index): (Axis, usize),
        positions: &[[f64; 2]],
        (radius_mm, flat, erase): (f64, bool, bool),
    ) -> Result<usize, DeskError> {
        let place = |p: &[f64; 2]| {
            let mut voxel = [0.0; 3];
            let [c, r] = axis.in_plane();
            (voxel[axis.number()], voxel[c], voxel[r]) = (index as f64, p[0], p[1]);
            self.ct.grid().patient_from_voxel().point(Point::from_array(voxel))
        };
        let line: Vec<_> = positions.iter().map(place).collect();
        self.check_slice(axis, index)?;
        let selection = stroke(self.ct.grid(), &line, radius_mm, flat.then_some(axis))?;
        if self.stroke.is_none() {
            self.editor.begin_stroke();
            self.stroke = Some(Stroke { target: target.clone(), slices: Vec::new() });
        }
        let changed = self.change(&selection, target, erase)?.count();
        if flat && changed > 0 {
            self.key(axis, target.label, index);
            let slices = self.stroke.as_mut().map(|s| &mut s.slices);
            slices.filter(|s| !s.contains(&(axis, index))).into_iter().for_each(|s| s.push((axis, index)));
        }
        Ok(changed)
    }

    /// Ends a brush stroke, if there is one.
    pub fn end_stroke(&mut self) {
        if self.stroke.take().is_some() {
            self.editor.end_stroke();
        }
    }

    /// Ends a brush stroke as [`Desk::end_stroke`], after filling again between each slice that it changed and the next
    /// drawn ones in that direction, as part of the same step. Returns the number of voxels changed by that.
    ///
    /// # Errors
    /// None that a stroke that began can meet.
    pub fn end_stroke_between(&mut self) -> Result<usize, DeskError> {
        let Some(Stroke { target, slices }) = self.stroke.take() else { return Ok(0) };
        let filled = slices.iter().map(|&(axis, index)| self.correct_between(axis, &target, index)).sum();
        self.editor.end_stroke();
        filled
    }

    /// Paints or erases within the target's limits.
    fn change(&mut self, selection: &Selection, target: &Target, erase: bool) -> Result<Diff, DeskError> {
        if Structure::from_label(target.label).is_none() {
            return Err(DeskError::Label(target.label));
        }
        // A preview shows what would become of labels that are no more.
        self.preview = None;
        let limited = self.in_range(selection, target);
        let rule = target.rule();
        let diff = if erase {
            self.editor.erase(&limited, target.label, target.fallback(), &rule)
        } else {
            self.editor.paint(&limited, target.label, &rule)
        };
        Ok(diff?)
    }

    fn in_range(&self, selection: &Selection, target: &Target) -> Selection {
        let Some(range) = &target.range else { return selection.clone() };
        let fits = |n: &usize| range.contains(&self.ct.data()[*n]);
        Selection::from_voxels(*selection.grid(), selection.voxels().filter(fits).collect())
    }

    /// Gives the voxels `now` of a label a new shape within the target's limits, as part of the current step.
    fn reshape(&mut self, now: &Selection, shape: &Selection, target: &Target) -> Result<usize, DeskError> {
        let lost = self.change(&now.difference(shape)?, target, true)?;
        let gained = self.change(&shape.difference(now)?, target, false)?;
        Ok(lost.count() + gained.count())
    }

    /// Runs edits as one undoable step.
    fn as_one_step<T>(&mut self, work: impl FnOnce(&mut Self) -> Result<T, DeskError>) -> Result<T, DeskError> {
        self.end_stroke();
        self.editor.begin_stroke();
        let out = work(self);
        self.editor.end_stroke();
        out
    }

    /// Notes that a label was drawn on a slice.
    fn key(&mut self, axis: Axis, label: u8, index: usize) {
        // Grids have far fewer slices than 2^32, and there are three directions.
        self.editor.note(Drawn { axis: axis.number() as u8, label, slice: index as u32 });
    }

    /// The slices of a direction on which a label was drawn, as of now; also those of an earlier session.
    pub fn drawn_slices(&self, axis: Axis, label: u8) -> Vec<usize> {
        self.editor.drawn_slices(axis.number() as u8, label)
    }

    /// The label's pixels on a slice.
    fn mask(&self, axis: Axis, index: usize, label: u8) -> Result<Mask, DeskError> {
        let dims = self.ct.grid().dims();
        let [w, h] = axis.in_plane().map(|a| dims[a]);
        let flags = self.slice_voxels(axis, index)?.map(|n| self.labels().data()[n] == label).collect();
        Ok(Mask::new(w, h, flags)?)
    }

    /// The voxels of a mask on a slice.
    fn selection(&self, axis: Axis, index: usize, mask: &Mask) -> Selection {
        let grid = self.ct.grid();
        let voxel = |(c, r)| {
            let [i, j, k] = axis.voxel(index, c, r);
            grid.index(i, j, k)
        };
        Selection::from_voxels(*grid, mask.pixels().map(voxel).collect())
    }
}

#[cfg(test)]
mod tests;
