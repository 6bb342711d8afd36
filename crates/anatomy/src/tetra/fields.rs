//! The labels as smooth fields whose level sets are the surfaces to mesh.
//!
//! One field for everything that is kept, and one for each label but the last, which is what remains, in the order in which
//! they are cut off ([`cutting_order`]). Inside, a point carries the label of the largest field, so a septum thinner than a
//! cell survives between two ventricles.

use super::bodies::{Body, pieces, voids};
use super::cells::Cells;
use super::gaps::between_slices;
use super::nearby::Nearby;
use super::order::cutting_order;
use super::remainder::give_away;
use super::smooth::smoothed;
use crate::surface::even::{Extent, even, even_step, extents};
use monro_geometry::d3::{D3, sub};
use monro_geometry::{Grid, Volume};
use std::ops::Range;

/// Most cells of the common even grid over everything kept.
const MOST_CELLS: usize = 6_000_000;
pub(super) const MARGIN: usize = 5;
/// Extents, mm, at which lengths given in mm hold as they are, and the one that others are brought to.
const USUAL: Range<f64> = 12.0..500.0;
const HEAD: f64 = 180.0;
/// It is not less than this part of a cell, however small the extent.
const FINEST_UNIT: f64 = 0.2;

/// A label has a part in a cell where its field is above this: on either side of a surface along the cells it is 0.2.
pub(super) const COMMON: f32 = 0.15;

/// Where the field of a label is not above this, it is not there: at its surface it is a sixth at least.
pub(super) const ABSENT: f64 = 0.1;

/// A field sampled trilinearly in patient mm, with one value outside its box.
#[derive(Debug, Clone)]
pub(super) struct Field {
    volume: Volume<f32>,
    cells: Cells,
    outside: f64,
}

impl Field {
    pub(super) fn new(volume: Volume<f32>) -> Self {
        Self { cells: Cells::new(volume.grid()), volume, outside: 0.0 }
    }

    pub(super) const fn cells(&self) -> &Cells {
        &self.cells
    }

    pub(super) const fn volume(&self) -> &Volume<f32> {
        &self.volume
    }

    pub(super) const fn volume_mut(&mut self) -> &mut Volume<f32> {
        &mut self.volume
    }

    pub(super) fn at(&self, p: D3) -> f64 {
        let Some((at, t)) = self.cells.find(p) else { return self.outside };
        let [up, over] = self.cells.steps();
        let data = self.volume.data();
        let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
        let line = |at: usize| match data[at..] {
            [low, high, ..] => mix(f64::from(low), f64::from(high), t[0]),
            _ => 0.0,
        };
        let sheet = |at: usize| mix(line(at), line(at + up), t[1]);
        mix(sheet(at), sheet(at + over), t[2])
    }

    /// Where the first cell of `other`, a field on the same lattice, lies in this one.
    pub(super) fn offset_of(&self, other: &Self) -> [isize; 3] {
        let first = self.volume.grid().voxel_from_patient().point(other.volume.grid().centre(0, 0, 0)).to_array();
        first.map(|x| x.round() as isize)
    }

    /// Applies `change` to each cell that this field shares with `other`, a field on the same lattice, and its value there.
    pub(super) fn combine(&mut self, other: &Self, change: impl Fn(&mut f32, f32)) {
        let (offset, [nx, ny, nz]) = (self.offset_of(other), self.volume.grid().dims());
        for [j, k] in (0..nz).flat_map(|k| (0..ny).map(move |j| [j, k])) {
            if let Some((first, from)) = self.row_over(other, offset, [j, k]) {
                let row = &mut self.volume.data_mut()[(k * ny + j) * nx + first..][..from.len()];
                row.iter_mut().zip(from).for_each(|(v, &o)| change(v, o));
            }
        }
    }

    /// How many cells have this value or more.
    fn cells_from(&self, level: f32) -> usize {
        self.volume.data().iter().filter(|&&v| v >= level).count()
    }

