//! What couplings, springs, thin membranes and planes do to single vertices.

use super::film::FilmsAround;
use super::rings::Batch;
use crate::abutments::Against;
use crate::bytes;
use crate::contact::{Coupling, Rule};
use crate::marks::Marks;
use crate::model::Tether;
use crate::vec3::{V3, axpy, dot, scale, sub, xyz};

/// Couplings and springs by vertex.
#[derive(Debug, Clone, Default)]
pub(super) struct Touches {
    /// Vertex, coupling and weight, in order.
    list: Vec<(u32, u32, f32)>,
    /// Entries of each vertex in the list, where the first begins and the last ends.
    own: Vec<(u32, u32)>,
    /// Stiffness of the springs on each vertex, mN/mm.
    spring: Vec<f32>,
    /// Vertices that anything acts on.
    touched: Marks,
}

impl Touches {
    /// Bytes that it takes.
    pub(super) fn bytes(&self) -> usize {
        bytes::of(&self.list) + bytes::of(&self.own) + bytes::of(&self.spring) + self.touched.bytes()
    }

    /// Lists what acts on the vertices of a model. Few are touched: only what was listed before is cleared.
    pub(super) fn list(&mut self, couplings: &[Coupling], tethers: &[Tether], vertices: usize) {
        for &v in self.touched.list() {
            (self.own[v as usize], self.spring[v as usize]) = ((0, 0), 0.0);
        }
        self.touched.clear(vertices);
        self.own.resize(vertices, (0, 0));
        self.spring.resize(vertices, 0.0);
        self.list.clear();
        for (k, c) in couplings.iter().enumerate() {
            let shares = c.nodes.iter().zip(&c.weights).filter(|s| *s.1 != 0.0);
            self.list.extend(shares.map(|(&n, &w)| (n, k as u32, w)));
        }
        self.list.sort_unstable_by_key(|t| (t.0, t.1));
        for (i, &(v, ..)) in (0..).zip(&self.list) {
            let own = &mut self.own[v as usize];
            *own = if self.touched.has(v as usize) { (own.0, i + 1) } else { (i, i + 1) };
            self.touched.mark(v);
        }
        for t in tethers {
            self.spring[t.node as usize] += t.stiffness;
            self.touched.mark(t.node);
        }
    }

    /// Whether anything acts on any vertex.
    fn any(&self) -> bool {
        !self.touched.list().is_empty()
    }
}

/// What acts on the vertices of a part, the first of which has the number `first`.
#[derive(Clone, Copy)]
pub(super) struct Touching<'a> {
    pub(super) touches: &'a Touches,
    pub(super) films: &'a FilmsAround,
    pub(super) against: Against<'a>,
    pub(super) couplings: &'a [Coupling],
    /// All vertices at rest.
    pub(super) rest: &'a [[f32; 4]],
    pub(super) first: usize,
}

impl Touching<'_> {
    /// Whether a tool or a spring acts on a vertex of the batch.
    pub(super) fn held(&self, batch: &Batch) -> bool {
        self.touches.any() && batch.vertices[..batch.count].iter().any(|&v| self.holds(v))
    }

    /// Whether a tool or a spring acts on a vertex.
    #[inline(always)]
    pub(super) fn holds(&self, v: u32) -> bool {
        self.touches.touched.has(v as usize)
    }

    /// Whether anything acts on a vertex of the batch.
    #[inline(always)]
    pub(super) fn any(&self, batch: &Batch) -> bool {
        let somewhere = self.touches.any() || self.films.any() || self.against.abutments.any();
        somewhere && batch.vertices[..batch.count].iter().any(|&v| self.touches(v))
    }

    /// Whether anything acts on a vertex.
    #[inline(always)]
    pub(super) fn touches(&self, v: u32) -> bool {
        self.holds(v) || self.films.on(v) || self.against.abutments.on(v)
    }

    /// Adds what couplings, springs, thin membranes and planes do to vertex `v`, on which nothing else acts that is not in these
    /// already; `vertices` are those of the part.
    pub(super) fn act(&self, v: u32, vertices: &[[f32; 4]], g: &mut V3, h: &mut [f32; 6]) {
        let i = v as usize;
        if self.films.on(v) {
            self.films.act(v, (vertices, self.first), (g, h));
        }
        let own = xyz(vertices[i - self.first]);
        let spring = self.touches.spring[i];
        if spring > 0.0 {
            *g = axpy(*g, spring, sub(own, xyz(self.rest[i])));
            (0..3).for_each(|a| h[a] += spring);
        }
        let (first, end) = self.touches.own[i];
        for &(_, c, weight) in &self.touches.list[first as usize..end as usize] {
            let coupling = &self.couplings[c as usize];
            let x = coupling.point_from(vertices, self.first);
            let force = penalty_force(coupling, x);
            *g = axpy(*g, -weight, force);
            let k = weight * weight * coupling.stiffness;
            match coupling.rule {
                Rule::Push { normal, .. } => {
                    if dot(force, normal) > 0.0 {
                        add_outer(h, k, normal);
                    }
                }
                Rule::Hold { axis, target, limit } => {
                    (0..3).for_each(|a| h[a] += k);
                    // Without the limit: along an oblique axis the force that is cut to it may come out below.
                    if dot(scale(sub(target, x), coupling.stiffness), axis).abs() >= limit {
                        add_outer(h, -k, axis);
                    }
                }
            }
        }
        if self.against.abutments.on(v) {
            self.against.act(v, (own, self.rest), g, h);
        }
    }
}

/// Force of a coupling's penalty on its material point `x`.
pub(super) fn penalty_force(c: &Coupling, x: V3) -> V3 {
    match c.rule {
        Rule::Push { normal, bound } => scale(normal, c.stiffness * (bound - dot(normal, x)).max(0.0)),
        Rule::Hold { axis, target, limit } => {
            let pull = scale(sub(target, x), c.stiffness);
            let along = dot(pull, axis);
            axpy(pull, along.clamp(-limit, limit) - along, axis)
        }
    }
}

fn add_outer(h: &mut [f32; 6], k: f32, n: V3) {
    h[0] += k * n[0] * n[0];
    h[1] += k * n[1] * n[1];
    h[2] += k * n[2] * n[2];
    h[3] += k * n[0] * n[1];
    h[4] += k * n[0] * n[2];
    h[5] += k * n[1] * n[2];
}
