//! Finding the lattice whose cuts have the count: octree, body-centred lattice and cuts, for one finest edge or another.

use super::cut::{RawMesh, cut_all};
use super::draw;
use super::fields::LabelFields;
use super::lattice;
use super::octree::Octree;
use super::size::SizeField;
use super::thickness::Thin;
use monro_geometry::d3::D3;
use std::cell::{Cell, RefCell};

/// Cell edge of a body-centred lattice over its mean tetrahedron edge (six long edges and eight of sqrt(3)/2 at a point).
const CELL_PER_EDGE: f64 = 1.083;
/// A cell is split when longer than this many wanted edges.
pub(super) const SPLIT: f64 = 1.41;
/// So is one that may hold some of what is fine, when it is longer than so many times that: with strong growth the edge wanted
/// in its middle does not tell. With the usual growth of 0.7 mm a mm it does: cells become no longer than 7 of the finest edges.
const STEPS_OVER: [f64; 2] = [2.0, 8.0];
/// Growth of edges when none is asked for, mm a mm.
pub(super) const USUAL_GROWTH: f64 = 0.7;
/// Half the diagonal of a cell over its edge.
const HALF_DIAGONAL: f64 = 0.867;
/// Levels of the octree at most: coordinates are packed into 21 bits.
const MOST_LEVELS: u32 = 18;

/// Coarsening takes back this part of the elements that the powers of two waste.
const SURPLUS: f64 = 1.22;
/// The count of the lattice may fall short of its aim by this part, and exceed it by that: coarsening does the rest.
const SHORT: f64 = 0.06;
const OVER: f64 = 0.16;
const MOST_TRIES: usize = 8;
/// Where thin parts take more than this times the elements, all is thin: a lattice that sees it could only be coarsened
/// until it is lost again, after minutes.
const MOST_SPLIT: f64 = 4.0;
/// Where they are foreseen to take this many, it need not even be cut to know it.
const FAR_TOO_MANY: f64 = 2.0 * MOST_SPLIT;
/// There may be no lattice between two whose counts miss the aim by more than this, as logarithms, on either side.
const JUMP: f64 = 0.7;
/// The part more that a lattice of the least size has than estimated, because of its grading, and the power of the size
/// with which that falls (measured on phantoms and heads).
const GRADING: f64 = 0.55;
const GRADING_POWER: f64 = 0.85;
/// Elements a lattice should have at least so that it does not miss thin parts; below, surfaces are coarsened too,
const LEAST_LATTICE: f64 = 80_000.0;
/// but not by more than this factor, or that one where there is no inner label.
const MOST_COARSER: f64 = 14.0;
const MOST_COARSER_OUTSIDE: f64 = 8.0;
/// Elements that a cell more to be split for the path brings (measured on phantoms and heads).
const PER_ALONG: f64 = 115.0;
/// Elements that a cell more to be split for thin parts brings, and what a lattice without any has of the count aimed at
/// (measured on phantoms and heads): a lattice that exceeds it by this part more than it may need not be cut to know it.
const PER_THIN: f64 = 330.0;
const WITHOUT_THIN: f64 = 0.87;
const SURELY: f64 = 0.05;

/// A cut lattice and the finest edges wanted in it and in the mesh to be made of it.
pub(super) struct Start {
    pub(super) raw: RawMesh,
    /// How many elements it has but for those along the path, at a guess.
    counted: f64,
    /// Where its cells are smaller than wanted elsewhere because of thin parts, and the edges there.
    pub(super) bounds: Vec<(D3, f64)>,
    pub(super) lattice_edge: f64,
    pub(super) finest: f64,
}

/// Elements that the cut lattice for so many should have.
fn lattice_aim(wanted: usize, fields: &LabelFields) -> f64 {
    let coarser = if fields.parts.is_empty() { MOST_COARSER_OUTSIDE } else { MOST_COARSER };
    (wanted as f64 * SURPLUS).max(LEAST_LATTICE.min(coarser * wanted as f64))
}

/// How many times as many elements a lattice has as estimated: grading takes more the coarser it is.
fn underestimate(aim: f64) -> f64 {
    1.0 + GRADING * (LEAST_LATTICE / aim).powf(GRADING_POWER)
}

