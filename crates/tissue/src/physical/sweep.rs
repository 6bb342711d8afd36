//! One sweep of vertex block descent through a part: each vertex goes to its own minimum.

use super::rings::{Batch, Part};
use super::touch::Touching;
use crate::fast::{Kernel, Lanes, Row, WIDTH};

/// Three components, and the six different entries of a symmetric matrix (xx, yy, zz, xy, xz, yz).
type Vector<V> = [V; 3];
type Matrix<V> = [V; 6];

/// What changes from sweep to sweep in an element: its pressure without its own growth, shear modulus (kPa), volumetric
/// stiffness and penalty over its volume (kPa/mm3).
pub(crate) type Element = [f32; 4];

/// What is the same in all sweeps of a substep. Arrays of vertices are those of the part.
#[derive(Clone, Copy)]
pub(super) struct Substep<'a> {
    pub(super) elements: &'a [Element],
    /// Predicted positions, mm, and the averaged share of the shear force, mN.
    pub(super) target: &'a [[f32; 4]],
    pub(super) far: &'a [[f32; 4]],
    /// Damping time over time step, and one over the square of the time step.
    pub(super) damping: f32,
    pub(super) inertia: f32,
    pub(super) touching: Touching<'a>,
}

/// What a part leaves behind.
#[derive(Debug, Clone, Default)]
pub(super) struct Memory {
    /// Elements' own elastic force on each batch at the start of the substep, mN.
    pub(super) before: Vec<[Row; 3]>,
    /// Square of each vertex's motion in the last sweep it had, mm2.
    pub(super) motion: Vec<Row>,
    /// Batches in the predicted deformation space, and whether the next sweep keeps to them.
    pub(super) active: Vec<u32>,
    pub(super) only_active: bool,
}

/// A sweep, or only its forces.
pub(super) struct Sweep<'a> {
    pub(super) part: &'a Part,
    pub(super) substep: Substep<'a>,
    pub(super) vertices: &'a mut [[f32; 4]],
    pub(super) memory: &'a mut Memory,
    /// Whether to note the forces instead of moving.
    pub(super) note: bool,
}

impl Kernel for Sweep<'_> {
    type Out = ();

    #[inline(always)]
    fn run<V: Lanes>(mut self) {
        let batches = self.part.batches.len();
        self.memory.motion.resize(batches, [0.0; WIDTH]);
        self.memory.before.resize(batches, [[0.0; WIDTH]; 3]);
        if self.memory.only_active {
            for i in 0..self.memory.active.len() {
                let b = self.memory.active[i] as usize;
                self.batch::<V>(b);
            }
        } else {
            for b in 0..batches {
                self.batch::<V>(b);
            }
        }
    }
}

/// Sums over what is around the vertices of a batch.
struct Sums<V> {
    /// Shear force of the neighbours, force of the pressures and their elements, the latter without pressures.
    shear: Vector<V>,
    elastic: Vector<V>,
    viscous: Vector<V>,
    hessian: Matrix<V>,
}

