//! What couplings and springs do to single vertices.

use super::descent::{Body, DescentScratch};
use crate::contact::{Coupling, Rule};
use crate::vec3::{V3, axpy, dot, scale, sub, xyz};

/// Adds what couplings and springs do to vertex `i`.
pub(super) fn act(i: usize, body: &Body<'_>, scratch: &DescentScratch, g: &mut V3, h: &mut [f32; 6]) {
    let spring = scratch.spring[i];
    if spring > 0.0 {
        *g = axpy(*g, spring, sub(xyz(body.positions[i]), xyz(body.rest[i])));
        (0..3).for_each(|a| h[a] += spring);
    }
    let touches = scratch.first_touch[i] as usize..scratch.first_touch[i + 1] as usize;
    for &(_, c, weight) in &scratch.touched[touches] {
        let coupling = &body.couplings[c as usize];
        let force = penalty_force(coupling, coupling.point(body.positions));
        *g = axpy(*g, -weight, force);
        let k = weight * weight * coupling.stiffness;
        match coupling.rule {
            Rule::Push { normal, .. } => {
                if dot(force, normal) > 0.0 {
                    add_outer(h, k, normal);
                }
            }
            Rule::Hold { axis, limit, .. } => {
                (0..3).for_each(|a| h[a] += k);
                if dot(force, axis).abs() >= limit {
                    add_outer(h, -k, axis);
                }
            }
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

pub(super) fn list_touches(body: &Body<'_>, scratch: &mut DescentScratch) {
    scratch.touched.clear();
    for (k, c) in body.couplings.iter().enumerate() {
        let shares = c.nodes.iter().zip(&c.weights).filter(|s| *s.1 != 0.0);
        scratch.touched.extend(shares.map(|(&n, &w)| (n, k as u32, w)));
    }
    scratch.touched.sort_unstable_by_key(|t| (t.0, t.1));
    scratch.first_touch.clear();
    let mut next = 0;
    for i in 0..=body.positions.len() as u32 {
        while next < scratch.touched.len() && scratch.touched[next].0 < i {
            next += 1;
        }
        scratch.first_touch.push(next as u32);
    }
    scratch.spring.clear();
    scratch.spring.resize(body.positions.len(), 0.0);
    for t in body.tethers {
        scratch.spring[t.node as usize] += t.stiffness;
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
