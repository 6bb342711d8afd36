//! Cutting the lattice along the surfaces so that every element lies on one side.
//!
//! For each surface in turn: points close to a cut move onto it, then the edges still crossing are split one by one in
//! one global order. Both sides of each face see the same order, so the mesh conforms whatever meets where; three labels
//! in one element are just two surfaces after each other. Only elements near a label are looked at for it.

use super::adjacency::EDGES;
use super::fields::{ABSENT, LabelFields};
use super::lattice::PackedMap;
use super::quality::quality;
use super::repair;
use monro_geometry::by_point;
use monro_geometry::d3::{D3, add, distance, lerp, scale};

/// A point moves onto a cut within this fraction of the edge. Beyond 0.3 whole elements come to lie on the surface.
const WARP: f64 = 0.25;
/// A point that may not move is taken for one on the cut within this fraction of the edge: where surfaces meet in a plane
/// of the lattice, its cuts would lie in one place but for rounding.
const SNAP: f64 = 0.02;
/// What lies behind a cut is looked at this part of the edge further on.
const BEYOND: f64 = 0.02;
/// A warp may not leave an element worse than this.
const WORST: f64 = 0.08;
/// Label of elements not yet given away.
pub(super) const PENDING: u8 = u8::MAX;
/// Label of elements outside.
pub(super) const OUTSIDE: u8 = u8::MAX - 1;

/// A mesh under construction: positions in patient mm, label indices.
#[derive(Debug, Clone, Default)]
pub(super) struct RawMesh {
    pub(super) points: Vec<D3>,
    pub(super) tets: Vec<[u32; 4]>,
    pub(super) labels: Vec<u8>,
}

impl RawMesh {
    pub(super) fn corners(&self, t: [u32; 4]) -> [D3; 4] {
        t.map(|v| self.points[v as usize])
    }
}

/// Cuts along all surfaces and labels the elements; those outside are dropped. Points `pinned` stay where they are.
pub(super) fn cut_all(points: Vec<D3>, tets: Vec<[u32; 4]>, mut pinned: Vec<bool>, fields: &LabelFields) -> RawMesh {
    let mut mesh = RawMesh { labels: vec![PENDING; tets.len()], points, tets };
    for s in 0..fields.surfaces() {
        // Surface 0 keeps its inner side pending; later ones give their inner side to the label.
        let (plus, minus) = if s == 0 { (PENDING, OUTSIDE) } else { ((s - 1) as u8, PENDING) };
        Cut::new(&mut mesh, &mut pinned, fields, s).run(plus, minus);
        if s == 0 {
            drop_with(&mut mesh, &mut pinned);
            // Bodies are parted before it is asked whose what spans the gap between them is: cut in two it leaves crumbs.
            if fields.surfaces() > 1 {
                repair::part(&mut mesh, &mut pinned.clone());
                drop_with(&mut mesh, &mut pinned);
            }
        }
    }
    give_rest(&mut mesh, fields);
    mesh
}

/// The last label has what no other has taken. Where three others meet, rounding may leave an element to none of them: far from
/// the last one it is of the label that is there.
fn give_rest(mesh: &mut RawMesh, fields: &LabelFields) {
    let rest = (fields.surfaces() - 1) as u8;
    for t in (0..mesh.tets.len()).filter(|&t| mesh.labels[t] == PENDING).collect::<Vec<_>>() {
        let corners = mesh.corners(mesh.tets[t]);
        let is_near = rest < 2 || corners.iter().any(|&p| fields.rest(p) > ABSENT);
        let there = if is_near { None } else { fields.label_at(scale(corners.into_iter().fold([0.0; 3], add), 0.25)) };
        mesh.labels[t] = there.map_or(rest, |l| l as u8);
    }
}

/// Removes elements labelled [`OUTSIDE`], and points no longer used with what is known of them.
fn drop_with(mesh: &mut RawMesh, pinned: &mut Vec<bool>) {
    let order = drop_outside(mesh);
    *pinned = order.iter().map(|&v| pinned[v as usize]).collect();
}

