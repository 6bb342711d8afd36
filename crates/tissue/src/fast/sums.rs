//! Sums of a few numbers each from a long list, sixteen sums at a time.
//!
//! One sum after the other is mostly waiting: each ends after another count of numbers, which the processor guesses wrong.
//! Sums of about as many numbers side by side end together.

use super::lanes::{Kernel, Lanes, Numbers, Places, WIDTH};
use crate::bytes;
use core::ops::Range;

/// Sums that are sorted by their lengths: many end together, few stay near each other.
const NEIGHBOURHOOD: usize = 64;
// The first sum of each batch is its longest.
const _: () = assert!(NEIGHBOURHOOD.is_multiple_of(WIDTH));

/// Batches of sums, sixteen of about as many numbers or fewer, the longest first; and where those of each piece of sums cut at
/// `cuts` begin, and the end.
pub(crate) fn side_by_side(cuts: &[usize], length: impl Fn(u32) -> usize) -> (Vec<Vec<u32>>, Vec<usize>) {
    let (mut batches, mut pieces) = (Vec::new(), vec![0]);
    for piece in cuts.windows(2) {
        let mut order: Vec<u32> = (piece[0] as u32..piece[1] as u32).collect();
        let near = order.chunks_mut(NEIGHBOURHOOD);
        near.for_each(|sums| sums.sort_by_key(|&sum| (core::cmp::Reverse(length(sum)), sum)));
        batches.extend(order.chunks(WIDTH).map(<[u32]>::to_vec));
        pieces.push(batches.len());
    }
    (batches, pieces)
}

/// Sixteen sums.
#[derive(Debug, Clone)]
struct Batch {
    /// Their numbers.
    sums: [u32; WIDTH],
    count: usize,
    rows: Range<usize>,
}

/// Which numbers go into which sum, in pieces that threads may share.
#[derive(Debug, Clone, Default)]
pub(crate) struct Sums {
    places: Places<1, u32>,
    /// Bits of the lanes whose sums are not yet at their end, of each row of places.
    lanes: Vec<u16>,
    batches: Vec<Batch>,
    /// Batch of each sum.
    batch_of: Vec<u32>,
    /// Where each piece's batches begin, and the end.
    pieces: Vec<usize>,
}

impl Sums {
    /// Of the lists `around[start[i]..start[i + 1]]`, for pieces of lists cut at `cuts`.
    pub(crate) fn new(start: &[u32], around: &[u32], cuts: &[usize]) -> Self {
        let list = |sum: u32| &around[start[sum as usize] as usize..start[sum as usize + 1] as usize];
        let (batches, pieces) = side_by_side(cuts, |sum| list(sum).len());
        let (mut rows, mut out) = (Vec::new(), Self { pieces, ..Self::default() });
        out.batch_of = vec![0; start.len().saturating_sub(1)];
        for sums in &batches {
            let (first, most) = (rows.len(), list(sums[0]).len());
            for k in 0..most {
                let place = |l: usize| sums.get(l).and_then(|&sum| list(sum).get(k));
                let some = list(sums[0])[k];
                rows.push([core::array::from_fn(|l| place(l).copied().unwrap_or(some))]);
                out.lanes.push((0..WIDTH).filter(|&l| place(l).is_some()).fold(0, |bits, l| bits | 1 << l));
            }
            let sums_of = core::array::from_fn(|l| sums[l.min(sums.len() - 1)]);
            sums.iter().for_each(|&sum| out.batch_of[sum as usize] = out.batches.len() as u32);
            out.batches.push(Batch { sums: sums_of, count: sums.len(), rows: first..rows.len() });
        }
        out.places = Places::new(rows);
        out
    }

    /// Bytes that they take.
    pub(crate) fn bytes(&self) -> usize {
        let batches = bytes::of(&self.batches) + bytes::of(&self.batch_of) + bytes::of(&self.pieces);
        self.places.bytes() + bytes::of(&self.lanes) + batches
    }

    /// Number of batches that sums are done in.
    pub(crate) fn batches(&self) -> usize {
        self.batches.len()
    }

    /// Batch that a sum is in.
    pub(crate) fn batch_of(&self, sum: usize) -> u32 {
        self.batch_of[sum]
    }

