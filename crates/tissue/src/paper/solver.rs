//! All constraints of a mesh, and one Gauss-Seidel iteration over them.

use super::constraints::{angle_with_gradients, dihedral, hetero, stretch, triangle, volume};
use super::global_volume::GlobalVolume;
use super::{per_iteration, project, surface};
use crate::membrane::{Membranes, OUTSIDE};
use crate::model::Region;
use crate::options::{DihedralScope, PaperOptions};
use crate::vec3::{V3, add, norm, scale, sub, xyz};

/// A constraint on `N` vertices with its rest value and its coefficient.
#[derive(Debug, Clone, Copy)]
struct Constraint<const N: usize> {
    nodes: [u32; N],
    rest: f32,
    coefficient: f32,
}

/// Springs of equation (11) in one element.
#[derive(Debug, Clone, Copy)]
struct Springs {
    nodes: [u32; 4],
    rest: [f32; 4],
    coefficient: f32,
}

/// The constraints of a mesh: constant.
#[derive(Debug, Clone)]
pub(crate) struct PaperModel {
    edges: Vec<Constraint<2>>,
    hinges: Vec<Constraint<4>>,
    strips: Vec<Constraint<3>>,
    volumes: Vec<Constraint<4>>,
    springs: Vec<Springs>,
    global: GlobalVolume,
    global_coefficient: f64,
    /// Share of the deforming motion lost per second.
    pub(crate) damping: f64,
}

/// Coefficients corrected for a number of iterations, and memory for the global volume.
#[derive(Debug, Clone, Default)]
pub(crate) struct PaperScratch {
    iterations: u32,
    edges: Vec<f32>,
    hinges: Vec<f32>,
    strips: Vec<f32>,
    volumes: Vec<f32>,
    springs: Vec<f32>,
    global: f32,
    gradients: Vec<V3>,
}

impl PaperModel {
    pub(crate) fn new(
        rest: &[[f32; 4]],
        tets: &[[u32; 4]],
        region: &[u8],
        regions: &[Region],
        membranes: &Membranes,
        options: &PaperOptions,
    ) -> Self {
        let of = |r: u8| regions[r as usize].material.paper;
        let corners = |t: &[u32; 4]| t.map(|v| xyz(rest[v as usize]));
        let volumes = tets.iter().zip(region).map(|(t, &r)| Constraint {
            nodes: *t,
            // By the same arithmetic as in the iteration: at rest the constraint is then exactly zero.
            rest: volume(corners(t), 0.0).0,
            coefficient: of(r).volume as f32,
        });
        let springs = tets.iter().zip(region).map(|(t, &r)| {
            let p = corners(t);
            let q = scale(add(add(p[0], p[1]), add(p[2], p[3])), 0.25);
            Springs { nodes: *t, rest: p.map(|v| norm(sub(v, q))), coefficient: of(r).hetero as f32 }
        });
        let strips = surface::strips(membranes, rest).into_iter().filter_map(|(nodes, r)| {
            let (rest, _) = triangle(nodes.map(|v| xyz(rest[v as usize])), 0.0)?;
            Some(Constraint { nodes, rest, coefficient: of(r).triangle as f32 })
        });
        let outer = membranes.faces.iter().filter(|m| m.outer == OUTSIDE).map(|m| m.nodes).collect();
        Self {
            edges: edges(rest, tets, region, regions),
            hinges: hinges(rest, tets, region, regions, membranes, options.dihedral),
            strips: strips.collect(),
            volumes: volumes.collect(),
            springs: springs.collect(),
            global: GlobalVolume::new(outer, rest),
            global_coefficient: options.global_volume,
            damping: options.damping,
        }
    }

    /// Prepares the coefficients for `iterations` per substep, equation (4).
    pub(crate) fn correct(&self, scratch: &mut PaperScratch, iterations: u32) {
        if scratch.iterations == iterations {
            return;
        }
        let corrected = |k: f32| per_iteration(k.into(), iterations);
        scratch.edges = self.edges.iter().map(|c| corrected(c.coefficient)).collect();
        scratch.hinges = self.hinges.iter().map(|c| corrected(c.coefficient)).collect();
        scratch.strips = self.strips.iter().map(|c| corrected(c.coefficient)).collect();
        scratch.volumes = self.volumes.iter().map(|c| corrected(c.coefficient)).collect();
        scratch.springs = self.springs.iter().map(|c| corrected(c.coefficient)).collect();
        scratch.global = per_iteration(self.global_coefficient, iterations);
        scratch.iterations = iterations;
    }

