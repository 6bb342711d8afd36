//! The predicted deformation space (paper, section II.4): where the solver goes on while the rest waits.
//!
//! The paper compares the mean change of a region's tetrahedra with that of the whole brain. Here a region is a batch of
//! elements: it joins the space when its mean motion in a sweep over all is above [`JOIN`] times that of the whole, and
//! leaves when it falls below [`LEAVE`] times (hysteresis within a substep). Between two sweeps over all, two go through
//! the space alone. A space chosen anew in each substep forgets nothing that a snapshot would miss.

use super::solver::PaperScratch;

/// Every so many sweeps go over the whole tissue.
pub(crate) const WHOLE_EVERY: u32 = 3;
/// Mean motion over the whole's at which a batch joins.
const JOIN: f64 = 1.0;
/// Mean motion over the whole's at which it leaves again.
const LEAVE: f64 = 0.5;

impl PaperScratch {
    /// Chooses the space from the last measured sweep; `anew` at the start of a substep. Returns its share of all batches.
    pub(crate) fn predict_space(&mut self, anew: bool) -> f64 {
        let mean = |rows: &[f32]| rows.iter().map(|&v| f64::from(v.sqrt())).sum::<f64>();
        let (mut sum, mut count) = (0.0, 0usize);
        for part in self.parts.iter().flatten() {
            sum += part.motion.iter().map(|row| mean(row)).sum::<f64>();
            count += part.motion.len();
        }
        let whole = sum / count.max(1) as f64;
        let mut chosen = 0usize;
        for part in self.parts.iter_mut().flatten() {
            let mut before = core::mem::take(&mut part.active);
            let inside = |b: u32| !anew && before.binary_search(&b).is_ok();
            let moves = |(b, row): (usize, &crate::fast::Row)| {
                let least = if inside(b as u32) { LEAVE } else { JOIN };
                (mean(row) > least * whole).then_some(b as u32)
            };
            let active: Vec<u32> = part.motion.iter().enumerate().filter_map(moves).collect();
            before.clear();
            before.extend(active);
            chosen += before.len();
            part.active = before;
        }
        chosen as f64 / count.max(1) as f64
    }
}