    /// In how many cells this field and `other`, on the same lattice, have a part each.
    fn shared_with(&self, other: &Self) -> usize {
        let (offset, [nx, ny, nz]) = (self.offset_of(other), self.volume.grid().dims());
        let rows = (0..nz).flat_map(|k| (0..ny).map(move |j| [j, k]));
        let both = rows.filter_map(|[j, k]| {
            let (first, theirs) = self.row_over(other, offset, [j, k])?;
            let own = &self.volume.data()[(k * ny + j) * nx + first..];
            Some(own.iter().zip(theirs).filter(|&(&a, &b)| a > COMMON && b > COMMON).count())
        });
        both.sum()
    }

    /// Where row `j`, `k` of this field and one of `other`, a field on the same lattice, lie over each other: the first cell
    /// of this row, and what `other` holds from there on.
    fn row_over<'a>(&self, other: &'a Self, offset: [isize; 3], [j, k]: [usize; 2]) -> Option<(usize, &'a [f32])> {
        let (d, e) = (self.volume.grid().dims(), other.volume.grid().dims());
        let there = |x: usize, a: usize| usize::try_from(x as isize - offset[a]).ok().filter(|&x| x < e[a]);
        let (y, z) = (there(j, 1)?, there(k, 2)?);
        let (low, high) = (offset[0].max(0), (offset[0] + e[0] as isize).min(d[0] as isize));
        let first = other.volume.grid().index((low - offset[0]) as usize, y, z);
        (low < high).then(|| (low as usize, &other.volume.data()[first..first + (high - low) as usize]))
    }

    /// A field of one value on the same lattice and box.
    fn filled_as(&self, value: f32) -> Self {
        Self { volume: Volume::filled(*self.volume.grid(), value), ..*self }
    }

    /// The value and its gradient per mm inside the cell.
    pub(super) fn with_slope(&self, p: D3) -> (f64, D3) {
        let Some((at, t)) = self.cells.find(p) else { return (self.outside, [0.0; 3]) };
        let [up, over] = self.cells.steps();
        let data = self.volume.data();
        let line = |at: usize| {
            let (low, high) = (f64::from(data[at]), f64::from(data[at + 1]));
            (low + (high - low) * t[0], high - low)
        };
        let sheet = |at: usize| {
            let (low, high) = (line(at), line(at + up));
            let mix = |a: f64, b: f64| a + (b - a) * t[1];
            (mix(low.0, high.0), mix(low.1, high.1), high.0 - low.0)
        };
        let (low, high) = (sheet(at), sheet(at + over));
        let mix = |a: f64, b: f64| a + (b - a) * t[2];
        let g = [mix(low.1, high.1), mix(low.2, high.2), high.0 - low.0];
        (mix(low.0, high.0), self.cells.per_mm(g))
    }
}

/// What is to be meshed.
#[derive(Debug, Clone)]
pub(super) struct LabelFields {
    /// Everything kept.
    pub(super) union: Field,
    /// Each label but the last.
    pub(super) parts: Vec<Field>,
    /// For each of `parts` how far it exceeds what remains for the last label: its surface with that is the zero level.
    fronts: Vec<Field>,
    /// Which of `parts` have anything where.
    nearby: Nearby,
    /// All labels, the remainder last; those absent from the volume are left out.
    pub(super) labels: Vec<u16>,
    /// Volume that each label should have, mm3: of its voxels, but for pieces that the fields do not keep.
    pub(super) volumes: Vec<f64>,
    /// Where each label's voxels are, and how many.
    pub(super) extents: Vec<Extent>,
    /// Cavities that no label fills.
    pub(super) voids: Vec<Body>,
    /// Of each label the separate pieces but for the largest.
    pub(super) pieces: Vec<Vec<Body>>,
    /// Which labels are but specks, for which no number of elements is enough: for the sake of these none is given up.
    pub(super) specks: Vec<bool>,
    /// Volume of a voxel, mm3.
    pub(super) voxel: f64,
    /// Whether something kept reaches the border of the volume.
    pub(super) at_border: bool,
    /// Cell edge, mm.
    pub(super) step: f64,
    /// A millimetre for a head; in what is much larger or smaller, the length that stands for it, mm.
    pub(super) unit: f64,
}

