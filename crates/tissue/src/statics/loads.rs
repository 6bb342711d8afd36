//! Supports and loads in the model's numbering.

use super::refine::distance;
use super::{EmbeddedRod, StaticError, StaticProblem};
use crate::Model;
use crate::membrane::OUTSIDE;
use crate::physical::elastic::{D3, Elastic};
use std::collections::{BTreeMap, BTreeSet};

pub(crate) struct Loads {
    /// Prescribed displacement of each component; `None` is free.
    pub(crate) support: Vec<[Option<f64>; 3]>,
    /// Dead force on each node, mN.
    dead: Vec<D3>,
    /// Triangles that a pressure (kPa) pushes along their normal.
    pushed: Vec<([u32; 3], f64)>,
    /// Nodes that each rod holds, and in which components: what a support holds of them stays with it.
    pub(super) rods: Vec<Vec<(u32, [bool; 3])>>,
}

impl Loads {
    pub(crate) fn new(model: &Model, elastic: &Elastic, problem: &StaticProblem) -> Result<Self, StaticError> {
        let vertices = model.number.len();
        let number =
            |vertex: u32| model.number.get(vertex as usize).copied().ok_or(StaticError::Vertex { vertex, vertices });
        let mut support = vec![[None; 3]; vertices];
        for (i, p) in model.rest.iter().enumerate() {
            if p[3] == 0.0 {
                support[i] = [Some(0.0); 3];
            }
        }
        for s in &problem.supports {
            if s.displacement_mm.iter().flatten().any(|v| !v.is_finite()) {
                return Err(StaticError::NotFinite { what: "a prescribed displacement" });
            }
            let node = &mut support[number(s.node)? as usize];
            (0..3).for_each(|a| node[a] = s.displacement_mm[a].or(node[a]));
        }
        if problem.body_force_mn_mm3.iter().any(|v| !v.is_finite()) {
            return Err(StaticError::NotFinite { what: "the body force" });
        }
        let mut dead = vec![[0.0; 3]; vertices];
        for (tet, volume) in elastic.tets.iter().zip(&elastic.volume) {
            for &n in tet {
                (0..3).for_each(|a| dead[n as usize][a] += problem.body_force_mn_mm3[a] * volume / 4.0);
            }
        }
        let mut rods = Vec::new();
        for (rod, r) in problem.rods.iter().enumerate() {
            rods.push(hold(model, (rod, r), &mut support)?);
        }
        let pushed = oriented(model, problem, number)?;
        Ok(Self { support, dead, pushed, rods })
    }

    /// Adds a share of the loads to the gradient of the energy and returns their potential.
    pub(crate) fn add(&self, share: f64, x: &[D3], rest: &[D3], gradient: &mut [D3]) -> f64 {
        let mut energy = 0.0;
        for (i, f) in self.dead.iter().enumerate() {
            for a in 0..3 {
                gradient[i][a] -= share * f[a];
                energy -= share * f[a] * (x[i][a] - rest[i][a]);
            }
        }
        for (t, kpa) in &self.pushed {
            let (p, kpa) = (t.map(|n| x[n as usize]), share * kpa);
            // The potential of a follower pressure is minus pressure times swept volume, exact for a closed cavity.
            energy -= kpa * dot_cross(p[0], p[1], p[2]) / 6.0;
            let third = area(p).map(|v| kpa * v / 3.0);
            for &n in t {
                (0..3).for_each(|a| gradient[n as usize][a] -= third[a]);
            }
        }
        energy
    }

    /// Forces of all loads on the nodes at rest, mN.
    pub(super) fn at_rest(&self, rest: &[D3]) -> Vec<D3> {
        let mut gradient = vec![[0.0; 3]; rest.len()];
        self.add(1.0, rest, rest, &mut gradient);
        gradient.iter().map(|g| g.map(|v| -v)).collect()
    }

