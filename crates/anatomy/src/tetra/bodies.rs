//! Bodies whose volume no label's volume tells: cavities that no label fills, whose walls belong to what is around them, and
//! separate pieces of one label, of which one may win what another loses.

use super::fields::Field;
use crate::surface::even::Extent;
use monro_geometry::d3::D3;
use monro_geometry::{DisjointSets, Volume};
use std::collections::BTreeMap;
use std::ops::Range;

/// Bodies of fewer cells have no walls that a mesh could follow.
const LEAST_CELLS: usize = 27;
/// How far around the cells of a body its voxels are looked for, voxels.
const AROUND: f64 = 2.0;
/// Bodies of a kind that are looked after at most, the largest.
const MOST: usize = 128;

/// A cavity, or a piece of a label.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Body {
    /// Volume of its voxels, mm3.
    pub(super) volume: f64,
    /// The corners of its box, LPS mm.
    pub(super) low: D3,
    pub(super) high: D3,
}

/// Cells of a row that belong together.
#[derive(Debug, Clone)]
struct Run {
    cells: Range<usize>,
    row: [usize; 2],
}

/// What a component has.
#[derive(Debug, Clone, Copy)]
struct Component {
    cells: usize,
    low: [usize; 3],
    high: [usize; 3],
    /// The middle of its longest run.
    inside: [usize; 3],
    longest: usize,
}

/// The cavities in `union`, the smooth field of what is kept, with the volumes that they have in the voxels; those that the voxels do
/// not close are none.
pub(super) fn voids<T: Copy>(labels: &Volume<T>, is_kept: &impl Fn(T) -> bool, union: &Field) -> Vec<Body> {
    // But for the one around all, of the first cell.
    let cavities = components(union, |v| v < 0.5).into_iter().filter(|(root, _)| *root > 0);
    largest(cavities.filter_map(|(_, c)| enclosed((labels, &|l| !is_kept(l)), union, &c, Joined::ByFaces)))
}

/// The separate pieces of what `is_own` in a smooth field of its own but for the largest, with the volumes that they have in the
/// voxels; those that the voxels join to others are none.
pub(super) fn pieces<T: Copy>(labels: &Volume<T>, is_own: &impl Fn(T) -> bool, own: &Field) -> Vec<Body> {
    let mut all: Vec<Component> = components(own, |v| v >= 0.5).into_values().collect();
    all.sort_by_key(|c| core::cmp::Reverse(c.cells));
    largest(all.iter().skip(1).filter_map(|c| enclosed((labels, is_own), own, c, Joined::ByCorners)))
}

fn largest(all: impl Iterator<Item = Body>) -> Vec<Body> {
    let mut all: Vec<Body> = all.collect();
    all.sort_by(|a, b| b.volume.total_cmp(&a.volume));
    all.truncate(MOST);
    all
}

/// Components, by faces, of the cells whose values `is_in` accepts, by the number of their first run.
fn components(field: &Field, is_in: impl Fn(f32) -> bool) -> BTreeMap<u32, Component> {
    let [nx, ny, _] = field.volume().grid().dims();
    let (mut runs, mut ends, mut sets): (Vec<Run>, Vec<usize>, _) = (Vec::new(), vec![0], DisjointSets::new(0));
    for (r, row) in field.volume().data().chunks(nx).enumerate() {
        let (before, below) = (r % ny > 0, r >= ny);
        let beside = [before.then(|| r - 1), below.then(|| r - ny)].into_iter().flatten();
        let beside: Vec<Range<usize>> = beside.map(|b| ends[b]..ends[b + 1]).collect();
        for cells in accepted(row, &is_in) {
            let own = sets.add();
            let touches = |n: &usize| runs[*n].cells.start < cells.end && cells.start < runs[*n].cells.end;
            beside.iter().cloned().flatten().filter(touches).for_each(|n| sets.join(own, n as u32));
            runs.push(Run { cells, row: [r % ny, r / ny] });
        }
        ends.push(runs.len());
    }
    let mut found = BTreeMap::<u32, Component>::new();
    for (n, run) in (0..).zip(&runs) {
        let own = Component::of(run);
        found.entry(sets.root(n)).and_modify(|sum| *sum = sum.joined(own)).or_insert(own);
    }
    found.retain(|_, c| c.cells >= LEAST_CELLS);
    found
}

