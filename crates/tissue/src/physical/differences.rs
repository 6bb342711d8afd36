//! Weighted sums of differences between vertices, as a matrix whose rows add up to nothing makes them.

use super::rings::SingleRows;
use crate::fast::{Kernel, Lanes};

/// For each vertex from `first` on, the sum of its row's weights times what others have more than it.
pub(super) struct Differences<'a> {
    pub(super) rows: &'a SingleRows,
    pub(super) of: &'a [[f32; 4]],
    pub(super) first: usize,
    pub(super) out: &'a mut [[f32; 4]],
}

impl Kernel for Differences<'_> {
    type Out = ();

    /// Four numbers at a time on any processor; but one with wider vectors has better words for that, too.
    #[inline(always)]
    fn run<V: Lanes>(self) {
        for (v, out) in (self.first..).zip(self.out) {
            *out = weighted(self.rows.row(v), self.of, self.of[v]);
        }
    }
}

/// Weighted sum of differences from `own`. Loops, not closures: these would be compiled for any processor.
#[inline(always)]
fn weighted(row: &[(u32, f32)], of: &[[f32; 4]], own: [f32; 4]) -> [f32; 4] {
    // Four sums at a time: one after the other would wait for each addition.
    let mut sums = [[0f32; 4]; 4];
    let (fours, rest) = row.as_chunks::<4>();
    for four in fours {
        for (sum, entry) in sums.iter_mut().zip(four) {
            add(sum, entry, of, own);
        }
    }
    for (sum, entry) in sums.iter_mut().zip(rest) {
        add(sum, entry, of, own);
    }
    let [a, b, c, d] = sums;
    core::array::from_fn(|i| (a[i] + b[i]) + (c[i] + d[i]))
}

#[inline(always)]
fn add(sum: &mut [f32; 4], &(n, weight): &(u32, f32), of: &[[f32; 4]], own: [f32; 4]) {
    let other = of[n as usize];
    for a in 0..4 {
        sum[a] = weight.mul_add(other[a] - own[a], sum[a]);
    }
}