    /// Adds the product of the loads' Hessian with `d`.
    pub(crate) fn add_hessian(&self, share: f64, x: &[D3], d: &[D3], out: &mut [D3]) {
        for (t, kpa) in &self.pushed {
            let kpa = share * kpa;
            let (p, q) = (t.map(|n| x[n as usize]), t.map(|n| d[n as usize]));
            // Derivative of the volume form, which is symmetric; for a closed surface it equals that of the area form.
            for i in 0..3 {
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                let (u, v) = (cross(q[j], p[k]), cross(p[j], q[k]));
                (0..3).for_each(|a| out[t[i] as usize][a] -= kpa * (u[a] + v[a]) / 6.0);
            }
        }
    }

    /// Size of the loads, mN.
    pub(crate) fn size2(&self, x: &[D3]) -> f64 {
        let dead: f64 = self.dead.iter().flatten().map(|v| v * v).sum();
        let pushed = self
            .pushed
            .iter()
            .map(|(t, kpa)| area(t.map(|n| x[n as usize])).iter().map(|v| (kpa * v / 3.0).powi(2)).sum::<f64>() * 3.0);
        dead + pushed.sum::<f64>()
    }
}

/// Prescribes the motion of the rod for all nodes inside it that nothing else holds.
fn hold(
    model: &Model,
    (rod, r): (usize, &EmbeddedRod),
    support: &mut [[Option<f64>; 3]],
) -> Result<Vec<(u32, [bool; 3])>, StaticError> {
    let ends = r.ends.map(|p| (p - model.origin).to_array());
    let reach = r.radius_mm * (1.0 + 1e-5);
    let inside = |p: &[f32; 4]| distance(ends, [p[0], p[1], p[2]].map(f64::from)) <= reach;
    let mut held = Vec::new();
    for (i, p) in model.rest.iter().enumerate() {
        if inside(p) && support[i].iter().any(Option::is_none) {
            let way = r.displacement_mm.to_array();
            held.push((i as u32, support[i].map(|s| s.is_none())));
            support[i] = core::array::from_fn(|a| support[i][a].or(Some(way[a])));
        }
    }
    if held.is_empty() { Err(StaticError::Rod { rod, radius_mm: r.radius_mm }) } else { Ok(held) }
}

/// Faces of the pressures with normals that point into the tissue.
fn oriented(
    model: &Model,
    problem: &StaticProblem,
    number: impl Fn(u32) -> Result<u32, StaticError>,
) -> Result<Vec<([u32; 3], f64)>, StaticError> {
    let sorted = |mut t: [u32; 3]| {
        t.sort_unstable();
        t
    };
    let outer = model.membranes.faces.iter().filter(|m| m.outer == OUTSIDE);
    let surface: BTreeMap<[u32; 3], [u32; 3]> = outer.map(|m| (sorted(m.nodes), m.nodes)).collect();
    let mut pushed = Vec::new();
    for p in &problem.pressures {
        if !p.kpa.is_finite() {
            return Err(StaticError::NotFinite { what: "a pressure" });
        }
        let mut seen = BTreeSet::new();
        for face in &p.faces {
            if !seen.insert(sorted(*face)) {
                return Err(StaticError::Twice(*face));
            }
            let key = sorted([number(face[0])?, number(face[1])?, number(face[2])?]);
            let [a, b, c] = *surface.get(&key).ok_or(StaticError::Face(*face))?;
            pushed.push(([a, c, b], p.kpa));
        }
    }
    Ok(pushed)
}

fn cross(a: D3, b: D3) -> D3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot_cross(a: D3, b: D3, c: D3) -> f64 {
    let n = cross(a, b);
    n[0] * c[0] + n[1] * c[1] + n[2] * c[2]
}

pub(super) fn area([a, b, c]: [D3; 3]) -> D3 {
    let (u, v): (D3, D3) = (core::array::from_fn(|i| b[i] - a[i]), core::array::from_fn(|i| c[i] - a[i]));
    cross(u, v).map(|n| 0.5 * n)
}
