//! A few threads that wait for work, and share it without being told who does what.
//!
//! A call opens a gate; threads that happen to be awake come in and take pieces of the work until none is left; then the
//! gate is closed and the caller waits for those inside. A thread that sleeps, or that the system has put aside, is never
//! waited for: the others do its pieces. Which thread does a piece never matters to the result, because pieces share no
//! data.

use super::plan::Plans;
use super::queue::Queue;
use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicBool, AtomicU16, AtomicU64, Ordering};
use std::sync::Arc;
use std::thread::JoinHandle;

/// The gate is open.
const OPEN: u64 = 1 << 16;
/// One more opening of the gate.
const EPOCH: u64 = 1 << 17;
/// Threads inside.
const INSIDE: u64 = OPEN - 1;

/// Turns of a waiting loop before a thread lets the system run something else in its place, if there is anything: a
/// thread that waits must never keep the one that it waits for from working.
const GRACE: u32 = 200;
/// Turns before a thread goes to sleep: some hundred microseconds.
const PATIENCE: u32 = 1_000;

/// Threads at most.
pub(super) const MOST: usize = 32;

type Work<'a> = dyn Fn(usize) + Sync + 'a;

/// Sweeps that threads are let in for at once.
const AT_ONCE: usize = 16;

/// Whose turn it is: a part of a round of a sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Turn {
    pub(crate) sweep: usize,
    /// The first or the second.
    pub(crate) round: usize,
    pub(crate) part: usize,
}

/// What is done with a part at its turn, with its data and its slot.
type TurnWork<'a, T, S> = dyn Fn(Turn, &mut [T], &mut S) + Sync + 'a;

/// Threads that wait.
#[derive(Debug)]
pub(crate) struct Pool {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
    busy: AtomicBool,
}

#[derive(Debug, Default)]
struct Shared {
    /// Count of openings, whether it is open, how many threads are inside.
    gate: AtomicU64,
    work: Job,
    /// Which threads sleep, one bit each.
    asleep: AtomicU64,
    stop: AtomicBool,
    /// A piece of work has panicked on another thread.
    panicked: AtomicBool,
}

/// The work behind the gate, as long as it is open.
#[derive(Default)]
struct Job(UnsafeCell<Option<&'static Work<'static>>>);

impl core::fmt::Debug for Job {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("Job")
    }
}

// SAFETY: written only by the caller of `Pool::run` while the gate is closed and nobody is inside; read only by threads
// inside, who came in after the write (acquire and release on the gate).
unsafe impl Sync for Job {}

impl Pool {
    /// A pool of `threads` threads, the caller's among them (at most [`MOST`]).
    pub(crate) fn new(threads: usize) -> Self {
        let shared = Arc::new(Shared::default());
        let start = |index: usize| {
            let shared = Arc::clone(&shared);
            let work = move || shared.wait_for_work(index);
            std::thread::Builder::new().name(format!("tissue-{index}")).spawn(work).ok()
        };
        // Without more threads the caller does everything: slower, the same result.
        let threads = (1..threads.clamp(1, MOST)).map_while(start).collect();
        Self { shared, threads, busy: AtomicBool::new(false) }
    }

    /// Threads, the caller's among them.
    pub(crate) fn threads(&self) -> usize {
        self.threads.len() + 1
    }

    /// Wakes the threads that sleep, so that they are there when work comes. A thread on its way is not called again.
    pub(crate) fn wake(&self) {
        if self.shared.asleep.load(Ordering::Relaxed) == 0 {
            return;
        }
        let asleep = self.shared.asleep.swap(0, Ordering::SeqCst);
        for (i, t) in self.threads.iter().enumerate() {
            if asleep >> (i + 1) & 1 == 1 {
                t.thread().unpark();
            }
        }
    }

