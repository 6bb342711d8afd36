//! Vertex block descent with nodal pressures, in single precision.

use super::elastic::Elastic;
use crate::contact::{Coupling, Rule};
use crate::model::{Region, Tether};
use crate::vec3::{V3, add, axpy, cross, dot, scale, sub, xyz};

/// Volumetric stiffness that the sweeps carry themselves, over the shear modulus; the rest is the pressure's.
const PENALTY: f64 = 2.0;

/// One element seen from one of its vertices.
#[derive(Debug, Clone, Copy)]
struct Star {
    /// The other three vertices, so that `(b - a) x (c - a)` is six times the gradient of the volume.
    others: [u32; 3],
    tet: u32,
    /// Volume at rest by the arithmetic of the sweep: at rest the pressure is then exactly `-mu`.
    volume: f32,
    /// Volumetric stiffness of the element, and of the penalty, over its volume, kPa/mm3.
    stiffness: f32,
    penalty: f32,
    mu: f32,
}

/// Constants of the sweeps.
#[derive(Debug, Clone)]
pub(crate) struct Descent {
    /// Free vertices by colour; those of one colour share no element.
    order: Vec<u32>,
    /// Start of each colour in `order`, one more than colours.
    colours: Vec<u32>,
    star_start: Vec<u32>,
    stars: Vec<Star>,
    near_start: Vec<u32>,
    near: Vec<(u32, f32)>,
    /// Sum of a row of the shear matrix without its diagonal, mN/mm (negative).
    near_sum: Vec<f32>,
    far_start: Vec<u32>,
    far: Vec<(u32, f32)>,
    /// Force of the shear matrix at rest, mN.
    base: Vec<V3>,
    tets: Vec<[u32; 4]>,
    mu: Vec<f32>,
    patch: Vec<[u32; 4]>,
    /// Six times the volume at rest, and the penalty over it, kPa/mm3.
    tet_rest: Vec<f32>,
    tet_penalty: Vec<f32>,
    patch_volume: Vec<f32>,
    /// Of each patch: what the sweeps carry of its volumetric stiffness, and what the pressure carries, kPa.
    patch_penalty: Vec<f32>,
    patch_bulk: Vec<f32>,
    /// Largest damping time of the regions, s.
    pub(crate) damping_s: f32,
}

/// Gradients at a vertex (mN) and the second derivative of both, the viscous one scaled by the damping (xx, yy, zz, xy,
/// xz, yz; mN/mm).
struct Local {
    elastic: V3,
    viscous: V3,
    hessian: [f32; 6],
}

/// What a substep needs beside the constants.
#[derive(Debug, Clone, Default)]
pub(crate) struct DescentScratch {
    /// Predicted position.
    target: Vec<V3>,
    /// Elements' own elastic force at the start of the substep, for damping.
    before: Vec<V3>,
    /// Correction of the shear force by averaging, constant during a substep.
    far: Vec<V3>,
    /// Pressure of each element apart from what its own change of volume adds, kPa.
    pressure: Vec<f32>,
    /// Six times the growth of each element.
    growth: Vec<f32>,
    /// Pressure of each patch, penalty included, kPa.
    total: Vec<f32>,
    /// Dilation of each patch.
    dilation: Vec<f32>,
    /// Couplings and springs on each vertex.
    touched: Vec<(u32, u32, f32)>,
    first_touch: Vec<u32>,
    spring: Vec<f32>,
}

/// Numbers of a substep.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Substep {
    pub(crate) dt: f32,
    pub(crate) iterations: u32,
    pub(crate) gravity: V3,
}

/// A state to be advanced.
pub(crate) struct Body<'a> {
    pub(crate) positions: &'a mut [[f32; 4]],
    pub(crate) velocities: &'a [[f32; 4]],
    pub(crate) pressure: &'a mut [f32],
    pub(crate) rest: &'a [[f32; 4]],
    pub(crate) mass: &'a [f32],
    pub(crate) tethers: &'a [Tether],
    pub(crate) couplings: &'a mut [Coupling],
}