impl LabelFields {
    /// Fields of the labels in `keep` that occur; `None` when none does. The label with most voxels is the remainder.
    pub(super) fn new<T: Copy + Eq + Into<u16> + Sync>(labels: &Volume<T>, keep: &[u16]) -> Option<Self> {
        let mut index = vec![0u8; 1 << 16];
        keep.iter().zip(1..).for_each(|(&k, i)| index[usize::from(k)] = i);
        let all = |l: T| index[usize::from(l.into())] != 0;
        let found = extents(labels, &index, keep.len());
        let whole = found.iter().flatten().copied().reduce(Extent::joined)?;
        let step = even_step(labels.grid(), &whole, MOST_CELLS);
        let mut present: Vec<(u16, Extent)> = keep.iter().zip(found).filter_map(|(&k, e)| Some((k, e?))).collect();
        let largest = (0..present.len()).max_by_key(|&i| (present[i].1.count, std::cmp::Reverse(i)))?;
        let rest = present.remove(largest);
        let union = even(labels, &all, &whole, step, MARGIN)?;
        let (at_border, union) = (union.at_border, Field::new(union.field));
        let raw = between_slices(labels, &union, (&present, rest), step)?;
        let union = Field::new(smoothed(union.volume, false));
        let mut parts: Vec<Field> = raw.into_iter().map(|own| Field::new(smoothed(own.volume, true))).collect();
        let mut fronts: Vec<Field> = parts.iter().map(|own| front(own, &union, &parts)).collect();
        give_away((labels, &|l: T| l.into() == rest.0), &union, (&mut parts, &mut fronts), step);
        let cells: Vec<usize> = parts.iter().map(|own| own.cells_from(0.5)).collect();
        let order = cutting_order(&cells, &shared(&parts, &fronts));
        let (parts, fronts) = (put_in_order(parts, &order), put_in_order(fronts, &order));
        present = order.iter().map(|&l| present[l]).chain([rest]).collect();
        let voids = voids(labels, &all, &union);
        let own = |l: &(u16, Extent), field: &Field| pieces(labels, &|v: T| v.into() == l.0, field);
        let remainder = rest_on(&union, &union, &parts);
        let pieces = present.iter().zip(parts.iter().chain([&remainder])).map(|(l, field)| own(l, field)).collect();
        Some(Self {
            nearby: Nearby::new(&union, &parts),
            union,
            parts,
            fronts,
            labels: present.iter().map(|p| p.0).collect(),
            volumes: present.iter().map(|p| p.1.count as f64 * labels.grid().voxel_volume()).collect(),
            extents: present.iter().map(|p| p.1).collect(),
            voids,
            pieces,
            specks: vec![false; present.len()],
            voxel: labels.grid().voxel_volume(),
            at_border,
            step,
            unit: unit(&whole, labels.grid()).max(FINEST_UNIT * step),
        })
    }

    /// Everything kept as one label, the last.
    pub(super) fn as_one(&self) -> Self {
        Self {
            union: self.union.clone(),
            parts: Vec::new(),
            fronts: Vec::new(),
            nearby: Nearby::new(&self.union, &[]),
            labels: self.labels.last().copied().into_iter().collect(),
            volumes: vec![self.volumes.iter().sum()],
            extents: self.extents.iter().copied().reduce(Extent::joined).into_iter().collect(),
            voids: self.voids.clone(),
            pieces: Vec::new(),
            specks: vec![false],
            ..*self
        }
    }

    /// Number of surfaces to cut: the outer one, then one for each label but the last.
    pub(super) fn surfaces(&self) -> usize {
        self.parts.len() + 1
    }