    /// Calls `work` with each piece of each queue and the queue's number, once, on whichever threads are awake; no piece is
    /// taken from a queue before all of the one before it are. Queues are for so many threads.
    fn each(&self, queues: &[Queue<'_>], work: &(dyn Fn(usize, usize) + Sync)) {
        let counts = queues.iter().map(Queue::len);
        if self.threads() == 1 || counts.clone().all(|c| c < 2) || self.busy.swap(true, Ordering::Acquire) {
            counts.enumerate().for_each(|(q, count)| (0..count).for_each(|i| work(q, i)));
            return;
        }
        // One that fell asleep in a long stretch for one thread would else be missing until the next step.
        self.wake();
        let free = Free(&self.busy);
        // A call in which the caller's own piece panicked, too, may have left it set.
        self.shared.panicked.store(false, Ordering::SeqCst);
        self.open(&|thread| {
            for (q, queue) in queues.iter().enumerate() {
                while let Some(piece) = queue.take(thread) {
                    work(q, piece);
                }
            }
        });
        drop(free);
        assert!(!self.shared.panicked.swap(false, Ordering::SeqCst), "a thread of the soft body has panicked");
    }

    /// Cuts `data` at `cuts` (in order, the first is where the first part begins) and calls `work` with each part and the
    /// slot of the same number.
    ///
    /// # Panics
    /// When the cuts are not in order or beyond the data, or when there are more parts than slots.
    pub(crate) fn each_part<T: Send, S: Send>(
        &self,
        data: &mut [T],
        cuts: &[usize],
        slots: &mut [S],
        work: &(dyn Fn(usize, &mut [T], &mut S) + Sync),
    ) {
        let queue = Queue::new(cuts.len().saturating_sub(1), self.threads());
        self.each_part_of(queue, data, cuts, slots, work);
    }

    /// Calls `work` with each chunk of `data` and the place that it begins at; all are `size` long but for the last.
    ///
    /// # Panics
    /// When `size` is 0.
    pub(crate) fn each_chunk<T: Send>(&self, data: &mut [T], size: usize, work: &(dyn Fn(usize, &mut [T]) + Sync)) {
        let (count, length) = (data.len().div_ceil(size), data.len());
        let data = Base(data.as_mut_ptr());
        self.each(&[Queue::new(count, self.threads())], &|_, i| {
            let first = i * size;
            // SAFETY: chunks lie within the data, which is borrowed until all are done, and each is done once.
            work(first, unsafe { core::slice::from_raw_parts_mut(data.at(first), size.min(length - first)) });
        });
    }

    /// So many sweeps over the same data, each of two rounds of parts by plans of who begins with what. A part is begun as
    /// soon as those of the round before that it shares data with are done. `work` is told whose turn it is.
    ///
    /// # Panics
    /// As [`Pool::each_part`], and when a plan is for other parts.
    pub(crate) fn sweeps<T: Send, S: Send>(
        &self,
        (plans, cuts): (&Plans, [&[usize]; 2]),
        count: usize,
        data: &mut [T],
        [even, odd]: [&mut [S]; 2],
        work: &TurnWork<'_, T, S>,
    ) {
        for first in (0..count).step_by(AT_ONCE) {
            let sweeps = first..count.min(first + AT_ONCE);
            self.sweeps_at_once((plans, cuts), sweeps, data, [even, odd], work);
        }
    }

    /// At most [`AT_ONCE`] sweeps.
    fn sweeps_at_once<T: Send, S: Send>(
        &self,
        (plans, cuts): (&Plans, [&[usize]; 2]),
        sweeps: core::ops::Range<usize>,
        data: &mut [T],
        slots: [&mut [S]; 2],
        work: &TurnWork<'_, T, S>,
    ) {
        let parts = cuts.map(|c| c.len().saturating_sub(1));
        let plan = plans.of(self.threads());
        let even = |round: usize| Queue::new(parts[round], self.threads());
        let queue = |round: usize| plan.map_or_else(|| even(round), |p| Queue::planned(&p[round]));
        let needed = |q: usize| if q < 2 * sweeps.len() { queue(q % 2) } else { Queue::new(0, 1) };
        let queues: [Queue<'_>; 2 * AT_ONCE] = core::array::from_fn(needed);
        for round in 0..2 {
            check(&queues[round], data.len(), cuts[round], slots[round].len());
        }
        let data = Base(data.as_mut_ptr());
        let slots = slots.map(|s| Base(s.as_mut_ptr()));
        let one = |q: usize, part: usize| {
            let (sweep, round) = (sweeps.start + q / 2, q % 2);
            let (from, to) = (cuts[round][part], cuts[round][part + 1]);
            // SAFETY: the cuts are in order and within the data, which is borrowed until all pieces are done, and each
            // piece is done once. In a round nobody else has this part, or this slot; and a part comes after itself and all
            // that it shares data with in the rounds before.
            let (own, slot) =
                unsafe { (core::slice::from_raw_parts_mut(data.at(from), to - from), &mut *slots[round].at(part)) };
            work(Turn { sweep, round, part }, own, slot);
        };
        let queues = &queues[..2 * sweeps.len()];
        if parts[0].max(parts[1]) > Done::MOST {
            // Too many to tell apart: one round after the other.
            (0..queues.len()).for_each(|q| self.each(&queues[q..=q], &|_, part| one(q, part)));
            return;
        }
        let done = Done::default();
        self.each(queues, &|q, part| {
            let (round, turn) = (q % 2, q / 2);
            // All of the rounds before have been taken, by threads that are at work on them.
            done.wait(round, part, turn);
            let own = cuts[round][part]..cuts[round][part + 1];
            let other = 1 - round;
            let first = cuts[other].partition_point(|&c| c <= own.start).saturating_sub(1);
            (first..parts[other]).take_while(|&p| cuts[other][p] < own.end).for_each(|p| {
                done.wait(other, p, turn + round);
            });
            // Noted even when it panics: nobody must wait for it for ever.
            let noted = Noted(&done, round, part);
            one(q, part);
            drop(noted);
        });
    }

    fn each_part_of<T: Send, S: Send>(
        &self,
        queue: Queue<'_>,
        data: &mut [T],
        cuts: &[usize],
        slots: &mut [S],
        work: &(dyn Fn(usize, &mut [T], &mut S) + Sync),
    ) {
        check(&queue, data.len(), cuts, slots.len());
        let (data, slots) = (Base(data.as_mut_ptr()), Base(slots.as_mut_ptr()));
        self.each(&[queue], &|_, i| {
            // SAFETY: the cuts are in order and within the data, which is borrowed until all pieces are done, and each
            // piece is done once: nobody else has this part, or this slot.
            let (part, slot) = unsafe {
                (core::slice::from_raw_parts_mut(data.at(cuts[i]), cuts[i + 1] - cuts[i]), &mut *slots.at(i))
            };
            work(i, part, slot);
        });
    }

    /// Lets threads in, works along, and returns when all are out again.
    fn open(&self, work: &Work<'_>) {
        let shared = &*self.shared;
        // SAFETY: the reference is used only by threads inside the gate, and `Closing` does not let this function end,
        // by return or by panic, before the gate is closed and all of them are out.
        let lent = unsafe { core::mem::transmute::<&Work<'_>, &'static Work<'static>>(work) };
        // SAFETY: the gate is closed and nobody is inside; `busy` keeps other callers out.
        unsafe { *shared.work.0.get() = Some(lent) };
        shared.gate.fetch_add(EPOCH | OPEN, Ordering::Release);
        let closing = Closing(shared);
        work(0);
        drop(closing);
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::SeqCst);
        for t in self.threads.drain(..) {
            t.thread().unpark();
            drop(t.join());
        }
    }
}

/// Lets the next caller in, whatever happens.
struct Free<'a>(&'a AtomicBool);

impl Drop for Free<'_> {
    fn drop(&mut self) {
        self.0.store(false, Ordering::Release);
    }
}