impl Descent {
    pub(crate) fn new(elastic: &Elastic, rest: &[[f32; 4]], region: &[u8], regions: &[Region]) -> Self {
        let nodes = rest.len();
        let (star_start, stars) = stars(elastic, rest);
        let single = |v: &[f64]| v.iter().map(|&v| v as f32).collect::<Vec<f32>>();
        let rows = |r: &super::elastic::Rows| {
            (r.start.clone(), r.column.iter().zip(&r.weight).map(|(&c, &w)| (c, w as f32)).collect::<Vec<_>>())
        };
        let (near_start, near) = rows(&elastic.near);
        let (far_start, far) = rows(&elastic.far);
        let near_sum = (0..nodes).map(|i| -elastic.near.diagonal(i) as f32).collect();
        let base =
            (0..nodes).map(|i| base_force(&stars[star_start[i] as usize..star_start[i + 1] as usize], elastic, rest));
        let base = base.collect();
        let (order, colours) = colour(rest, &near_start, &near);
        let mut patch_penalty = vec![0.0; elastic.patch_volume.len()];
        for (t, corners) in elastic.patch.iter().enumerate() {
            corners.iter().for_each(|&p| {
                patch_penalty[p as usize] = (PENALTY * elastic.mu[t]).min(elastic.patch_bulk[p as usize]);
            });
        }
        let patch_bulk: Vec<f64> = elastic.patch_bulk.iter().zip(&patch_penalty).map(|(k, r)| k - r).collect();
        let tet_penalty = (0..elastic.tets.len())
            .map(|t| (patch_penalty[elastic.patch[t][0] as usize] / (6.0 * elastic.volume[t])) as f32)
            .collect();
        let damping_s = region.iter().map(|&r| regions[r as usize].material.damping_s as f32).fold(0.0, f32::max);
        let tet_rest = elastic.tets.iter().map(|t| crate::vec3::six_volume(t.map(|v| xyz(rest[v as usize])))).collect();
        Self {
            order,
            colours,
            star_start,
            stars,
            near_start,
            near,
            near_sum,
            far_start,
            far,
            base,
            tets: elastic.tets.clone(),
            mu: single(&elastic.mu),
            patch: elastic.patch.clone(),
            tet_rest,
            patch_volume: single(&elastic.patch_volume),
            tet_penalty,
            patch_penalty: single(&patch_penalty),
            patch_bulk: single(&patch_bulk),
            damping_s,
        }
    }

    /// Number of nodal pressures.
    pub(crate) fn patches(&self) -> usize {
        self.patch_volume.len()
    }

    /// Advances the positions by one substep; returns the largest motion of a vertex in the last sweep, mm.
    pub(crate) fn advance(&self, body: &mut Body<'_>, scratch: &mut DescentScratch, step: Substep) -> f32 {
        self.predict(body, scratch, step);
        let mut most = 0f32;
        for _ in 0..step.iterations {
            most = self.sweep(body, scratch, step);
            self.measure(body.positions, scratch);
            self.update_pressure(body.pressure, scratch);
            self.spread_pressure(body.pressure, scratch);
        }
        for c in body.couplings.iter_mut() {
            c.force = penalty_force(c, c.point(body.positions));
        }
        most
    }

    /// Inertial target, lagged terms and the lists of what acts on single vertices. Positions start at the target.
    fn predict(&self, body: &mut Body<'_>, scratch: &mut DescentScratch, step: Substep) {
        self.measure(body.positions, scratch);
        self.spread_pressure(body.pressure, scratch);
        self.average_shear(body, scratch);
        list_touches(body, scratch);
        let mut before = core::mem::take(&mut scratch.before);
        before.clear();
        if self.damping_ratio(step) > 0.0 {
            let all = 0..body.positions.len();
            before.extend(all.map(|i| self.local(i, body, scratch, 0.0).viscous));
        } else {
            before.resize(body.positions.len(), [0.0; 3]);
        }
        scratch.before = before;
        scratch.target.clear();
        for (p, v) in body.positions.iter_mut().zip(body.velocities) {
            let mut target = xyz(*p);
            if p[3] > 0.0 {
                for a in 0..3 {
                    // The sweeps start without the fall: at rest under a load they then have nothing to undo.
                    p[a] += step.dt * v[a];
                    target[a] = p[a] + step.dt * step.dt * step.gravity[a];
                }
            }
            scratch.target.push(target);
        }
        self.measure(body.positions, scratch);
        self.spread_pressure(body.pressure, scratch);
    }

    /// Damping time over time step. Implicit Euler damps like one time step by itself, and that is taken off.
    fn damping_ratio(&self, step: Substep) -> f32 {
        (self.damping_s / step.dt - 1.0).max(0.0)
    }

