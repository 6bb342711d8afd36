//! Who begins with which pieces of work of unequal weight.
//!
//! Pieces that lie next to each other share data, so a thread should have a run of them, and the same in each round; but
//! where that would leave a thread waiting for another, they are shared out by weight. Made once, for each number of threads.

use super::MOST_THREADS;
use super::queue::Queue;

/// Numbers of threads that there are plans for.
const THREADS: core::ops::RangeInclusive<usize> = 2..=MOST_THREADS;
/// Sharing out by weight must make the slowest thread quicker by this much to be worth the loss of neighbours.
const GAIN: f64 = 0.08;

/// Plans for different numbers of threads.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Plans(Vec<Plan>);

/// A stretch of pieces for each thread.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Plan {
    /// What the places in the stretches stand for.
    pub(super) order: Vec<usize>,
    /// Where the first stretch begins, and where each ends.
    pub(super) ends: Vec<usize>,
}

impl Plans {
    /// For pieces of these weights.
    pub(crate) fn new(weights: &[usize]) -> Self {
        Self(THREADS.map(|threads| Plan::new(weights, threads)).collect())
    }

    /// How long the slowest of so many threads works, in units of weight.
    pub(crate) fn span(&self, weights: &[usize], threads: usize) -> usize {
        self.of(threads).map_or_else(|| weights.iter().sum(), |plan| plan.span(weights))
    }

    /// The plan for so many threads, if there is one.
    pub(super) fn of(&self, threads: usize) -> Option<&Plan> {
        self.0.get(threads.checked_sub(*THREADS.start())?)
    }
}

impl Plan {
    fn new(weights: &[usize], threads: usize) -> Self {
        let near = Self::neighbours(weights.len(), threads);
        let even = Self::heaviest_first(weights, threads);
        let gain = 1.0 - even.span(weights) as f64 / near.span(weights).max(1) as f64;
        if gain > GAIN { even } else { near }
    }

    /// Runs of as many pieces each, every other one from its end: threads that follow each other begin or end with the
    /// pieces where they meet, so that neither waits for the other's last ones in the round after.
    fn neighbours(count: usize, threads: usize) -> Self {
        let ends: Vec<usize> = (0..=threads).map(|t| count * t / threads).collect();
        let mut order: Vec<usize> = (0..count).collect();
        (1..threads).step_by(2).for_each(|t| order[ends[t]..ends[t + 1]].reverse());
        Self { order, ends }
    }

    /// Each piece, the heaviest first, to the thread with the least so far (Graham 1969).
    fn heaviest_first(weights: &[usize], threads: usize) -> Self {
        let mut pieces: Vec<usize> = (0..weights.len()).collect();
        pieces.sort_by_key(|&i| core::cmp::Reverse(weights[i]));
        let mut of_thread = vec![(0, Vec::new()); threads];
        for i in pieces {
            let least = (0..threads).min_by_key(|&t| of_thread[t].0).unwrap_or(0);
            of_thread[least].0 += weights[i];
            of_thread[least].1.push(i);
        }
        let end = |t: usize| of_thread[..t].iter().map(|(_, own)| own.len()).sum();
        Self { ends: (0..=threads).map(end).collect(), order: of_thread.iter().flat_map(|t| t.1.clone()).collect() }
    }

    /// How long the slowest thread works, in units of weight.
    fn span(&self, weights: &[usize]) -> usize {
        let queue = Queue::planned(self);
        let mut busy_until = vec![0; self.ends.len() - 1];
        loop {
            let next = (0..busy_until.len()).min_by_key(|&t| busy_until[t]).unwrap_or(0);
            let Some(piece) = queue.take(next) else { break };
            busy_until[next] += weights[piece];
        }
        busy_until.into_iter().max().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_stay_together_where_that_costs_little() {
        let weights = [100, 110, 95, 105, 100, 90];
        let plan = Plan::new(&weights, 2);
        assert_eq!(plan, Plan { order: vec![0, 1, 2, 5, 4, 3], ends: vec![0, 3, 6] });
    }

    #[test]
    fn pieces_of_very_unequal_weight_are_shared_out_by_weight() {
        let weights = [780, 1878, 2512, 2037, 365];
        let plan = Plan::new(&weights, 2);
        assert_eq!(plan, Plan { order: vec![2, 0, 4, 3, 1], ends: vec![0, 3, 5] });
        assert_eq!(plan.span(&weights), 1878 + 2037);
        assert_eq!(Plan::neighbours(5, 2).span(&weights), 365 + 2037 + 2512);
    }

    #[test]
    fn every_piece_is_in_every_plan_once() {
        for count in [0, 1, 2, 7, 40] {
            let weights: Vec<usize> = (0..count).map(|i| (i * 7919) % 13).collect();
            for threads in THREADS {
                let mut order = Plan::new(&weights, threads).order;
                order.sort_unstable();
                assert_eq!(order, (0..count).collect::<Vec<_>>());
            }
        }
    }
}
