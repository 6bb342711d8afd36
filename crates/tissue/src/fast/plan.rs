//! Who begins with which parts of the sweeps.
//!
//! A part of the second round of a sweep shares data with the one of the same number in the first round and the one after
//! it, so a thread should have a run of parts that follow each other through both rounds: then it waits for others only
//! where its run ends. Parts are of unequal weight, and there are few of them; of several ways to share them out the one
//! is taken that is through first, as far as weights tell. Made once, for each number of threads.

use super::MOST_THREADS;
use super::queue::Queue;

/// Numbers of threads that there are plans for.
const THREADS: core::ops::RangeInclusive<usize> = 2..=MOST_THREADS;
/// Sharing out by weight must make a sweep quicker by this much to be worth the loss of neighbours.
const GAIN: f64 = 0.08;
/// Sweeps that follow each other without a stop, for which plans are made.
const SWEEPS: usize = 2;

/// Plans for different numbers of threads.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Plans(Vec<[Plan; 2]>);

/// A stretch of the parts of a round for each thread.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Plan {
    /// What the places in the stretches stand for.
    pub(super) order: Vec<usize>,
    /// Where the first stretch begins, and where each ends.
    pub(super) ends: Vec<usize>,
}

impl Plans {
    /// For parts of these weights in both rounds.
    pub(crate) fn new(weights: [&[usize]; 2]) -> Self {
        Self(THREADS.map(|threads| plan(weights, threads).0).collect())
    }

    /// The plan for both rounds on so many threads, if there is one.
    pub(super) fn of(&self, threads: usize) -> Option<&[Plan; 2]> {
        self.0.get(threads.checked_sub(*THREADS.start())?)
    }
}

/// How long so many threads take for a sweep, in units of weight.
pub(crate) fn span(weights: [&[usize]; 2], threads: usize) -> usize {
    plan(weights, threads).1 / SWEEPS
}

/// The best plan, and how long the threads take for [`SWEEPS`] sweeps with it.
fn plan(weights: [&[usize]; 2], threads: usize) -> ([Plan; 2], usize) {
    let timed = |plan: [Plan; 2]| {
        let time = time(&plan, weights);
        (plan, time)
    };
    let even = timed(weights.map(|w| Plan::heaviest_first(w, threads)));
    let runs = [0, -1, 1].map(|shift| timed(runs(weights, threads, shift)));
    let near = runs.into_iter().reduce(|best, next| if next.1 < best.1 { next } else { best });
    match near {
        Some(near) if even.1 as f64 >= (1.0 - GAIN) * near.1 as f64 => near,
        _ => even,
    }
}

/// Runs of parts through both rounds, of about the same weight, cut `shift` parts further. Every other run is gone through
/// from its end: threads that follow each other come last to where they meet, so that neither waits for the other there.
fn runs(weights: [&[usize]; 2], threads: usize, shift: isize) -> [Plan; 2] {
    let count = 2 * weights[0].len().max(weights[1].len());
    let mut sums = vec![0];
    (0..count).for_each(|i| sums.push(sums[i] + weights[i % 2].get(i / 2).copied().unwrap_or(0)));
    // Where more than half of a part lies before the goal, it does too.
    let before = |t: usize| sums.windows(2).take_while(|s| (s[0] + s[1]) * threads <= 2 * sums[count] * t).count();
    let cut = |t: usize| match t {
        0 => 0,
        t if t == threads => count,
        t => before(t).saturating_add_signed(shift).min(count),
    };
    let ends: Vec<usize> = (0..=threads).map(cut).collect();
    [0, 1].map(|round| {
        let of = |t: usize| (ends[t]..ends[t + 1]).filter(|i| i % 2 == round).map(|i| i / 2);
        let there = |&part: &usize| part < weights[round].len();
        let forwards = |t: usize| of(t).filter(there).collect::<Vec<_>>();
        let backwards = |t: usize| of(t).rev().filter(there).collect();
        Plan::of((0..threads).map(|t| if t % 2 == 1 { backwards(t) } else { forwards(t) }).collect())
    })
}

