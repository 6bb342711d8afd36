//! Labels under edit: painting within limits, undo and redo, and the journal.

use super::journal::{self, Event, Recovery, ReplayError};
use super::selection::check_grid;
use super::{Diff, EditError, Selection};
use monro_geometry::Volume;

/// Which voxels an edit may change.
#[derive(Debug, Clone)]
pub struct Rule {
    over: [bool; 256],
    within: Option<Selection>,
}

impl Default for Rule {
    fn default() -> Self {
        Self::anything()
    }
}

impl Rule {
    /// No limits.
    pub const fn anything() -> Self {
        Self { over: [true; 256], within: None }
    }

    /// Only voxels that carry one of these labels now.
    pub fn only_over(labels: &[u8]) -> Self {
        let mut out = Self { over: [false; 256], within: None };
        labels.iter().for_each(|&l| out.over[usize::from(l)] = true);
        out
    }

    /// Also only inside a selection (the mask of another label, a threshold).
    #[must_use]
    pub fn within(mut self, mask: Selection) -> Self {
        self.within = Some(mask);
        self
    }
}

/// One step that undo takes back, possibly of several edits (the dabs of a stroke).
#[derive(Debug, Clone, PartialEq)]
struct Step {
    diffs: Vec<Diff>,
    drawn: Vec<Drawn>,
}

/// A slice on which a label was drawn by hand: what lies between such slices is interpolated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Drawn {
    /// Index direction across the slice, 0, 1 or 2.
    pub axis: u8,
    /// The label.
    pub label: u8,
    /// Number of the slice.
    pub slice: u32,
}

/// Labels with their history.
///
/// After each call that changes something, append [`Editor::take_journal`] to a file and flush it: then a killed
/// process loses nothing but, at worst, the event that was being written.
#[derive(Debug, Clone)]
pub struct Editor {
    labels: Volume<u8>,
    past: Vec<Step>,
    future: Vec<Step>,
    /// Drawn before the first step, in journals of before a stroke without changes was one.
    drawn: Vec<Drawn>,
    in_stroke: bool,
    stroke_begun: bool,
    unwritten: Vec<u8>,
}

impl Editor {
    /// Starts on labels; the journal begins with their checksum.
    pub fn new(labels: Volume<u8>) -> Self {
        let unwritten = journal::header(&labels);
        let (past, future, drawn) = (Vec::new(), Vec::new(), Vec::new());
        Self { labels, past, future, drawn, in_stroke: false, stroke_begun: false, unwritten }
    }

    /// Restores labels and history from the labels at the start and the journal; a torn last record is dropped and
    /// counted. Cut the file to [`Recovery::valid_bytes`] before appending more.
    ///
    /// # Errors
    /// The bytes are no journal, belong to other labels, or are damaged before their end.
    pub fn replay(base: Volume<u8>, bytes: &[u8]) -> Result<(Self, Recovery), ReplayError> {
        let (events, recovery) = journal::read(bytes, &base)?;
        let mut editor = Self::new(base);
        for (record, event) in events.into_iter().enumerate() {
            // A whole record that does not fit cannot come from this program: say where.
            editor.again(event).ok_or(ReplayError::Damaged { record, offset: editor.unwritten.len() })?;
        }
        // Replaying wrote the same journal anew; all of it is on file already, except a header that was torn.
        if recovery.valid_bytes > 0 {
            editor.unwritten.clear();
        }
        Ok((editor, recovery))
    }

    /// The labels now.
    pub const fn labels(&self) -> &Volume<u8> {
        &self.labels
    }

    /// Bytes to append to the journal file since the last call.
    pub fn take_journal(&mut self) -> Vec<u8> {
        core::mem::take(&mut self.unwritten)
    }

    /// Steps that can be undone and redone.
    pub const fn steps(&self) -> (usize, usize) {
        (self.past.len(), self.future.len())
    }

    /// Edits until [`Editor::end_stroke`] are one step.
    pub const fn begin_stroke(&mut self) {
        self.in_stroke = true;
        self.stroke_begun = false;
    }

    /// Ends the step that [`Editor::begin_stroke`] began.
    pub const fn end_stroke(&mut self) {
        self.in_stroke = false;
    }

    /// Gives the selected voxels a label, as far as the rule allows (label 0 erases). Returns what changed.
    ///
    /// # Errors
    /// The selection or the rule's mask is on another grid.
    pub fn paint(&mut self, selection: &Selection, label: u8, rule: &Rule) -> Result<Diff, EditError> {
        self.write(selection, rule, |_, _| label)
    }

    /// Takes a label from the selected voxels; each becomes what most of its 26 neighbours are that are not `label`
    /// (the lower of equals), or `fallback` where there is no other label around.
    ///
    /// # Errors
    /// As [`Editor::paint`].
    pub fn erase(&mut self, selection: &Selection, label: u8, fallback: u8, rule: &Rule) -> Result<Diff, EditError> {
        let replace = |labels: &Volume<u8>, n: usize| {
            if labels.data()[n] == label { most_around(labels, n, label).unwrap_or(fallback) } else { labels.data()[n] }
        };
        self.write(selection, rule, replace)
    }

