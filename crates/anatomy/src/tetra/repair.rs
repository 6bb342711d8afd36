//! Making each label's surface two-manifold, and dropping crumbs.

use super::adjacency::{FACES, Incidence, OUT, neighbours};
use super::cut::{OUTSIDE, RawMesh, drop_outside};
use super::lattice::PackedMap;
use monro_geometry::DisjointSets;
use monro_geometry::d3::{D3, volume6};
use std::cell::RefCell;
use std::collections::BTreeMap;

/// Rounds at most; each may uncover a few new places.
const ROUNDS: usize = 24;
/// Rounds in which as little as possible is relabelled. Two labels may then pass elements to and fro for ever; later rounds
/// give all that is around such a point to one of them.
const GENTLE: usize = 6;
/// Elements at most between pieces of a label that are joined: cuts leave many small ones along a thin part.
const LONGEST_WAY: usize = 32;

/// A separate piece of a label that was too small to keep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Crumb {
    /// Index of the label.
    pub(super) label: u8,
    /// Volume, mm3.
    pub(super) volume: f64,
    /// A corner of it, LPS mm.
    pub(super) place: D3,
}

/// Relabels the smaller part wherever a label (or what lies around it) meets itself in a point or edge only, and pieces
/// of a label too small to matter: below `crumb` mm3 and a hundredth of the label.
///
/// Returns the pieces given away.
pub(super) fn repair(mesh: &mut RawMesh, labels: u8, crumb: f64, holds: impl Fn([D3; 4], u8) -> bool) -> Vec<Crumb> {
    let mut r = Repair::new(mesh);
    let mut given = Vec::new();
    let mut points = Vec::new();
    for round in 0..ROUNDS {
        let mut pieces = r.label_pieces();
        // Two pieces may join each other first, and the rest of their label next; mending pinches may part them again.
        for _ in 0..if round < GENTLE { GENTLE } else { 0 } {
            if !r.bridge(&pieces, labels, &holds) {
                break;
            }
            pieces = r.label_pieces();
        }
        r.crumbs(&pieces, labels, crumb, if round == 0 { Some(&mut given) } else { None });
        if round == 0 {
            points = r.points_of_faces();
        } else {
            points.extend(r.points_of_changed());
            points.sort_unstable();
            points.dedup();
        }
        r.changed.clear();
        r.pinches(&points, |r, star, outside| r.unpinch(star, outside, round >= GENTLE));
        if r.changed.is_empty() {
            break;
        }
        points = r.points_of_changed();
    }
    if mesh.labels.contains(&OUTSIDE) {
        drop_outside(mesh);
    }
    given
}

/// Labels elements [`OUTSIDE`] where all that is meshed, or what lies around it, meets itself in a point or edge only: those that
/// span a narrow gap. Points on the surface, `outer`, are given; those that come to lie on it are added.
pub(super) fn part(mesh: &mut RawMesh, outer: &mut [bool]) {
    while part_at(mesh, outer) {}
}

/// The same at the points given; whether there were any such elements.
fn part_at(mesh: &mut RawMesh, outer: &mut [bool]) -> bool {
    // All that is around these points, which is all that is asked for: most elements lie further in.
    let touches = |&t: &usize| mesh.labels[t] != OUTSIDE && mesh.tets[t].iter().any(|&v| outer[v as usize]);
    let shell: Vec<usize> = (0..mesh.tets.len()).filter(touches).collect();
    let tets = shell.iter().map(|&t| mesh.tets[t]).collect();
    let mut raw = RawMesh { points: mesh.points.clone(), tets, labels: vec![0; shell.len()] };
    let points: Vec<u32> = (0..).zip(&*outer).filter(|&(_, &o)| o).map(|(v, _)| v).collect();
    Repair::new(&mut raw).pinches(&points, Repair::unpinch_all);
    let gone: Vec<usize> = (0..shell.len()).filter(|&t| raw.labels[t] == OUTSIDE).collect();
    for &t in &gone {
        mesh.labels[shell[t]] = OUTSIDE;
        raw.tets[t].iter().for_each(|&v| outer[v as usize] = true);
    }
    !gone.is_empty()
}

/// Elements labelled [`OUTSIDE`] meanwhile count as not there.
struct Repair<'a> {
    mesh: &'a mut RawMesh,
    around: Incidence,
    behind: Vec<[u32; 4]>,
    volumes: Vec<f64>,
    /// Elements relabelled since the last look.
    changed: Vec<u32>,
    /// Place of each element around the point that is looked at; [`OUT`] for all others.
    place: Vec<u32>,
    /// Whether an element holds some of a label, as far as it was asked: rounds ask again.
    held: RefCell<PackedMap<bool>>,
}

