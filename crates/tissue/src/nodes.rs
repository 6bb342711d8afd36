//! What is done with every node by itself: copies, velocities, checks.
//!
//! Each is a short walk through all nodes, mostly the wait for what another processor has written; so threads share them as
//! they share the sweeps, each with the nodes that it has at hand, and with the widest vectors.

use crate::fast::{Kernel, Lanes, Pool, widest};
use crate::slabs::{self, PIECES};
use crate::vec3::larger;
use crate::{State, bytes};

/// Floats of the nodes that are looked at together: four nodes.
const LOT: usize = 16;

/// The nodes of a model in pieces for threads.
#[derive(Debug, Clone)]
pub(crate) struct Nodes {
    cuts: Vec<usize>,
    /// Cuts of a list that has one entry for each piece.
    ones: Vec<usize>,
}

/// What is found in a piece.
#[derive(Debug, Clone, Copy)]
struct Found {
    /// Square of the longest way, mm2; endless if one is not finite.
    square: f32,
    sane: bool,
}

impl Nodes {
    pub(crate) fn new(count: usize) -> Self {
        let cuts = slabs::even_cuts(count);
        Self { ones: (0..cuts.len()).collect(), cuts }
    }

    /// Where pieces begin, and the end.
    pub(crate) fn cuts(&self) -> &[usize] {
        &self.cuts
    }

    /// Bytes that they take.
    pub(crate) fn bytes(&self) -> usize {
        bytes::of(&self.cuts) + bytes::of(&self.ones)
    }

    /// Copies a state, without allocating when the sizes agree.
    pub(crate) fn copy(&self, from: &State, to: &mut State, pool: &Pool) {
        to.positions.resize(from.positions.len(), [0.0; 4]);
        to.velocities.resize(from.velocities.len(), [0.0; 4]);
        let mut velocities = slabs::split(&mut to.velocities, &self.cuts);
        pool.each_part(&mut to.positions, &self.cuts, &mut velocities, &|i, positions, velocities| {
            let own = self.cuts[i]..self.cuts[i + 1];
            positions.copy_from_slice(&from.positions[own.clone()]);
            velocities.copy_from_slice(&from.velocities[own]);
        });
        to.copy_rest_from(from);
    }

    /// Equation (5): velocities from the positions now and `dt` seconds before, mm/s.
    pub(crate) fn set_velocities(
        &self,
        (positions, before): (&[[f32; 4]], &[[f32; 4]]),
        velocities: &mut [[f32; 4]],
        dt: f32,
        pool: &Pool,
    ) {
        let per_s = 1.0 / dt;
        pool.each_part(velocities, &self.cuts, &mut [(); PIECES], &|i, velocities, ()| {
            let own = self.cuts[i]..self.cuts[i + 1];
            widest(Apart { positions: &positions[own.clone()], from: &before[own], times: per_s, out: velocities });
        });
    }

    /// The longest way from `rest`, mm, endless if a coordinate is not finite; and whether no coordinate has gone further than
    /// `most`, mm, since `before` and all velocities are finite.
    pub(crate) fn look(
        &self,
        (now, before, rest): (&State, &State, &[[f32; 4]]),
        most: f32,
        pool: &Pool,
    ) -> (f32, bool) {
        let found = self.each(pool, &|own| {
            let (positions, velocities) = (&now.positions[own.clone()], &now.velocities[own.clone()]);
            let square = widest(Ways { positions, from: &rest[own.clone()] });
            let sane = widest(Sane { positions, before: &before.positions[own], velocities, most });
            Found { square, sane }
        });
        (found.square.sqrt(), found.sane)
    }

    /// What is found in all pieces together.
    fn each(&self, pool: &Pool, find: &(dyn Fn(core::ops::Range<usize>) -> Found + Sync)) -> Found {
        let mut pieces = [Found { square: 0.0, sane: true }; PIECES];
        pool.each_part(&mut pieces, &self.ones, &mut [(); PIECES], &|i, piece, ()| {
            piece.fill(find(self.cuts[i]..self.cuts[i + 1]));
        });
        let both = |a: Found, b: Found| Found { square: larger(a.square, b.square), sane: a.sane && b.sane };
        pieces.into_iter().fold(Found { square: 0.0, sane: true }, both)
    }
}

/// The longest way between positions of the same nodes, mm; endless if a coordinate is not finite. On one thread.
pub(crate) fn longest_way(positions: &[[f32; 4]], from: &[[f32; 4]]) -> f32 {
    widest(Ways { positions, from }).sqrt()
}

/// Differences between positions, times a number.
pub(crate) struct Apart<'a> {
    pub(crate) positions: &'a [[f32; 4]],
    pub(crate) from: &'a [[f32; 4]],
    pub(crate) times: f32,
    pub(crate) out: &'a mut [[f32; 4]],
}

impl Kernel for Apart<'_> {
    type Out = ();

    /// In words that the compiler makes as wide as it may; the inverse mass, which stays, becomes nothing.
    #[inline(always)]
    fn run<V: Lanes>(self) {
        let both = self.positions.as_flattened().iter().zip(self.from.as_flattened());
        both.zip(self.out.as_flattened_mut()).for_each(|((p, q), out)| *out = (p - q) * self.times);
    }
}

struct Ways<'a> {
    positions: &'a [[f32; 4]],
    from: &'a [[f32; 4]],
}