    /// Positive on the inner side of surface `s`: 0 is the outer one, `s` > 0 parts label `s - 1` from the labels after.
    pub(super) fn side(&self, s: usize, p: [f64; 3]) -> f64 {
        if s == 0 {
            return self.union.at(p) - 0.5;
        }
        let mut side = self.fronts[s - 1].at(p);
        let (later, near) = (self.parts.len() - s, self.near_from(s, p));
        if later > 0 {
            let own = self.parts[s - 1].at(p);
            // Those that are not near have nothing there.
            side = if near.len() < later { side.min(own) } else { side };
            side = near.fold(side, |side, (_, other)| side.min(own - other));
        }
        // Where neither it nor any later one is, what is left of others has no side by rounding.
        if side.abs() < ABSENT { side.min(self.parts[s - 1].at(p) - ABSENT) } else { side }
    }

    /// Whether none of the labels that surface `s` parts is at a point, which then lies in one that was cut off before. Before
    /// the outer one, 0, none was.
    pub(super) fn is_beyond(&self, s: usize, p: D3) -> bool {
        s > 0 && self.near_from(s - 1, p).all(|(_, value)| value < ABSENT) && self.rest(p) < ABSENT
    }

    /// Whether a point may lie on the inner side of surface `s`: off the box of its label it does not.
    pub(super) fn may_be_inside(&self, s: usize, p: D3) -> bool {
        s == 0 || self.parts[s - 1].cells.find(p).is_some()
    }

    /// The labels but the last that may have something at a point, by their indices, in order.
    pub(super) fn near(&self, p: D3) -> &[u8] {
        self.nearby.at(p)
    }

    /// Those from index `l` on, and what each has there.
    fn near_from(&self, l: usize, p: D3) -> impl ExactSizeIterator<Item = (usize, f64)> {
        let near = self.near(p);
        let first = near.partition_point(|&other| usize::from(other) < l);
        near[first..].iter().map(move |&other| (usize::from(other), self.parts[usize::from(other)].at(p)))
    }

    /// Positive on the side of label `a`, zero on its surface with label `b` (`None`: with the outside); and the gradient
    /// per mm.
    pub(super) fn between(&self, a: u8, b: Option<u8>, p: D3) -> (f64, D3) {
        let Some(b) = b else {
            let (value, slope) = self.union.with_slope(p);
            return (value - 0.5, slope);
        };
        match (self.parts.get(usize::from(a)), self.parts.get(usize::from(b))) {
            (Some(one), Some(two)) => {
                let (one, two) = (one.with_slope(p), two.with_slope(p));
                (one.0 - two.0, sub(one.1, two.1))
            }
            (Some(_), None) => self.fronts[usize::from(a)].with_slope(p),
            (None, _) => {
                let (value, slope) = self.fronts[usize::from(b)].with_slope(p);
                (-value, slope.map(|x| -x))
            }
        }
    }

    /// Label `l` on its own lattice: positive inside, the difference in field values to the next label or to the outside.
    pub(super) fn margins(&self, l: usize) -> Volume<f32> {
        let own = self.parts.get(l);
        let like = own.unwrap_or(&self.union);
        let rest = rest_on(like, &self.union, &self.parts);
        let mut others = if own.is_some() { rest.clone() } else { like.filled_as(f32::NEG_INFINITY) };
        for (_, part) in self.parts.iter().enumerate().filter(|(m, _)| *m != l) {
            others.combine(part, |most, value| *most = most.max(value));
        }
        let mut margin = own.cloned().unwrap_or(rest);
        margin.combine(&others, |value, other| *value -= other);
        margin.combine(&self.union, |value, union| *value = value.min(union - 0.5));
        margin.volume
    }

    /// Volume of each label in the fields, mm3, to a few parts in a thousand.
    pub(super) fn found(&self) -> Vec<f64> {
        let cell = self.step.powi(3);
        let mut found: Vec<f64> = self.fronts.iter().map(|f| f.cells_from(0.0) as f64 * cell).collect();
        found.push(self.union.cells_from(0.5) as f64 * cell - found.iter().sum::<f64>());
        found
    }

