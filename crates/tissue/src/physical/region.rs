//! The predicted deformation space (paper, section II.4): where the solver goes on while the rest waits.
//!
//! The paper compares the mean change of a region with that of the whole. Here a region is a batch of vertices: it joins
//! the space when its mean motion in a sweep over all is above [`JOIN`] times that of the whole, or when a tool touches it,
//! and leaves when it falls below [`LEAVE`] times (hysteresis within a substep). Chosen anew in each substep, the space
//! forgets nothing that a snapshot would miss.

use super::rings::Part;
use super::sweep::Memory;
use super::touch::Touching;
use crate::fast::Row;
use crate::slabs::Round;

/// Motion below this share of the model's size is none: the last digits of single precision.
const STILL: f64 = 1e-7;
/// Mean motion over the whole's at which a batch joins.
const JOIN: f64 = 1.0;
/// Mean motion over the whole's at which it leaves again.
const LEAVE: f64 = 0.6;

/// Chooses the space from the last sweep over all; `anew` at the start of a substep. `reach` is the size of the model, mm.
/// Returns the number of vertices in it.
pub(super) fn predict(
    parts: &[(Round, Vec<Part>); 2],
    memory: &mut [Vec<Memory>; 2],
    touching: Touching<'_>,
    (anew, reach): (bool, f32),
) -> usize {
    let (mut sum, mut count) = (0.0, 0usize);
    for (part, memory) in parts.iter().flat_map(|r| &r.1).zip(memory.iter().flatten()) {
        for (batch, motion) in part.batches.iter().zip(&memory.motion) {
            sum += gone(motion, batch.count);
            count += batch.count;
        }
    }
    let (whole, still) = (sum / count.max(1) as f64, STILL * f64::from(reach));
    let mut nodes = 0;
    for (part, memory) in parts.iter().flat_map(|r| &r.1).zip(memory.iter_mut().flatten()) {
        let before = core::mem::take(&mut memory.active);
        for (b, (batch, motion)) in part.batches.iter().zip(&memory.motion).enumerate() {
            let inside = !anew && before.binary_search(&(b as u32)).is_ok();
            let least = (whole * if inside { LEAVE } else { JOIN }).max(still);
            if gone(motion, batch.count) / batch.count as f64 > least || touching.held(batch) {
                memory.active.push(b as u32);
                nodes += batch.count;
            }
        }
    }
    nodes
}

/// The way that the first `count` vertices of a batch have gone, mm, from its squares.
fn gone(squares: &Row, count: usize) -> f64 {
    let ways: Row = core::array::from_fn(|l| if l < count { squares[l].sqrt() } else { 0.0 });
    // Four sums at a time: one after the other would wait for each addition.
    let sums: [f32; 4] = core::array::from_fn(|l| (ways[l] + ways[l + 4]) + (ways[l + 8] + ways[l + 12]));
    f64::from((sums[0] + sums[1]) + (sums[2] + sums[3]))
}
