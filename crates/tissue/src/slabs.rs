//! Slabs of a mesh: the parts that threads work on at the same time.
//!
//! No vertex has neighbours in more than two slabs, and these follow each other (`cuts`): so everything that an element, or
//! two elements with a common edge, holds together lies in one slab or in two. All that begins in an even slab can then be
//! done at once, slab by slab, and after it all that begins in an odd one: two rounds in a sweep, however many threads, and
//! the same result for any number of them. What lies within a slab may as well be done with what begins in the slab before,
//! and evens out their work.

use crate::fast::WIDTH;

/// Vertices of two slabs at most: places within them have 16 bits.
const FIT: usize = 1 << 16;

/// Slabs of the vertices of a model, whose order follows them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Slabs {
    /// First vertex of each slab, and at the end the number of vertices.
    pub(crate) starts: Vec<usize>,
}

/// A round of a sweep: parts that can be done at the same time.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Round {
    /// First vertex of each part, and at the end where the last one ends.
    pub(crate) cuts: Vec<usize>,
}

/// Pieces that work without any order is cut into: enough for all threads, each worth the while.
pub(crate) const PIECES: usize = 16;

/// Cuts of `count` entries into at most [`PIECES`] pieces, equal but for a row of lanes: what is done sixteen at a time has few
/// that are not full.
pub(crate) fn even_cuts(count: usize) -> Vec<usize> {
    let pieces = PIECES.min(count.div_ceil(64)).max(1);
    (0..=pieces).map(|i| (count * i / pieces).next_multiple_of(WIDTH).min(count)).collect()
}

/// The lowest and the highest of some numbers.
pub(crate) fn ends(numbers: impl IntoIterator<Item = u32>) -> (u32, u32) {
    numbers.into_iter().fold((u32::MAX, 0), |(low, high), n| (low.min(n), high.max(n)))
}

/// The pieces of both between the cuts.
pub(crate) fn split_both<'a, S, T>(
    (mut one, mut other): (&'a mut [S], &'a mut [T]),
    cuts: &[usize],
) -> [(&'a mut [S], &'a mut [T]); PIECES] {
    core::array::from_fn(|i| (take_piece(&mut one, cuts, i), take_piece(&mut other, cuts, i)))
}

/// The pieces of `data` between the cuts, for threads that have no other part of it.
pub(crate) fn split<'a, T>(mut data: &'a mut [T], cuts: &[usize]) -> [&'a mut [T]; PIECES] {
    core::array::from_fn(|i| take_piece(&mut data, cuts, i))
}

/// Takes piece `i` off the front; there is none beyond the cuts.
fn take_piece<'a, T>(data: &mut &'a mut [T], cuts: &[usize], i: usize) -> &'a mut [T] {
    let length = if i + 1 < cuts.len() { cuts[i + 1] - cuts[i] } else { 0 };
    let (piece, rest) = core::mem::take(data).split_at_mut(length);
    *data = rest;
    piece
}

impl Slabs {
    /// From the slab of each vertex, which must not fall along the order of the vertices. Slabs too full for 16 bits make
    /// rounds of one part impossible; see [`Slabs::too_full`].
    pub(crate) fn new(slab_of: &[u32]) -> Self {
        debug_assert!(slab_of.is_sorted(), "vertices are ordered by slab");
        let count = slab_of.last().map_or(0, |&s| s as usize + 1);
        let mut starts: Vec<usize> = (0..count).map(|s| slab_of.partition_point(|&o| (o as usize) < s)).collect();
        starts.push(slab_of.len());
        Self { starts }
    }

    /// Number of slabs.
    pub(crate) fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Slab of a vertex.
    pub(crate) fn of(&self, vertex: u32) -> usize {
        self.starts.partition_point(|&s| s <= vertex as usize) - 1
    }

    /// The slab with whose part each item is done, so that the parts are as even as they can be. An item is the lowest and
    /// the highest of its vertices, which lie in one slab or in two that follow each other, and its weight.
    pub(crate) fn shares(&self, items: &[(u32, u32, usize)]) -> Vec<usize> {
        let mut begins = vec![0; self.len()];
        let mut within = begins.clone();
        for &(low, high, weight) in items {
            let slab = self.of(low);
            begins[slab] += weight;
            within[slab] += if self.of(high) == slab { weight } else { 0 };
        }
        let mut left = lent(&begins, &within);
        let share = |&(low, high, weight): &(u32, u32, usize)| {
            let slab = self.of(low);
            let goes = self.of(high) == slab && 2 * left[slab] > weight;
            if goes {
                left[slab] = left[slab].saturating_sub(weight);
            }
            slab - usize::from(goes)
        };
        items.iter().map(share).collect()
    }