    /// What elasticity and viscosity say at a vertex. The viscous part takes the energy of the elements alone, without the
    /// pressures: those follow the positions with a delay, and their rate would be noise.
    #[inline(always)]
    fn local(&self, i: usize, body: &Body<'_>, scratch: &DescentScratch, damping: f32) -> Local {
        let p = xyz(body.positions[i]);
        let displaced = |n: usize| sub(xyz(body.positions[n]), xyz(body.rest[n]));
        let diagonal = -self.near_sum[i];
        let mut shear = axpy(scratch.far[i], diagonal, displaced(i));
        for &(n, w) in &self.near[self.near_start[i] as usize..self.near_start[i + 1] as usize] {
            shear = axpy(shear, w, displaced(n as usize));
        }
        let (mut elastic, mut viscous) = ([0.0; 3], [0.0; 3]);
        let stiff = diagonal * (1.0 + damping);
        let mut h = [stiff, stiff, stiff, 0.0, 0.0, 0.0];
        for s in &self.stars[self.star_start[i] as usize..self.star_start[i + 1] as usize] {
            let [a, b, c] = s.others.map(|n| xyz(body.positions[n as usize]));
            let n = scale(cross(sub(b, a), sub(c, a)), 1.0 / 6.0);
            let growth = dot(n, sub(p, a)) - s.volume;
            elastic = axpy(elastic, scratch.pressure[s.tet as usize] + (s.stiffness + s.penalty) * growth, n);
            viscous = axpy(viscous, s.stiffness * growth - s.mu, n);
            add_outer(&mut h, s.stiffness * (1.0 + damping) + s.penalty, n);
        }
        // At rest both sums are exactly minus the base: nothing moves.
        Local {
            elastic: add(shear, add(self.base[i], elastic)),
            viscous: add(shear, add(self.base[i], viscous)),
            hessian: h,
        }
    }

    /// One pass over all free vertices, colour by colour.
    fn sweep(&self, body: &mut Body<'_>, scratch: &DescentScratch, step: Substep) -> f32 {
        let inertia = 1.0 / (step.dt * step.dt);
        let damping = self.damping_ratio(step);
        let mut most = 0f32;
        for colour in self.colours.windows(2) {
            for &i in &self.order[colour[0] as usize..colour[1] as usize] {
                let i = i as usize;
                let Local { elastic, viscous, hessian: mut h } = self.local(i, body, scratch, damping);
                let mass = body.mass[i] * inertia;
                let offset = sub(xyz(body.positions[i]), scratch.target[i]);
                let mut g = axpy(elastic, damping, sub(viscous, scratch.before[i]));
                g = axpy(g, mass, offset);
                (0..3).for_each(|a| h[a] += mass);
                act(i, body, scratch, &mut g, &mut h);
                let d = solve(h, g);
                (0..3).for_each(|a| body.positions[i][a] -= d[a]);
                most = most.max(dot(d, d));
            }
        }
        most.sqrt()
    }

    /// Dilation of the patches at the current positions.
    fn measure(&self, positions: &[[f32; 4]], scratch: &mut DescentScratch) {
        scratch.dilation.clear();
        scratch.dilation.resize(self.patch_volume.len(), 0.0);
        scratch.growth.clear();
        for ((tet, patch), rest) in self.tets.iter().zip(&self.patch).zip(&self.tet_rest) {
            let grown = crate::vec3::six_volume(tet.map(|v| xyz(positions[v as usize]))) - rest;
            scratch.growth.push(grown);
            patch.iter().for_each(|&p| scratch.dilation[p as usize] += grown);
        }
        for (d, v) in scratch.dilation.iter_mut().zip(&self.patch_volume) {
            *d /= 24.0 * v;
        }
    }

    /// Multiplier update of the augmented Lagrangian: `p <- (p + r (J - 1)) / (1 + r / k)`, at rest in itself when
    /// `p = k (J - 1)`.
    fn update_pressure(&self, nodal: &mut [f32], scratch: &DescentScratch) {
        for (k, p) in nodal.iter_mut().enumerate() {
            let (step, bulk) = (self.patch_penalty[k], self.patch_bulk[k]);
            *p = if bulk > 0.0 { (*p + step * scratch.dilation[k]) * bulk / (bulk + step) } else { 0.0 };
        }
    }

    /// Pressure of each element: the mean of its patches, less what the element's own change since now will add again.
    fn spread_pressure(&self, nodal: &[f32], scratch: &mut DescentScratch) {
        scratch.total.clear();
        scratch.total.extend(nodal.iter().zip(&self.patch_penalty).zip(&scratch.dilation).map(|((p, r), d)| p + r * d));
        scratch.pressure.clear();
        let own = scratch.growth.iter().zip(&self.tet_penalty).map(|(g, r)| g * r);
        let total = &scratch.total;
        scratch.pressure.extend(
            self.patch
                .iter()
                .zip(&self.mu)
                .zip(own)
                .map(|((patch, mu), own)| 0.25 * patch.iter().map(|&p| total[p as usize]).sum::<f32>() - own - mu),
        );
    }

    /// The concave part of the shear energy, linearised at the start of the substep: a bound from above, so descent on it
    /// is descent on the energy.
    fn average_shear(&self, body: &Body<'_>, scratch: &mut DescentScratch) {
        scratch.far.clear();
        scratch.far.resize(body.positions.len(), [0.0; 3]);
        if self.far.is_empty() {
            return;
        }
        let displaced = |n: usize| sub(xyz(body.positions[n]), xyz(body.rest[n]));
        for i in 0..body.positions.len() {
            let own = displaced(i);
            let mut g = [0.0; 3];
            for &(n, w) in &self.far[self.far_start[i] as usize..self.far_start[i + 1] as usize] {
                g = axpy(g, w, sub(displaced(n as usize), own));
            }
            scratch.far[i] = g;
        }
    }
}