impl Component {
    fn of(Run { cells, row: [j, k] }: &Run) -> Self {
        let at = |i: usize| [i, *j, *k];
        let (low, last) = (at(cells.start), cells.end - 1);
        let inside = at(usize::midpoint(cells.start, last));
        Self { cells: cells.len(), low, high: at(last), inside, longest: cells.len() }
    }

    fn joined(self, other: Self) -> Self {
        let longest = if other.longest > self.longest { other } else { self };
        Self {
            cells: self.cells + other.cells,
            low: [0, 1, 2].map(|a| self.low[a].min(other.low[a])),
            high: [0, 1, 2].map(|a| self.high[a].max(other.high[a])),
            ..longest
        }
    }
}

/// Runs of cells whose values `is_in` accepts.
fn accepted(row: &[f32], is_in: impl Fn(f32) -> bool) -> impl Iterator<Item = Range<usize>> {
    let mut from = 0;
    std::iter::from_fn(move || {
        let start = from + row.get(from..)?.iter().position(|&v| is_in(v))?;
        from = start + row[start..].iter().position(|&v| !is_in(v)).unwrap_or(row.len() - start);
        Some(start..from)
    })
}

/// The body of the voxels that `is_in` accepts in that of a field's cells; `None` where its voxels go on beyond.
fn enclosed<T: Copy>(
    (labels, is_in): (&Volume<T>, &impl Fn(T) -> bool),
    field: &Field,
    cells: &Component,
    joined: Joined,
) -> Option<Body> {
    let grid = labels.grid();
    let place = |[i, j, k]: [usize; 3]| field.volume().grid().centre(i, j, k);
    let voxel = |corner| grid.voxel_from_patient().point(place(corner)).to_array();
    let [low, high] = ends(corners(cells.low, cells.high).map(voxel))?;
    let low = low.map(|x| (x - AROUND).floor().max(0.0) as usize);
    let high = [0, 1, 2].map(|a| ((high[a] + AROUND).ceil() as usize).min(grid.dims()[a] - 1));
    let first = grid.containing(place(cells.inside))?;
    let is_own = |[i, j, k]: [usize; 3]| is_in(labels.data()[grid.index(i, j, k)]);
    let found = flood(first, (low, high), joined, is_own)?;
    let centre = |[i, j, k]: [usize; 3]| grid.centre(i, j, k).to_array();
    let [low, high] = ends(corners(found.low, found.high).map(centre))?;
    Some(Body { volume: found.count as f64 * grid.voxel_volume(), low, high })
}

/// The corners of a box.
fn corners(low: [usize; 3], high: [usize; 3]) -> impl Iterator<Item = [usize; 3]> + Clone {
    (0..8usize).map(move |c| [0, 1, 2].map(|a| if c >> a & 1 == 0 { low[a] } else { high[a] }))
}

/// The box of some points; `None` where there are none.
pub(super) fn ends(points: impl Iterator<Item = D3> + Clone) -> Option<[D3; 2]> {
    let end = |pick: fn(f64, f64) -> f64| points.clone().reduce(|e, p| [0, 1, 2].map(|a| pick(e[a], p[a])));
    Some([end(f64::min)?, end(f64::max)?])
}

/// What voxels must share to be of one body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Joined {
    ByFaces,
    ByCorners,
}

/// The voxels within a box that are joined to `first`; `None` where they reach its sides.
fn flood(
    first: [usize; 3],
    (low, high): ([usize; 3], [usize; 3]),
    joined: Joined,
    is_own: impl Fn([usize; 3]) -> bool,
) -> Option<Extent> {
    let size = [0, 1, 2].map(|a| high[a] + 1 - low[a]);
    let at = |v: [usize; 3]| (v[0] - low[0]) + size[0] * ((v[1] - low[1]) + size[1] * (v[2] - low[2]));
    if !(0..3).all(|a| (low[a]..=high[a]).contains(&first[a])) || !is_own(first) {
        return None;
    }
    let mut seen = vec![false; size.iter().product()];
    seen[at(first)] = true;
    let (mut edge, mut found) = (vec![first], Extent { low: first, high: first, count: 0 });
    while let Some(v) = edge.pop() {
        if (0..3).any(|a| v[a] == low[a] || v[a] == high[a]) {
            return None;
        }
        found = found.joined(Extent { low: v, high: v, count: 1 });
        for other in beside(v, joined) {
            if !std::mem::replace(&mut seen[at(other)], true) && is_own(other) {
                edge.push(other);
            }
        }
    }
    Some(found)
}