    /// One iteration over all constraints in Gauss-Seidel order; returns the largest motion of a vertex, mm.
    pub(crate) fn iterate(&self, positions: &mut [[f32; 4]], scratch: &mut PaperScratch) -> f32 {
        let mut most = 0f32;
        for (c, &k) in self.edges.iter().zip(&scratch.edges) {
            if let Some((value, g)) = stretch(c.nodes.map(|v| xyz(positions[v as usize])), c.rest) {
                most = most.max(project(positions, c.nodes, value, g, k));
            }
        }
        for (c, &k) in self.hinges.iter().zip(&scratch.hinges) {
            if let Some((value, g)) = dihedral(c.nodes.map(|v| xyz(positions[v as usize])), c.rest) {
                most = most.max(project(positions, c.nodes, value, g, k));
            }
        }
        for (c, &k) in self.strips.iter().zip(&scratch.strips) {
            if let Some((value, g)) = triangle(c.nodes.map(|v| xyz(positions[v as usize])), c.rest) {
                most = most.max(project(positions, c.nodes, value, g, k));
            }
        }
        for (c, &k) in self.springs.iter().zip(&scratch.springs) {
            let (value, g) = hetero(c.nodes.map(|v| xyz(positions[v as usize])), c.rest, [1.0; 4]);
            most = most.max(project(positions, c.nodes, value, g, k));
        }
        for (c, &k) in self.volumes.iter().zip(&scratch.volumes) {
            let (value, g) = volume(c.nodes.map(|v| xyz(positions[v as usize])), c.rest);
            most = most.max(project(positions, c.nodes, value, g, k));
        }
        self.global.project(positions, scratch.global, &mut scratch.gradients);
        most.sqrt()
    }
}

/// Distinct edges; the coefficient is the mean of the elements around.
fn edges(rest: &[[f32; 4]], tets: &[[u32; 4]], region: &[u8], regions: &[Region]) -> Vec<Constraint<2>> {
    const PAIRS: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
    let mut all: Vec<([u32; 2], u8)> = Vec::with_capacity(tets.len() * 6);
    for (t, &r) in tets.iter().zip(region) {
        all.extend(PAIRS.map(|[a, b]| ([t[a].min(t[b]), t[a].max(t[b])], r)));
    }
    all.sort_unstable();
    let mean = |c: &[([u32; 2], u8)]| {
        c.iter().map(|e| regions[e.1 as usize].material.paper.stretch).sum::<f64>() / c.len() as f64
    };
    all.chunk_by(|a, b| a.0 == b.0)
        .map(|c| {
            let [a, b] = c[0].0;
            let length = norm(sub(xyz(rest[a as usize]), xyz(rest[b as usize])));
            Constraint { nodes: [a, b], rest: length, coefficient: mean(c) as f32 }
        })
        .collect()
}

fn hinges(
    rest: &[[f32; 4]],
    tets: &[[u32; 4]],
    region: &[u8],
    regions: &[Region],
    membranes: &Membranes,
    scope: DihedralScope,
) -> Vec<Constraint<4>> {
    // The four corners of a tetrahedron, each of its edges first.
    const EDGES: [[usize; 4]; 6] = [[0, 1, 2, 3], [0, 2, 3, 1], [0, 3, 1, 2], [1, 2, 0, 3], [1, 3, 2, 0], [2, 3, 0, 1]];
    let mut all = surface::hinges(membranes);
    if scope == DihedralScope::Elements {
        all.extend(tets.iter().zip(region).flat_map(|(t, &r)| EDGES.map(|e| (e.map(|i| t[i]), r))));
    }
    let make = |(nodes, r): ([u32; 4], u8)| {
        let (rest, _) = angle_with_gradients(nodes.map(|v| xyz(rest[v as usize])))?;
        Some(Constraint { nodes, rest, coefficient: regions[r as usize].material.paper.dihedral as f32 })
    };
    all.into_iter().filter_map(make).collect()
}
