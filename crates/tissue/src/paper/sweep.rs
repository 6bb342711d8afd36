//! One Gauss-Seidel sweep through a part.

use super::lanes::{self, Corner};
use super::parts::{Batches, Part, Shares};
use super::solver::Motion;
use crate::fast::{Kernel, Lanes, Row, WIDTH, Window, sum_of_roots};
use crate::vec3::larger;

/// Which of a part's batches of elements a sweep goes through, and what it notes on the way.
#[derive(Debug)]
pub(super) enum Scope<'a> {
    /// All of them.
    Whole,
    /// All of them, noting how far they go.
    Measured(&'a mut Motion),
    /// These alone, without the constraints of surfaces.
    Only(&'a [u32]),
}

/// A sweep through the constraints of a part.
pub(super) struct Sweep<'a> {
    pub(super) part: &'a Part,
    pub(super) shares: &'a Shares,
    pub(super) vertices: &'a mut [[f32; 4]],
    pub(super) scope: Scope<'a>,
}

impl Kernel for Sweep<'_> {
    type Out = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let Self { part, shares, vertices, scope } = self;
        match scope {
            Scope::Whole => solids::<V>(part, shares, vertices, 0..part.solids.counts.len(), None),
            Scope::Measured(motion) => {
                motion.ways.clear();
                motion.ways.resize(part.solids.counts.len(), 0.0);
                let mut farthest = Farthest { ways: &mut motion.ways, squares: Default::default(), most: [0.0; WIDTH] };
                solids::<V>(part, shares, vertices, 0..part.solids.counts.len(), Some(&mut farthest));
                motion.most = farthest.most.into_iter().fold(0.0, larger);
            }
            Scope::Only(list) => {
                return solids::<V>(part, shares, vertices, list.iter().map(|&b| b as usize), None);
            }
        }
        each(&part.edges, &shares.edges, vertices, lanes::stretch_pair::<V>);
        each(&part.hinges, &shares.hinges, vertices, lanes::fold::<V>);
        each(&part.strips, &shares.strips, vertices, lanes::bend::<V>);
    }
}

/// Elements: their two edges, springs and volume while their vertices are at hand.
#[inline(always)]
fn solids<V: Lanes>(
    part: &Part,
    shares: &Shares,
    vertices: &mut [[f32; 4]],
    batches: impl Iterator<Item = usize>,
    mut motion: Option<&mut Farthest<'_>>,
) {
    let mut window = part.solids.places.over(vertices);
    let mut batches = batches.peekable();
    while let Some(b) = batches.next() {
        let next = (part.solids.joined[b]).then(|| batches.next_if_eq(&(b + 1))).flatten();
        for first in (0..WIDTH).step_by(V::N) {
            let at = Lot { part, shares, batch: b, first };
            // Two batches that share no vertex are worked on at once: one computes while the other waits.
            let also = next.map(|next| Lot { batch: next, ..at }).filter(Lot::is_there);
            if let Some(also) = also {
                let (p01, q01): ([Corner<V>; 2], [Corner<V>; 2]) = (at.edge(&window, 0), also.edge(&window, 0));
                let (p23, q23) = (at.edge(&window, 1), also.edge(&window, 1));
                at.rest(&mut window, p01, p23, motion.as_deref_mut());
                also.rest(&mut window, q01, q23, motion.as_deref_mut());
            } else if at.is_there() {
                let (p01, p23): ([Corner<V>; 2], [Corner<V>; 2]) = (at.edge(&window, 0), at.edge(&window, 1));
                at.rest(&mut window, p01, p23, motion.as_deref_mut());
            }
        }
    }
}

/// What is noted of how far elements' corners go, batch by batch.
struct Farthest<'a> {
    ways: &'a mut [f32],
    /// Of the batch at hand and the one beside it.
    squares: [Row; 2],
    most: Row,
}

impl Farthest<'_> {
    /// All lanes of a batch have been noted, of which `count` are elements; empty ones repeat one of these, or are left from a batch
    /// before and count already.
    #[inline(always)]
    fn end(&mut self, batch: usize, count: usize) {
        let squares = &self.squares[batch % 2];
        self.ways[batch] = sum_of_roots(squares, count);
        self.most = core::array::from_fn(|l| larger(self.most[l], squares[l]));
    }
}

/// The elements of a batch from lane `first` on.
#[derive(Clone, Copy)]
struct Lot<'a> {
    part: &'a Part,
    shares: &'a Shares,
    batch: usize,
    first: usize,
}