/// Removes elements labelled [`OUTSIDE`] and points no longer used; returns the old number of each point.
pub(super) fn drop_outside(mesh: &mut RawMesh) -> Vec<u32> {
    let keep: Vec<bool> = mesh.labels.iter().map(|&l| l != OUTSIDE).collect();
    let mut each = keep.iter();
    mesh.tets.retain(|_| each.next().copied().unwrap_or(false));
    mesh.labels.retain(|&l| l != OUTSIDE);
    compact(mesh)
}

/// Renumbers the points in use in order of first appearance; returns the old number of each.
pub(super) fn compact(mesh: &mut RawMesh) -> Vec<u32> {
    let mut number = vec![u32::MAX; mesh.points.len()];
    let mut order = Vec::new();
    for v in mesh.tets.iter_mut().flatten() {
        let n = &mut number[*v as usize];
        if *n == u32::MAX {
            *n = order.len() as u32;
            order.push(*v);
        }
        *v = *n;
    }
    mesh.points = order.iter().map(|&v| mesh.points[v as usize]).collect();
    order
}

/// A crossing edge, lower vertex first, and where it is cut.
#[derive(Debug, Clone, Copy)]
struct Crossing {
    ends: [u32; 2],
    at: D3,
    /// Fraction from the first end.
    t: f64,
    length: f64,
}

struct Cut<'a> {
    mesh: &'a mut RawMesh,
    /// Points on an earlier surface, which stay.
    pinned: &'a mut Vec<bool>,
    fields: &'a LabelFields,
    surface: usize,
    /// Which elements are near the label: edges that the surface cuts are of these.
    is_near: Vec<bool>,
    /// Side of the surface that the corners of the pending ones of these are on; 0 on it, and where it does not matter.
    side: Vec<i8>,
}

impl<'a> Cut<'a> {
    fn new(mesh: &'a mut RawMesh, pinned: &'a mut Vec<bool>, fields: &'a LabelFields, surface: usize) -> Self {
        let may_be: Vec<bool> = mesh.points.iter().map(|&p| fields.may_be_inside(surface, p)).collect();
        let is_near: Vec<bool> = mesh.tets.iter().map(|t| t.iter().any(|&v| may_be[v as usize])).collect();
        // Points of elements given away have no side, and far ones all lie on the other one.
        let mut asked = vec![false; mesh.points.len()];
        for t in pending(mesh, &is_near) {
            t.iter().for_each(|&v| asked[v as usize] = true);
        }
        // Edges between points on an earlier surface may lie in its label: a cut there is on all later ones.
        let is_beyond = |v: usize, p: D3| pinned[v] && fields.is_beyond(surface, p);
        let side = |(v, &p): (usize, &D3)| match asked[v] && !is_beyond(v, p) {
            true => sign(fields.side(surface, p)),
            false => 0,
        };
        let side: Vec<i8> = mesh.points.iter().enumerate().map(side).collect();
        for v in 0..side.len() {
            pinned[v] |= asked[v] && side[v] == 0;
        }
        Self { mesh, pinned, fields, surface, is_near, side }
    }

    fn run(&mut self, plus: u8, minus: u8) {
        let mut crossings = self.crossings();
        self.warp(&crossings);
        crossings.retain(|c| self.crosses(c.ends));
        self.split(crossings);
        self.classify(plus, minus);
    }

    fn crosses(&self, [a, b]: [u32; 2]) -> bool {
        self.side[a as usize] * self.side[b as usize] < 0
    }

    fn crossings(&self) -> Vec<Crossing> {
        let mut keys = Vec::new();
        for t in pending(self.mesh, &self.is_near) {
            for [i, j] in EDGES {
                if self.crosses([t[i], t[j]]) {
                    keys.push(edge_key(t[i], t[j]));
                }
            }
        }
        keys.sort_unstable();
        keys.dedup();
        keys.into_iter().map(|k| self.crossing([(k >> 32) as u32, k as u32])).collect()
    }