/// How long the threads take for [`SWEEPS`] sweeps: each takes parts as it does from a [`Queue`], and begins one when those
/// of the round before that it shares data with are done.
fn time(plan: &[Plan; 2], weights: [&[usize]; 2]) -> usize {
    let mut free = vec![(0, 0); plan[0].ends.len() - 1];
    let queues: Vec<Queue<'_>> = (0..2 * SWEEPS).map(|q| Queue::planned(&plan[q % 2])).collect();
    let mut done = weights.map(|w| vec![0; w.len()]);
    // The thread that is free first goes on; whatever it waits for has been begun.
    while let Some(t) = (0..free.len()).filter(|&t| free[t].1 < queues.len()).min_by_key(|&t| free[t]) {
        let (now, q) = free[t];
        let Some(part) = queues[q].take(t) else {
            free[t].1 += 1;
            continue;
        };
        let (round, other) = (q % 2, &done[1 - q % 2]);
        let before = other.iter().take(part + 1 + round).skip(part.saturating_sub(1 - round));
        let start = before.copied().fold(now.max(done[round][part]), usize::max);
        done[round][part] = start + weights[round][part];
        free[t].0 = done[round][part];
    }
    done.iter().flatten().copied().max().unwrap_or(0)
}

impl Plan {
    /// From the parts of each thread.
    fn of(threads: Vec<Vec<usize>>) -> Self {
        let end = |t: usize| threads[..t].iter().map(Vec::len).sum();
        Self { ends: (0..=threads.len()).map(end).collect(), order: threads.concat() }
    }

    /// Each part, the heaviest first, to the thread with the least so far (Graham 1969).
    fn heaviest_first(weights: &[usize], threads: usize) -> Self {
        let mut parts: Vec<usize> = (0..weights.len()).collect();
        parts.sort_by_key(|&i| core::cmp::Reverse(weights[i]));
        let mut of_thread = vec![(0, Vec::new()); threads];
        for i in parts {
            let least = (0..threads).min_by_key(|&t| of_thread[t].0).unwrap_or(0);
            of_thread[least].0 += weights[i];
            of_thread[least].1.push(i);
        }
        Self::of(of_thread.into_iter().map(|(_, own)| own).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_have_runs_of_parts_and_meet_at_their_ends() {
        let [even, odd] = plan([&[100, 110, 95, 105], &[105, 100, 90, 110]], 2).0;
        assert_eq!(even, Plan { order: vec![0, 1, 3, 2], ends: vec![0, 2, 4] });
        assert_eq!(odd, even);
    }

    #[test]
    fn rounds_that_cannot_be_shared_out_evenly_are_evened_out_by_each_other() {
        // The first round alone takes 1830, the second 1821.
        let weights: [&[usize]; 2] = [&[734, 1096, 1261], &[1179, 1097, 724]];
        let all: usize = weights.concat().iter().sum();
        assert!(span(weights, 2) as f64 <= 1.05 * all as f64 / 2.0, "{} of {all}", span(weights, 2));
    }

    #[test]
    fn no_plan_is_faster_than_the_work_or_slower_than_one_thread() {
        for (even, odd) in [(0, 0), (1, 0), (1, 1), (2, 1), (5, 5), (9, 8)] {
            let weights = [even, odd].map(|count| (0..count).map(|i| 1 + (i * 7919) % 13).collect::<Vec<usize>>());
            let all: usize = weights.iter().flatten().sum();
            for threads in THREADS {
                let span = span([&weights[0], &weights[1]], threads);
                assert!(span >= all / threads && span <= all, "{threads}: {span} of {all}");
            }
        }
    }

    #[test]
    fn every_part_is_in_every_plan_once() {
        for (even, odd) in [(0, 0), (1, 0), (1, 1), (2, 1), (7, 7), (40, 39), (3, 1)] {
            let weights = [even, odd].map(|count| (0..count).map(|i| (i * 7919) % 13).collect::<Vec<usize>>());
            for threads in THREADS {
                for (plan, count) in plan([&weights[0], &weights[1]], threads).0.into_iter().zip([even, odd]) {
                    let mut order = plan.order;
                    order.sort_unstable();
                    assert_eq!(order, (0..count).collect::<Vec<_>>());
                    assert!(plan.ends.is_sorted() && plan.ends.len() == threads + 1 && plan.ends[threads] == count);
                }
            }
        }
    }
}