    /// Takes back the last step; false when there is none.
    pub fn undo(&mut self) -> bool {
        let Some(step) = self.past.pop() else { return false };
        step.diffs.iter().rev().for_each(|d| d.revert(&mut self.labels));
        self.future.push(step);
        self.stroke_begun = false;
        journal::append(&mut self.unwritten, &Event::Undo);
        true
    }

    /// Does the last undone step again; false when there is none.
    pub fn redo(&mut self) -> bool {
        let Some(step) = self.future.pop() else { return false };
        step.diffs.iter().for_each(|d| d.apply(&mut self.labels));
        self.past.push(step);
        self.stroke_begun = false;
        journal::append(&mut self.unwritten, &Event::Redo);
        true
    }

    /// Notes that a label was drawn on a slice, as part of the current step, or else of the last: it is undone and done
    /// again with it. A stroke that has changed no voxel is a step of its own then.
    pub fn note(&mut self, drawn: Drawn) {
        if self.all_drawn().any(|d| *d == drawn) {
            return;
        }
        if self.in_stroke && !self.stroke_begun {
            self.commit(Diff::default(), false);
        }
        self.past.last_mut().map_or(&mut self.drawn, |step| &mut step.drawn).push(drawn);
        journal::append(&mut self.unwritten, &Event::Drawn(drawn));
    }

    /// The slices across `axis` on which a label was drawn, in their order.
    pub fn drawn_slices(&self, axis: u8, label: u8) -> Vec<usize> {
        let here = self.all_drawn().filter(|d| (d.axis, d.label) == (axis, label));
        let mut slices: Vec<usize> = here.map(|d| d.slice as usize).collect();
        slices.sort_unstable();
        slices
    }

    fn all_drawn(&self) -> impl Iterator<Item = &Drawn> {
        self.drawn.iter().chain(self.past.iter().flat_map(|step| &step.drawn))
    }

    fn write(
        &mut self,
        selection: &Selection,
        rule: &Rule,
        new: impl Fn(&Volume<u8>, usize) -> u8,
    ) -> Result<Diff, EditError> {
        let dims = self.labels.grid().dims();
        check_grid(dims, selection.grid().dims())?;
        let limited = rule.within.as_ref().map(|mask| {
            check_grid(dims, mask.grid().dims())?;
            selection.intersection(mask)
        });
        let limited = limited.transpose()?;
        let mut diff = Diff::default();
        for n in limited.as_ref().unwrap_or(selection).voxels() {
            let before = self.labels.data()[n];
            if rule.over[usize::from(before)] {
                diff.push(n, before, new(&self.labels, n));
            }
        }
        if !diff.is_empty() {
            let continues = self.in_stroke && self.stroke_begun;
            self.commit(diff.clone(), continues);
        }
        Ok(diff)
    }

    fn commit(&mut self, diff: Diff, continues: bool) {
        diff.apply(&mut self.labels);
        self.future.clear();
        self.stroke_begun = true;
        let event = Event::Edit { diff: diff.clone(), continues };
        journal::append(&mut self.unwritten, &event);
        match self.past.last_mut() {
            Some(step) if continues => step.diffs.push(diff),
            _ => self.past.push(Step { diffs: vec![diff], drawn: Vec::new() }),
        }
    }

    /// Does an event of a journal; `None` when it does not fit.
    fn again(&mut self, event: Event) -> Option<()> {
        let done = match event {
            Event::Edit { diff, continues } => {
                let fits = diff.fits(&self.labels);
                if fits {
                    self.commit(diff, continues);
                }
                fits
            }
            Event::Undo => self.undo(),
            Event::Redo => self.redo(),
            Event::Drawn(drawn) => {
                self.note(drawn);
                true
            }
        };
        done.then_some(())
    }
}

/// The most frequent label among the 26 neighbours of a voxel that is not `not`.
fn most_around(labels: &Volume<u8>, n: usize, not: u8) -> Option<u8> {
    let grid = labels.grid();
    let ([i, j, k], [nx, ny, nz]) = (grid.voxel(n), grid.dims());
    let near = |v: usize, n: usize| v.saturating_sub(1)..=(v + 1).min(n - 1);
    let mut counts = [0u8; 256];
    for c in near(k, nz) {
        for b in near(j, ny) {
            for a in near(i, nx) {
                counts[usize::from(labels.at(a, b, c))] += 1;
            }
        }
    }
    let others = (0..=255u8).filter(|&l| l != not && counts[usize::from(l)] > 0);
    others.max_by_key(|&l| (counts[usize::from(l)], core::cmp::Reverse(l)))
}
