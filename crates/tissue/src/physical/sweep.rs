//! One sweep of vertex block descent through a part: each vertex goes to its own minimum.

use super::around::{Around, Damped, Force, Matrix, Resistance, Sums, Vector, area, away};
use super::rings::{Batch, Part};
use super::streams::Stream;
use super::touch::Touching;
use crate::fast::{Kernel, Lanes, Row, WIDTH, ask_ahead, dot, sum_of_roots};
use crate::space::Space;

/// Rows of steps, some 200 bytes each, from which on a part is a large one.
const LARGE: usize = 4096;

/// What a sweep goes by. Arrays of vertices are those of the part.
#[derive(Clone, Copy)]
pub(super) struct Substep<'a> {
    /// Elements along the walks of the part.
    pub(super) stream: Stream<'a>,
    /// Predicted positions, mm, and the averaged share of the shear force, mN (asked for when it is noted).
    pub(super) target: &'a [[f32; 4]],
    pub(super) far: &'a [[f32; 4]],
    /// Damping time over time step, and one over the square of the time step.
    pub(super) damping: f32,
    pub(super) inertia: f32,
    pub(super) pace: Pace,
    pub(super) touching: Touching<'a>,
}

/// What a part leaves behind.
#[derive(Debug, Clone, Default)]
pub(super) struct Memory {
    /// Of each batch, at rest: the force that cancels all others to the last bit, and what is noted of what resists motion, mN.
    pub(super) rest: Vec<[[Row; 3]; 2]>,
    /// Force on each batch that stays as it is in a substep, mN: that at rest, the averaged share of the shear, and what
    /// resists motion as noted at the start, taken off.
    pub(super) steady: Vec<[Row; 3]>,
    /// Square of each vertex's motion in the last sweep it had, mm2.
    pub(super) motion: Vec<Row>,
    /// The way that each batch's vertices went together in the last sweep that was asked to tell, mm.
    pub(super) way: Vec<f32>,
    /// Batches in the predicted deformation space.
    pub(super) space: Space,
}

/// What differs from sweep to sweep.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pace {
    /// A vertex goes this many times as far as its own minimum. Where a tool or a spring holds on, the energy is not
    /// quadratic, and vertices go to their minimum; so do those of slivers.
    pub(super) beyond: f32,
    /// Whether it keeps to the predicted deformation space.
    pub(super) only_active: bool,
    /// Whether it tells the ways of the batches.
    pub(super) tells: bool,
}

/// What a pass through a part is for.
#[derive(Clone, Copy)]
pub(super) enum Task<'a> {
    /// Each vertex goes to its own minimum.
    Move,
    /// Notes what stays as it is in a substep. For it, what damping has of the elements of each region, and the region of each
    /// element.
    Note(DampedRegions<'a>),
    /// Notes how it is at rest, with the same.
    Balance(DampedRegions<'a>),
}

type DampedRegions<'a> = (&'a [[f32; 2]], &'a [u8]);

/// A pass through a part.
pub(super) struct Sweep<'a> {
    pub(super) part: &'a Part,
    pub(super) substep: Substep<'a>,
    pub(super) vertices: &'a mut [[f32; 4]],
    pub(super) memory: &'a mut Memory,
    pub(super) task: Task<'a>,
}

impl Kernel for Sweep<'_> {
    type Out = ();

    #[inline(always)]
    fn run<V: Lanes>(mut self) {
        let batches = self.part.batches.len();
        self.memory.motion.resize(batches, [0.0; WIDTH]);
        self.memory.steady.resize(batches, [[0.0; WIDTH]; 3]);
        self.memory.rest.resize(batches, [[[0.0; WIDTH]; 3]; 2]);
        if self.substep.pace.only_active {
            for i in 0..self.memory.space.batches().len() {
                let b = self.memory.space.batches()[i] as usize;
                self.batch::<V>(b);
            }
        } else {
            for b in 0..batches {
                self.batch::<V>(b);
            }
        }
        if self.substep.pace.tells {
            let (memory, batches) = (self.memory, self.part.batches.iter());
            memory.way.clear();
            memory.way.extend(batches.zip(&memory.motion).map(|(batch, motion)| sum_of_roots(motion, batch.count)));
        }
    }
}

impl<'a> Sweep<'a> {
    #[inline(always)]
    fn batch<V: Lanes>(&mut self, b: usize) {
        let batch = &self.part.batches[b];
        for first in (0..WIDTH).step_by(V::N).take_while(|&f| f < batch.count) {
            match self.task {
                Task::Move => self.lanes::<V>(b, batch, first),
                Task::Note(elements) => self.note::<V>(b, batch, first, elements),
                Task::Balance(elements) => self.balance::<V>(b, batch, first, elements),
            }
        }
    }