    /// Hands over each sum of a piece that is in a batch asked for, in any order.
    pub(crate) fn of_piece<T: Take>(&self, piece: usize, asked: impl Fn(u32) -> bool, numbers: &[f32], to: T) {
        let own = self.pieces[piece]..self.pieces[piece + 1];
        let batches = own.filter(|&b| asked(b as u32)).map(|b| &self.batches[b]);
        super::widest(Chosen { of: self, batches, numbers, to });
    }
}

/// What sums are for. Not a closure: these are compiled for any processor, and called.
pub(crate) trait Take {
    /// Takes a sum, with its number.
    fn take(&mut self, number: usize, sum: f32);
}

/// Some of the sums.
struct Chosen<'a, B, T> {
    of: &'a Sums,
    batches: B,
    numbers: &'a [f32],
    to: T,
}

impl Sums {
    /// The numbers of a row of places, zero where a sum has ended.
    #[inline(always)]
    fn number<V: Lanes>(&self, numbers: &Numbers<'_, 1, u32>, row: usize, first: usize) -> V {
        V::choose(self.lanes[row], first, numbers.gather(row, 0, first), V::splat(0.0))
    }
}

impl<'a, B: Iterator<Item = &'a Batch>, T: Take> Kernel for Chosen<'a, B, T> {
    type Out = ();

    #[inline(always)]
    fn run<V: Lanes>(mut self) {
        let numbers = self.of.places.numbers(self.numbers);
        for batch in self.batches {
            let mut all = [0.0; WIDTH];
            for first in (0..WIDTH).step_by(V::N).take_while(|&f| f < batch.count) {
                // Two sums at a time: one after the other would wait for each addition.
                let (mut even, mut odd) = (V::splat(0.0), V::splat(0.0));
                let mut row = batch.rows.start;
                while row + 1 < batch.rows.end {
                    even = even + self.of.number::<V>(&numbers, row, first);
                    odd = odd + self.of.number::<V>(&numbers, row + 1, first);
                    row += 2;
                }
                if row < batch.rows.end {
                    even = even + self.of.number::<V>(&numbers, row, first);
                }
                (even + odd).store(&mut all, first);
            }
            for (&number, &sum) in batch.sums[..batch.count].iter().zip(&all) {
                self.to.take(number as usize, sum);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Take for &mut Vec<(usize, f32)> {
        fn take(&mut self, number: usize, sum: f32) {
            self.push((number, sum));
        }
    }

    #[test]
    fn sums_of_any_lengths_in_any_pieces_are_those_of_each_list_by_itself() {
        let lengths: Vec<usize> = (0..75).map(|i| (i * 7) % 23).collect();
        let mut start = vec![0];
        lengths.iter().for_each(|&n| start.push(start[start.len() - 1] + n as u32));
        let around: Vec<u32> = (0..start[75]).map(|i| i * 37 % 101).collect();
        // Whole numbers, so that the order of adding does not matter.
        let numbers: Vec<f32> = (0..101).map(|i| (i * i % 59) as f32 - 20.0).collect();
        for cuts in [vec![0, 75], vec![0, 0, 16, 17, 60, 75]] {
            let sums = Sums::new(&start, &around, &cuts);
            let mut all = Vec::new();
            for piece in 0..cuts.len() - 1 {
                sums.of_piece(piece, |_| true, &numbers, &mut all);
            }
            all.sort_by_key(|s| s.0);
            assert!(all.iter().map(|s| s.0).eq(0..75));
            let found: Vec<f32> = all.iter().map(|s| s.1).collect();
            let list = |i: usize| &around[start[i] as usize..start[i + 1] as usize];
            let wanted: Vec<f32> = (0..75).map(|i| list(i).iter().map(|&p| numbers[p as usize]).sum()).collect();
            assert_eq!(found, wanted);
            let batches: Vec<u32> = [3, 40].map(|i| sums.batch_of(i)).into();
            let mut some = Vec::new();
            for piece in 0..cuts.len() - 1 {
                sums.of_piece(piece, |b| batches.contains(&b), &numbers, &mut some);
            }
            assert!([3, 40].iter().all(|&i| some.contains(&(i, wanted[i]))), "{some:?}");
            assert!(some.len() < 75 && some.iter().all(|s| s.1 == wanted[s.0]), "{some:?}");
        }
    }
}