    /// The largest number of vertices in two slabs that follow each other, if more than fit.
    pub(crate) fn too_full(&self) -> Option<usize> {
        let pairs = (0..self.len()).map(|s| self.starts[(s + 2).min(self.len())] - self.starts[s]);
        pairs.max().filter(|&n| n > FIT)
    }

    /// The two rounds of a sweep: parts of two slabs each, from an even slab on and from an odd one.
    pub(crate) fn rounds(&self) -> [Round; 2] {
        [0, 1].map(|first| {
            let mut cuts: Vec<usize> = self.starts.iter().skip(first).step_by(2).copied().collect();
            let end = self.starts.last().copied().unwrap_or(0);
            if cuts.last().is_some_and(|&c| c < end) {
                cuts.push(end);
            }
            Round { cuts }
        })
    }
}

/// How much of the work within each slab goes to the part that begins with the slab before, whose end it is. `begins` is all
/// work that begins in each slab, `within` that of it that ends there.
pub(crate) fn lent(begins: &[usize], within: &[usize]) -> Vec<usize> {
    let mut lent = vec![0; begins.len()];
    let mut shared: usize = begins.iter().sum();
    for s in 0..begins.len().saturating_sub(1) {
        // One part alone in its round is best small: all others wait for it.
        let goal = match begins.len() {
            3 if s == 1 => 0,
            3 => shared / 2,
            slabs => shared / (slabs - s),
        };
        let own = begins[s] - lent[s];
        lent[s + 1] = goal.saturating_sub(own).min(within[s + 1]);
        shared -= own + lent[s + 1];
    }
    lent
}

impl Round {
    /// Number of parts.
    pub(crate) fn parts(&self) -> usize {
        self.cuts.len().saturating_sub(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_cover_all_slabs_in_pairs() {
        let slabs = Slabs::new(&[0, 0, 1, 2, 2, 2, 3, 4]);
        assert_eq!(slabs.starts, [0, 2, 3, 6, 7, 8]);
        let [even, odd] = slabs.rounds();
        assert_eq!((even.cuts, odd.cuts), (vec![0, 3, 7, 8], vec![2, 6, 8]));
        assert_eq!((slabs.of(0), slabs.of(2), slabs.of(7)), (0, 1, 4));
        let one = Slabs::new(&[0, 0]).rounds();
        assert_eq!((one[0].parts(), one[1].parts()), (1, 0));
    }

    #[test]
    fn parts_get_as_much_to_do_as_one_another_and_nothing_that_is_not_theirs() {
        for (slabs, size) in [(1, 30), (2, 30), (4, 30), (5, 21), (8, 300)] {
            let count: u32 = slabs * size;
            let all = Slabs::new(&(0..count).map(|v| v / size).collect::<Vec<_>>());
            // Each vertex reaches the one two further on; those of the first slab weigh nothing in the beginning.
            let weight = |v: u32| if v < size / 4 { 0 } else { 1 + (v * 7919 % 5) as usize };
            let items: Vec<_> = (0..count).map(|v| (v, (v + 2).min(count - 1), weight(v))).collect();
            let shares = all.shares(&items);
            let mut work = vec![0; all.len()];
            for (&(low, high, weight), &share) in items.iter().zip(&shares) {
                let (first, last) = (all.of(low), all.of(high));
                assert!(first == share || first == last && first == share + 1, "{first} {last} {share}");
                work[share] += weight;
            }
            let even = work.iter().sum::<usize>() / work.len();
            assert!(slabs == 1 || work.iter().all(|&w| w.abs_diff(even) <= 5 * work.len()), "{work:?}");
        }
    }

    #[test]
    fn a_part_alone_in_its_round_gets_no_more_than_it_must() {
        assert_eq!(lent(&[60, 50, 70], &[55, 40, 65]), [0, 30, 0]);
        assert_eq!(lent(&[60, 50, 70], &[55, 20, 65]), [0, 20, 0]);
        assert_eq!(lent(&[10, 50, 70, 90], &[5, 40, 60, 90]), [0, 40, 46, 33]);
        assert_eq!(lent(&[], &[]), [0usize; 0]);
    }
}
