//! Where pressures follow the positions more often than everywhere.
//!
//! Pressures that are held while vertices sweep on push as hard as they did at first. Where a membrane has just given way,
//! what it was in balance with is then thrown out, on fine meshes further in three sweeps than any later sweep takes back.
//! So around the few vertices that go much further than the mean, or that a tool or a spring holds, they follow every second
//! sweep, everywhere else every sixth (twelfth with a predicted space): the rest of the tissue needs no more as long as it is
//! calm. While it is not, nothing is near, and all follow as often.

use super::rings::{Batch, Part};
use super::sweep::Memory;
use super::touch::Touching;
use crate::fast::WIDTH;
use crate::marks::Marks;
use crate::slabs::Round;

/// Way over the mean of all from which a vertex is near.
const FAST: f64 = 3.0;

/// What follows more often.
#[derive(Debug, Clone, Default)]
pub(super) struct Near {
    /// Elements around the near vertices, and rows of sixteen with such an element.
    elements: Marks,
    rows: Marks,
    /// Batches of sums with a patch of such an element.
    batches: Marks,
    /// Patches of the near vertices: their pressures take steps.
    patches: Marks,
}

impl Near {
    /// Forgets all, for a model of so many elements, batches of sums and patches.
    pub(super) fn clear(&mut self, (elements, batches, patches): (usize, usize, usize)) {
        self.elements.clear(elements);
        self.rows.clear(elements.div_ceil(WIDTH));
        self.batches.clear(batches);
        self.patches.clear(patches);
    }

    /// Marks the elements around the vertices that went far in the last sweep over all, and their patches of the same
    /// number; `mean` is the mean way of all vertices, mm. There are `tets` elements, and larger numbers are none.
    pub(super) fn choose(
        &mut self,
        parts: &[(Round, Vec<Part>); 2],
        memory: &[Vec<Memory>; 2],
        touching: Touching<'_>,
        (mean, tets): (f64, usize),
    ) {
        let least = (FAST * mean) as f32;
        for (part, memory) in parts.iter().flat_map(|r| &r.1).zip(memory.iter().flatten()) {
            for ((batch, motion), &way) in part.batches.iter().zip(&memory.motion).zip(&memory.way) {
                if way < least && !touching.held(batch) {
                    continue;
                }
                for lane in (0..batch.count).filter(|&l| motion[l] > least * least || touching.holds(batch.vertices[l]))
                {
                    self.patches.mark(batch.vertices[lane]);
                    let around = batch.rows().map(|row| part.tets.row(row)[0][lane]).filter(|&t| (t as usize) < tets);
                    around.for_each(|t| self.elements.mark(t));
                }
            }
        }
    }

    /// Marks the rows of the elements that are marked.
    pub(super) fn mark_rows(&mut self) {
        self.elements.list().iter().for_each(|t| self.rows.mark(t / WIDTH as u32));
    }

    /// Marks a batch of sums.
    pub(super) fn mark_batch(&mut self, batch: u32) {
        self.batches.mark(batch);
    }

    /// Marks a patch whose pressure takes steps.
    pub(super) fn mark_patch(&mut self, patch: u32) {
        self.patches.mark(patch);
    }

    /// Whether a vertex of the batch is near.
    pub(super) fn has_any(&self, batch: &Batch) -> bool {
        !self.patches.list().is_empty() && batch.vertices[..batch.count].iter().any(|&v| self.has_patch(v))
    }

    /// Whether an element is around a near vertex.
    pub(super) fn has_element(&self, element: usize) -> bool {
        self.elements.has(element)
    }

    /// Elements around the near vertices.
    pub(super) fn elements(&self) -> &[u32] {
        self.elements.list()
    }

    /// Whether a row of sixteen elements has one of them.
    pub(super) fn has_row(&self, row: usize) -> bool {
        self.rows.has(row)
    }

    /// Rows of sixteen elements with one of them.
    pub(super) fn rows(&self) -> &[u32] {
        self.rows.list()
    }

    /// Whether a batch of sums is marked.
    pub(super) fn has_batch(&self, batch: u32) -> bool {
        self.batches.has(batch as usize)
    }

    /// Whether a patch's pressure takes steps.
    pub(super) fn has_patch(&self, patch: u32) -> bool {
        self.patches.has(patch as usize)
    }

    /// Bytes that it takes.
    pub(super) fn bytes(&self) -> usize {
        [&self.elements, &self.rows, &self.batches, &self.patches].map(Marks::bytes).into_iter().sum()
    }
}
