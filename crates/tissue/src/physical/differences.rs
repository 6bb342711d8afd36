//! Weighted sums of differences between vertices, as a matrix whose rows add up to nothing makes them.

use super::elastic::Rows;
use crate::bytes;
use crate::fast::{Kernel, Lanes, Place, Places, Row, WIDTH, side_by_side};
use core::ops::Range;

/// Rows of such a matrix in single precision, sixteen side by side: the largest part of a model, gone through in each substep.
/// Columns of a batch lie near each other, so they are held as what they are beyond the first vertex of a window.
#[derive(Debug, Clone)]
pub(super) struct DifferenceRows {
    batches: Vec<Batch>,
    /// Where each piece's batches begin, and the end.
    pieces: Vec<usize>,
    /// Rows of each batch.
    own: Places<1, u32>,
    columns: Columns,
    weights: Vec<Row>,
}

/// Sixteen rows, or fewer at the end of a piece.
#[derive(Debug, Clone)]
struct Batch {
    count: usize,
    /// First vertex of the window.
    from: usize,
    steps: Range<usize>,
}

#[derive(Debug, Clone)]
enum Columns {
    Near(Places<1, u16>),
    Far(Places<1, u32>),
}

impl Columns {
    fn new(places: Vec<[[u32; WIDTH]; 1]>) -> Self {
        let fit = places.iter().flatten().flatten().all(|&p| u16::try_from(p).is_ok());
        if fit {
            return Self::Near(Places::new(places.iter().map(|[lanes]| [lanes.map(|p| p as u16)]).collect()));
        }
        Self::Far(Places::new(places))
    }
}

impl DifferenceRows {
    /// For pieces of rows cut at `cuts`.
    pub(super) fn new(rows: &Rows, cuts: &[usize]) -> Self {
        let entries = |row: u32| rows.start[row as usize] as usize..rows.start[row as usize + 1] as usize;
        let (batches, pieces) = side_by_side(cuts, |row| entries(row).len());
        let ends = |batch: &[u32]| {
            let columns = batch.iter().flat_map(|&row| &rows.column[entries(row)]).map(|&c| c as usize);
            columns.fold((usize::MAX, 0), |(low, high), c| (low.min(c), high.max(c)))
        };
        let window = batches.iter().map(|b| ends(b)).map(|(low, high)| high.saturating_sub(low) + 1).max().unwrap_or(0);
        // They stay as long as the model: nothing is kept free.
        let steps = batches.iter().map(|b| entries(b[0]).len()).sum();
        let (mut columns, mut weights) = (Vec::with_capacity(steps), Vec::with_capacity(steps));
        let mut list = Vec::with_capacity(batches.len());
        for batch in &batches {
            // No window reaches beyond the last vertex.
            let from = ends(batch).0.min(rows.start.len() - 1 - window);
            let first = columns.len();
            for k in 0..entries(batch[0]).len() {
                // A row that has ended goes on with what weighs nothing.
                let entry = |l: usize| batch.get(l).and_then(|&row| entries(row).nth(k));
                columns.push([core::array::from_fn(|l| entry(l).map_or(0, |e| rows.column[e] - from as u32))]);
                weights.push(core::array::from_fn(|l| entry(l).map_or(0.0, |e| rows.weight[e] as f32)));
            }
            list.push(Batch { count: batch.len(), from, steps: first..columns.len() });
        }
        let own = batches.iter().map(|b| [core::array::from_fn(|l| b[l.min(b.len() - 1)])]).collect();
        Self { batches: list, pieces, own: Places::new(own), columns: Columns::new(columns), weights }
    }

    /// Whether there is nothing to sum.
    pub(super) fn is_empty(&self) -> bool {
        self.weights.is_empty()
    }

    /// Bytes that they take.
    pub(super) fn bytes(&self) -> usize {
        let columns = match &self.columns {
            Columns::Near(places) => places.bytes(),
            Columns::Far(places) => places.bytes(),
        };
        let batches = bytes::of(&self.batches) + bytes::of(&self.pieces) + self.own.bytes();
        batches + columns + bytes::of(&self.weights)
    }
}