/// Closes the gate and waits for those inside, whatever happens.
struct Closing<'a>(&'a Shared);

impl Drop for Closing<'_> {
    fn drop(&mut self) {
        self.0.gate.fetch_and(!OPEN, Ordering::AcqRel);
        let mut turns = 0u32;
        while self.0.gate.load(Ordering::Acquire) & INSIDE != 0 {
            turns += 1;
            pause(turns);
        }
    }
}

/// Waits a little: longer when it has waited before.
fn pause(turns: u32) {
    if turns < GRACE {
        core::hint::spin_loop();
    } else {
        std::thread::yield_now();
    }
}

impl Shared {
    fn wait_for_work(&self, index: usize) {
        let (mut seen, mut turns) = (0, 0u32);
        while !self.stop.load(Ordering::Relaxed) {
            let gate = self.gate.load(Ordering::Relaxed);
            let news = gate & OPEN != 0 && gate / EPOCH != seen;
            if news && self.gate.compare_exchange(gate, gate + 1, Ordering::Acquire, Ordering::Relaxed).is_ok() {
                (seen, turns) = (gate / EPOCH, 0);
                self.work_inside(index);
                self.gate.fetch_sub(1, Ordering::Release);
            } else if turns < PATIENCE {
                turns += 1;
                pause(turns);
            } else {
                turns = 0;
                self.sleep(index);
            }
        }
    }

