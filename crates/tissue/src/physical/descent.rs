//! Vertex block descent with nodal pressures, in single precision.

use super::elastic::{Elastic, Rows};
use super::lanes::{self, Batch, Batches, Element, LANES, Lane, displacement, gather3};
use super::region::Active;
use super::touch::{act, list_touches, penalty_force};
use crate::contact::Coupling;
use crate::model::{Region, Tether};
use crate::simd;
use crate::vec3::{V3, six_volume, xyz};
use wide::f32x4;

/// Volumetric stiffness that the sweeps carry themselves, over the shear modulus; the rest is the pressure's.
const PENALTY: f64 = 2.0;

/// With a predicted space, one sweep in so many goes over the whole tissue.
const WHOLE_EVERY: u32 = 3;

/// Rows of a matrix in single precision: start of each row, then column and weight.
#[derive(Debug, Clone, Default)]
struct SingleRows {
    start: Vec<u32>,
    entries: Vec<(u32, f32)>,
}

/// Constants of the sweeps.
#[derive(Debug, Clone)]
pub(crate) struct Descent {
    pub(super) batches: Batches,
    near: SingleRows,
    /// Diagonal of the shear matrix, mN/mm.
    diagonal: Vec<f32>,
    far: SingleRows,
    /// Force of the shear matrix at rest, mN.
    base: Vec<[f32; 4]>,
    pub(super) tets: Vec<[u32; 4]>,
    /// Shear modulus, and volumetric stiffness and penalty over the volume, of each element.
    pub(super) elements: Vec<Element>,
    pub(super) patch: Vec<[u32; 4]>,
    /// Six times the volume at rest, and the penalty over it, kPa/mm3.
    pub(super) tet_rest: Vec<f32>,
    pub(super) tet_penalty: Vec<f32>,
    pub(super) patch_volume: Vec<f32>,
    /// Of each patch: what the sweeps carry of its volumetric stiffness over 24 times its volume, kPa/mm3, and the share
    /// `k / (k + r)` of the multiplier's step, 0 where the sweeps carry all.
    pub(super) patch_rate: Vec<f32>,
    pub(super) patch_share: Vec<f32>,
    /// Largest coordinate at rest, mm.
    reach: f32,
    /// Largest damping time of the regions, s.
    pub(crate) damping_s: f32,
}

/// What a substep needs beside the constants.
#[derive(Debug, Clone, Default)]
pub(crate) struct DescentScratch {
    /// Predicted position.
    target: Vec<[f32; 4]>,
    displacement: Vec<[f32; 4]>,
    /// Elements' own elastic force at the start of the substep, for damping.
    before: Vec<[f32; 4]>,
    /// Correction of the shear force by averaging, constant during a substep.
    far: Vec<[f32; 4]>,
    /// Square of each vertex's motion in the last sweep it had, mm2.
    pub(super) moved: Vec<f32>,
    active: Active,
    /// Elements with their current pressure.
    pub(super) elements: Vec<Element>,
    /// Six times the growth of each element.
    pub(super) growth: Vec<f32>,
    /// Pressure of each patch, penalty included, kPa.
    pub(super) total: Vec<f32>,
    /// Dilation of each patch.
    pub(super) dilation: Vec<f32>,
    /// Couplings and springs on each vertex.
    pub(super) touched: Vec<(u32, u32, f32)>,
    pub(super) first_touch: Vec<u32>,
    pub(super) spring: Vec<f32>,
}

