//! Volumes of all elements at once.

use crate::fast::{Kernel, Lanes, Places, Pool, Row, View, WIDTH, ask_ahead, cross, dot, widest};
use crate::{bytes, slabs};
use core::ops::Range;
use monro_geometry::Incidence;

/// Corners and volumes at rest of all elements, sixteen a row.
#[derive(Debug, Clone, Default)]
pub(crate) struct Volumes {
    corners: Places<4, u32>,
    /// Six times the volume at rest, mm3.
    rest: Vec<Row>,
    tets: usize,
    /// Rows with an element around each vertex: where those of each begin, and the rows in order.
    around: (Vec<u32>, Vec<u32>),
    /// Pieces for threads.
    cuts: Vec<usize>,
}

/// Sums over all elements.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Survey {
    /// Growth of the whole against rest, mm3.
    pub(crate) growth: f64,
    /// Elements without positive volume.
    pub(crate) inverted: usize,
}

impl Volumes {
    pub(crate) fn new(tets: &[[u32; 4]], rest: &[[f32; 4]]) -> Self {
        let rows = tets.len().div_ceil(WIDTH);
        // What is missing in the last row repeats the last element.
        let lane = |r: usize, l: usize| tets[(r * WIDTH + l).min(tets.len() - 1)];
        let places = (0..rows).map(|r| [0, 1, 2, 3].map(|c| core::array::from_fn(|l| lane(r, l)[c]))).collect();
        let none = vec![[0.0; WIDTH]; rows];
        let around = rows_around(tets, rest.len());
        let mut out =
            Self { corners: Places::new(places), rest: none.clone(), tets: tets.len(), around, cuts: Vec::new() };
        let mut at_rest = none;
        widest(Growth { of: &out, positions: rest, rows: 0..rows, first: 0, out: &mut at_rest });
        out.rest = at_rest;
        out.cuts = slabs::even_cuts(rows);
        out
    }

    /// Bytes that they take.
    pub(crate) fn bytes(&self) -> usize {
        self.corners.bytes() + bytes::of(&self.rest) + bytes::of(&self.around.0) + bytes::of(&self.around.1)
    }

    /// Corners of all elements.
    pub(crate) fn corners(&self) -> &Places<4, u32> {
        &self.corners
    }

    /// Six times the volume of each element at rest, mm3; the last row may have some too many.
    pub(crate) fn six_rest(&self) -> &[Row] {
        &self.rest
    }

    /// Six times the growth of each element against rest, mm3, exactly zero at rest; the last row may have some too many.
    pub(crate) fn measure(&self, positions: &[[f32; 4]], growth: &mut Vec<Row>, pool: &Pool) {
        self.measure_where(|_| true, positions, growth, pool);
    }

    /// As [`Volumes::measure_rows`], of the rows that are asked for, on all threads.
    pub(crate) fn measure_where(
        &self,
        asked: impl Fn(usize) -> bool + Sync,
        positions: &[[f32; 4]],
        growth: &mut Vec<Row>,
        pool: &Pool,
    ) {
        growth.resize(self.rest.len(), [0.0; WIDTH]);
        pool.each_part(growth, &self.cuts, &mut [(); slabs::PIECES], &|i, out, ()| {
            let first = self.cuts[i];
            let rows = (first..first + out.len()).filter(|&r| asked(r));
            widest(Growth { of: self, positions, rows, first, out });
        });
    }

    /// Measures the elements of some rows anew, all having been measured before.
    pub(crate) fn measure_rows(&self, positions: &[[f32; 4]], rows: &[u32], growth: &mut [Row]) {
        let rows = rows.iter().map(|&r| r as usize);
        widest(Growth { of: self, positions, rows, first: 0, out: growth });
    }

    /// Edge of an element at rest, mm, if it were regular.
    pub(crate) fn edge(&self, tet: u32) -> f64 {
        regular_edge(f64::from(self.rest.as_flattened()[tet as usize]) / 6.0)
    }

    /// Edge below which so many elements in a thousand are, mm.
    pub(crate) fn fine_edge(&self, per_thousand: usize) -> f64 {
        let mut six = self.rest.as_flattened()[..self.tets].to_vec();
        let at = six.len() * per_thousand / 1000;
        regular_edge(f64::from(*six.select_nth_unstable_by(at, f32::total_cmp).1) / 6.0)
    }

