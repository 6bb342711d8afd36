//! All constraints of a mesh, and one Gauss-Seidel iteration over them.

use super::constraints::{angle_with_gradients, dihedral, stretch, triangle, volume};
use super::global_volume::GlobalVolume;
use super::lanes::{Edges, Tets};
use super::{per_iteration, project, surface};
use crate::membrane::{Membranes, OUTSIDE};
use crate::model::Region;
use crate::options::{DihedralScope, PaperOptions};
use crate::simd;
use crate::vec3::{V3, add, norm, scale, sub, xyz};

/// A constraint on `N` vertices with its rest value and its coefficient.
#[derive(Debug, Clone, Copy)]
struct Constraint<const N: usize> {
    nodes: [u32; N],
    rest: f32,
    coefficient: f32,
}

/// The constraints of a mesh: constant.
#[derive(Debug, Clone)]
pub(crate) struct PaperModel {
    edges: Edges,
    edge_coefficients: Vec<f32>,
    hinges: Vec<Constraint<4>>,
    strips: Vec<Constraint<3>>,
    tets: Tets,
    volume_coefficients: Vec<f32>,
    spring_coefficients: Vec<f32>,
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
        // By the same arithmetic as in the iteration: at rest the constraints are then exactly zero.
        let volumes: Vec<f32> = tets.iter().map(|t| volume(corners(t), 0.0).0).collect();
        let springs: Vec<[f32; 4]> = tets.iter().map(|t| centroid_distances(corners(t))).collect();
        let strips =
            surface::strips(membranes, rest).into_iter().filter(|s| of(s.1).triangle > 0.0).filter_map(|(nodes, r)| {
                let (rest, _) = triangle(nodes.map(|v| xyz(rest[v as usize])), 0.0)?;
                Some(Constraint { nodes, rest, coefficient: of(r).triangle as f32 })
            });
        let outer = membranes.faces.iter().filter(|m| m.outer == OUTSIDE).map(|m| m.nodes).collect();
        let edges = edges(rest, tets, region, regions);
        let ends: Vec<[u32; 2]> = edges.iter().map(|e| e.nodes).collect();
        let lengths: Vec<f32> = edges.iter().map(|e| e.rest).collect();
        Self {
            edges: Edges::new(&ends, &lengths),
            edge_coefficients: edges.iter().map(|e| e.coefficient).collect(),
            hinges: hinges(rest, tets, region, regions, membranes, options.dihedral),
            strips: strips.collect(),
            tets: Tets::new(tets, &springs, &volumes),
            volume_coefficients: region.iter().map(|&r| of(r).volume as f32).collect(),
            spring_coefficients: region.iter().map(|&r| of(r).hetero as f32).collect(),
            global: GlobalVolume::new(outer, rest),
            global_coefficient: options.global_volume,
            damping: options.damping,
        }
    }

    /// Constraints of each kind.
    pub(crate) fn counts(&self) -> Vec<(&'static str, usize)> {
        let acting = |k: &[f32]| k.iter().filter(|k| **k > 0.0).count();
        vec![
            ("edges", acting(&self.edge_coefficients)),
            ("volumes", acting(&self.volume_coefficients)),
            ("springs", acting(&self.spring_coefficients)),
            ("dihedral_angles", self.hinges.len()),
            ("triangles", self.strips.len()),
            ("global_volume", usize::from(self.global_coefficient > 0.0)),
        ]
    }

    /// Prepares the coefficients for `iterations` per substep, equation (4).
    pub(crate) fn correct(&self, scratch: &mut PaperScratch, iterations: u32) {
        if scratch.iterations == iterations {
            return;
        }
        let corrected = |k: f32| per_iteration(k.into(), iterations);
        scratch.edges = self.edge_coefficients.iter().map(|&k| corrected(k)).collect();
        scratch.hinges = self.hinges.iter().map(|c| corrected(c.coefficient)).collect();
        scratch.strips = self.strips.iter().map(|c| corrected(c.coefficient)).collect();
        scratch.volumes = self.volume_coefficients.iter().map(|&k| corrected(k)).collect();
        scratch.springs = self.spring_coefficients.iter().map(|&k| corrected(k)).collect();
        scratch.global = per_iteration(self.global_coefficient, iterations);
        scratch.iterations = iterations;
    }

    /// One iteration over all constraints in Gauss-Seidel order; returns the largest motion of a vertex, mm.
    pub(crate) fn iterate(&self, positions: &mut [[f32; 4]], scratch: &mut PaperScratch) -> f32 {
        let mut most = simd::widest(
            #[inline(always)]
            || self.edges.project(positions, &scratch.edges),
        );
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
        let inside = simd::widest(
            #[inline(always)]
            || self.tets.project(positions, &scratch.springs, &scratch.volumes),
        );
        self.global.project(positions, scratch.global, &mut scratch.gradients);
        most.max(inside).sqrt()
    }
}

/// Distance of each corner from the centroid, by the arithmetic of the iteration.
fn centroid_distances(p: [V3; 4]) -> [f32; 4] {
    let q = scale(add(add(p[0], p[1]), add(p[2], p[3])), 0.25);
    p.map(|v| norm(sub(v, q)))
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
            // Validation has made sure that no two vertices coincide.
            let length = stretch([xyz(rest[a as usize]), xyz(rest[b as usize])], 0.0).map_or(0.0, |c| c.0);
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
    let acts = |r: u8| regions[r as usize].material.paper.dihedral > 0.0;
    let make = |(nodes, r): ([u32; 4], u8)| {
        let (rest, _) = angle_with_gradients(nodes.map(|v| xyz(rest[v as usize])))?;
        Some(Constraint { nodes, rest, coefficient: regions[r as usize].material.paper.dihedral as f32 })
    };
    all.into_iter().filter(|h| acts(h.1)).filter_map(make).collect()
}