impl Lot<'_> {
    /// Whether any of its lanes is an element.
    #[inline(always)]
    fn is_there(&self) -> bool {
        self.first < usize::from(self.part.solids.counts[self.batch])
    }

    #[inline(always)]
    fn corners<V: Lanes>(&self, window: &Window<'_, 4>) -> [Corner<V>; 4] {
        let (b, first) = (self.batch, self.first);
        [window.gather(b, 0, first), window.gather(b, 1, first), window.gather(b, 2, first), window.gather(b, 3, first)]
    }

    /// The corners of its first or second edge, moved by it.
    #[inline(always)]
    fn edge<V: Lanes>(&self, window: &Window<'_, 4>, i: usize) -> [Corner<V>; 2] {
        let (b, first) = (self.batch, self.first);
        let mut pair = [window.gather(b, 2 * i, first), window.gather(b, 2 * i + 1, first)];
        let (rest, k) = (&self.part.solids.rest[b][i], &self.shares.solids[b][i]);
        lanes::stretch_pair(&mut pair, load(first, rest), load(first, k));
        pair
    }

    /// What comes after the edges.
    #[inline(always)]
    fn rest<V: Lanes>(
        &self,
        window: &mut Window<'_, 4>,
        [p0, p1]: [Corner<V>; 2],
        [p2, p3]: [Corner<V>; 2],
        motion: Option<&mut Farthest<'_>>,
    ) {
        let mut p = [p0, p1, p2, p3];
        self.springs(&mut p);
        self.volumes(&mut p);
        self.finish(window, &p, motion);
    }

    #[inline(always)]
    fn springs<V: Lanes>(&self, p: &mut [Corner<V>; 4]) {
        let first = self.first;
        if let (Some(rest), Some(k)) = (self.part.springs.rest.get(self.batch), self.shares.springs.get(self.batch)) {
            let rest = [load(first, &rest[0]), load(first, &rest[1]), load(first, &rest[2]), load(first, &rest[3])];
            lanes::pull(p, rest, load(first, &k[0]));
        }
    }

    #[inline(always)]
    fn volumes<V: Lanes>(&self, p: &mut [Corner<V>; 4]) {
        let (rest, k) = (&self.part.solids.rest[self.batch], &self.shares.solids[self.batch]);
        lanes::inflate(p, load(self.first, &rest[2]), load(self.first, &k[2]));
    }

    /// Writes the corners back; notes how far the farthest has gone, if asked.
    #[inline(always)]
    fn finish<V: Lanes>(&self, window: &mut Window<'_, 4>, p: &[Corner<V>; 4], motion: Option<&mut Farthest<'_>>) {
        let (b, first) = (self.batch, self.first);
        if let Some(motion) = motion {
            farthest(&self.corners(window), p).store(&mut motion.squares[b % 2], first);
            let count = usize::from(self.part.solids.counts[b]);
            if first + V::N >= count {
                motion.end(b, count);
            }
        }
        window.put(b, 0, first, p[0]);
        window.put(b, 1, first, p[1]);
        window.put(b, 2, first, p[2]);
        window.put(b, 3, first, p[3]);
    }
}

#[inline(always)]
fn load<V: Lanes>(first: usize, row: &Row) -> V {
    V::load(row, first)
}

#[inline(always)]
fn gather<V: Lanes, const N: usize>(window: &Window<'_, N>, batch: usize, first: usize) -> [Corner<V>; N] {
    let mut p = [[V::splat(0.0); 4]; N];
    for (c, corner) in p.iter_mut().enumerate() {
        *corner = window.gather(batch, c, first);
    }
    p
}