/// For each element the first one of its connected piece, and for each of these the piece's volume, mm3.
struct Pieces {
    roots: Vec<u32>,
    volumes: Vec<f64>,
}

impl<'a> Repair<'a> {
    fn new(mesh: &'a mut RawMesh) -> Self {
        let around = Incidence::new(&mesh.tets, mesh.points.len());
        let behind = neighbours(&mesh.tets, mesh.points.len());
        let volumes = mesh.tets.iter().map(|&t| volume6(mesh.corners(t)) / 6.0).collect();
        let place = vec![OUT; mesh.tets.len()];
        Self { mesh, around, behind, volumes, changed: Vec::new(), place, held: RefCell::default() }
    }

    fn label(&self, t: u32) -> u8 {
        if t == OUT { OUTSIDE } else { self.mesh.labels[t as usize] }
    }

    fn relabel(&mut self, t: u32, label: u8) {
        self.mesh.labels[t as usize] = label;
        self.changed.push(t);
    }

    /// Points of the elements relabelled since the last look, some more than once.
    fn points_of_changed(&self) -> Vec<u32> {
        self.changed.iter().flat_map(|&t| self.mesh.tets[t as usize]).collect()
    }

    /// The connected pieces of the labels.
    fn label_pieces(&self) -> Pieces {
        let count = self.mesh.tets.len() as u32;
        let mut sets = DisjointSets::new(count as usize);
        for t in 0..count {
            let own = self.label(t);
            for b in self.behind[t as usize] {
                if b != OUT && b > t && own != OUTSIDE && self.label(b) == own {
                    sets.join(t, b);
                }
            }
        }
        let roots: Vec<u32> = (0..count).map(|t| sets.root(t)).collect();
        let mut volumes = vec![0.0; count as usize];
        for (t, &root) in roots.iter().enumerate().filter(|(t, _)| self.label(*t as u32) != OUTSIDE) {
            volumes[root as usize] += self.volumes[t];
        }
        Pieces { roots, volumes }
    }

    /// Points of faces between labels, or to the outside.
    fn points_of_faces(&self) -> Vec<u32> {
        let mut found = vec![false; self.mesh.points.len()];
        for (t, tet) in (0u32..).zip(&self.mesh.tets) {
            for i in (0..4).filter(|&i| self.label(self.behind[t as usize][i]) != self.label(t)) {
                FACES[i].iter().for_each(|&k| found[tet[k] as usize] = true);
            }
        }
        (0..found.len() as u32).filter(|&v| found[v as usize]).collect()
    }

    /// Joins pieces of a label, but the largest, to another of it through a few elements that `holds` some of the label: a
    /// thin part of which the cuts have left beads. Whether there were any.
    fn bridge(&mut self, pieces: &Pieces, labels: u8, holds: impl Fn([D3; 4], u8) -> bool) -> bool {
        let roots = &pieces.roots;
        let mut of_labels: Vec<Vec<u32>> = vec![Vec::new(); usize::from(labels)];
        for (t, _) in (0u32..).zip(roots).filter(|(t, root)| t == *root && self.label(*t) != OUTSIDE) {
            of_labels[usize::from(self.label(t))].push(t);
        }
        let mut any = false;
        for (l, mut of_label) in (0u8..).zip(of_labels) {
            // Those before may have taken some.
            of_label.retain(|&root| self.label(root) == l);
            let volume = |root: u32| pieces.volumes[root as usize];
            of_label.sort_by(|&a, &b| volume(b).total_cmp(&volume(a)).then(a.cmp(&b)));
            for &root in of_label.iter().skip(1) {
                let piece: Vec<u32> = (0..roots.len() as u32).filter(|&t| roots[t as usize] == root).collect();
                let way = self.way(&piece, roots, l, &holds);
                any |= !way.is_empty();
                way.into_iter().for_each(|t| self.relabel(t, l));
            }
        }
        any
    }

