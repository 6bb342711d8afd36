//! All constraints of a mesh, and one Gauss-Seidel iteration over them.

use super::global_volume::GlobalVolume;
use super::matching::{self, Matching};
use super::parts::{Constraint, Part, Share, Shares, Solid};
use super::sweep::{Scope, Sweep};
use super::{per_iteration, surface};
use crate::bytes;
use crate::fast::{Plans, Pool, widest};
use crate::membrane::{Membranes, OUTSIDE};
use crate::model::Region;
use crate::options::{DihedralScope, PaperOptions};
use crate::slabs::{Round, Slabs, ends};
use crate::space::Space;
use crate::vec3::{V3, larger};

/// The constraints of a mesh: constant.
#[derive(Debug, Clone)]
pub(crate) struct PaperModel {
    /// Two rounds of parts that can be done at the same time.
    rounds: [(Round, Vec<Part>); 2],
    plans: Plans,
    global: Option<GlobalVolume>,
    global_coefficient: f64,
    counts: Vec<(&'static str, usize)>,
    /// Share of the deforming motion lost per second.
    pub(crate) damping: f64,
}

/// Coefficients corrected for a number of iterations, and memory for a sweep.
#[derive(Debug, Clone, Default)]
pub(crate) struct PaperScratch {
    iterations: u32,
    pub(super) parts: [Vec<PartScratch>; 2],
    global: f32,
    gradients: Vec<V3>,
}

/// What a sweep through a part needs and leaves behind.
#[derive(Debug, Clone, Default)]
pub(super) struct PartScratch {
    shares: Shares,
    /// What was noted in the last measured sweep.
    pub(super) motion: Motion,
    /// Batches in the predicted deformation space.
    pub(super) space: Space,
}

/// How far the corners of elements went in a sweep, each element's farthest.
#[derive(Debug, Clone, Default)]
pub(super) struct Motion {
    /// Of each batch the sum over its elements, mm.
    pub(super) ways: Vec<f32>,
    /// Square of the farthest, mm2.
    pub(super) most: f32,
}

impl PaperModel {
    /// Bytes that the constraints take.
    pub(crate) fn bytes(&self) -> usize {
        let global = self.global.as_ref().map_or(0, GlobalVolume::bytes);
        self.rounds.iter().flat_map(|r| &r.1).map(Part::bytes).sum::<usize>() + global
    }
}

impl PaperScratch {
    /// Bytes that it takes.
    pub(crate) fn bytes(&self) -> usize {
        let part = |p: &PartScratch| p.shares.bytes() + bytes::of(&p.motion.ways) + p.space.bytes();
        self.parts.iter().flatten().map(part).sum::<usize>() + bytes::of(&self.gradients)
    }
}

/// What a mesh is, as far as its constraints are concerned.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shape<'a> {
    pub(crate) rest: &'a [[f32; 4]],
    pub(crate) tets: &'a [[u32; 4]],
    pub(crate) region: &'a [u8],
    pub(crate) regions: &'a [Region],
    pub(crate) membranes: &'a Membranes,
    pub(crate) slabs: &'a Slabs,
}

/// Which constraints a sweep goes through.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Extent {
    /// All.
    Whole,
    /// All, and the motion is measured.
    Measured,
    /// Those in the predicted deformation space.
    Predicted,
}

impl PaperModel {
    pub(crate) fn new(shape: &Shape<'_>, options: &PaperOptions) -> Self {
        let (shares, counts) = shares(shape, options);
        let rounds = shape.slabs.rounds();
        let parts = |round: &Round, first: usize| {
            let own = shares.iter().skip(first).step_by(2);
            let part = |(i, share): (usize, &Share)| {
                Part::new(share, &shape.rest[round.cuts[i]..round.cuts[i + 1]], round.cuts[i])
            };
            // A last slab without a partner in an odd round begins where the round ends.
            own.take(round.parts()).enumerate().map(part).collect::<Vec<Part>>()
        };
        let [even, odd] = rounds;
        let (even_parts, odd_parts) = (parts(&even, 0), parts(&odd, 1));
        let work = [&even_parts, &odd_parts].map(|parts| parts.iter().map(Part::work).collect::<Vec<_>>());
        let outer = shape.membranes.faces.iter().filter(|m| m.outer == OUTSIDE).map(|m| m.nodes).collect();
        Self {
            rounds: [(even, even_parts), (odd, odd_parts)],
            plans: Plans::new([&work[0], &work[1]]),
            global: (options.global_volume > 0.0).then(|| GlobalVolume::new(outer, shape.rest)),
            global_coefficient: options.global_volume,
            counts,
            damping: options.damping,
        }
    }

