//! The predicted deformation space (paper, section II.4): where the solver goes on after its first sweep.
//!
//! The paper divides the tissue by comparing the mean change of a part with that of the whole. Here a batch of vertices
//! belongs to the space when it has moved more than the whole in the last sweep over all, each in the mean, or when a
//! tool touches it. The rest of the tissue gets that one sweep. Chosen anew in each substep, the space grows and shrinks with the
//! motion and remembers nothing.

use super::descent::{Descent, DescentScratch};
use super::lanes::LANES;

/// Motion below this share of the model's size is none: the last digits of single precision.
const STILL: f32 = 1e-7;

/// How much of the mean motion of the whole a part must make to belong to the space.
const FACTOR: f32 = 0.75;

/// Parts of the model that the sweeps work on.
#[derive(Debug, Clone, Default)]
pub(crate) struct Active {
    pub(super) batches: Vec<u32>,
    pub(super) tets: Vec<u32>,
    pub(super) patches: Vec<u32>,
    /// Vertices of the space last predicted, in whole batches.
    pub(super) nodes: usize,
    marked_tets: Vec<bool>,
    marked_patches: Vec<bool>,
}

impl Descent {
    /// Everything.
    pub(super) fn whole(&self, active: &mut Active) {
        let all = |v: &mut Vec<u32>, n: usize| {
            if v.len() != n {
                v.clear();
                v.extend(0..n as u32);
            }
        };
        all(&mut active.batches, self.batches.batches.len());
        all(&mut active.tets, self.tets.len());
        all(&mut active.patches, self.patch_volume.len());
    }

    /// Keeps the batches that moved more than the mean in the last sweep; `scratch.moved` holds the square of each free
    /// vertex's motion, mm2.
    pub(super) fn predict_space(&self, active: &mut Active, scratch: &DescentScratch, reach: f32) {
        let (mut sum, mut count) = (0f64, 0u32);
        for batch in &self.batches.batches {
            for &v in &batch.vertices[..batch.count as usize] {
                sum += f64::from(scratch.moved[v as usize].sqrt());
                count += 1;
            }
        }
        let mean = (sum / f64::from(count.max(1))) as f32;
        let least = (FACTOR * mean).max(STILL * reach);
        active.batches.clear();
        active.tets.clear();
        active.patches.clear();
        active.marked_tets.clear();
        active.marked_tets.resize(self.tets.len(), false);
        active.marked_patches.clear();
        active.marked_patches.resize(self.patch_volume.len(), false);
        for (b, batch) in self.batches.batches.iter().enumerate() {
            let own = &batch.vertices[..batch.count as usize];
            let moved = own.iter().map(|&v| scratch.moved[v as usize].sqrt()).sum::<f32>() / own.len() as f32;
            if moved > least || own.iter().any(|&v| scratch.touches(v)) {
                active.batches.push(b as u32);
                self.batches.elements(batch, |t| active.mark(t, &self.patch[t as usize]));
            }
        }
        active.nodes = active.batches.len() * LANES;
    }
}

impl Active {
    fn mark(&mut self, tet: u32, patches: &[u32; 4]) {
        if core::mem::replace(&mut self.marked_tets[tet as usize], true) {
            return;
        }
        self.tets.push(tet);
        for &p in patches {
            if !core::mem::replace(&mut self.marked_patches[p as usize], true) {
                self.patches.push(p);
            }
        }
    }
}