/// For each vertex of a piece, the first of which is `first`, the sum of its row's weights times what others have more than it.
pub(super) struct Differences<'a> {
    pub(super) rows: &'a DifferenceRows,
    pub(super) of: &'a [[f32; 4]],
    pub(super) piece: usize,
    pub(super) first: usize,
    pub(super) out: &'a mut [[f32; 4]],
}

impl Kernel for Differences<'_> {
    type Out = ();

    #[inline(always)]
    fn run<V: Lanes>(mut self) {
        match &self.rows.columns {
            Columns::Near(columns) => self.sums::<V, _>(columns),
            Columns::Far(columns) => self.sums::<V, _>(columns),
        }
    }
}

impl Differences<'_> {
    #[inline(always)]
    fn sums<V: Lanes, P: Place>(&mut self, columns: &Places<1, P>) {
        let (rows, own) = (self.rows, self.rows.own.view(self.of));
        for b in rows.pieces[self.piece]..rows.pieces[self.piece + 1] {
            let batch = &rows.batches[b];
            let weights = &rows.weights[batch.steps.clone()];
            let others = columns.view(&self.of[batch.from..]).part(batch.steps.start, weights.len());
            let mut sums = [[0.0; WIDTH]; 3];
            for first in (0..WIDTH).step_by(V::N).take_while(|&f| f < batch.count) {
                let p: [V; 4] = own.gather(b, 0, first);
                let mut sum = [V::splat(0.0); 3];
                for (k, weight) in weights.iter().enumerate() {
                    let (q, weight): ([V; 4], V) = (others.gather(k, 0, first), V::load(weight, first));
                    for a in 0..3 {
                        sum[a] = weight.mul_add(q[a] - p[a], sum[a]);
                    }
                }
                for a in 0..3 {
                    sum[a].store(&mut sums[a], first);
                }
            }
            for (l, &row) in rows.own.row(b)[0][..batch.count].iter().enumerate() {
                self.out[row as usize - self.first] = [sums[0][l], sums[1][l], sums[2][l], 0.0];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fast::{plain, widest};

    #[test]
    fn rows_with_columns_near_and_far_give_the_same_sums() {
        // The third row may reach beyond what 16 bits hold; those after it have no entries, but for the last one.
        const COUNT: usize = 70_000;
        let start = [0, 0, 5].into_iter().chain(core::iter::repeat_n(12, COUNT - 3)).chain([14]).collect::<Vec<u32>>();
        let rows = |far: u32| Rows {
            start: start.clone(),
            column: [3, 1, 2, 4, 0].into_iter().chain((0..6).map(|i| 2 * i)).chain([far, 69_998, 69_999]).collect(),
            weight: (0..14).map(|i| f64::from(i) - 4.5).collect(),
        };
        let of: Vec<[f32; 4]> =
            (0..COUNT as u32).map(|i| [i % 97, i % 31, i % 7, i].map(|v| v as f32 * 0.25)).collect();
        for far in [11, 69_999] {
            let cuts = [0, 2, 1000, COUNT];
            let (rows, single) = (rows(far), DifferenceRows::new(&rows(far), &cuts));
            assert_eq!(matches!(single.columns, Columns::Far(_)), far > 65_535);
            let mut out = [vec![[f32::NAN; 4]; COUNT], vec![[f32::NAN; 4]; COUNT]];
            for (piece, cut) in cuts.windows(2).enumerate() {
                let [a, b] = out.each_mut().map(|out| &mut out[cut[0]..cut[1]]);
                widest(Differences { rows: &single, of: &of, piece, first: cut[0], out: a });
                plain(Differences { rows: &single, of: &of, piece, first: cut[0], out: b });
            }
            assert_eq!(out[0], out[1]);
            for v in 0..COUNT {
                let row = rows.start[v] as usize..rows.start[v + 1] as usize;
                for a in 0..3 {
                    let one = |k: usize| rows.weight[k] * f64::from(of[rows.column[k] as usize][a] - of[v][a]);
                    let (wanted, size) =
                        (row.clone().map(one).sum::<f64>(), row.clone().map(|k| one(k).abs()).sum::<f64>());
                    assert!((f64::from(out[0][v][a]) - wanted).abs() <= 1e-6 * size, "{:?}, row {v}", out[0][v]);
                }
            }
        }
    }
}