/// Adds what couplings and springs do to vertex `i`.
fn act(i: usize, body: &Body<'_>, scratch: &DescentScratch, g: &mut V3, h: &mut [f32; 6]) {
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
fn penalty_force(c: &Coupling, x: V3) -> V3 {
    match c.rule {
        Rule::Push { normal, bound } => scale(normal, c.stiffness * (bound - dot(normal, x)).max(0.0)),
        Rule::Hold { axis, target, limit } => {
            let pull = scale(sub(target, x), c.stiffness);
            let along = dot(pull, axis);
            axpy(pull, along.clamp(-limit, limit) - along, axis)
        }
    }
}

fn list_touches(body: &Body<'_>, scratch: &mut DescentScratch) {
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

/// Solves the symmetric positive definite 3x3 system `h d = g`.
fn solve([xx, yy, zz, xy, xz, yz]: [f32; 6], g: V3) -> V3 {
    let (cx, cy, cz) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
    let inverse = 1.0 / (xx * cx + xy * cy + xz * cz);
    let (dy, dz, e) = (xx * zz - xz * xz, xx * yy - xy * xy, xy * xz - xx * yz);
    [
        (cx * g[0] + cy * g[1] + cz * g[2]) * inverse,
        (cy * g[0] + dy * g[1] + e * g[2]) * inverse,
        (cz * g[0] + e * g[1] + dz * g[2]) * inverse,
    ]
}

/// The elements around each vertex.
fn stars(elastic: &Elastic, rest: &[[f32; 4]]) -> (Vec<u32>, Vec<Star>) {
    // The other three corners as seen from each corner of a positive tetrahedron.
    const OTHERS: [[usize; 3]; 4] = [[1, 3, 2], [0, 2, 3], [0, 3, 1], [0, 1, 2]];
    let mut all: Vec<(u32, Star)> = Vec::with_capacity(elastic.tets.len() * 4);
    for (t, tet) in elastic.tets.iter().enumerate() {
        for (corner, others) in OTHERS.iter().enumerate() {
            let others = others.map(|k| tet[k]);
            let [a, b, c] = others.map(|n| xyz(rest[n as usize]));
            let n = scale(cross(sub(b, a), sub(c, a)), 1.0 / 6.0);
            let volume = dot(n, sub(xyz(rest[tet[corner] as usize]), a));
            let penalty = (PENALTY * elastic.mu[t]).min(elastic.patch_bulk[elastic.patch[t][0] as usize]);
            let over = |k: f64| (k / elastic.volume[t]) as f32;
            let (stiffness, penalty, mu) = (over(elastic.bulk[t]), over(penalty), elastic.mu[t] as f32);
            all.push((tet[corner], Star { others, tet: t as u32, volume, stiffness, penalty, mu }));
        }
    }
    all.sort_by_key(|s| (s.0, s.1.tet));
    let mut start = vec![0u32; rest.len() + 1];
    all.iter().for_each(|s| start[s.0 as usize + 1] += 1);
    for i in 0..rest.len() {
        start[i + 1] += start[i];
    }
    (start, all.into_iter().map(|s| s.1).collect())
}

/// Force of the shear matrix at rest, by the arithmetic of the sweep: it then cancels exactly.
fn base_force(stars: &[Star], elastic: &Elastic, rest: &[[f32; 4]]) -> V3 {
    let sum = stars.iter().fold([0.0; 3], |g, s| {
        let [a, b, c] = s.others.map(|n| xyz(rest[n as usize]));
        axpy(g, -(elastic.mu[s.tet as usize] as f32), scale(cross(sub(b, a), sub(c, a)), 1.0 / 6.0))
    });
    scale(sum, -1.0)
}

/// Greedy colouring of the free vertices so that neighbours differ.
fn colour(rest: &[[f32; 4]], start: &[u32], near: &[(u32, f32)]) -> (Vec<u32>, Vec<u32>) {
    let mut colour = vec![u32::MAX; rest.len()];
    let mut groups: Vec<Vec<u32>> = Vec::new();
    for i in 0..rest.len() {
        if rest[i][3] == 0.0 {
            continue;
        }
        let row = &near[start[i] as usize..start[i + 1] as usize];
        let taken = |c: u32| row.iter().any(|&(n, _)| colour[n as usize] == c);
        let own = (0..).find(|&c| !taken(c)).unwrap_or(0);
        colour[i] = own;
        if groups.len() <= own as usize {
            groups.push(Vec::new());
        }
        groups[own as usize].push(i as u32);
    }
    let mut starts = vec![0];
    for g in &groups {
        starts.push(starts[starts.len() - 1] + g.len() as u32);
    }
    (groups.concat(), starts)
}