    /// Where the field along an edge is zero, by the Illinois variant of regula falsi.
    fn crossing(&self, ends: [u32; 2]) -> Crossing {
        let [a, b] = ends.map(|v| self.mesh.points[v as usize]);
        let f = |t: f64| self.fields.side(self.surface, lerp(a, b, t));
        let (mut low, mut high) = ((0.0, f(0.0)), (1.0, f(1.0)));
        let mut t = 0.5;
        for i in 0..12 {
            // The fields saturate: the first steps halve, later ones follow the slope.
            t = if i < 3 { 0.5 * (low.0 + high.0) } else { (low.0 * high.1 - high.0 * low.1) / (high.1 - low.1) };
            let value = f(t);
            if value.abs() < 1e-4 || high.0 - low.0 < 1e-3 {
                break;
            }
            if (value > 0.0) == (high.1 > 0.0) {
                high = (t, value);
                low.1 *= if i < 3 { 1.0 } else { 0.5 };
            } else {
                low = (t, value);
                high.1 *= if i < 3 { 1.0 } else { 0.5 };
            }
        }
        t = self.middle_beyond([a, b], t, low.1 > 0.0);
        Crossing { ends, at: lerp(a, b, t), t, length: distance(a, b) }
    }

    /// Where an edge leaves the inner side of the surface at `t`, and lies from there on in a label that was cut off before
    /// until it comes to what is to be parted from this one: the middle of that way. It crosses the surface of that label
    /// about there, where all three meet. Else `t`.
    fn middle_beyond(&self, [a, b]: [D3; 2], t: f64, from_first: bool) -> f64 {
        let (own, other) = if from_first { (0.0, 1.0) } else { (1.0, 0.0) };
        let is_beyond = |t: f64| self.fields.is_beyond(self.surface, lerp(a, b, t));
        let after = t + BEYOND * (other - own);
        if !(0.0..=1.0).contains(&after) || !is_beyond(after) || is_beyond(other) {
            return t;
        }
        let (mut near, mut far) = (after, other);
        for _ in 0..8 {
            let middle = 0.5 * (near + far);
            *if is_beyond(middle) { &mut near } else { &mut far } = middle;
        }
        0.5 * (t + near)
    }

    /// Moves points near a cut onto the nearest one, in the order of their numbers.
    fn warp(&mut self, crossings: &[Crossing]) {
        let mut wishes: Vec<(u32, f64, u32)> = Vec::new();
        for (i, c) in crossings.iter().enumerate() {
            for (v, t) in [(c.ends[0], c.t), (c.ends[1], 1.0 - c.t)] {
                if t < if self.pinned[v as usize] { SNAP } else { WARP } {
                    wishes.push((v, t * c.length, i as u32));
                }
            }
        }
        wishes.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
        let (first, around) = self.around(&wishes);
        for of_one in wishes.chunk_by(|a, b| a.0 == b.0) {
            for &(v, _, i) in of_one {
                let around = &around[first[v as usize] as usize..first[v as usize + 1] as usize];
                let c = &crossings[i as usize];
                let t = if c.ends[0] == v { c.t } else { 1.0 - c.t };
                if self.crosses(c.ends) && (self.try_move(v, c.at, around) || t < SNAP) {
                    self.side[v as usize] = 0;
                    self.pinned[v as usize] = true;
                    break;
                }
            }
        }
    }

    /// The elements around each point that wishes to move: where those of each point begin, and all of them.
    fn around(&self, wishes: &[(u32, f64, u32)]) -> (Vec<u32>, Vec<u32>) {
        let mut wished = vec![false; self.mesh.points.len()];
        wishes.iter().for_each(|w| wished[w.0 as usize] = true);
        let corners = (0..).zip(&self.mesh.tets).flat_map(|(e, t)| t.iter().map(move |&v| (v, e)));
        by_point(corners.filter(|c| wished[c.0 as usize]), wished.len())
    }