/// What to ask the estimate for at first.
pub(super) fn first_guess(wanted: usize, fields: &LabelFields) -> f64 {
    let aim = lattice_aim(wanted, fields);
    aim / underestimate(aim)
}

/// Edge of the finest cells that are tried at first, mm.
pub(super) fn first_cell(size: &SizeField, wanted: usize, fields: &LabelFields) -> f64 {
    CELL_PER_EDGE * finest_for(size, first_guess(wanted, fields))
}

/// Finds the finest edge that gives the count with its surplus, or `more` times as many; a mesh that cannot have it is left as
/// near as it comes.
pub(super) fn to_count(fields: &LabelFields, size: &SizeField, wanted: usize, more: f64) -> Option<Start> {
    let aim = more * lattice_aim(wanted, fields);
    let mut search = Search { ratio: underestimate(aim), last: None };
    let mut best: Option<Start> = None;
    let miss = |n: f64| (n / aim).ln();
    let (none, mut thin) = (Thin::none(), &size.thin);
    for _ in 0..MOST_TRIES {
        let lattice_edge = finest_for(size, aim / search.ratio);
        let Grown { tree, bounds, along } = Grown::new(fields, size, thin, lattice_edge);
        let has_thin = !bounds.is_empty();
        let foreseen = miss(WITHOUT_THIN * aim + PER_THIN * bounds.len() as f64);
        if search.last.is_none() && (OVER + SURELY..MOST_SPLIT.ln()).contains(&foreseen) {
            search.follow(foreseen, has_thin);
            continue;
        }
        if has_thin && foreseen > FAR_TOO_MANY.ln() {
            thin = &none;
            continue;
        }
        let raw = tree.cut(thin, fields);
        // What the path takes is left out: the cells elsewhere are what they would be without.
        let n = (raw.tets.len() as f64 - PER_ALONG * along as f64).max(0.0);
        if has_thin && n > MOST_SPLIT * aim {
            thin = &none;
            continue;
        }
        // What was only foreseen is none to fall back on.
        let is_over = n == 0.0 || (best.is_some() && search.is_over(miss(n)));
        let nearer = best.as_ref().is_none_or(|b| miss(n).abs() < miss(b.counted).abs());
        if nearer {
            best = Some(Start { raw, counted: n, bounds, lattice_edge, finest: lattice_edge });
        }
        // Cells of thin parts come and go by themselves: a step that led no nearer is followed by others that do not.
        if (-SHORT..OVER).contains(&miss(n)) || (has_thin && !nearer) || is_over {
            break;
        }
        search.follow(miss(n), has_thin);
    }
    let mut start = best.filter(|start| !start.raw.tets.is_empty())?;
    let needed = wanted as f64 * SURPLUS * more;
    if needed < aim {
        start.finest = finest_for(size, needed / search.ratio).max(start.lattice_edge);
    }
    Some(start)
}

/// The search for a count.
struct Search {
    /// How many times as many elements a lattice has as estimated.
    ratio: f64,
    /// Of the last lattice the logarithms of this and of its count over the one aimed at.
    last: Option<(f64, f64)>,
}

impl Search {
    /// Whether there is nothing more to be found: far too many and far too few in turn, where a lattice sees thin parts or does
    /// not.
    fn is_over(&self, now: f64) -> bool {
        self.last.is_some_and(|(_, m)| m * now < -JUMP * JUMP)
    }

    /// The next step from a lattice that misses by `now`: a secant in the logarithms, with bounded slopes and steps, as where a
    /// lattice sees next to nothing neither means much.
    fn follow(&mut self, now: f64, has_thin: bool) {
        let at = self.ratio.ln();
        // What is too many at first is of thin parts, whose cells are no fewer the next time: the others are to make room for
        // them.
        let thin_first = if has_thin && now > 0.0 { now / -(2.0 - now.exp()).max(0.4).ln() } else { 1.0 };
        let slope = self.last.map_or(thin_first, |(a, m)| ((m - now) / (at - a)).clamp(0.7, 2.0));
        self.last = Some((at, now));
        self.ratio *= (now / slope).clamp(-1.5, 1.5).exp();
    }
}

/// The finest edge of the lattice whose estimated count is `count`.
pub(super) fn finest_for(size: &SizeField, count: f64) -> f64 {
    edge_for(size, count, |finest, edge| {
        let finest = CELL_PER_EDGE * finest;
        finest * (SPLIT * edge / finest).log2().floor().max(0.0).exp2()
    })
}

