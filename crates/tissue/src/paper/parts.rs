//! The constraints of a part of a mesh: what begins in one slab, in the order in which a sweep goes through it.

use super::batches::{Members, batches};
use super::lanes;
use super::matching::{NONE, TURNS};
use super::per_iteration;
use crate::bytes;
use crate::fast::{Kernel, Lanes, Places, Row, WIDTH, plain};

/// A constraint on `N` vertices of a model with its coefficient.
#[derive(Debug, Clone, Copy)]
pub(super) struct Constraint<const N: usize> {
    pub(super) nodes: [u32; N],
    pub(super) coefficient: f32,
}

/// An element with up to two of its edges, its corners turned so that these are the first two and the last two.
#[derive(Debug, Clone, Copy)]
pub(super) struct Solid {
    pub(super) nodes: [u32; 4],
    pub(super) edges: [f32; 2],
    pub(super) volume: f32,
    pub(super) spring: f32,
}

/// Batches of one kind of constraint: `N` vertices, `R` values at rest, `C` coefficients.
#[derive(Debug, Clone, Default)]
pub(super) struct Batches<const N: usize, const R: usize, const C: usize> {
    pub(super) places: Places<N>,
    pub(super) counts: Vec<u8>,
    /// Which batches share no vertex with the next.
    pub(super) joined: Vec<bool>,
    pub(super) rest: Vec<[Row; R]>,
    pub(super) coefficients: Vec<[Row; C]>,
}

impl<const N: usize, const R: usize, const C: usize> Batches<N, R, C> {
    fn bytes(&self) -> usize {
        let rows = bytes::of(&self.rest) + bytes::of(&self.coefficients);
        self.places.bytes() + bytes::of(&self.counts) + bytes::of(&self.joined) + rows
    }
}

impl Part {
    /// Bytes that it takes.
    pub(super) fn bytes(&self) -> usize {
        let springs = bytes::of(&self.springs.rest) + bytes::of(&self.springs.coefficients);
        self.solids.bytes() + springs + self.edges.bytes() + self.hinges.bytes() + self.strips.bytes()
    }
}

impl Part {
    /// How long a sweep through it takes, about, in units of a batch of edges.
    pub(super) fn work(&self) -> usize {
        let batches = 4 * self.solids.counts.len() + 2 * self.springs.rest.len() + self.edges.counts.len();
        batches + 3 * self.hinges.counts.len() + 2 * self.strips.counts.len()
    }
}

impl Shares {
    /// Bytes that they take.
    pub(super) fn bytes(&self) -> usize {
        let elements = bytes::of(&self.solids) + bytes::of(&self.springs) + bytes::of(&self.edges);
        elements + bytes::of(&self.hinges) + bytes::of(&self.strips)
    }
}

/// Two edges and the volume of an element.
pub(super) const SOLID: usize = 3;

/// Springs of elements to their centroids, batches as of the elements themselves; none where no element has any.
#[derive(Debug, Clone, Default)]
pub(super) struct Springs {
    pub(super) rest: Vec<[Row; 4]>,
    pub(super) coefficients: Vec<[Row; 1]>,
}

/// All constraints that begin in one slab.
#[derive(Debug, Clone, Default)]
pub(super) struct Part {
    pub(super) solids: Batches<4, SOLID, SOLID>,
    pub(super) springs: Springs,
    pub(super) edges: Batches<2, 1, 1>,
    pub(super) hinges: Batches<4, 1, 1>,
    pub(super) strips: Batches<3, 1, 1>,
}

/// The shares of a part corrected for a number of iterations.
#[derive(Debug, Clone, Default)]
pub(super) struct Shares {
    pub(super) solids: Vec<[Row; SOLID]>,
    pub(super) springs: Vec<[Row; 1]>,
    pub(super) edges: Vec<[Row; 1]>,
    pub(super) hinges: Vec<[Row; 1]>,
    pub(super) strips: Vec<[Row; 1]>,
}

/// What a part is made from.
#[derive(Debug, Clone, Default)]
pub(super) struct Share {
    pub(super) solids: Vec<Solid>,
    pub(super) edges: Vec<Constraint<2>>,
    pub(super) hinges: Vec<Constraint<4>>,
    pub(super) strips: Vec<Constraint<3>>,
}

impl Solid {
    /// From an element, its turn and its edges; `stretch` gives the coefficient of an edge.
    pub(super) fn new(
        tet: [u32; 4],
        (turn, edges): (u8, [u32; 2]),
        stretch: impl Fn(u32) -> f32,
        volume: f32,
        spring: f32,
    ) -> Self {
        let of = |e: u32| if e == NONE { 0.0 } else { stretch(e) };
        Self { nodes: TURNS[turn as usize].map(|i| tet[i]), edges: edges.map(of), volume, spring }
    }
}