    fn try_move(&mut self, v: u32, to: D3, around: &[u32]) -> bool {
        if self.pinned[v as usize] {
            return false;
        }
        let from = std::mem::replace(&mut self.mesh.points[v as usize], to);
        let good = |&t: &u32| quality(self.mesh.corners(self.mesh.tets[t as usize])) > WORST;
        if around.iter().all(good) {
            return true;
        }
        self.mesh.points[v as usize] = from;
        false
    }

    /// Splits the crossing edges, longest first.
    fn split(&mut self, mut crossings: Vec<Crossing>) {
        crossings.sort_unstable_by(|a, b| b.length.total_cmp(&a.length).then(a.ends.cmp(&b.ends)));
        let first = self.mesh.points.len() as u32;
        let mut rank: PackedMap<u32> = PackedMap::default();
        rank.reserve(crossings.len());
        for (i, c) in crossings.iter().enumerate() {
            rank.insert(edge_key(c.ends[0], c.ends[1]), i as u32);
            self.mesh.points.push(c.at);
            self.side.push(0);
            self.pinned.push(true);
        }
        let capacity = self.mesh.tets.len() + 4 * crossings.len();
        let tets = std::mem::replace(&mut self.mesh.tets, Vec::with_capacity(capacity));
        let labels = std::mem::replace(&mut self.mesh.labels, Vec::with_capacity(capacity));
        let near = std::mem::replace(&mut self.is_near, Vec::with_capacity(capacity));
        let mut stack = Vec::new();
        for ((t, label), is_near) in tets.into_iter().zip(labels).zip(near) {
            stack.push(t);
            while let Some(t) = stack.pop() {
                let cut = if is_near { self.first_cut(t, &rank) } else { None };
                let Some((i, j, r)) = cut else {
                    self.mesh.tets.push(t);
                    self.mesh.labels.push(label);
                    self.is_near.push(is_near);
                    continue;
                };
                let (mut low, mut high) = (t, t);
                low[j] = first + r;
                high[i] = first + r;
                stack.push(high);
                stack.push(low);
            }
        }
    }

    fn first_cut(&self, t: [u32; 4], rank: &PackedMap<u32>) -> Option<(usize, usize, u32)> {
        let mut best: Option<(usize, usize, u32)> = None;
        for i in 0..4 {
            for j in i + 1..4 {
                if self.crosses([t[i], t[j]])
                    && let Some(&r) = rank.get(&edge_key(t[i], t[j]))
                    && best.is_none_or(|b| r < b.2)
                {
                    best = Some((i, j, r));
                }
            }
        }
        best
    }

    fn classify(&mut self, plus: u8, minus: u8) {
        let near = self.mesh.tets.iter().zip(&mut self.mesh.labels).zip(&self.is_near).filter(|(_, is_near)| **is_near);
        for (t, label) in near.map(|(both, _)| both).filter(|(_, l)| **l == PENDING) {
            let sum: i8 = t.iter().map(|&v| self.side[v as usize]).sum();
            let inner = match sum {
                0 => {
                    let p = t.iter().fold([0.0; 3], |s, &v| add(s, self.mesh.points[v as usize]));
                    self.fields.side(self.surface, scale(p, 0.25)) >= 0.0
                }
                s => s > 0,
            };
            *label = if inner { plus } else { minus };
        }
    }
}

/// Elements near a label that have none yet.
fn pending<'a>(mesh: &'a RawMesh, is_near: &'a [bool]) -> impl Iterator<Item = [u32; 4]> + 'a {
    let all = mesh.tets.iter().zip(&mesh.labels).zip(is_near);
    all.filter(|((_, l), is_near)| **l == PENDING && **is_near).map(|((t, _), _)| *t)
}

const fn edge_key(a: u32, b: u32) -> u64 {
    if a < b { (a as u64) << 32 | b as u64 } else { (b as u64) << 32 | a as u64 }
}

fn sign(x: f64) -> i8 {
    match x {
        x if x > 0.0 => 1,
        x if x < 0.0 => -1,
        _ => 0,
    }
}