    /// Constraints of each kind.
    pub(crate) fn counts(&self) -> Vec<(&'static str, usize)> {
        self.counts.clone()
    }

    /// Prepares the coefficients for `iterations` per substep, equation (4).
    pub(crate) fn correct(&self, scratch: &mut PaperScratch, iterations: u32) {
        if scratch.iterations == iterations {
            return;
        }
        for (scratch, (_, parts)) in scratch.parts.iter_mut().zip(&self.rounds) {
            let part = |p: &Part| PartScratch { shares: p.corrected(iterations), ..PartScratch::default() };
            *scratch = parts.iter().map(part).collect();
        }
        scratch.global = per_iteration(self.global_coefficient, iterations);
        scratch.iterations = iterations;
    }

    /// Whether something is done for the body as a whole after each iteration.
    pub(crate) const fn ends_iterations(&self) -> bool {
        self.global.is_some()
    }

    /// So many iterations over the constraints in Gauss-Seidel order, each over its extent. Those after the first of several
    /// begin where the one before is done: only where nothing else is done in between (see [`Self::ends_iterations`]).
    pub(crate) fn iterate(
        &self,
        positions: &mut [[f32; 4]],
        scratch: &mut PaperScratch,
        (count, extent): (usize, &(dyn Fn(usize) -> Extent + Sync)),
        pool: &Pool,
    ) {
        let [even, odd] = &mut scratch.parts;
        let rounds = [&self.rounds[0].0, &self.rounds[1].0];
        let how = (&self.plans, rounds.map(|r| &r.cuts[..]));
        pool.sweeps(how, count, positions, [even, odd], &|turn, vertices, memory| {
            let PartScratch { shares, motion, space } = memory;
            let scope = match extent(turn.sweep) {
                Extent::Whole => Scope::Whole,
                Extent::Measured => Scope::Measured(motion),
                Extent::Predicted if space.batches().is_empty() => return,
                Extent::Predicted => Scope::Only(space.batches()),
            };
            widest(Sweep { part: &self.rounds[turn.round].1[turn.part], shares, vertices, scope });
        });
        if let Some(global) = self.global.as_ref().filter(|_| count > 0 && extent(count - 1) != Extent::Predicted) {
            global.project(positions, scratch.global, &mut scratch.gradients);
        }
    }
}

impl PaperScratch {
    /// Largest motion of a vertex of an element in the last measured iteration, mm.
    pub(crate) fn residual(&self) -> f32 {
        self.parts.iter().flatten().map(|p| p.motion.most).fold(0f32, larger).sqrt()
    }
}