/// Numbers of a substep.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Substep {
    pub(crate) dt: f32,
    pub(crate) iterations: u32,
    pub(crate) gravity: V3,
    pub(crate) predicted_space: bool,
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
        let single = |v: &[f64]| v.iter().map(|&v| v as f32).collect::<Vec<f32>>();
        let near = SingleRows::new(&elastic.near);
        let penalty = |t: usize| (PENALTY * elastic.mu[t]).min(elastic.patch_bulk[elastic.patch[t][0] as usize]);
        let elements = (0..elastic.tets.len()).map(|t| {
            let over = |k: f64| (k / elastic.volume[t]) as f32;
            [0.0, elastic.mu[t] as f32, over(elastic.bulk[t]), over(penalty(t))]
        });
        let mut patch_penalty = vec![0.0; elastic.patch_volume.len()];
        for (t, corners) in elastic.patch.iter().enumerate() {
            corners.iter().for_each(|&p| patch_penalty[p as usize] = penalty(t));
        }
        let rate: Vec<f64> = patch_penalty.iter().zip(&elastic.patch_volume).map(|(r, v)| r / (24.0 * v)).collect();
        // What is left for the multiplier is `k - r`, so its share is `(k - r) / k`.
        let share: Vec<f64> = elastic.patch_bulk.iter().zip(&patch_penalty).map(|(k, r)| (k - r) / k).collect();
        let tet_penalty = (0..elastic.tets.len()).map(|t| (penalty(t) / (6.0 * elastic.volume[t])) as f32);
        let groups = colour(rest, &near);
        let mut out = Self {
            batches: Batches::new(elastic, rest, groups),
            diagonal: (0..rest.len()).map(|i| elastic.near.diagonal(i) as f32).collect(),
            near,
            far: SingleRows::new(&elastic.far),
            base: vec![[0.0; 4]; rest.len()],
            tets: elastic.tets.clone(),
            elements: elements.collect(),
            patch: elastic.patch.clone(),
            tet_rest: elastic.tets.iter().map(|t| six_volume(t.map(|v| xyz(rest[v as usize])))).collect(),
            tet_penalty: tet_penalty.collect(),
            patch_volume: single(&elastic.patch_volume),
            patch_rate: single(&rate),
            patch_share: single(&share),
            reach: rest.iter().flat_map(|p| &p[..3]).fold(0f32, |m, v| m.max(v.abs())),
            damping_s: region.iter().map(|&r| regions[r as usize].material.damping_s as f32).fold(0.0, f32::max),
        };
        out.balance(rest);
        out
    }

    /// Sets the base so that it cancels the elements' push at rest to the last bit.
    fn balance(&mut self, rest: &[[f32; 4]]) {
        for batch in &self.batches.batches {
            let sums = self.batches.sums(batch, rest, &self.elements, 0.0);
            for (lane, &v) in batch.vertices[..batch.count as usize].iter().enumerate() {
                (0..3).for_each(|a| self.base[v as usize][a] = -sums.viscous[a][lane]);
            }
        }
    }

    /// Unknowns and elements of a sweep.
    pub(crate) fn counts(&self) -> Vec<(&'static str, usize)> {
        vec![
            ("elements", self.tets.len()),
            ("free_vertices", self.batches.batches.iter().map(|b| b.count as usize).sum()),
            ("pressures", self.patches()),
        ]
    }

    /// Number of nodal pressures.
    pub(crate) fn patches(&self) -> usize {
        self.patch_volume.len()
    }

    /// Advances the positions by one substep; returns the largest motion of a vertex in the last sweep, mm.
    pub(crate) fn advance(&self, body: &mut Body<'_>, scratch: &mut DescentScratch, step: Substep) -> f32 {
        let most = simd::widest(
            #[inline(always)]
            || self.relax(body, scratch, step),
        );
        for c in body.couplings.iter_mut() {
            c.force = penalty_force(c, c.point(body.positions));
        }
        most
    }

    #[inline(always)]
    fn relax(&self, body: &mut Body<'_>, scratch: &mut DescentScratch, step: Substep) -> f32 {
        self.predict(body, scratch, step);
        let mut active = core::mem::take(&mut scratch.active);
        active.nodes = body.positions.len();
        let mut most = 0f32;
        for k in 0..step.iterations {
            match k % WHOLE_EVERY {
                0 => self.whole(&mut active),
                1 if step.predicted_space => self.predict_space(&mut active, scratch, self.reach),
                _ => {}
            }
            most = self.sweep(body, scratch, &active, step);
            self.update(body.positions, body.pressure, &active, scratch);
        }
        scratch.active = active;
        most
    }

    /// Inertial target, lagged terms and the lists of what acts on single vertices.
    #[inline(always)]
    fn predict(&self, body: &mut Body<'_>, scratch: &mut DescentScratch, step: Substep) {
        scratch.elements.clone_from(&self.elements);
        list_touches(body, scratch);
        displace(body, scratch);
        self.average_shear(scratch);
        scratch.before.clear();
        scratch.before.resize(body.positions.len(), [0.0; 4]);
        if damping_ratio(self.damping_s, step.dt) > 0.0 {
            for batch in &self.batches.batches {
                let sums = self.batches.sums(batch, body.positions, &scratch.elements, 0.0);
                let shear = self.shear(batch, scratch);
                for (lane, &v) in batch.vertices[..batch.count as usize].iter().enumerate() {
                    (0..3).for_each(|a| scratch.before[v as usize][a] = shear[a][lane] + sums.viscous[a][lane]);
                }
            }
        }
        scratch.moved.resize(body.positions.len(), 0.0);
        scratch.target.clear();
        for (p, v) in body.positions.iter_mut().zip(body.velocities) {
            let mut target = *p;
            if p[3] > 0.0 {
                for a in 0..3 {
                    // The sweeps start without the fall: at rest under a load they then have nothing to undo.
                    p[a] += step.dt * v[a];
                    target[a] = p[a] + step.dt * step.dt * step.gravity[a];
                }
            }
            scratch.target.push(target);
        }
        displace(body, scratch);
        self.measure(body.positions, body.pressure, scratch);
    }

    /// Force of the shear matrix on eight vertices, mN, with what it is at rest.
    #[inline(always)]
    fn shear(&self, batch: &Batch, scratch: &DescentScratch) -> [Lane; 3] {
        let mut out = [[0f32; LANES]; 3];
        for (lane, &v) in batch.vertices[..batch.count as usize].iter().enumerate() {
            let v = v as usize;
            let mut g = f32x4::from(scratch.far[v]);
            g += f32x4::splat(self.diagonal[v]) * f32x4::from(scratch.displacement[v]);
            for &(n, w) in self.near.row(v) {
                g += f32x4::splat(w) * f32x4::from(scratch.displacement[n as usize]);
            }
            g += f32x4::from(self.base[v]);
            let g = g.to_array();
            for a in 0..3 {
                out[a][lane] = g[a];
            }
        }
        out
    }

    /// One pass over all free vertices, colour by colour; each goes to its own minimum.
    #[inline(always)]
    fn sweep(&self, body: &mut Body<'_>, scratch: &mut DescentScratch, active: &Active, step: Substep) -> f32 {
        let mut most = 0f32;
        for &b in &active.batches {
            let batch = &self.batches.batches[b as usize];
            let (g, h) = self.derivatives(batch, body, scratch, step);
            let d = lanes::solve(&h, &g);
            for (lane, &v) in batch.vertices[..batch.count as usize].iter().enumerate() {
                let p = &mut body.positions[v as usize];
                (0..3).for_each(|a| p[a] -= d[a][lane]);
                scratch.displacement[v as usize] = displacement(*p, body.rest[v as usize]);
                let moved = d[0][lane] * d[0][lane] + d[1][lane] * d[1][lane] + d[2][lane] * d[2][lane];
                scratch.moved[v as usize] = moved;
                most = most.max(moved);
            }
        }
        most.sqrt()
    }

    /// Gradient and second derivative of all that acts on the vertices of a batch. The viscous part takes the energy of the
    /// elements alone, without the pressures: those follow the positions with a delay, and their rate would be noise.
    #[inline(always)]
    fn derivatives(
        &self,
        batch: &Batch,
        body: &Body<'_>,
        scratch: &DescentScratch,
        step: Substep,
    ) -> ([Lane; 3], [Lane; 6]) {
        let damping = damping_ratio(self.damping_s, step.dt);
        let inertia = 1.0 / (step.dt * step.dt);
        let sums = self.batches.sums(batch, body.positions, &scratch.elements, damping);
        let shear = self.shear(batch, scratch);
        let (mut g, mut h) = ([[0f32; LANES]; 3], sums.hessian);
        let p = gather3(&batch.vertices, body.positions);
        let target = gather3(&batch.vertices, &scratch.target);
        let before = gather3(&batch.vertices, &scratch.before);
        for (lane, &v) in batch.vertices.iter().enumerate() {
            let mass = body.mass[v as usize] * inertia;
            let stiff = self.diagonal[v as usize] * (1.0 + damping) + mass;
            for a in 0..3 {
                let viscous = shear[a][lane] + sums.viscous[a][lane] - before[a][lane];
                g[a][lane] = shear[a][lane] + sums.elastic[a][lane] + damping * viscous;
                g[a][lane] += mass * (p[a][lane] - target[a][lane]);
                h[a][lane] += stiff;
            }
        }
        for (lane, &v) in batch.vertices[..batch.count as usize].iter().enumerate() {
            if scratch.touches(v) {
                let (mut gl, mut hl) = (g.map(|g| g[lane]), h.map(|h| h[lane]));
                act(v as usize, body, scratch, &mut gl, &mut hl);
                (0..3).for_each(|a| g[a][lane] = gl[a]);
                (0..6).for_each(|a| h[a][lane] = hl[a]);
            }
        }
        (g, h)
    }

    /// The concave part of the shear energy, linearised at the start of the substep: a bound from above, so descent on it
    /// is descent on the energy.
    #[inline(always)]
    fn average_shear(&self, scratch: &mut DescentScratch) {
        scratch.far.clear();
        scratch.far.resize(scratch.displacement.len(), [0.0; 4]);
        if self.far.entries.is_empty() {
            return;
        }
        for (i, far) in scratch.far.iter_mut().enumerate() {
            let own = f32x4::from(scratch.displacement[i]);
            let mut sum = f32x4::splat(0.0);
            for &(n, w) in self.far.row(i) {
                sum += f32x4::splat(w) * (f32x4::from(scratch.displacement[n as usize]) - own);
            }
            *far = sum.to_array();
        }
    }
}