    /// Number of rows.
    pub(crate) fn rows(&self) -> usize {
        self.rest.len()
    }

    /// Rows with an element around a vertex.
    pub(crate) fn rows_around(&self, vertex: u32) -> &[u32] {
        let (start, rows) = &self.around;
        &rows[start[vertex as usize] as usize..start[vertex as usize + 1] as usize]
    }

    /// Lists the elements of some rows with less than `share` of their volume at rest, with six times that at rest (mm3), as
    /// `growth` was measured.
    pub(crate) fn smaller(
        &self,
        share: f32,
        rows: impl Iterator<Item = usize>,
        growth: &[Row],
        list: &mut Vec<(u32, f32)>,
    ) {
        list.clear();
        for row in rows {
            let (growth, rest) = (&growth[row], &self.rest[row]);
            let lacks: [bool; WIDTH] = core::array::from_fn(|l| growth[l] < (share - 1.0) * rest[l]);
            // Few rows have any.
            if lacks.iter().fold(false, |any, l| any | l) {
                let own = (0..WIDTH).map(|l| (row * WIDTH + l, l)).filter(|&(t, l)| t < self.tets && lacks[l]);
                list.extend(own.map(|(t, l)| (t as u32, rest[l])));
            }
        }
    }

    /// Sums over all elements; `growth` is memory to work in.
    pub(crate) fn survey(&self, positions: &[[f32; 4]], growth: &mut Vec<Row>, pool: &Pool) -> Survey {
        growth.resize(self.rest.len(), [0.0; WIDTH]);
        self.sums(growth, pool, &|rows, out| {
            let first = rows.start;
            widest(Growth { of: self, positions, rows, first, out });
        })
    }

    /// Sums over all elements, as `growth` was measured.
    pub(crate) fn measured(&self, growth: &mut [Row], pool: &Pool) -> Survey {
        self.sums(growth, pool, &|_, _| {})
    }

    /// Sums over all elements after something was done with each piece of the rows.
    fn sums(&self, growth: &mut [Row], pool: &Pool, first: &(dyn Fn(Range<usize>, &mut [Row]) + Sync)) -> Survey {
        let mut pieces = [Survey::default(); slabs::PIECES];
        pool.each_part(growth, &self.cuts, &mut pieces, &|i, growth, piece| {
            let rows = self.cuts[i]..self.cuts[i + 1];
            first(rows.clone(), growth);
            let last = (self.tets + WIDTH - rows.end * WIDTH).min(WIDTH);
            *piece = widest(Sums { growth, rest: &self.rest[rows], last });
        });
        let growth = pieces.iter().map(|p| p.growth).sum();
        Survey { growth, inverted: pieces.iter().map(|p| p.inverted).sum() }
    }
}

/// Sums over the elements of some rows.
struct Sums<'a> {
    growth: &'a [Row],
    rest: &'a [Row],
    /// Elements in the last row, which may have some too many.
    last: usize,
}

impl Kernel for Sums<'_> {
    type Out = Survey;

    /// In words that the compiler makes as wide as it may.
    #[inline(always)]
    fn run<V: Lanes>(self) -> Survey {
        let (mut sums, mut inverted) = ([0f64; WIDTH], [0u32; WIDTH]);
        let mut add = |growth: &Row, rest: &Row, lanes: usize| {
            for l in 0..lanes {
                sums[l] += f64::from(growth[l]);
                inverted[l] += u32::from(growth[l] <= -rest[l]);
            }
        };
        let Some(((last, growth), (rest_of_last, rest))) = self.growth.split_last().zip(self.rest.split_last()) else {
            return Survey::default();
        };
        growth.iter().zip(rest).for_each(|(growth, rest)| add(growth, rest, WIDTH));
        add(last, rest_of_last, self.last);
        Survey { growth: sums.iter().sum::<f64>() / 6.0, inverted: inverted.iter().sum::<u32>() as usize }
    }
}

/// Edge of a regular tetrahedron of some volume, mm.
pub(crate) fn regular_edge(volume: f64) -> f64 {
    (72f64.sqrt() * volume).cbrt()
}

