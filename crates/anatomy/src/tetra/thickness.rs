//! Where labels are thin: a lattice sees nothing thinner than its cells.

use super::fields::LabelFields;
use crate::surface::distance::squared_distance;
use monro_geometry::d3::D3;
use monro_geometry::{Volume, by_point};
use rayon::prelude::*;

/// What is thinner than this many of the finest edges may fall through a lattice, whose cells are up to 1.41 of them.
const SEEN: f64 = 1.5;
/// What stands out of a thick part by less than this part of the finest edge, or a cell of the fields, is a ridge, which a
/// coarser surface may cut off; rough labels are full of them.
const RIDGE: f64 = 0.25;
/// Growth of the distance per mm towards a neighbour above which a cell belongs to the neighbour's ball.
const COVERED: f32 = 0.5;
/// Cells of the lattice of less than this many cells of the fields are not split; of those above `EASY` times that one
/// element must have an edge in a thin part, of smaller ones a corner.
const LEAST: f64 = 1.5;
const EASY: f64 = 1.4;
/// Middles are kept by cubes of this size, mm,
const BLOCK: f64 = 3.0;
/// and not asked for in boxes that are larger than this.
const LARGEST: f64 = 16.0;

/// The middles of thin parts of labels.
#[derive(Debug, Clone)]
pub(super) struct Thin {
    middles: Middles,
    least: f64,
    /// Longest box that middles are asked for in, mm.
    largest: f64,
}

impl Thin {
    /// Thin parts of the labels in `fine` where edges are `finest` mm.
    pub(super) fn new(fields: &LabelFields, fine: &[usize], finest: f64) -> Self {
        let mut middles: Vec<(u8, D3)> = Vec::new();
        for &l in fine {
            if let Some(part) = fields.parts.get(l) {
                each_middle(part.volume(), fields.step, finest, |p| middles.push((l as u8, p)));
            }
        }
        let [block, largest] = [BLOCK, LARGEST].map(|x| x * fields.unit);
        Self { middles: Middles::new(&middles, block), least: LEAST * fields.step, largest }
    }

    /// Nothing thin.
    pub(super) fn none() -> Self {
        Self { middles: Middles::new(&[], BLOCK), least: 0.0, largest: 0.0 }
    }

    /// Whether a lattice with a cell of edge `cube` around `centre` would not see a thin part there: of the corners of the
    /// element around one of its middles too few lie in the part.
    pub(super) fn is_unseen(&self, fields: &LabelFields, centre: D3, cube: f64) -> bool {
        if cube < self.least {
            return false;
        }
        let corners = if cube > EASY * self.least { 2 } else { 1 };
        let is_seen = |l: u8, p: D3| {
            let part = fields.parts.get(usize::from(l));
            part.is_none_or(|part| {
                element(p, centre, cube).into_iter().filter(|&c| part.at(c) >= 0.5).count() >= corners
            })
        };
        let corner = |side: f64| centre.map(|x| x + side * 0.5 * cube);
        self.within(corner(-1.0), corner(1.0)).any(|(l, p)| !is_seen(l, p))
    }

    /// The middles in a box, each with its label; none in one that is large, which lies away from what is fine.
    pub(super) fn within(&self, low: D3, high: D3) -> impl Iterator<Item = (u8, D3)> + '_ {
        let is_large = (0..3).any(|a| high[a] - low[a] > self.largest);
        (!is_large).then(|| self.middles.within(low, high)).into_iter().flatten()
    }
}

/// Points with the labels that they belong to, by cubes.
#[derive(Debug, Clone)]
struct Middles {
    /// Edge of the cubes, mm, the first cube and how many there are along each axis.
    block: f64,
    first: [i64; 3],
    dims: [usize; 3],
    /// Where the points of each cube begin, the last axis fastest.
    starts: Vec<u32>,
    points: Vec<(u8, D3)>,
}

impl Middles {
    fn new(points: &[(u8, D3)], block: f64) -> Self {
        let of = |p: D3| p.map(|x| (x / block).floor() as i64);
        let bound = |a: usize| points.iter().map(move |&(_, p)| of(p)[a]);
        let first: [i64; 3] = std::array::from_fn(|a| bound(a).min().unwrap_or(0));
        let dims = std::array::from_fn(|a| bound(a).max().map_or(0, |last| (last - first[a] + 1) as usize));
        let mut middles = Self { block, first, dims, starts: vec![0], points: Vec::new() };
        let cube = |p: D3| middles.cube(std::array::from_fn(|a| (of(p)[a] - first[a]) as usize)) as u32;
        let (starts, sorted) = by_point(points.iter().map(|&(l, p)| (cube(p), (l, p))), dims.iter().product());
        (middles.starts, middles.points) = (starts, sorted);
        middles
    }