/// The constraints that begin in each slab, and how many there are of each kind.
fn shares(shape: &Shape<'_>, options: &PaperOptions) -> (Vec<Share>, Vec<(&'static str, usize)>) {
    let of = |r: u8| shape.regions[r as usize].material.paper;
    let mut out = vec![Share::default(); shape.slabs.len()];
    // What holds only nodes that never move can change nothing, and is left out.
    let moves = |nodes: &[u32]| nodes.iter().any(|&v| shape.rest[v as usize][3] > 0.0);
    let matching = matching::of_tets(shape.tets, |v| moves(&[v]));
    let stretch = stretches(&matching, shape);
    let moving = shape.tets.iter().enumerate().filter(|(_, tet)| moves(*tet));
    let solid = |(t, tet): (usize, &[u32; 4])| {
        let k = of(shape.region[t]);
        Solid::new(*tet, matching.of_tet[t], |e| stretch[e as usize], k.volume as f32, k.hetero as f32)
    };
    share_out(shape.slabs, moving.map(solid).collect(), |s| s.nodes, |share, s| out[share].solids.push(s));
    let loose = matching.loose.iter().map(|&e| (matching.edges[e as usize], stretch[e as usize]));
    share_out(shape.slabs, constraints(loose), |c| c.nodes, |share, c| out[share].edges.push(c));
    let hinges = hinges(shape, options.dihedral).into_iter().filter(|h| moves(&h.0));
    let hinges = constraints(hinges.map(|(nodes, r)| (nodes, of(r).dihedral as f32)));
    share_out(shape.slabs, hinges, |c| c.nodes, |share, c| out[share].hinges.push(c));
    let strips = surface::strips(shape.membranes, shape.rest).into_iter();
    let strips = strips.map(|(nodes, r)| (nodes, of(r).triangle as f32)).filter(|s| s.1 > 0.0 && moves(&s.0));
    share_out(shape.slabs, constraints(strips), |c| c.nodes, |share, c| out[share].strips.push(c));
    let acting = |k: &dyn Fn(u8) -> f64| {
        shape.tets.iter().zip(shape.region).filter(|(tet, r)| k(**r) > 0.0 && moves(*tet)).count()
    };
    let edges = matching.edges.iter().zip(&stretch).filter(|(e, k)| **k > 0.0 && moves(*e)).count();
    let counts = vec![
        ("edges", edges),
        ("volumes", acting(&|r| of(r).volume)),
        ("springs", acting(&|r| of(r).hetero)),
        ("dihedral_angles", out.iter().map(|s| s.hinges.len()).sum()),
        ("triangles", out.iter().map(|s| s.strips.len()).sum()),
        ("global_volume", usize::from(options.global_volume > 0.0)),
    ];
    (out, counts)
}

fn constraints<const N: usize>(all: impl Iterator<Item = ([u32; N], f32)>) -> Vec<Constraint<N>> {
    all.map(|(nodes, coefficient)| Constraint { nodes, coefficient }).collect()
}

/// Puts each of `all`, which take as long as one another, to the share of a slab that its nodes belong to.
fn share_out<T, const N: usize>(
    slabs: &Slabs,
    all: Vec<T>,
    nodes: impl Fn(&T) -> [u32; N],
    mut put: impl FnMut(usize, T),
) {
    let item = |one: &T| {
        let (low, high) = ends(nodes(one));
        (low, high, 1)
    };
    let shares = slabs.shares(&all.iter().map(item).collect::<Vec<_>>());
    all.into_iter().zip(shares).for_each(|(one, share)| put(share, one));
}

/// Coefficient of each edge: the mean of the elements around.
fn stretches(matching: &Matching, shape: &Shape<'_>) -> Vec<f32> {
    let mut sums = vec![(0f64, 0u32); matching.edges.len()];
    for (edges, &r) in matching.edges_of.iter().zip(shape.region) {
        let k = shape.regions[r as usize].material.paper.stretch;
        for &e in edges {
            let sum = &mut sums[e as usize];
            *sum = (sum.0 + k, sum.1 + 1);
        }
    }
    sums.into_iter().map(|(sum, count)| (sum / f64::from(count)) as f32).collect()
}

fn hinges(shape: &Shape<'_>, scope: DihedralScope) -> Vec<([u32; 4], u8)> {
    // The four corners of a tetrahedron, each of its edges first.
    const EDGES: [[usize; 4]; 6] = [[0, 1, 2, 3], [0, 2, 3, 1], [0, 3, 1, 2], [1, 2, 0, 3], [1, 3, 2, 0], [2, 3, 0, 1]];
    let mut all = surface::hinges(shape.membranes);
    if scope == DihedralScope::Elements {
        all.extend(shape.tets.iter().zip(shape.region).flat_map(|(t, &r)| EDGES.map(|e| (e.map(|i| t[i]), r))));
    }
    all.retain(|h| shape.regions[h.1 as usize].material.paper.dihedral > 0.0);
    all
}