    /// The elements between a piece and another of its label, none where there is no short way.
    fn way(&self, piece: &[u32], roots: &[u32], l: u8, holds: impl Fn([D3; 4], u8) -> bool) -> Vec<u32> {
        let own = roots[piece[0] as usize];
        let mut before: BTreeMap<u32, u32> = piece.iter().map(|&t| (t, t)).collect();
        let mut edge = piece.to_vec();
        for _ in 0..=LONGEST_WAY {
            let mut next = Vec::new();
            for &t in &edge {
                for b in self.behind[t as usize].into_iter().filter(|&b| b != OUT) {
                    if before.contains_key(&b) {
                        continue;
                    }
                    if self.label(b) == l && roots[b as usize] != own {
                        let step = |&x: &u32| Some(before[&x]).filter(|&y| y != x);
                        return std::iter::successors(Some(t), step).filter(|&x| self.label(x) != l).collect();
                    }
                    if self.held(b, l, &holds) {
                        before.insert(b, t);
                        next.push(b);
                    }
                }
            }
            edge = next;
        }
        Vec::new()
    }

    /// Whether an element `holds` some of a label.
    fn held(&self, t: u32, l: u8, holds: impl Fn([D3; 4], u8) -> bool) -> bool {
        let key = u64::from(t) << 8 | u64::from(l);
        let mut known = self.held.borrow_mut();
        *known.entry(key).or_insert_with(|| holds(self.mesh.corners(self.mesh.tets[t as usize]), l))
    }

    /// Gives small separate pieces of a label to their neighbours, and lists them.
    fn crumbs(&mut self, pieces: &Pieces, labels: u8, crumb: f64, list: Option<&mut Vec<Crumb>>) {
        let count = self.mesh.tets.len() as u32;
        let Pieces { roots, volumes: size } = pieces;
        let mut whole = vec![0.0; usize::from(labels)];
        for t in (0..count).filter(|&t| self.label(t) != OUTSIDE) {
            whole[usize::from(self.label(t))] += self.volumes[t as usize];
        }
        let small = |t: u32| {
            let (s, label) = (size[roots[t as usize] as usize], self.label(t));
            label != OUTSIDE && s < crumb && s < 0.01 * whole[usize::from(label)]
        };
        if let Some(list) = list {
            let roots = (0..count).filter(|&t| roots[t as usize] == t && small(t));
            let place = |t: u32| self.mesh.points[self.mesh.tets[t as usize][0] as usize];
            list.extend(roots.map(|t| Crumb { label: self.label(t), volume: size[t as usize], place: place(t) }));
        }
        // From the rim inwards; the rounds do the rest. Inner labels are preferred to the outside.
        let rim =
            |t: u32| self.behind[t as usize].map(|b| self.label(b)).into_iter().filter(|&l| l != self.label(t)).min();
        let new: Vec<(u32, u8)> = (0..count).filter(|&t| small(t)).filter_map(|t| Some((t, rim(t)?))).collect();
        new.into_iter().for_each(|(t, l)| self.relabel(t, l));
    }

    /// Has what is in two pieces around each of the points relabelled, where labels or the outside meet there.
    fn pinches(&mut self, points: &[u32], unpinch: impl Fn(&mut Self, &[u32], &[Vec<u32>])) {
        let mut star = Vec::new();
        for &v in points {
            star.clear();
            star.extend(self.around.of(v as usize).iter().copied().filter(|&t| self.label(t) != OUTSIDE));
            let Some(&first) = star.first() else { continue };
            let outside = self.outside_pieces(v, &star);
            if !outside.is_empty() || star.iter().any(|&t| self.label(t) != self.label(first)) {
                (0u32..).zip(&star).for_each(|(a, &t)| self.place[t as usize] = a);
                unpinch(self, &star, &outside);
                star.iter().for_each(|&t| self.place[t as usize] = OUT);
            }
        }
    }

    /// The pieces of the outside around a point, each as the places in `star` of the elements that it touches: outer faces
    /// at the point belong together where they share an edge with no third one.
    fn outside_pieces(&self, v: u32, star: &[u32]) -> Vec<Vec<u32>> {
        let mut ends: Vec<(u32, u32)> = Vec::new();
        let mut owner: Vec<u32> = Vec::new();
        for (a, &t) in star.iter().enumerate() {
            let tet = self.mesh.tets[t as usize];
            for i in (0..4).filter(|&i| tet[i] != v && self.label(self.behind[t as usize][i]) == OUTSIDE) {
                let rim = (0..4).filter(|&k| k != i && tet[k] != v).map(|k| tet[k]);
                ends.extend(rim.map(|x| (x, owner.len() as u32)));
                owner.push(a as u32);
            }
        }
        ends.sort_unstable();
        let mut sets = DisjointSets::new(owner.len());
        for pair in ends.chunk_by(|a, b| a.0 == b.0).filter(|c| c.len() == 2) {
            sets.join(pair[0].1, pair[1].1);
        }
        let mut pieces: Vec<(u32, Vec<u32>)> = Vec::new();
        for (f, &a) in owner.iter().enumerate() {
            let root = sets.root(f as u32);
            match pieces.iter_mut().find(|p| p.0 == root) {
                Some(p) => p.1.push(a),
                None => pieces.push((root, vec![a])),
            }
        }
        pieces.into_iter().map(|p| p.1).collect()
    }