    fn cube(&self, [i, j, k]: [usize; 3]) -> usize {
        (i * self.dims[1] + j) * self.dims[2] + k
    }

    /// The points in a box.
    fn within(&self, low: D3, high: D3) -> impl Iterator<Item = (u8, D3)> + '_ {
        let end = |x: f64, a: usize, more: i64| {
            ((x / self.block).floor() as i64 - self.first[a] + more).clamp(0, self.dims[a] as i64) as usize
        };
        let from: [usize; 3] = std::array::from_fn(|a| end(low[a], a, 0));
        let to: [usize; 3] = std::array::from_fn(|a| end(high[a], a, 1).max(from[a]));
        let rows = (from[0]..to[0]).flat_map(move |i| (from[1]..to[1]).map(move |j| [i, j]));
        let cubes = rows.map(move |[i, j]| self.cube([i, j, from[2]])..self.cube([i, j, to[2]]));
        let points = cubes.flat_map(|c| &self.points[self.starts[c.start] as usize..self.starts[c.end] as usize]);
        points.copied().filter(move |(_, p)| (0..3).all(|a| p[a] >= low[a] && p[a] <= high[a]))
    }
}

/// The corners of the element around a point of a cell, in an even body-centred lattice: the centres of the cell and of the
/// one behind the nearest face, and the ends of the face's nearest edge.
fn element(p: D3, centre: D3, cube: f64) -> [D3; 4] {
    let d: D3 = std::array::from_fn(|a| p[a] - centre[a]);
    let mut axes = [0, 1, 2];
    axes.sort_by(|&a, &b| d[b].abs().total_cmp(&d[a].abs()));
    let [face, edge, along] = axes;
    let at = |f: f64, e: f64, l: f64| {
        let mut q = centre;
        q[face] += f * cube * d[face].signum();
        q[edge] += e * cube * d[edge].signum();
        q[along] += l * cube;
        q
    };
    [centre, at(1.0, 0.0, 0.0), at(0.5, 0.5, -0.5), at(0.5, 0.5, 0.5)]
}

/// Medial cells by the maximal-ball test (no neighbour's inscribed ball holds theirs) that stand out of what is thick enough.
fn each_middle(field: &Volume<f32>, step: f64, finest: f64, mut found: impl FnMut(D3)) {
    let dims = field.grid().dims();
    let depth = |sites: &[bool]| {
        let mut d = squared_distance(sites, dims, [step; 3]);
        d.par_iter_mut().for_each(|x| *x = x.sqrt());
        d
    };
    let d = depth(&field.data().iter().map(|&v| v < 0.5).collect::<Vec<_>>());
    let thick = (0.5 * SEEN * finest + 0.5 * step) as f32;
    let to_core = depth(&d.iter().map(|&d| d >= thick).collect::<Vec<_>>());
    let ridge = thick + (RIDGE * finest).max(step) as f32;
    for k in 1..dims[2] - 1 {
        for j in 1..dims[1] - 1 {
            for i in 1..dims[0] - 1 {
                let at = field.grid().index(i, j, k);
                if d[at] > 0.0 && to_core[at] > ridge && is_medial(&d, dims, at, step as f32) {
                    found(field.grid().centre(i, j, k).to_array());
                }
            }
        }
    }
}

fn is_medial(d: &[f32], dims: [usize; 3], at: usize, step: f32) -> bool {
    (0..27usize).filter(|&n| n != 13).all(|n| {
        let shift = [n % 3, n / 3 % 3, n / 9];
        let other = at + shift[0] + dims[0] * (shift[1] + dims[1] * shift[2]) - (1 + dims[0] * (1 + dims[1]));
        let length = (shift.iter().filter(|&&s| s != 1).count() as f32).sqrt() * step;
        d[other] - d[at] < COVERED * length
    })
}

