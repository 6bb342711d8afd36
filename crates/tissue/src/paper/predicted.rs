//! The predicted deformation space (paper, section II.4): where the solver goes on while the rest waits.
//!
//! The paper compares the mean change of a region's tetrahedra with that of the whole brain. Here a region is a batch of
//! elements: it joins the space when its mean motion in a sweep over all is above [`JOIN`] times that of the whole, and
//! leaves when it falls below [`LEAVE`] times (hysteresis within a substep). Between two sweeps over all, two go through
//! the space alone. A space chosen anew in each substep forgets nothing that a snapshot would miss.

use super::solver::{Motion, PaperScratch, PartScratch};

/// Every so many sweeps go over the whole tissue.
pub(crate) const WHOLE_EVERY: u32 = 3;
/// Mean motion over the whole's at which a batch joins.
const JOIN: f64 = 0.7;
/// Mean motion over the whole's at which it leaves again.
const LEAVE: f64 = 0.35;

impl PaperScratch {
    /// Chooses the space from the last measured sweep; `anew` at the start of a substep. Returns its share of all batches.
    pub(crate) fn predict_space(&mut self, anew: bool) -> f64 {
        let (mut sum, mut count) = (0.0, 0usize);
        for part in self.parts.iter().flatten() {
            sum += part.motion.ways.iter().map(|&w| f64::from(w)).sum::<f64>();
            count += part.motion.ways.len();
        }
        let whole = sum / count.max(1) as f64;
        let mut chosen = 0usize;
        for PartScratch { motion: Motion { ways, .. }, space, .. } in self.parts.iter_mut().flatten() {
            space.choose(anew, ways.len(), |b, was| f64::from(ways[b]) > whole * if was { LEAVE } else { JOIN });
            chosen += space.batches().len();
        }
        chosen as f64 / count.max(1) as f64
    }
}