impl Kernel for Ways<'_> {
    type Out = f32;

    #[inline(always)]
    fn run<V: Lanes>(self) -> f32 {
        let (p, p_end) = self.positions.as_flattened().as_chunks::<LOT>();
        let (q, q_end) = self.from.as_flattened().as_chunks::<LOT>();
        let (mut most, mut sum) = ([0f32; LOT], [0f32; LOT]);
        for (p, q) in p.iter().zip(q) {
            ways(p, q, &mut most, &mut sum);
        }
        let filled = |v: &[f32]| core::array::from_fn(|l| v.get(l).copied().unwrap_or(0.0));
        ways(&filled(p_end), &filled(q_end), &mut most, &mut sum);
        let finite = sum.iter().all(|s| s.is_finite());
        if finite { most.into_iter().fold(0.0, larger) } else { f32::INFINITY }
    }
}

/// Squares of the ways of four nodes, each in all of its lanes; the inverse mass, which stays, adds nothing.
#[inline(always)]
fn ways(p: &[f32; LOT], q: &[f32; LOT], most: &mut [f32; LOT], sum: &mut [f32; LOT]) {
    let squares: [f32; LOT] = core::array::from_fn(|l| (p[l] - q[l]) * (p[l] - q[l]));
    let pairs: [f32; LOT] = core::array::from_fn(|l| squares[l] + squares[l ^ 1]);
    let all: [f32; LOT] = core::array::from_fn(|l| pairs[l] + pairs[l ^ 2]);
    *most = core::array::from_fn(|l| larger(most[l], all[l]));
    *sum = core::array::from_fn(|l| sum[l] + all[l]);
}

struct Sane<'a> {
    positions: &'a [[f32; 4]],
    before: &'a [[f32; 4]],
    velocities: &'a [[f32; 4]],
    most: f32,
}

impl Kernel for Sane<'_> {
    type Out = bool;

    /// Without stopping at the first that is not: that is quicker when all is well.
    #[inline(always)]
    fn run<V: Lanes>(self) -> bool {
        let ways = self.positions.as_flattened().iter().zip(self.before.as_flattened());
        let near = ways.fold(true, |all, (p, q)| all & ((p - q).abs() < self.most));
        self.velocities.as_flattened().iter().fold(near, |all, v| all & v.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vec3::{norm, sub, xyz};

    fn nodes(count: usize, shift: f32) -> Vec<[f32; 4]> {
        (0..count).map(|i| [i as f32, shift * ((i * 7) % 31) as f32, (i as f32).sin(), 0.5]).collect()
    }

    #[test]
    fn ways_velocities_and_copies_are_those_of_each_node_by_itself() {
        for count in [1, 3, 4, 63, 64, 1000, 1001] {
            let (pool, all) = (Pool::new(2), Nodes::new(count));
            let (p, q) = (nodes(count, 0.4), nodes(count, 0.1));
            let way = |i: usize| norm(sub(xyz(p[i]), xyz(q[i])));
            let longest = (0..count).map(way).fold(0f32, f32::max);
            assert!((longest_way(&p, &q) - longest).abs() <= 1e-6 * longest);
            let mut velocities = vec![[f32::NAN; 4]; count];
            all.set_velocities((&p, &q), &mut velocities, 0.25, &pool);
            for (i, v) in velocities.iter().enumerate() {
                assert_eq!(*v, [0, 1, 2, 3].map(|a| (p[i][a] - q[i][a]) * 4.0));
            }
            let state = |positions: &Vec<[f32; 4]>| State {
                positions: positions.clone(),
                velocities: velocities.clone(),
                pressure: vec![1.0],
                csf_kpa: 0.3,
                tools: Vec::new(),
                knotted: 2,
                time_s: 4.0,
            };
            let (from, mut to) = (state(&p), State { time_s: 0.0, ..state(&q) });
            assert_eq!(all.look((&from, &to, &q), 2.0 * longest + 1.0, &pool), (longest_way(&p, &q), true));
            all.copy(&from, &mut to, &pool);
            assert_eq!(from, to);
        }
    }

    #[test]
    fn one_node_that_is_no_number_or_far_away_is_found_wherever_it_is() {
        let (count, pool) = (201, Pool::new(2));
        let all = Nodes::new(count);
        let good = State {
            positions: nodes(count, 0.4),
            velocities: nodes(count, 0.1),
            pressure: Vec::new(),
            csf_kpa: 0.0,
            tools: Vec::new(),
            knotted: 0,
            time_s: 0.0,
        };
        assert_eq!(all.look((&good, &good, &good.positions), 1.0, &pool), (0.0, true));
        for i in 0..count {
            for a in 0..3 {
                for (bad, longest) in [(f32::NAN, f32::INFINITY), (f32::INFINITY, f32::INFINITY), (500.0, 300.0)] {
                    let mut now = good.clone();
                    now.positions[i][a] = bad;
                    let (way, sane) = all.look((&now, &good, &good.positions), 200.0, &pool);
                    assert!(!sane && way >= longest, "{i} {a} {bad}");
                }
                let mut now = good.clone();
                now.velocities[i][a] = f32::NAN;
                assert!(!all.look((&now, &good, &good.positions), 200.0, &pool).1, "{i} {a}");
            }
        }
    }
}