/// Two sweeps over the rows of the array, each cell bounded by the neighbours already passed, `growth` more a mm.
pub(super) fn spread(cap: &mut [f32], dims: [usize; 3], step: f64, growth: f64) {
    let rise = [1.0f64, 2.0, 3.0].map(|n| (n.sqrt() * step * growth) as f32);
    let inner: Vec<[usize; 2]> = (1..dims[2] - 1).flat_map(|k| (1..dims[1] - 1).map(move |j| [j, k])).collect();
    let mut bound = vec![0f32; dims[0]];
    for backwards in [false, true] {
        let side = if backwards { 1 } else { -1 };
        // Rows passed before this one: how far off in y and z.
        let passed = [[-1, side], [0, side], [1, side], [side, 0]];
        for at in 0..inner.len() {
            let [j, k] = inner[if backwards { inner.len() - 1 - at } else { at }];
            bound.fill(f32::INFINITY);
            for [dj, dk] in passed {
                let first = dims[0] * (j.wrapping_add_signed(dj) + dims[1] * k.wrapping_add_signed(dk));
                let across = usize::from(dj != 0) + usize::from(dk != 0);
                lower(&mut bound, &cap[first..first + dims[0]], rise[across - 1], rise[across]);
            }
            let first = dims[0] * (j + dims[1] * k);
            sweep(&mut cap[first..first + dims[0]], &bound, rise[0], backwards);
        }
    }
}

/// Bounds the cells of a row by those of another, straight across and askew.
fn lower(bound: &mut [f32], row: &[f32], straight: f32, askew: f32) {
    let n = row.len();
    bound.iter_mut().zip(row).for_each(|(b, &r)| *b = b.min(r + straight));
    bound[1..].iter_mut().zip(row).for_each(|(b, &r)| *b = b.min(r + askew));
    bound[..n - 1].iter_mut().zip(&row[1..]).for_each(|(b, &r)| *b = b.min(r + askew));
}

/// Along a row, each cell bounded by the one before.
fn sweep(row: &mut [f32], bound: &[f32], rise: f32, backwards: bool) {
    let n = row.len();
    for i in 1..n - 1 {
        let (at, before) = if backwards { (n - 1 - i, n - i) } else { (i, i - 1) };
        row[at] = row[at].min(bound[at]).min(row[before] + rise);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::d3::volume6;
    use monro_geometry::{Grid, Volume as Labels};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_element_around_a_point_holds_it(p in proptest::array::uniform3(-1.5..1.5f64)) {
            let corners = element(p, [0.0; 3], 3.0);
            let whole = volume6(corners).abs();
            // Elements of a body-centred lattice are a twelfth of a cell.
            prop_assert!((whole / 6.0 - 27.0 / 12.0).abs() < 1e-12);
            let parts: f64 = (0..4).map(|i| {
                let mut c = corners;
                c[i] = p;
                volume6(c).abs()
            }).sum();
            prop_assert!((parts - whole).abs() < 1e-9, "{parts} {whole}");
        }
    }

    /// A ball of 9 mm with a rod along x, 2 mm thick, from 9 to 25 mm.
    fn ball_with_rod() -> LabelFields {
        let grid = Grid::axis_aligned([70, 40, 40], [1.0; 3], [-19.5; 3]).expect("grid");
        let data = (0..grid.len()).map(|at| {
            let [i, j, k] = grid.voxel(at);
            let [x, y, z] = grid.centre(i, j, k).to_array();
            let rod = x > 0.0 && x < 25.0 && y.abs() < 1.0 && z.abs() < 1.0;
            if rod || (x * x + y * y + z * z).sqrt() < 9.0 { 2u16 } else { 1 }
        });
        LabelFields::new(&Labels::new(grid, data.collect()).expect("count"), &[1, 2]).expect("fields")
    }

    #[test]
    fn a_lattice_must_split_where_a_rod_runs_between_its_points() {
        let fields = ball_with_rod();
        let fine = fields.labels.iter().position(|&l| l == 2).expect("there");
        let thin = Thin::new(&fields, &[fine], 4.0);
        // The rod runs half way between centre, corners and middles of faces of this cell, then through its centre.
        assert!(thin.is_unseen(&fields, [18.0, 2.0, 1.0], 4.0));
        assert!(!thin.is_unseen(&fields, [18.0, 0.0, 0.0], 2.2));
        // The ball is thick, and nothing is elsewhere.
        assert!(!thin.is_unseen(&fields, [0.0, 2.0, 1.0], 4.0) && !thin.is_unseen(&fields, [18.0, 9.0, 1.0], 4.0));
        assert_eq!(Thin::none().within([-20.0; 3], [-10.0; 3]).count(), 0);
    }
}