impl Part {
    /// `rest` are the vertices of the part, the first of which has the number `first`.
    pub(super) fn new(share: &Share, rest: &[[f32; 4]], first: usize) -> Self {
        let local = |v: u32| (v as usize - first) as u16;
        let nodes: Vec<[u16; 4]> = share.solids.iter().map(|s| s.nodes.map(local)).collect();
        let (members, places) = batches(&nodes, rest.len());
        let of = |i: u32| &share.solids[i as usize];
        let shares = |m: &Members| [m.row(|i| of(i).edges[0]), m.row(|i| of(i).edges[1]), m.row(|i| of(i).volume)];
        let coefficients = members.iter().map(shares).collect();
        let springs = if share.solids.iter().any(|s| s.spring > 0.0) {
            let coefficients = members.iter().map(|m| [m.row(|i| of(i).spring)]).collect();
            Springs { rest: plain(Rest::<4, 4> { places: &places, vertices: rest }), coefficients }
        } else {
            Springs::default()
        };
        Self {
            solids: Batches::new(&members, places, coefficients, rest),
            springs,
            edges: Batches::of(&share.edges, local, rest),
            hinges: Batches::of(&share.hinges, local, rest),
            strips: Batches::of(&share.strips, local, rest),
        }
    }

    /// Shares for each of `iterations`, equation (4).
    pub(super) fn corrected(&self, iterations: u32) -> Shares {
        fn all<const C: usize>(of: &[[Row; C]], iterations: u32) -> Vec<[Row; C]> {
            of.iter().map(|c| c.map(|row| row.map(|k| per_iteration(k.into(), iterations)))).collect()
        }
        Shares {
            solids: all(&self.solids.coefficients, iterations),
            springs: all(&self.springs.coefficients, iterations),
            edges: all(&self.edges.coefficients, iterations),
            hinges: all(&self.hinges.coefficients, iterations),
            strips: all(&self.strips.coefficients, iterations),
        }
    }
}

impl<const N: usize> Batches<N, 1, 1>
where
    for<'a> Rest<'a, N, 1>: Kernel<Out = Vec<[Row; 1]>>,
{
    fn of(constraints: &[Constraint<N>], local: impl Fn(u32) -> u16, rest: &[[f32; 4]]) -> Self {
        let nodes: Vec<[u16; N]> = constraints.iter().map(|c| c.nodes.map(&local)).collect();
        let (members, places) = batches(&nodes, rest.len());
        let shares = members.iter().map(|m| [m.row(|i| constraints[i as usize].coefficient)]).collect();
        Self::new(&members, places, shares, rest)
    }
}

impl<const N: usize, const R: usize, const C: usize> Batches<N, R, C>
where
    for<'a> Rest<'a, N, R>: Kernel<Out = Vec<[Row; R]>>,
{
    fn new(members: &[Members], places: Places<N>, coefficients: Vec<[Row; C]>, rest: &[[f32; 4]]) -> Self {
        let at_rest = plain(Rest::<N, R> { places: &places, vertices: rest });
        let counts = members.iter().map(|m| m.count as u8).collect();
        let joined = members.iter().map(|m| m.joined).collect();
        Self { places, counts, joined, rest: at_rest, coefficients }
    }
}

/// Values at rest by the arithmetic of the sweep: at rest the constraints are then exactly zero.
pub(super) struct Rest<'a, const N: usize, const R: usize> {
    places: &'a Places<N>,
    vertices: &'a [[f32; 4]],
}

impl<const N: usize, const R: usize> Rest<'_, N, R> {
    #[inline(always)]
    fn each<V: Lanes>(self, values: impl Fn(&[lanes::Corner<V>; N]) -> [V; R]) -> Vec<[Row; R]> {
        let count = self.places.len();
        let window = self.places.view(self.vertices);
        let mut out = vec![[[0.0; WIDTH]; R]; count];
        for (b, rows) in out.iter_mut().enumerate() {
            for first in (0..WIDTH).step_by(V::N) {
                let p = core::array::from_fn(|c| window.gather::<V>(b, c, first));
                values(&p).into_iter().zip(rows.iter_mut()).for_each(|(v, row)| v.store(row, first));
            }
        }
        out
    }
}

impl Kernel for Rest<'_, 4, SOLID> {
    type Out = Vec<[Row; SOLID]>;
    fn run<V: Lanes>(self) -> Self::Out {
        self.each::<V>(|p| [lanes::length(&p[0], &p[1]), lanes::length(&p[2], &p[3]), lanes::six_volumes(p)])
    }
}

impl Kernel for Rest<'_, 4, 4> {
    type Out = Vec<[Row; 4]>;
    fn run<V: Lanes>(self) -> Self::Out {
        self.each::<V>(lanes::centroid_distances)
    }
}

impl Kernel for Rest<'_, 2, 1> {
    type Out = Vec<[Row; 1]>;
    fn run<V: Lanes>(self) -> Self::Out {
        self.each::<V>(|p| [lanes::length(&p[0], &p[1])])
    }
}

impl Kernel for Rest<'_, 4, 1> {
    type Out = Vec<[Row; 1]>;
    fn run<V: Lanes>(self) -> Self::Out {
        self.each::<V>(|p| [lanes::angle(p).0])
    }
}

impl Kernel for Rest<'_, 3, 1> {
    type Out = Vec<[Row; 1]>;
    fn run<V: Lanes>(self) -> Self::Out {
        self.each::<V>(|p| [lanes::height(p).0])
    }
}