    fn work_inside(&self, index: usize) {
        // SAFETY: this thread is inside the open gate, where the work stays until it is out.
        let work = unsafe { *self.work.0.get() };
        let run = || {
            if let Some(work) = work {
                work(index);
            }
        };
        if std::panic::catch_unwind(core::panic::AssertUnwindSafe(run)).is_err() {
            self.panicked.store(true, Ordering::SeqCst);
        }
    }

    fn sleep(&self, index: usize) {
        self.asleep.fetch_or(1 << index, Ordering::SeqCst);
        if !self.stop.load(Ordering::SeqCst) {
            std::thread::park();
        }
        self.asleep.fetch_and(!(1 << index), Ordering::SeqCst);
    }
}

fn check(queue: &Queue<'_>, data: usize, cuts: &[usize], slots: usize) {
    let parts = queue.len();
    assert_eq!(parts, cuts.len().saturating_sub(1), "a plan is for its own parts");
    let sound = cuts.is_sorted() && cuts.last().is_none_or(|&last| last <= data) && parts <= slots;
    assert!(sound, "cuts {cuts:?} of {data} entries with {slots} slots");
}

/// How often each part of both rounds is done.
struct Done([[AtomicU16; Self::MOST]; 2]);

/// Notes that a part of a round is done, whatever happens.
struct Noted<'a>(&'a Done, usize, usize);

impl Drop for Noted<'_> {
    fn drop(&mut self) {
        let Self(done, round, part) = self;
        done.0[*round][*part].fetch_add(1, Ordering::Release);
    }
}

impl Default for Done {
    fn default() -> Self {
        Self([0; 2].map(|_| core::array::from_fn(|_| AtomicU16::new(0))))
    }
}

impl Done {
    /// Parts that there is room for.
    const MOST: usize = 128;

    /// Waits until a part of a round has been done so often.
    fn wait(&self, round: usize, part: usize, times: usize) {
        let mut turns = 0u32;
        while usize::from(self.0[round][part].load(Ordering::Acquire)) < times {
            turns += 1;
            pause(turns);
        }
    }
}

/// The start of data that is lent in parts.
struct Base<T>(*mut T);

// SAFETY: `each_part` hands out parts that do not overlap, of a type that may be sent.
unsafe impl<T: Send> Sync for Base<T> {}

