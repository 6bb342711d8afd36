//! Signed distances to the outline of a slice of partial values, where a neighbouring slice gives them a meaning.
//!
//! Between two slices that are on the same side of their outlines, by half a cell or more, there is nothing to interpolate. That
//! is so nearly everywhere; elsewhere the way to the outline is short, and looking for it takes less than a transform of all.

use super::runs::runs;

/// Distances are limited to this many slice thicknesses.
const FARTHEST: f32 = 4.0;

/// Cells looked at together for any that is asked for.
const PIECE: usize = 32;

/// No cell of the other side in a row.
const NONE: u32 = u32::MAX;

/// A slice, and which of its cells are inside of its outline.
pub(super) struct Outline {
    values: Vec<f32>,
    inside: Vec<bool>,
    /// Cells that share a side with one of the other side: their value says where in them the outline runs.
    near: Vec<bool>,
    dims: [usize; 2],
}

impl Outline {
    pub(super) fn new(values: Vec<f32>, dims: [usize; 2]) -> Self {
        let inside: Vec<bool> = values.iter().map(|&v| v >= 0.5).collect();
        let mut near = vec![false; inside.len()];
        let [nx, ny] = dims;
        let differ = |near: &mut [bool], a: &[bool], b: &[bool]| {
            near.iter_mut().zip(a.iter().zip(b)).for_each(|(near, (a, b))| *near |= a != b);
        };
        for (j, near) in near.chunks_mut(nx).enumerate() {
            let row = |j: usize| &inside[j * nx..][..nx];
            differ(near, &row(j)[1..], row(j));
            differ(&mut near[1..], row(j), &row(j)[1..]);
            [j.wrapping_sub(1), j + 1].into_iter().filter(|&n| n < ny).for_each(|n| differ(near, row(j), row(n)));
        }
        Self { values, inside, near, dims }
    }

    /// Which cells are inside.
    pub(super) fn inside(&self) -> &[bool] {
        &self.inside
    }

    /// Signed distances in mm (positive inside) on cells of edge `step`, given the slices `beside` at `thickness` mm (nothing
    /// where there is none). Where these and this one are on the same side of their outlines, by half a cell at least, only
    /// the sign counts. In a slice without the set, minus one thickness.
    pub(super) fn distances(&self, beside: [Option<&Self>; 2], step: f64, thickness: f64) -> Vec<f32> {
        let (step, thickness) = (step as f32, thickness as f32);
        if !self.inside.contains(&true) {
            // What little is there (below half a cell everywhere) keeps its partial value near the outline.
            let value = |&m: &f32| if m > 0.0 { (m - 0.5) * step } else { -thickness };
            return self.values.iter().map(value).collect();
        }
        let limit = FARTHEST * thickness;
        let mut out: Vec<f32> = self.inside.iter().map(|&inside| if inside { limit } else { -limit }).collect();
        let across = |other: Option<&Self>| match other {
            Some(other) => {
                other.inside.iter().zip(&self.inside).zip(&other.near).map(|((o, i), near)| o != i || *near).collect()
            }
            None => self.inside.clone(),
        };
        let across: [Vec<bool>; 2] = beside.map(across);
        let asked =
            self.near.iter().zip(across[0].iter().zip(&across[1])).map(|(near, (below, above))| near | below | above);
        let asked: Vec<bool> = asked.collect();
        let rows = self.along_rows();
        let value = |n: usize| {
            if self.near[n] {
                return ((self.values[n] - 0.5) * step).clamp(-limit, limit);
            }
            let way = (self.cells_to_outline(n, &rows, limit / step) * step - 0.5 * step).min(limit);
            if self.inside[n] { way } else { -way }
        };
        for (c, (out, asked)) in out.chunks_mut(PIECE).zip(asked.chunks(PIECE)).enumerate() {
            // Most pieces have none.
            if asked.contains(&true) {
                let own = out.iter_mut().zip(asked).enumerate().filter(|(_, (_, asked))| **asked);
                own.for_each(|(i, (out, _))| *out = value(c * PIECE + i));
            }
        }
        out
    }

    /// From each cell to the next of the other side in its row, in cells; [`NONE`] where there is none.
    fn along_rows(&self) -> Vec<u32> {
        let mut out = vec![NONE; self.inside.len()];
        for (row, out) in self.inside.chunks(self.dims[0]).zip(out.chunks_mut(self.dims[0])) {
            for (run, _) in runs(row) {
                let (length, first, last) = (run.len() as u32, run.start > 0, run.end < row.len());
                for (i, out) in (0..).zip(&mut out[run]) {
                    let (up, down) = (i + 1, length - i);
                    *out = (if first { up } else { NONE }).min(if last { down } else { NONE });
                }
            }
        }
        out
    }

    /// From a cell to the nearest one of the other side, in cells; infinite beyond `most`.
    fn cells_to_outline(&self, n: usize, rows: &[u32], most: f32) -> f32 {
        let [nx, ny] = self.dims;
        let j = n / nx;
        let square = |m: usize| match rows[m] {
            _ if self.inside[m] != self.inside[n] => 0.0,
            NONE => f32::INFINITY,
            cells => (cells as f32).powi(2),
        };
        let mut least = square(n);
        for up in 1..ny {
            let height = (up as f32).powi(2);
            if height >= least || up as f32 > most + 1.0 {
                break;
            }
            if j >= up {
                least = least.min(height + square(n - up * nx));
            }
            if j + up < ny {
                least = least.min(height + square(n + up * nx));
            }
        }
        least.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn distances_are_exact_where_a_neighbouring_slice_is_on_the_other_side(
            own in proptest::collection::vec(proptest::bool::weighted(0.2), 7 * 9),
            other in proptest::collection::vec(proptest::bool::weighted(0.5), 7 * 9),
        ) {
            let values = |inside: &[bool]| inside.iter().map(|&i| if i { 0.75 } else { 0.0 }).collect::<Vec<f32>>();
            let [slice, beside] = [&own, &other].map(|inside| Outline::new(values(inside), [7, 9]));
            let found = slice.distances([Some(&beside), Some(&slice)], 2.0, 5.0);
            for n in 0..own.len() {
                let to = |m: usize| (n % 7).abs_diff(m % 7).pow(2) + (n / 7).abs_diff(m / 7).pow(2);
                let Some(squared) = (0..own.len()).filter(|&m| own[m] != own[n]).map(to).min() else { continue };
                let sign = if own[n] { 1.0 } else { -1.0 };
                let exact = match squared {
                    1 => (values(&own)[n] - 0.5) * 2.0,
                    s => sign * ((s as f32).sqrt() * 2.0 - 1.0f32).min(20.0),
                };
                if other[n] != own[n] {
                    prop_assert!((found[n] - exact).abs() < 1e-5, "{} {exact} at {n}", found[n]);
                } else if own.contains(&true) {
                    // The sign, and half a cell at least where it is not the value that tells.
                    prop_assert!(found[n] == exact || (found[n] * sign >= 1.0 && squared > 1), "{} {exact}", found[n]);
                }
            }
        }
    }
}