impl Sweep<'_> {
    #[inline(always)]
    fn batch<V: Lanes>(&mut self, b: usize) {
        let batch = &self.part.batches[b];
        for first in (0..WIDTH).step_by(V::N).take_while(|&f| f < batch.count) {
            self.lanes::<V>(b, batch, first);
        }
    }

    #[inline(always)]
    fn lanes<V: Lanes>(&mut self, b: usize, batch: &Batch, first: usize) {
        let (part, s) = (self.part, self.substep);
        let mut p: [V; 4] = part.own.view(self.vertices).gather(b, 0, first);
        let sums = self.sums::<V>(batch, first, &p);
        let far: [V; 4] = part.own.view(s.far).gather(b, 0, first);
        let damping = V::splat(s.damping);
        let mass = V::load(&part.mass[b], first) * V::splat(s.inertia);
        let target: [V; 4] = part.own.view(s.target).gather(b, 0, first);
        let (mut g, mut h) = ([V::splat(0.0); 3], sums.hessian);
        let stiff = V::load(&part.diagonal[b], first) * (V::splat(1.0) + damping) + mass;
        for a in 0..3 {
            // At rest the first two cancel the base to the last bit.
            let base = V::load(&part.base[b][a], first);
            let own = (sums.shear[a] + sums.viscous[a]) + base + far[a];
            if self.note {
                own.store(&mut self.memory.before[b][a], first);
                continue;
            }
            let viscous = own - V::load(&self.memory.before[b][a], first);
            let elastic = (sums.shear[a] + sums.elastic[a]) + base + far[a];
            g[a] = elastic + damping * viscous + mass * (p[a] - target[a]);
            h[a] = h[a] + stiff;
        }
        if self.note {
            return;
        }
        if s.touching.any(batch) {
            touch(&s.touching, self.vertices, batch, first, &mut g, &mut h);
        }
        let d = solve(&h, &g);
        let mut motion = V::splat(0.0);
        for a in 0..3 {
            p[a] = p[a] - d[a];
            motion = motion + d[a] * d[a];
        }
        motion.store(&mut self.memory.motion[b], first);
        part.own.over(self.vertices).scatter(b, 0, first, p, batch.count - first);
    }

    #[inline(always)]
    fn sums<V: Lanes>(&self, batch: &Batch, first: usize, p: &[V; 4]) -> Sums<V> {
        let (part, s) = (self.part, &self.substep);
        let none = [V::splat(0.0); 3];
        let mut out = Sums { shear: none, elastic: none, viscous: none, hessian: [V::splat(0.0); 6] };
        let links = part.links.view(self.vertices);
        for k in batch.links.clone() {
            let (q, w): ([V; 4], V) = (links.gather(k, 0, first), V::load(&part.weight[k], first));
            for a in 0..3 {
                out.shear[a] = out.shear[a] + w * (q[a] - p[a]);
            }
        }
        let (others, elements) = (part.others.view(self.vertices), part.tets.view(s.elements));
        let more = V::splat(1.0 + s.damping);
        for k in batch.elements.clone() {
            let corners = [others.gather(k, 0, first), others.gather(k, 1, first), others.gather(k, 2, first)];
            let (volume, n) = volume_and_area(p, &corners);
            let [pressure, mu, stiffness, penalty]: [V; 4] = elements.gather(k, 0, first);
            let growth = volume - V::load(&part.volume[k], first);
            let elastic = pressure + (stiffness + penalty) * growth;
            let viscous = stiffness * growth - mu;
            let second = stiffness * more + penalty;
            let m = [second * n[0], second * n[1], second * n[2]];
            for a in 0..3 {
                out.elastic[a] = out.elastic[a] + elastic * n[a];
                out.viscous[a] = out.viscous[a] + viscous * n[a];
                out.hessian[a] = out.hessian[a] + m[a] * n[a];
            }
            out.hessian[3] = out.hessian[3] + m[0] * n[1];
            out.hessian[4] = out.hessian[4] + m[0] * n[2];
            out.hessian[5] = out.hessian[5] + m[1] * n[2];
        }
        out
    }
}

/// Volume of each element and its gradient by the vertex `p`, whose opposite corners are `a`, `b` and `c`.
#[inline(always)]
fn volume_and_area<V: Lanes>(p: &[V; 4], [a, b, c]: &[[V; 4]; 3]) -> (V, Vector<V>) {
    let (ux, uy, uz) = (b[0] - a[0], b[1] - a[1], b[2] - a[2]);
    let (vx, vy, vz) = (c[0] - a[0], c[1] - a[1], c[2] - a[2]);
    let sixth = V::splat(1.0 / 6.0);
    let n = [(uy * vz - uz * vy) * sixth, (uz * vx - ux * vz) * sixth, (ux * vy - uy * vx) * sixth];
    (n[0] * (p[0] - a[0]) + n[1] * (p[1] - a[1]) + n[2] * (p[2] - a[2]), n)
}

/// Volumes at rest by the arithmetic of the sweep: at rest the growth is then exactly zero.
pub(super) struct Volumes<'a> {
    pub(super) part: &'a mut Part,
    pub(super) rest: &'a [[f32; 4]],
}

impl Kernel for Volumes<'_> {
    type Out = ();

    fn run<V: Lanes>(self) {
        let Self { part, rest } = self;
        let (own, others) = (part.own.view(rest), part.others.view(rest));
        for (b, batch) in part.batches.iter().enumerate() {
            for first in (0..WIDTH).step_by(V::N) {
                let p: [V; 4] = own.gather(b, 0, first);
                for k in batch.elements.clone() {
                    let corners = [others.gather(k, 0, first), others.gather(k, 1, first), others.gather(k, 2, first)];
                    volume_and_area(&p, &corners).0.store(&mut part.volume[k], first);
                }
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