/// Square of the largest motion of a corner.
#[inline(always)]
fn farthest<V: Lanes>(before: &[Corner<V>; 4], after: &[Corner<V>; 4]) -> V {
    let mut most = V::splat(0.0);
    for (p, q) in before.iter().zip(after) {
        let d = [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
        most = most.max(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    }
    most
}

#[inline(always)]
fn each<V: Lanes, const N: usize>(
    batches: &Batches<N, 1, 1>,
    shares: &[[Row; 1]],
    vertices: &mut [[f32; 4]],
    satisfy: impl Fn(&mut [Corner<V>; N], V, V),
) {
    let mut window = batches.places.over(vertices);
    for (b, (rest, k)) in batches.rest.iter().zip(shares).enumerate() {
        let count = usize::from(batches.counts[b]);
        for first in (0..WIDTH).step_by(V::N).take_while(|&f| f < count) {
            let mut p: [Corner<V>; N] = gather(&window, b, first);
            satisfy(&mut p, V::load(&rest[0], first), V::load(&k[0], first));
            for (c, v) in p.into_iter().enumerate() {
                window.put(b, c, first, v);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::constraints::{dihedral, hetero, stretch, triangle, volume};
    use super::super::parts::{Constraint, Share, Solid};
    use super::super::project;
    use super::*;
    use crate::fast::{plain, widest};
    use crate::model::tests::block;
    use crate::vec3::{add, norm, scale, sub, xyz};

    type Vertices = Vec<[f32; 4]>;

    fn shaken() -> (monro_geometry::TetMesh, Vertices, Vertices) {
        let mesh = block([4, 3, 3], 3.0);
        let mass = |i: usize| if i.is_multiple_of(7) { 0.0 } else { 1.0 + i as f32 * 0.1 };
        let rest: Vertices =
            mesh.vertices.iter().enumerate().map(|(i, v)| [v.x as f32, v.y as f32, v.z as f32, mass(i)]).collect();
        let noise = |i: usize, a: usize| ((i * 7919 + a * 104_729) % 1000) as f32 / 1000.0 - 0.5;
        let moved = |(i, p): (usize, &[f32; 4])| [p[0] + noise(i, 0), p[1] + noise(i, 1), p[2] + noise(i, 2), p[3]];
        let now = rest.iter().enumerate().map(moved).collect();
        (mesh, rest, now)
    }

    /// Runs a part with the widest vectors and in plain arithmetic, which must agree to the bit.
    fn swept(share: &Share, rest: &[[f32; 4]], now: &Vertices) -> (Part, Vertices) {
        let part = Part::new(share, rest, 0);
        let shares = part.corrected(1);
        let (mut fast, mut truth) = (now.clone(), now.clone());
        widest(Sweep { part: &part, shares: &shares, vertices: &mut fast, scope: Scope::Whole });
        let (mut motion, mut wide) = (Motion::default(), Motion::default());
        plain(Sweep { part: &part, shares: &shares, vertices: &mut truth, scope: Scope::Measured(&mut motion) });
        let bits = |v: &Vertices| v.iter().flatten().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&fast), bits(&truth));
        let apart = |(p, q): (&[f32; 4], &[f32; 4])| norm(sub(xyz(*p), xyz(*q)));
        widest(Sweep { part: &part, shares: &shares, vertices: &mut now.clone(), scope: Scope::Measured(&mut wide) });
        assert_eq!((&motion.ways, motion.most.to_bits()), (&wide.ways, wide.most.to_bits()));
        let most = motion.most.sqrt();
        let moved = now.iter().zip(&truth).map(apart).fold(0.0, f32::max);
        assert!(part.solids.counts.is_empty() || (most > 0.1 * moved && most < 10.0 * moved), "{most} {moved}");
        (part, fast)
    }

    fn close(a: &[[f32; 4]], b: &[[f32; 4]]) {
        for (p, q) in a.iter().zip(b) {
            assert!((0..3).all(|k| (p[k] - q[k]).abs() < 2e-4), "{p:?} {q:?}");
        }
    }

    #[test]
    fn sixteen_elements_at_once_do_what_the_plain_constraints_do() {
        let (mesh, rest, now) = shaken();
        let at = |p: &[[f32; 4]], t: [u32; 4]| t.map(|v| xyz(p[v as usize]));
        let edge = |p: &[[f32; 4]], a: u32, b: u32| [xyz(p[a as usize]), xyz(p[b as usize])];
        for spring in [0.0, 0.2] {
            let solid = |t: &[u32; 4]| Solid { nodes: *t, edges: [0.3, 0.0], volume: 0.6, spring };
            let share = Share { solids: mesh.tets.iter().map(solid).collect(), ..Share::default() };
            let (part, fast) = swept(&share, &rest, &now);
            let mut plain = now.clone();
            let nodes: Vec<[u16; 4]> = mesh.tets.iter().map(|t| t.map(|v| v as u16)).collect();
            for &t in super::super::batches::groups(&nodes, rest.len()).iter().flatten() {
                let t = mesh.tets[t as usize];
                let length = stretch(edge(&rest, t[0], t[1]), 0.0).expect("apart").0;
                let (value, g) = stretch(edge(&plain, t[0], t[1]), length).expect("apart");
                project(&mut plain, [t[0], t[1]], value, g, 0.3);
                let p = at(&rest, t);
                let q = scale(add(add(p[0], p[1]), add(p[2], p[3])), 0.25);
                let (value, g) = hetero(at(&plain, t), p.map(|v| norm(sub(v, q))), [1.0; 4]);
                project(&mut plain, t, value, g, spring);
                let (value, g) = volume(at(&plain, t), volume(p, 0.0).0);
                project(&mut plain, t, value, g, 0.6);
            }
            assert_eq!(part.springs.rest.is_empty(), spring == 0.0);
            close(&fast, &plain);
        }
    }

    #[test]
    fn sixteen_edges_hinges_and_strips_at_once_do_what_the_plain_constraints_do() {
        let (mesh, rest, now) = shaken();
        let (mut edges, mut hinges, mut strips) = (Vec::new(), Vec::new(), Vec::new());
        for t in &mesh.tets {
            edges.push(Constraint { nodes: [t[0], t[2]], coefficient: 0.4 });
            hinges.push(Constraint { nodes: *t, coefficient: 0.3 });
            strips.push(Constraint { nodes: [t[0], t[1], t[3]], coefficient: 0.5 });
        }
        fn at<const N: usize>(p: &[[f32; 4]], n: [u32; N]) -> [crate::vec3::V3; N] {
            n.map(|v| xyz(p[v as usize]))
        }
        fn order<const N: usize>(all: &[Constraint<N>], vertices: usize) -> Vec<[u32; N]> {
            let nodes: Vec<[u16; N]> = all.iter().map(|c| c.nodes.map(|v| v as u16)).collect();
            super::super::batches::groups(&nodes, vertices)
                .concat()
                .into_iter()
                .map(|i| all[i as usize].nodes)
                .collect()
        }
        let (_, fast) = swept(&Share { edges: edges.clone(), ..Share::default() }, &rest, &now);
        let mut plain = now.clone();
        for n in order(&edges, rest.len()) {
            let length = stretch(at(&rest, n), 0.0).expect("apart").0;
            let (value, g) = stretch(at(&plain, n), length).expect("apart");
            project(&mut plain, n, value, g, 0.4);
        }
        close(&fast, &plain);
        let (_, fast) = swept(&Share { hinges: hinges.clone(), ..Share::default() }, &rest, &now);
        let mut plain = now.clone();
        for n in order(&hinges, rest.len()) {
            let angle = dihedral(at(&rest, n), 0.0).expect("areas").0;
            let (value, g) = dihedral(at(&plain, n), angle).expect("areas");
            project(&mut plain, n, value, g, 0.3);
        }
        close(&fast, &plain);
        let (_, fast) = swept(&Share { strips: strips.clone(), ..Share::default() }, &rest, &now);
        let mut plain = now;
        for n in order(&strips, rest.len()) {
            let height = triangle(at(&rest, n), 0.0).expect("apart").0;
            let (value, g) = triangle(at(&plain, n), height).expect("apart");
            project(&mut plain, n, value, g, 0.5);
        }
        close(&fast, &plain);
    }

    #[test]
    fn corners_that_coincide_and_flat_faces_are_skipped_not_divided_by() {
        let rest: Vertices =
            block([1, 1, 1], 1.0).vertices.iter().map(|v| [v.x as f32, v.y as f32, v.z as f32, 1.0]).collect();
        let nodes = [0, 1, 3, 7];
        let share = Share {
            solids: vec![Solid { nodes, edges: [0.5; 2], volume: 1.0, spring: 0.5 }],
            edges: vec![Constraint { nodes: [0, 1], coefficient: 1.0 }],
            hinges: vec![Constraint { nodes, coefficient: 1.0 }],
            strips: vec![Constraint { nodes: [0, 1, 3], coefficient: 1.0 }],
        };
        let part = Part::new(&share, &rest, 0);
        for now in [vec![[0.0, 0.0, 0.0, 1.0]; 8], vec![[1.0, 2.0, 3.0, 0.0]; 8]] {
            let mut after = now.clone();
            widest(Sweep { part: &part, shares: &part.corrected(1), vertices: &mut after, scope: Scope::Whole });
            assert_eq!(now, after);
        }
    }
}
