//! The pieces of a piece of work that are left.

use super::plan::Plan;
use super::pool::MOST;
use core::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

/// Pieces that are left, in a stretch for each thread: a thread takes its own from the front, then others' from the back.
/// The same pieces so mostly go to the same thread, whose cache still holds them.
pub(super) struct Queue<'a> {
    /// What the places in the stretches stand for, if not for themselves.
    order: Option<&'a [usize]>,
    stretches: [AtomicU64; MOST],
    threads: usize,
    left: AtomicUsize,
}

impl<'a> Queue<'a> {
    pub(super) fn new(count: usize, threads: usize) -> Self {
        Self::cut(None, threads, count, |t| count * t / threads)
    }

    pub(super) fn planned(plan: &'a Plan) -> Self {
        Self::cut(Some(&plan.order), plan.ends.len() - 1, plan.order.len(), |t| plan.ends[t])
    }

    fn cut(order: Option<&'a [usize]>, threads: usize, count: usize, end: impl Fn(usize) -> usize) -> Self {
        let stretch = |t: usize| if t < threads { (end(t) as u64) << 32 | end(t + 1) as u64 } else { 0 };
        let stretches = core::array::from_fn(|t| AtomicU64::new(stretch(t)));
        Self { order, stretches, threads, left: AtomicUsize::new(count) }
    }

    /// Pieces that are left.
    pub(super) fn len(&self) -> usize {
        self.left.load(Ordering::Relaxed)
    }

    /// A piece that nobody else gets.
    pub(super) fn take(&self, thread: usize) -> Option<usize> {
        if self.len() == 0 {
            return None;
        }
        let own = self.take_from(thread, true);
        let piece =
            own.or_else(|| (1..self.threads).find_map(|i| self.take_from((thread + i) % self.threads, false)))?;
        self.left.fetch_sub(1, Ordering::Relaxed);
        Some(self.order.map_or(piece, |order| order[piece]))
    }

    fn take_from(&self, stretch: usize, front: bool) -> Option<usize> {
        let next = |s: u64| {
            let (first, end) = (s >> 32, s & 0xffff_ffff);
            (first < end).then(|| if front { (first + 1) << 32 | end } else { first << 32 | (end - 1) })
        };
        let before = self.stretches[stretch].fetch_update(Ordering::Relaxed, Ordering::Relaxed, next).ok()?;
        Some(if front { before >> 32 } else { (before & 0xffff_ffff) - 1 } as usize)
    }
}