    /// What the parts leave of everything kept for the last label at a point.
    pub(super) fn rest(&self, p: D3) -> f64 {
        self.near_from(0, p).fold(self.union.at(p), |rest, (_, value)| rest - value)
    }

    /// Index of the label at a point; `None` outside of all.
    pub(super) fn label_at(&self, p: [f64; 3]) -> Option<usize> {
        let whole = self.union.at(p);
        (whole >= 0.5).then(|| self.largest_part(p, whole))
    }

    /// Index of the label that has the largest part at a point, on the surface or off it, too.
    pub(super) fn likeliest_at(&self, p: [f64; 3]) -> usize {
        self.largest_part(p, self.union.at(p))
    }

    /// Index of the label with the largest part of the whole at a point.
    fn largest_part(&self, p: [f64; 3], whole: f64) -> usize {
        let mut rest = whole;
        let mut best = (self.parts.len(), f64::NEG_INFINITY);
        for (label, value) in self.near_from(0, p) {
            rest -= value;
            if value > best.1 {
                best = (label, value);
            }
        }
        if rest >= best.1 { self.parts.len() } else { best.0 }
    }
}

/// A millimetre where the longest side of the extent is usual, else a power of two of it that makes that side so.
fn unit(extent: &Extent, grid: &Grid) -> f64 {
    let longest = (0..3).map(|a| (extent.high[a] - extent.low[a] + 1) as f64 * grid.spacing()[a]).fold(0.0, f64::max);
    if USUAL.contains(&longest) { 1.0 } else { (longest / HEAD).log2().round().exp2() }
}

/// What remains of everything kept without the parts, on the lattice of `like`.
fn rest_on(like: &Field, union: &Field, parts: &[Field]) -> Field {
    let mut rest = like.filled_as(0.0);
    rest.combine(union, |value, union| *value = union);
    parts.iter().for_each(|part| rest.combine(part, |value, part| *value -= part));
    rest
}

fn put_in_order<T>(items: Vec<T>, order: &[usize]) -> Vec<T> {
    let mut items: Vec<Option<T>> = items.into_iter().map(Some).collect();
    order.iter().filter_map(|&i| items[i].take()).collect()
}

/// In how many cells two labels have a part each, for all of them, what remains last: about twice the cells of the surface
/// between them.
fn shared(parts: &[Field], fronts: &[Field]) -> Vec<Vec<usize>> {
    let last = parts.len();
    let mut shared = vec![vec![0; last + 1]; last + 1];
    for (a, own) in parts.iter().enumerate() {
        let rest = own.volume.data().iter().zip(fronts[a].volume.data());
        let mut share = |b: usize, cells: usize| (shared[a][b], shared[b][a]) = (cells, cells);
        share(last, rest.filter(|&(&v, &front)| v > COMMON && v - front > COMMON).count());
        parts[..a].iter().enumerate().for_each(|(b, other)| share(b, own.shared_with(other)));
    }
    shared
}