/// Where the rows with an element around each vertex begin, and these rows in order.
fn rows_around(tets: &[[u32; 4]], vertices: usize) -> (Vec<u32>, Vec<u32>) {
    let (first, elements) = Incidence::new(tets, vertices).into_lists();
    let (mut start, mut rows) = (vec![0], Vec::new());
    for own in first.windows(2) {
        let of_vertex = rows.len();
        for row in elements[own[0] as usize..own[1] as usize].iter().map(|t| t / WIDTH as u32) {
            // Elements come in order, so each row comes at once.
            if rows[of_vertex..].last() != Some(&row) {
                rows.push(row);
            }
        }
        start.push(rows.len() as u32);
    }
    rows.shrink_to_fit();
    (start, rows)
}

/// Six times the growth of the elements of some rows against rest.
struct Growth<'a, R> {
    of: &'a Volumes,
    positions: &'a [[f32; 4]],
    rows: R,
    /// Row that the output begins with.
    first: usize,
    out: &'a mut [Row],
}

impl<R: Iterator<Item = usize>> Kernel for Growth<'_, R> {
    type Out = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let corners = self.of.corners.view(self.positions);
        for r in self.rows {
            corners.ask_ahead(r);
            ask_ahead(&self.of.rest, r);
            grown::<V>(&corners, r, &self.of.rest[r], &mut self.out[r - self.first]);
        }
    }
}

/// Six times the growth of the elements of row `r` against `rest`.
#[inline(always)]
fn grown<V: Lanes>(corners: &View<'_, 4, u32>, r: usize, rest: &Row, out: &mut Row) {
    for lane in (0..WIDTH).step_by(V::N) {
        let p: [V; 4] = corners.gather(r, 0, lane);
        let [q, s, t]: [[V; 4]; 3] =
            [corners.gather(r, 1, lane), corners.gather(r, 2, lane), corners.gather(r, 3, lane)];
        let away = |c: [V; 4]| [c[0] - p[0], c[1] - p[1], c[2] - p[2]];
        let six = dot(cross(away(q), away(s)), away(t));
        (six - V::load(rest, lane)).store(out, lane);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::block;
    use crate::vec3::{six_volume, xyz};

    #[test]
    fn growth_and_turned_elements_are_those_of_each_element_by_itself() {
        let mesh = block([3, 3, 2], 2.0);
        let rest: Vec<[f32; 4]> = mesh.vertices.iter().map(|v| [v.x as f32, v.y as f32, v.z as f32, 1.0]).collect();
        let volumes = Volumes::new(&mesh.tets, &rest);
        let (pool, mut growth) = (Pool::new(2), Vec::new());
        assert_eq!(volumes.survey(&rest, &mut growth, &pool), Survey::default());
        let mut now = rest.clone();
        now[5] = [3.1, 2.7, 0.4, 1.0];
        now[20][2] += 3.0;
        let survey = volumes.survey(&now, &mut growth, &pool);
        let six = |p: &[[f32; 4]], t: [u32; 4]| six_volume(t.map(|v| xyz(p[v as usize])));
        let expected: f64 = mesh.tets.iter().map(|&t| f64::from(six(&now, t) - six(&rest, t)) / 6.0).sum();
        let turned = mesh.tets.iter().filter(|&&t| six(&now, t) <= 0.0).count();
        assert!((survey.growth - expected).abs() < 1e-4, "{survey:?} {expected}");
        assert!(turned > 0);
        assert_eq!(survey.inverted, turned);
        let mut again = growth.clone();
        again[1].fill(f32::NAN);
        volumes.measure_rows(&now, &[1], &mut again);
        assert_eq!(again, growth);
        let rows: Vec<u32> = (0..volumes.rows() as u32).collect();
        for v in 0..rest.len() as u32 {
            let around = |r: &&u32| {
                let own = **r as usize * WIDTH..mesh.tets.len().min((**r as usize + 1) * WIDTH);
                mesh.tets[own].iter().flatten().any(|&c| c == v)
            };
            assert_eq!(volumes.rows_around(v), rows.iter().filter(around).copied().collect::<Vec<_>>(), "{v}");
        }
    }
}