    #[inline(always)]
    fn lanes<V: Lanes>(&mut self, b: usize, batch: &Batch, first: usize) {
        let (part, s) = (self.part, self.substep);
        self.ask_next(b);
        let damped = V::splat(1.0) + V::splat(s.damping);
        let mut p: [V; 4] = part.own.view(self.vertices).gather(b, 0, first);
        let (mut g, mut h) = self.force(b, batch, first, (s.stream, damped));
        let mass = V::load(&part.mass[b], first) * V::splat(s.inertia);
        let target: [V; 4] = part.own.view(s.target).gather(b, 0, first);
        let stiff = V::load(&part.diagonal[b], first) * damped + mass;
        for a in 0..3 {
            // At rest the first two cancel to the last bit.
            g[a] = g[a] + V::load(&self.memory.steady[b][a], first) + mass * (p[a] - target[a]);
            h[a] = h[a] + stiff;
        }
        let mut beyond = V::splat(s.pace.beyond).min(V::load(&part.most[b], first));
        if s.touching.any(batch) {
            touch(&s.touching, self.vertices, batch, first, &mut g, &mut h);
            let most = |l: usize| if s.touching.touches(batch.vertices[l]) { 1.0 } else { f32::INFINITY };
            beyond = beyond.min(V::load(&core::array::from_fn(most), first));
        }
        let d = solve(&h, &g);
        let mut motion = V::splat(0.0);
        for a in 0..3 {
            p[a] = p[a] - beyond * d[a];
            motion = motion + d[a] * d[a];
        }
        motion.store(&mut self.memory.motion[b], first);
        part.own.over(self.vertices).scatter(b, 0, first, p, batch.count - first);
    }

    /// Asks for what the next batches begin with, in a part that no cache holds from one sweep to the next.
    #[inline(always)]
    fn ask_next(&self, b: usize) {
        let (part, memory) = (self.part, &*self.memory);
        if part.ring.len() < LARGE {
            return;
        }
        ask_ahead(&part.batches, b);
        ask_ahead(&part.mass, b);
        ask_ahead(&part.diagonal, b);
        ask_ahead(&part.most, b);
        ask_ahead(&memory.motion, b);
        for a in 0..3 {
            ask_ahead(memory.steady.as_flattened(), 3 * b + a);
        }
        let targets = part.own.view(self.substep.target);
        targets.ask_ahead(b);
        targets.ask_next(b);
    }

    #[inline(always)]
    fn note<V: Lanes>(&mut self, b: usize, batch: &Batch, first: usize, elements: DampedRegions<'_>) {
        let damped = V::splat(1.0) + V::splat(self.substep.damping);
        let far: [V; 4] = self.part.own.view(self.substep.far).gather(b, 0, first);
        let resists = self.resistance::<V>(b, batch, first, elements);
        for a in 0..3 {
            let [base, at_rest] = [0, 1].map(|i| V::load(&self.memory.rest[b][i][a], first));
            // At rest, the base alone is left.
            let steady = far[a] * damped + (base + (at_rest - resists[a]));
            steady.store(&mut self.memory.steady[b][a], first);
        }
    }

    #[inline(always)]
    fn balance<V: Lanes>(&mut self, b: usize, batch: &Batch, first: usize, elements: DampedRegions<'_>) {
        let damped = V::splat(1.0) + V::splat(self.substep.damping);
        let (force, _) = self.force(b, batch, first, (self.substep.stream, damped));
        let resists = self.resistance::<V>(b, batch, first, elements);
        let rest = &mut self.memory.rest[b];
        for a in 0..3 {
            (V::splat(0.0) - force[a]).store(&mut rest[0][a], first);
            resists[a].store(&mut rest[1][a], first);
        }
    }

    /// What damping has of the force of a motion from rest to here within a time step.
    #[inline(always)]
    fn resistance<V: Lanes>(
        &self,
        b: usize,
        batch: &Batch,
        first: usize,
        (regions, region): DampedRegions<'_>,
    ) -> Vector<V> {
        if self.substep.damping == 0.0 {
            return [V::splat(0.0); 3];
        }
        let damped = V::splat(self.substep.damping);
        let p: [V; 4] = self.part.own.view(self.vertices).gather(b, 0, first);
        let far: [V; 4] = self.part.own.view(self.substep.far).gather(b, 0, first);
        let mut sum = Resistance(Force { sum: [V::splat(0.0); 3], damped });
        let elements = Damped { regions, region, rise: self.substep.stream.rise, rows: &self.part.regions };
        self.walk(batch, first, &p, elements, &mut sum);
        core::array::from_fn(|a| far[a].mul_add(damped, sum.0.sum[a]))
    }