/// The finest edge where all edges are as long as wanted and the estimated count is `count`.
pub(super) fn even_edge_for(size: &SizeField, count: f64) -> f64 {
    edge_for(size, count, |_, edge| CELL_PER_EDGE * edge)
}

/// Bisects for the finest edge whose estimated count is `count`, with cells that follow from it and the wanted edge.
fn edge_for(size: &SizeField, count: f64, cell: impl Fn(f64, f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.05 * size.unit, 100.0 * size.unit);
    for _ in 0..40 {
        let middle = (low * high).sqrt();
        if size.estimate(middle, |edge| cell(middle, edge)) > count { low = middle } else { high = middle }
    }
    (low * high).sqrt()
}

/// An octree for one finest edge, with smaller cells where thin parts would not be seen.
pub(super) struct Grown {
    pub(super) tree: Tree,
    /// Where its cells are smaller because of thin parts, and the edges there.
    bounds: Vec<(D3, f64)>,
    /// How many cells were split for the path alone.
    along: usize,
}

impl Grown {
    pub(super) fn new(fields: &LabelFields, size: &SizeField, thin_parts: &Thin, finest: f64) -> Self {
        let cell = CELL_PER_EDGE * finest;
        let (low, high) = size.bounds();
        let extent = (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max) + 2.0 * cell;
        let levels = (extent / cell).log2().ceil().clamp(1.0, f64::from(MOST_LEVELS)) as u32;
        // Levels below the finest cell, for thin places and dense labels.
        let thin = (cell / fields.step).log2().ceil().clamp(1.0, f64::from(MOST_LEVELS + 1 - levels)) as u32;
        let levels = levels + thin;
        let unit = 0.5 * cell / f64::from(1u32 << thin);
        let span = f64::from(2u32 << levels) * unit;
        let origin: D3 = std::array::from_fn(|a| 0.5 * (low[a] + high[a] - span));
        let (bounds, along) = (RefCell::new(Vec::new()), Cell::new(0));
        let [least, most] = STEPS_OVER;
        let steps_over = SPLIT * finest * (most * (USUAL_GROWTH / size.growth()).powi(2)).clamp(least, most);
        let tree = Octree::new(levels, |corner, edge| {
            let place = |more: f64| placed(origin, unit, corner.map(|c| f64::from(c) + more));
            let length = f64::from(edge) * unit;
            // As far again as the cell is large: neighbours share elements.
            if !size.is_near(place(0.0), place(f64::from(edge)), length + 2.0 * fields.step) {
                return false;
            }
            let centre = place(0.5 * f64::from(edge));
            let distance = size.distance(centre);
            let steps_over = length > steps_over && distance < HALF_DIAGONAL * length;
            if steps_over || length > SPLIT * size.edge_off(distance, centre, finest) {
                return true;
            }
            if size.along.is_some_and(|along| along.is_coarse(place(0.0), centre, length)) {
                along.set(along.get() + 1);
                return true;
            }
            let unseen = thin_parts.is_unseen(fields, centre, length);
            if unseen {
                bounds.borrow_mut().push((centre, length / CELL_PER_EDGE));
            }
            unseen
        });
        Self { tree: Tree { tree, origin, unit }, bounds: bounds.into_inner(), along: along.get() }
    }
}

/// An octree in its place.
pub(super) struct Tree {
    tree: Octree,
    /// Lowest corner and unit, mm.
    origin: D3,
    unit: f64,
}

impl Tree {
    /// The lattice over the tree, cut along all surfaces.
    pub(super) fn cut(&self, thin_parts: &Thin, fields: &LabelFields) -> RawMesh {
        let lattice = lattice::lattice(&self.tree);
        let mut points: Vec<D3> =
            lattice.points.iter().map(|p| placed(self.origin, self.unit, p.map(f64::from))).collect();
        let stay = draw::draw(&mut points, &lattice.tets, thin_parts, fields);
        cut_all(points, lattice.tets, stay, fields)
    }
}

/// Where a place of the tree is, mm.
fn placed(origin: D3, unit: f64, p: D3) -> D3 {
    std::array::from_fn(|a| origin[a] + p[a] * unit)
}
