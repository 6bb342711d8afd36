//! Weighted sums of differences between vertices, as a matrix whose rows add up to nothing makes them.

use super::elastic::Rows;
use crate::bytes;
use crate::fast::{Kernel, Lanes};

/// Entries of a row that are summed side by side: one after the other would wait for each addition. Rows are filled up to
/// whole lots with entries that weigh nothing.
const LOT: usize = 8;

/// Rows of such a matrix in single precision. Columns lie near each other, so they are held as what they are beyond the
/// first of their row: the largest part of a model, gone through in each substep.
#[derive(Debug, Clone)]
pub(super) struct DifferenceRows {
    /// Lot that each row begins with, and the end.
    start: Vec<u32>,
    first: Vec<u32>,
    beyond: Beyond,
    weight: Vec<[f32; LOT]>,
}

#[derive(Debug, Clone)]
enum Beyond {
    Near(Vec<[u16; LOT]>),
    Far(Vec<[u32; LOT]>),
}

impl DifferenceRows {
    pub(super) fn new(rows: &Rows) -> Self {
        let count = rows.start.len() - 1;
        let own = |i: usize| rows.start[i] as usize..rows.start[i + 1] as usize;
        let lots = |i: usize| own(i).len().div_ceil(LOT);
        let all = (0..count).map(lots).sum();
        let (mut start, mut first) = (vec![0; count + 1], vec![0; count]);
        // They stay as long as the model: nothing is kept free.
        let (mut beyond, mut weight) = (Vec::with_capacity(all), Vec::with_capacity(all));
        for i in 0..count {
            let (columns, weights) = (&rows.column[own(i)], &rows.weight[own(i)]);
            first[i] = columns.iter().copied().min().unwrap_or(0);
            for k in (0..columns.len()).step_by(LOT) {
                beyond.push(core::array::from_fn(|l| columns.get(k + l).map_or(0, |c| c - first[i])));
                weight.push(core::array::from_fn(|l| weights.get(k + l).map_or(0.0, |&w| w as f32)));
            }
            start[i + 1] = weight.len() as u32;
        }
        let fits = beyond.as_flattened().iter().all(|&b: &u32| u16::try_from(b).is_ok());
        let near = || beyond.iter().map(|lot| lot.map(|b| b as u16)).collect();
        Self { start, first, weight, beyond: if fits { Beyond::Near(near()) } else { Beyond::Far(beyond) } }
    }

    /// Whether there is nothing to sum.
    pub(super) fn is_empty(&self) -> bool {
        self.weight.is_empty()
    }

    /// Bytes that they take.
    pub(super) fn bytes(&self) -> usize {
        let beyond = match &self.beyond {
            Beyond::Near(b) => bytes::of(b),
            Beyond::Far(b) => bytes::of(b),
        };
        bytes::of(&self.start) + bytes::of(&self.first) + beyond + bytes::of(&self.weight)
    }
}

/// For each vertex from `first` on, the sum of its row's weights times what others have more than it.
pub(super) struct Differences<'a> {
    pub(super) rows: &'a DifferenceRows,
    pub(super) of: &'a [[f32; 4]],
    pub(super) first: usize,
    pub(super) out: &'a mut [[f32; 4]],
}

impl Kernel for Differences<'_> {
    type Out = ();

    /// Four numbers at a time on any processor; but one with wider vectors has better words for that, too.
    #[inline(always)]
    fn run<V: Lanes>(self) {
        match &self.rows.beyond {
            Beyond::Near(beyond) => self.sums(beyond),
            Beyond::Far(beyond) => self.sums(beyond),
        }
    }
}

impl Differences<'_> {
    #[inline(always)]
    fn sums<B: Copy + Into<u32>>(self, beyond: &[[B; LOT]]) {
        let rows = self.rows;
        for (v, out) in (self.first..).zip(self.out) {
            let row = rows.start[v] as usize..rows.start[v + 1] as usize;
            let from = &self.of[rows.first[v] as usize..];
            *out = weighted((&beyond[row.clone()], &rows.weight[row]), from, self.of[v]);
        }
    }
}

/// Weighted sum of differences from `own`. Loops, not closures: these would be compiled for any processor.
#[inline(always)]
fn weighted<B: Copy + Into<u32>>(
    (beyond, weight): (&[[B; LOT]], &[[f32; LOT]]),
    from: &[[f32; 4]],
    own: [f32; 4],
) -> [f32; 4] {
    let mut sums = [[0f32; 4]; LOT];
    for (places, weights) in beyond.iter().zip(weight) {
        for i in 0..LOT {
            let other = from[places[i].into() as usize];
            for a in 0..4 {
                sums[i][a] = weights[i].mul_add(other[a] - own[a], sums[i][a]);
            }
        }
    }
    let [a, b, c, d, e, f, g, h] = sums;
    core::array::from_fn(|i| ((a[i] + b[i]) + (c[i] + d[i])) + ((e[i] + f[i]) + (g[i] + h[i])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fast::{plain, widest};

    #[test]
    fn rows_with_columns_near_and_far_give_the_same_sums() {
        // The third row reaches beyond what 16 bits hold.
        let rows = |far: u32| Rows {
            start: vec![0, 0, 5, 12],
            column: [3, 1, 2, 4, 0].into_iter().chain((0..6).map(|i| 2 * i)).chain([far]).collect(),
            weight: (0..12).map(|i| f64::from(i) - 4.5).collect(),
        };
        let of: Vec<[f32; 4]> = (0..70_000u32).map(|i| [i % 97, i % 31, i % 7, i].map(|v| v as f32 * 0.25)).collect();
        for far in [11, 69_999] {
            let (rows, single) = (rows(far), DifferenceRows::new(&rows(far)));
            assert_eq!(matches!(single.beyond, Beyond::Far(_)), far > 65_535);
            let mut out = [[[0.0; 4]; 3]; 2];
            widest(Differences { rows: &single, of: &of, first: 0, out: &mut out[0] });
            plain(Differences { rows: &single, of: &of, first: 0, out: &mut out[1] });
            assert_eq!(out[0], out[1]);
            for v in 0..3 {
                let row = rows.start[v] as usize..rows.start[v + 1] as usize;
                for a in 0..4 {
                    let one = |k: usize| rows.weight[k] * f64::from(of[rows.column[k] as usize][a] - of[v][a]);
                    let (wanted, size) =
                        (row.clone().map(one).sum::<f64>(), row.clone().map(|k| one(k).abs()).sum::<f64>());
                    assert!((f64::from(out[0][v][a]) - wanted).abs() <= 1e-6 * size, "{:?}, row {v}", out[0][v]);
                }
            }
        }
    }
}