    /// Force of neighbours, those `damped` times, and of elements, and its derivative without the neighbours'.
    #[inline(always)]
    fn force<V: Lanes>(
        &self,
        b: usize,
        batch: &Batch,
        first: usize,
        (stream, damped): (Stream<'_>, V),
    ) -> (Vector<V>, Matrix<V>) {
        let p: [V; 4] = self.part.own.view(self.vertices).gather(b, 0, first);
        let force = Force { sum: [V::splat(0.0); 3], damped };
        let mut sums = Sums { force, hessian: [V::splat(0.0); 6] };
        self.walk(batch, first, &p, stream, &mut sums);
        (sums.force.sum, sums.hessian)
    }

    /// Walks around the vertices `p`.
    #[inline(always)]
    fn walk<'e, V: Lanes, A: Around<V>>(
        &'e self,
        batch: &Batch,
        first: usize,
        p: &[V; 4],
        elements: A::Elements<'e>,
        sums: &mut A,
    ) {
        let (part, start, count) = (self.part, batch.steps.start, batch.rows().len());
        let ring = part.ring.view(self.vertices);
        // The first two steps complete no element.
        let (mut a, mut b) = (away(ring.gather(start, 0, first), p), away(ring.gather(start + 1, 0, first), p));
        sums.neighbour(V::load(&part.weight[start], first), &a);
        sums.neighbour(V::load(&part.weight[start + 1], first), &b);
        // Cut to one length, so that no step asks whether it is within.
        let (ring, weights) = (ring.part(start + 2, count), &part.weight[start + 2..][..count]);
        let keeps = &part.keeps_first[start + 2..][..count];
        let elements = A::along(elements, &part.tets, batch.elements, count);
        for k in 0..count {
            let c = away(ring.gather(k, 0, first), p);
            ask_ahead(weights, k);
            ring.ask_ahead(k);
            A::ask_ahead(&elements, k);
            sums.neighbour(V::load(&weights[k], first), &c);
            let n = area(&a, &b, &c);
            // Six times the volume is minus this.
            let volume = dot(n, a);
            sums.element((&elements, k, first), &n, volume);
            for i in 0..3 {
                (a[i], b[i]) = (V::choose(keeps[k], first, a[i], c[i]), V::choose(keeps[k], first, c[i], b[i]));
            }
        }
    }
}

/// What tools and springs add, vertex by vertex.
#[inline(never)]
fn touch_lane(touching: &Touching<'_>, vertices: &[[f32; 4]], v: u32, g: &mut [f32; 3], h: &mut [f32; 6]) {
    touching.act(v, vertices, g, h);
}

#[inline(always)]
fn touch<V: Lanes>(
    touching: &Touching<'_>,
    vertices: &[[f32; 4]],
    batch: &Batch,
    first: usize,
    g: &mut Vector<V>,
    h: &mut Matrix<V>,
) {
    let (mut gs, mut hs) = ([[0.0; WIDTH]; 3], [[0.0; WIDTH]; 6]);
    for a in 0..3 {
        g[a].store(&mut gs[a], first);
    }
    for a in 0..6 {
        h[a].store(&mut hs[a], first);
    }
    for l in first..batch.count.min(first + V::N) {
        if touching.touches(batch.vertices[l]) {
            let (mut gl, mut hl) = ([gs[0][l], gs[1][l], gs[2][l]], [0.0; 6]);
            for a in 0..6 {
                hl[a] = hs[a][l];
            }
            touch_lane(touching, vertices, batch.vertices[l], &mut gl, &mut hl);
            for a in 0..3 {
                gs[a][l] = gl[a];
            }
            for a in 0..6 {
                hs[a][l] = hl[a];
            }
        }
    }
    for a in 0..3 {
        g[a] = V::load(&gs[a], first);
    }
    for a in 0..6 {
        h[a] = V::load(&hs[a], first);
    }
}

/// Solves symmetric positive definite 3x3 systems `h d = g`.
#[inline(always)]
fn solve<V: Lanes>(h: &Matrix<V>, g: &Vector<V>) -> Vector<V> {
    let [xx, yy, zz, xy, xz, yz] = *h;
    let (cx, cy, cz) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
    let inverse = V::splat(1.0) / (xx * cx + xy * cy + xz * cz);
    let (dy, dz, e) = (xx * zz - xz * xz, xx * yy - xy * xy, xy * xz - xx * yz);
    [
        (cx * g[0] + cy * g[1] + cz * g[2]) * inverse,
        (cy * g[0] + dy * g[1] + e * g[2]) * inverse,
        (cz * g[0] + e * g[1] + dz * g[2]) * inverse,
    ]
}