impl<T> Base<T> {
    /// # Safety
    /// `i` is not beyond the end of the data.
    unsafe fn at(&self, i: usize) -> *mut T {
        // SAFETY: promised by the caller.
        unsafe { self.0.add(i) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::sync::atomic::AtomicUsize;
    use core::time::Duration;
    use std::time::Instant;

    #[test]
    fn every_piece_is_done_once_on_any_number_of_threads() {
        for threads in [1, 2, 3, 7] {
            let pool = Pool::new(threads);
            for count in [0, 1, 2, 5, 64] {
                for _ in 0..200 {
                    let mut data = vec![0u32; 3 * count];
                    let cuts: Vec<usize> = (0..=count).map(|i| 3 * i).collect();
                    let mut sums = vec![0; count];
                    pool.each_part(&mut data, &cuts, &mut sums, &|i, part, sum| {
                        part.iter_mut().for_each(|v| *v += i as u32 + 1);
                        *sum += part.len();
                    });
                    assert!(sums.iter().all(|&s| s == 3));
                    let expected: Vec<u32> = (0..3 * count as u32).map(|i| i / 3 + 1).collect();
                    assert_eq!(data, expected);
                }
            }
        }
    }

    #[test]
    fn every_chunk_is_done_once_and_knows_where_it_begins() {
        for (threads, length) in [(1, 10), (2, 0), (2, 1), (2, 700), (3, 701)] {
            let mut data = vec![0; length];
            Pool::new(threads).each_chunk(&mut data, 7, &|first, chunk| {
                assert!(chunk.len() == 7 || first + chunk.len() == length);
                chunk.iter_mut().enumerate().for_each(|(i, v)| *v += first + i);
            });
            assert_eq!(data, (0..length).collect::<Vec<_>>());
        }
    }

    #[test]
    fn parts_come_after_those_of_the_round_before_that_they_share_data_with() {
        for (threads, pieces, sweeps) in [(1, 6, 3), (2, 6, 1), (2, 6, 40), (3, 9, 7), (7, 40, 10), (2, 3000, 2)] {
            let pool = Pool::new(threads);
            // Each even part shares data with two odd ones, but for the first, and the last shares none.
            let cuts = [(0..=pieces + 1).map(|i| 4 * i).collect::<Vec<_>>(), (0..pieces).map(|i| 4 * i + 2).collect()];
            let weights = [&cuts[0], &cuts[1]].map(|c| vec![1; c.len() - 1]);
            let plans = Plans::new([&weights[0], &weights[1]]);
            for _ in 0..if pieces > 100 { 3 } else { 100 } {
                let mut data = vec![0usize; 4 * (pieces + 1)];
                let (mut even, mut odd) = (vec![0; pieces + 1], vec![0; pieces - 1]);
                let how = (&plans, [&cuts[0][..], &cuts[1][..]]);
                pool.sweeps(how, sweeps, &mut data, [&mut even, &mut odd], &|turn, own, slot| {
                    assert_eq!(*slot, turn.sweep, "{turn:?}");
                    *slot += 1;
                    for (i, v) in own.iter_mut().enumerate() {
                        let place = cuts[turn.round][turn.part] + i;
                        let both = (cuts[1][0]..cuts[1][pieces - 1]).contains(&place);
                        let before = if both { 2 * turn.sweep + turn.round } else { turn.sweep };
                        assert_eq!(*v, before, "{turn:?}");
                        *v += 1;
                    }
                });
                assert!(even.iter().chain(&odd).all(|&s| s == sweeps));
            }
        }
    }

    #[test]
    fn sleeping_threads_come_when_called() {
        let pool = Pool::new(2);
        std::thread::sleep(Duration::from_millis(50));
        let (begun, own) = (AtomicUsize::new(0), std::thread::current().id());
        let others = AtomicUsize::new(0);
        // Each of the two pieces waits for the other, so that one thread alone would not get through, for a while.
        pool.each(&[Queue::new(2, 2)], &|_, _| {
            begun.fetch_add(1, Ordering::SeqCst);
            others.fetch_add(usize::from(std::thread::current().id() != own), Ordering::SeqCst);
            let start = Instant::now();
            while begun.load(Ordering::SeqCst) < 2 && start.elapsed() < Duration::from_secs(20) {
                std::thread::yield_now();
            }
        });
        assert_eq!((begun.load(Ordering::SeqCst), others.load(Ordering::SeqCst)), (2, 1));
    }

    #[test]
    fn a_call_from_within_a_piece_does_its_own_work() {
        let pool = Pool::new(2);
        let done = AtomicUsize::new(0);
        pool.each(&[Queue::new(4, 2)], &|_, _| {
            pool.each(&[Queue::new(4, 2)], &|_, _| {
                done.fetch_add(1, Ordering::SeqCst);
            });
        });
        assert_eq!(done.load(Ordering::SeqCst), 16);
    }

    #[test]
    fn a_panic_in_a_piece_reaches_the_caller_and_the_pool_goes_on() {
        let pool = Pool::new(2);
        for _ in 0..20 {
            let bad = |i: usize| i == 5;
            pieces_that_panic(&pool, &bad);
            let done = AtomicUsize::new(0);
            pool.each(&[Queue::new(8, 2)], &|_, _| {
                done.fetch_add(1, Ordering::SeqCst);
            });
            assert_eq!(done.load(Ordering::SeqCst), 8);
        }
    }

    fn pieces_that_panic(pool: &Pool, bad: &(dyn Fn(usize) -> bool + Sync)) {
        let call = || pool.each(&[Queue::new(8, 2)], &|_, i| assert!(!bad(i), "piece {i}"));
        assert!(std::panic::catch_unwind(core::panic::AssertUnwindSafe(call)).is_err());
    }

    #[test]
    fn pieces_that_panicked_on_both_threads_failed_the_next_call_too() {
        let pool = Pool::new(2);
        for _ in 0..50 {
            // Neither goes on before the other has a piece, so that both panic.
            let both = AtomicUsize::new(0);
            let bad = |_: usize| {
                both.fetch_add(1, Ordering::SeqCst);
                let start = Instant::now();
                while both.load(Ordering::SeqCst) < 2 && start.elapsed() < Duration::from_secs(20) {
                    std::thread::yield_now();
                }
                true
            };
            pieces_that_panic(&pool, &bad);
            pool.each(&[Queue::new(8, 2)], &|_, _| ());
        }
    }

    #[test]
    #[should_panic(expected = "cuts")]
    fn cuts_beyond_the_data_are_refused() {
        Pool::new(1).each_part(&mut [0u8; 4], &[0, 5], &mut [(); 1], &|_, _, _| {});
    }
}