    /// Looks at one point, label by label, until something had to be relabelled.
    fn unpinch(&mut self, star: &[u32], outside: &[Vec<u32>], firmly: bool) {
        let mut labels: Vec<u8> = star.iter().map(|&t| self.label(t)).collect();
        labels.sort_unstable();
        let commonest = labels.chunk_by(|a, b| a == b).max_by_key(|c| c.len()).map_or(OUTSIDE, |c| c[0]);
        labels.dedup();
        for &l in &labels {
            let Some((elements, to)) = self.to_relabel(star, Some(l), outside) else { continue };
            if firmly && labels.len() > 1 {
                star.iter().for_each(|&t| self.relabel(t, commonest));
            } else {
                elements.into_iter().for_each(|a| self.relabel(star[a as usize], to));
            }
            return;
        }
        self.unpinch_all(star, outside);
    }

    /// Looks at one point for all labels together against the outside.
    fn unpinch_all(&mut self, star: &[u32], outside: &[Vec<u32>]) {
        if !outside.is_empty()
            && let Some((elements, to)) = self.to_relabel(star, None, outside)
        {
            elements.into_iter().for_each(|a| self.relabel(star[a as usize], to));
        }
    }

    /// Around a point, what to relabel where label `l` (`None`: all of them) or the rest is in several pieces (as places in
    /// `star`): the smallest piece of the label, else the smallest of the rest that has nothing of the outside, else what parts two pieces of the
    /// outside.
    fn to_relabel(&self, star: &[u32], l: Option<u8>, outside: &[Vec<u32>]) -> Option<(Vec<u32>, u8)> {
        let n = star.len();
        let inside = |a: u32| l.is_none_or(|l| self.label(star[a as usize]) == l);
        let mut sets = self.pieces(star, inside, outside);
        let open: Vec<u32> = (0..outside.len()).map(|k| sets.root((n + k) as u32)).collect();
        let mut pieces: Vec<(f64, u32, bool)> = Vec::new();
        for a in 0..(n + outside.len()) as u32 {
            let (root, own) = (sets.root(a), (a as usize) < n);
            let volume = if own { self.volumes[star[a as usize] as usize] } else { 0.0 };
            match pieces.iter_mut().find(|p| p.1 == root) {
                Some(p) => p.0 += volume,
                None => pieces.push((volume, root, own && inside(a))),
            }
        }
        let count = |side: bool| pieces.iter().filter(|p| p.2 == side).count();
        let side = count(true) > 1;
        if !side && count(false) < 2 {
            return None;
        }
        let fillable = pieces.iter().filter(|p| p.2 == side && !open.contains(&p.1));
        match fillable.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))) {
            Some(&(_, root, _)) => {
                let to = l.map_or(OUTSIDE, |l| if side { self.other_label(star, l) } else { l });
                Some(((0..n as u32).filter(|&a| sets.root(a) == root).collect(), to))
            }
            None => Some((self.between(star, &outside[0], |a| outside[1..].iter().any(|o| o.contains(&a)))?, OUTSIDE)),
        }
    }

    /// The pieces of a label and of the rest around a point. Those of the outside are further elements, after the last, that
    /// belong to the rest.
    fn pieces(&self, star: &[u32], inside: impl Fn(u32) -> bool, outside: &[Vec<u32>]) -> DisjointSets {
        let n = star.len();
        let mut sets = DisjointSets::new(n + outside.len());
        for (a, &t) in (0u32..).zip(star) {
            let places = self.behind[t as usize].into_iter().filter(|&u| u != OUT).map(|u| self.place[u as usize]);
            places.filter(|&b| b != OUT && b > a && inside(a) == inside(b)).for_each(|b| sets.join(a, b));
        }
        for (k, touched) in outside.iter().enumerate() {
            touched.iter().filter(|&&a| !inside(a)).for_each(|&a| sets.join(a, (n + k) as u32));
        }
        sets
    }

    /// The shortest way from one of the places `from` in a star to one of those that `ends`, face to face.
    fn between(&self, star: &[u32], from: &[u32], ends: impl Fn(u32) -> bool) -> Option<Vec<u32>> {
        let mut before = vec![OUT; star.len()];
        let mut queue: Vec<u32> = from.to_vec();
        queue.iter().for_each(|&a| before[a as usize] = a);
        let mut at = 0;
        while let Some(&a) = queue.get(at) {
            if ends(a) {
                let step = |&x: &u32| Some(before[x as usize]).filter(|&y| y != x);
                return Some(std::iter::successors(Some(a), step).collect());
            }
            for (b, &u) in star.iter().enumerate() {
                if before[b] == OUT && self.behind[star[a as usize] as usize].contains(&u) {
                    before[b] = a;
                    queue.push(b as u32);
                }
            }
            at += 1;
        }
        None
    }

    /// The label with most elements around a point besides `l`; the outside if there is none.
    fn other_label(&self, star: &[u32], l: u8) -> u8 {
        let mut others: Vec<u8> = star.iter().map(|&t| self.label(t)).filter(|&x| x != l).collect();
        others.sort_unstable();
        others.chunk_by(|a, b| a == b).max_by_key(|c| c.len()).map_or(OUTSIDE, |c| c[0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::{Point, TetMesh};

    /// A cone without its core, of six elements that all meet in its tip.
    fn hollow_cone() -> RawMesh {
        let ring = |radius: f64, turn: f64| {
            (0..3).map(move |i| {
                let a = (f64::from(i) + turn) * std::f64::consts::TAU / 3.0;
                [radius * a.cos(), radius * a.sin(), 1.0]
            })
        };
        let points: Vec<_> = [[0.0; 3]].into_iter().chain(ring(0.3, 0.0)).chain(ring(1.0, 0.5)).collect();
        let mut mesh = RawMesh { points, tets: Vec::new(), labels: vec![0; 6] };
        for i in 0..3u32 {
            let (a, b, c, d) = (1 + i, 1 + (i + 1) % 3, 4 + i, 4 + (i + 2) % 3);
            for mut t in [[0, a, b, c], [0, a, c, d]] {
                if volume6(mesh.corners(t)) < 0.0 {
                    t.swap(2, 3);
                }
                mesh.tets.push(t);
            }
        }
        mesh
    }

    fn topology(mesh: &RawMesh) -> monro_geometry::Topology {
        let vertices = mesh.points.iter().map(|&p| Point::from_array(p)).collect();
        let labels = mesh.labels.iter().map(|&l| u16::from(l)).collect();
        TetMesh { vertices, tets: mesh.tets.clone(), labels }.surface(|_| true).topology()
    }

    #[test]
    fn beads_of_a_thin_part_are_joined_through_what_holds_some_of_it() {
        // Four elements in a row, each sharing a face with the next; the first and the last carry label 1.
        let points = (0..7).map(|i| {
            let a = f64::from(i) * 2.0;
            [a.cos(), a.sin(), 0.4 * f64::from(i)]
        });
        let mut mesh = RawMesh { points: points.collect(), tets: Vec::new(), labels: vec![1, 0, 0, 1] };
        mesh.tets = (0..4u32).map(|i| [i, i + 1, i + 2, i + 3]).collect();
        let bridge = |mesh: &mut RawMesh, holds: fn([D3; 4], u8) -> bool| {
            let mut repair = Repair::new(mesh);
            let pieces = repair.label_pieces();
            repair.bridge(&pieces, 2, holds)
        };
        assert!(!bridge(&mut mesh, |_, _| false));
        assert_eq!(mesh.labels, [1, 0, 0, 1]);
        assert!(bridge(&mut mesh, |_, l| l == 1));
        assert_eq!(mesh.labels, [1, 1, 1, 1]);
    }

    #[test]
    fn an_outer_surface_that_meets_itself_in_a_point_is_opened() {
        let mut mesh = hollow_cone();
        assert!(!topology(&mesh).is_manifold());
        repair(&mut mesh, 1, 0.0, |_, _| false);
        let after = topology(&mesh);
        assert!(after.is_closed() && after.is_manifold() && after.euler() == 2, "{after:?}");
        assert_eq!(mesh.tets.len(), 4);
    }
}