/// How far a part exceeds what [`rest_on`] its lattice gives, row by row. Far from a label the rest is all there is.
fn front(own: &Field, union: &Field, parts: &[Field]) -> Field {
    let [nx, ny, _] = own.volume.grid().dims();
    let others: Vec<(&Field, [isize; 3])> = parts.iter().map(|part| (part, own.offset_of(part))).collect();
    let whole = own.offset_of(union);
    let mut front = own.volume.clone();
    let mut rest = vec![0f32; nx];
    for (row, values) in front.data_mut().chunks_mut(nx).enumerate() {
        let at = [row % ny, row / ny];
        rest.fill(0.0);
        if let Some((first, from)) = own.row_over(union, whole, at) {
            rest[first..first + from.len()].copy_from_slice(from);
        }
        for (first, from) in others.iter().filter_map(|(part, offset)| own.row_over(part, *offset, at)) {
            rest[first..].iter_mut().zip(from).for_each(|(r, &v)| *r -= v);
        }
        values.iter_mut().zip(&rest).for_each(|(v, rest)| *v -= rest);
    }
    Field { volume: front, outside: -1.0, ..*own }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Point;

    #[test]
    fn smoothing_keeps_a_ball_of_four_cells_at_its_size() {
        let grid = Grid::axis_aligned([24; 3], [1.0; 3], [-11.3, -11.6, -11.5]).expect("grid");
        let data = (0..grid.len()).map(|at| {
            let [i, j, k] = grid.voxel(at);
            u16::from((grid.centre(i, j, k) - Point::ORIGIN).norm() < 4.0)
        });
        let labels = Volume::new(grid, data.collect()).expect("count");
        let f = LabelFields::new(&labels, &[1]).expect("fields");
        // Where the field falls through the level along many directions.
        let mut sum = 0.0;
        let n = 400;
        for i in 0..n {
            let z = (f64::from(i) + 0.5) / f64::from(n) * 2.0 - 1.0;
            let a = f64::from(i) * 2.399_963;
            let s = (1.0 - z * z).sqrt();
            let at = |r: f64| f.side(0, [r * s * a.cos(), r * s * a.sin(), r * z]);
            sum += (0..600).map(|r| f64::from(r) * 0.01).find(|&r| at(r) < 0.0).expect("ends");
        }
        let radius = sum / f64::from(n);
        // A plain Gaussian of this width would take SIGMA^2 / r = 0.18 cells.
        assert!((radius - 4.0).abs() < 0.09, "{radius}");
    }

    #[test]
    fn a_rod_two_voxels_thick_is_kept_and_a_bump_of_one_is_smoothed() {
        // Half a space below z = 0, a rod on it and, apart, a bump; all on the voxels' lattice.
        let grid = Grid::axis_aligned([40, 30, 40], [1.0; 3], [-19.5, -14.5, -19.5]).expect("grid");
        let data = (0..grid.len()).map(|at| {
            let [i, j, k] = grid.voxel(at);
            let [x, y, z] = grid.centre(i, j, k).to_array();
            let rod = x.abs() < 1.0 && y.abs() < 1.0 && z < 10.0;
            let bump = x > 9.0 && x < 10.0 && y.abs() < 1.0 && y > 0.0 && z < 1.0;
            u16::from((z < 0.0 && z > -10.0) || ((rod || bump) && z > 0.0)) + 1
        });
        let labels = Volume::new(grid, data.collect()).expect("count");
        let f = LabelFields::new(&labels, &[1, 2]).expect("fields");
        let of = f.labels.iter().position(|&l| l == 2).expect("there");
        let height = |x: f64, y: f64| {
            let inside = |z: &f64| f.label_at([x, y, *z]) == Some(of);
            (0..150).map(|z| f64::from(z) * 0.1).filter(inside).fold(0.0, f64::max)
        };
        // Smoothing alone breaks the rod up or shortens it by two cells.
        assert!((height(0.0, 0.0) - 10.0).abs() < 0.6, "{}", height(0.0, 0.0));
        assert!((0..90).all(|z| f.label_at([0.0, 0.0, f64::from(z) * 0.1]) == Some(of)));
        assert!(height(9.5, 0.5) < 0.6, "{}", height(9.5, 0.5));
    }

    #[test]
    fn a_one_voxel_septum_keeps_its_label() {
        let grid = Grid::axis_aligned([30; 3], [0.9; 3], [0.0; 3]).expect("grid");
        let data = (0..grid.len()).map(|at| {
            let [i, j, k] = grid.voxel(at);
            let core = (5..25).contains(&j) && (5..25).contains(&k);
            match i {
                5..=14 if core => 5u16,
                16..=24 if core => 6,
                _ => 4,
            }
        });
        let f = LabelFields::new(&Volume::new(grid, data.collect()).expect("count"), &[4, 5, 6]).expect("fields");
        let at = |x: f64| f.label_at([x * 0.9, 13.5, 13.5]).map(|l| f.labels[l]);
        assert_eq!([at(13.0), at(15.0), at(17.0)], [Some(5), Some(4), Some(6)]);
        assert!(f.at_border);
    }
}
