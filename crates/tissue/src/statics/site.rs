//! Points of the outer surface at which it meets spheres: its vertices, and the middles of its faces.

use crate::Model;
use crate::membrane::OUTSIDE;
use crate::physical::elastic::Elastic;
use monro_geometry::d3::{D3, norm};

/// Penalty over Young's modulus, per length of an edge.
const PENALTY: f64 = 10.0;

/// Radius of the sphere that the middle of a face meets, over the true one: flat faces between vertices on the sphere reach
/// in by less.
const GUARD: f64 = 0.95;

/// Where the free components are no more than this share of a normal, nothing can give way along it.
const FIRM: f64 = 0.1;

/// What holds the components of a node; `None` is free.
pub(super) type Hold = [Option<f64>; 3];

/// A point of the outer surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Site {
    /// The vertex, or those of the face, and how much each has of the point.
    pub(super) nodes: [u32; 3],
    pub(super) share: [f64; 3],
    /// Radius of the sphere that it meets, over the true one: 1 for a vertex.
    pub(super) reach: f64,
    /// Area around it at rest, mm2.
    pub(super) area: f64,
    /// Penalty, kPa/mm.
    pub(super) penalty: f64,
    /// Which components nothing holds.
    free: [bool; 3],
}

impl Site {
    /// The site's value of what each node has.
    pub(super) fn at(&self, of: &[D3]) -> D3 {
        core::array::from_fn(|a| self.weights().map(|(n, w)| w * of[n][a]).sum())
    }

    /// Nodes and how much of the site each is.
    pub(super) fn weights(&self) -> impl Iterator<Item = (usize, f64)> + use<> {
        let several = if self.reach == 1.0 { 1 } else { 3 };
        self.nodes.into_iter().map(|n| n as usize).zip(self.share).take(several)
    }

    /// Adds a force at the site to its nodes.
    pub(super) fn scatter(&self, force: D3, out: &mut [D3]) {
        for (n, w) in self.weights() {
            (0..3).for_each(|a| out[n][a] += w * force[a]);
        }
    }

    /// Whether nothing of it is free.
    pub(super) fn held(&self) -> bool {
        self.free == [false; 3]
    }

    /// Whether supports or rods keep the site from giving way along a normal.
    pub(super) fn firm(&self, normal: D3) -> bool {
        let free: f64 = (0..3).filter(|&a| self.free[a]).map(|a| normal[a] * normal[a]).sum();
        free < FIRM * FIRM
    }
}

/// All points of a model's outer surface.
pub(super) fn all(model: &Model, elastic: &Elastic, support: &[Hold]) -> Vec<Site> {
    let (mut area, mut young) = (vec![0.0; elastic.rest.len()], vec![0.0f64; elastic.rest.len()]);
    let free = |n: u32| support[n as usize].map(|s| s.is_none());
    let mut middles = Vec::new();
    for face in model.membranes.faces.iter().filter(|m| m.outer == OUTSIDE) {
        let [a, b, c] = face.nodes.map(|n| elastic.rest[n as usize]);
        let size = super::loads::area([a, b, c]);
        let size = norm(size);
        let modulus = model.regions[face.inner as usize].material.young_kpa;
        for &n in &face.nodes {
            area[n as usize] += size / 3.0;
            young[n as usize] = young[n as usize].max(modulus);
        }
        let any = core::array::from_fn(|a| face.nodes.iter().any(|&n| free(n)[a]));
        let penalty = PENALTY * modulus / size.sqrt().max(f64::MIN_POSITIVE);
        middles.push(Site { nodes: face.nodes, share: [1.0 / 3.0; 3], reach: GUARD, area: size, penalty, free: any });
    }
    let vertex = |n: usize| {
        let node = n as u32;
        let penalty = PENALTY * young[n] / area[n].sqrt();
        Site { nodes: [node; 3], share: [1.0, 0.0, 0.0], reach: 1.0, area: area[n], penalty, free: free(node) }
    };
    (0..area.len()).filter(|&n| area[n] > 0.0).map(vertex).chain(middles).collect()
}
