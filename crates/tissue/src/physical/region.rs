//! The predicted deformation space (paper, section II.4): where the solver goes on while the rest waits.
//!
//! The paper compares the mean change of a region with that of the whole. Here a region is a batch of vertices: it joins
//! the space when its mean motion in a sweep over all is above [`JOIN`] times that of the whole, or when a tool touches it,
//! and leaves when it falls below [`LEAVE`] times (hysteresis within a substep). Chosen anew in each substep, the space
//! forgets nothing that a snapshot would miss.

use super::near::Near;
use super::rings::Part;
use super::sweep::Memory;
use super::touch::Touching;
use crate::slabs::Round;

/// Motion below this share of the model's size is none: the last digits of single precision.
const STILL: f64 = 1e-7;
/// Mean motion over the whole's at which a batch joins.
const JOIN: f64 = 1.0;
/// Mean motion over the whole's at which it leaves again.
const LEAVE: f64 = 0.6;

/// Chooses the space from the last sweep over all; `anew` at the start of a substep. `mean` is the mean way of all
/// vertices in that sweep, and `reach` the size of the model, mm. Returns the number of vertices in the space.
pub(super) fn predict(
    parts: &[(Round, Vec<Part>); 2],
    memory: &mut [Vec<Memory>; 2],
    (touching, near): (Touching<'_>, &Near),
    (anew, mean, reach): (bool, f64, f32),
) -> usize {
    let still = STILL * f64::from(reach);
    let mut nodes = 0;
    for (part, memory) in parts.iter().flat_map(|r| &r.1).zip(memory.iter_mut().flatten()) {
        let Memory { space, way, .. } = memory;
        space.choose(anew, way.len(), |b, was| {
            let batch = &part.batches[b];
            let least = (mean * if was { LEAVE } else { JOIN }).max(still);
            let joins = f64::from(way[b]) / batch.count as f64 > least || touching.held(batch) || near.has_any(batch);
            nodes += if joins { batch.count } else { 0 };
            joins
        });
    }
    nodes
}

/// The mean way of all `vertices` in the last sweep that told, mm.
pub(super) fn mean_way(memory: &[Vec<Memory>; 2], vertices: usize) -> f64 {
    let sum: f64 = memory.iter().flatten().flat_map(|m| &m.way).map(|&w| f64::from(w)).sum();
    sum / vertices.max(1) as f64
}