/// The voxels that a voxel within is joined to.
fn beside(v: [usize; 3], joined: Joined) -> impl Iterator<Item = [usize; 3]> {
    let all = (0..27).map(|n| [n % 3, n / 3 % 3, n / 9]);
    let is_beside = move |step: &[usize; 3]| match step.iter().filter(|&&s| s != 1).count() {
        0 => false,
        1 => true,
        _ => joined == Joined::ByCorners,
    };
    all.filter(is_beside).map(move |step| [0, 1, 2].map(|a| v[a] + step[a] - 1))
}

impl Body {
    /// Whether a closed wall around `volume` mm3 in this box is likely this one's.
    pub(super) fn is_like(&self, volume: f64, [low, high]: [D3; 2]) -> bool {
        let middle = |a: usize| f64::midpoint(self.low[a], self.high[a]);
        let within = (0..3).all(|a| (low[a]..=high[a]).contains(&middle(a)));
        within && (0.4..1.6).contains(&(volume / self.volume))
    }

    /// How far apart the sides of two boxes are in all, mm.
    pub(super) fn distance(&self, [low, high]: [D3; 2]) -> f64 {
        (0..3).map(|a| (low[a] - self.low[a]).abs() + (high[a] - self.high[a]).abs()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::super::smooth::smoothed;
    use super::*;
    use monro_geometry::Grid;

    /// A block of 26 voxels with cavities cut out of it, and their voids.
    fn of_block(is_cut: impl Fn([usize; 3]) -> bool) -> Vec<Body> {
        let grid = Grid::axis_aligned([36; 3], [1.0; 3], [0.0; 3]).expect("grid");
        let kept = |v: [usize; 3]| v.iter().all(|i| (5..31).contains(i)) && !is_cut(v);
        let data: Vec<u8> = (0..grid.len()).map(|at| u8::from(kept(grid.voxel(at)))).collect();
        let field = Volume::new(grid, data.iter().map(|&l| f32::from(l)).collect()).expect("count");
        let labels = Volume::new(grid, data).expect("count");
        voids(&labels, &|l| l == 1, &Field::new(smoothed(field, false)))
    }

    #[test]
    fn closed_cavities_are_found_with_the_volumes_of_their_voxels_and_open_ones_are_none() {
        let within =
            |v: [usize; 3], low: [usize; 3], size: usize| (0..3).all(|a| (low[a]..low[a] + size).contains(&v[a]));
        assert_eq!(of_block(|_| false), []);
        let two = of_block(|v| within(v, [8; 3], 8) || within(v, [20, 20, 9], 5));
        let boxes: Vec<(f64, D3, D3)> = two.iter().map(|v| (v.volume, v.low, v.high)).collect();
        assert_eq!(boxes, [(512.0, [8.0; 3], [15.0; 3]), (125.0, [20.0, 20.0, 9.0], [24.0, 24.0, 13.0])]);
        assert!(two[0].is_like(450.0, [[7.5; 3], [15.5; 3]]) && !two[1].is_like(450.0, [[7.5; 3], [15.5; 3]]));
        // A channel one voxel wide that the smooth field closes leads out of it.
        assert_eq!(of_block(|v| within(v, [8; 3], 8) || (v[0] == 12 && v[1] == 12 && v[2] < 9)), []);
        assert_eq!(of_block(|v| within(v, [8; 3], 8) || within(v, [10, 10, 3], 6)), []);
        assert_eq!(of_block(|v| within(v, [8; 3], 2)), [], "too small");
    }
}