impl DescentScratch {
    /// Vertices in the predicted space of the last substep, in whole batches.
    pub(crate) fn active_nodes(&self) -> usize {
        self.active.nodes
    }

    pub(super) fn touches(&self, v: u32) -> bool {
        let v = v as usize;
        self.first_touch[v] < self.first_touch[v + 1] || self.spring[v] > 0.0
    }
}

impl SingleRows {
    fn new(rows: &Rows) -> Self {
        let entries = rows.column.iter().zip(&rows.weight).map(|(&c, &w)| (c, w as f32)).collect();
        Self { start: rows.start.clone(), entries }
    }

    #[inline(always)]
    fn row(&self, i: usize) -> &[(u32, f32)] {
        &self.entries[self.start[i] as usize..self.start[i + 1] as usize]
    }
}

/// Damping time over time step. Implicit Euler damps like one time step by itself, and that is taken off.
fn damping_ratio(damping_s: f32, dt: f32) -> f32 {
    (damping_s / dt - 1.0).max(0.0)
}

fn displace(body: &Body<'_>, scratch: &mut DescentScratch) {
    scratch.displacement.clear();
    scratch.displacement.extend(body.positions.iter().zip(body.rest).map(|(p, r)| displacement(*p, *r)));
}

/// Greedy colouring of the free vertices so that neighbours differ.
fn colour(rest: &[[f32; 4]], near: &SingleRows) -> Vec<Vec<u32>> {
    let mut colour = vec![u32::MAX; rest.len()];
    let mut groups: Vec<Vec<u32>> = Vec::new();
    for i in 0..rest.len() {
        if rest[i][3] == 0.0 {
            continue;
        }
        let taken = |c: u32| near.row(i).iter().any(|&(n, _)| colour[n as usize] == c);
        let own = (0..).find(|&c| !taken(c)).unwrap_or(0);
        colour[i] = own;
        if groups.len() <= own as usize {
            groups.push(Vec::new());
        }
        groups[own as usize].push(i as u32);
    }
    groups
}
