//! Equation (9): the volume enclosed by the whole surface. The paper's sum lacks the factor 1/6.

use crate::bytes;
use crate::vec3::{V3, cross, dot, scale, shift, sub, xyz};

/// The closed outer surface and its enclosed volume at rest.
#[derive(Debug, Clone, Default)]
pub(crate) struct GlobalVolume {
    triangles: Vec<[u32; 3]>,
    /// Vertices of the surface, sorted.
    nodes: Vec<u32>,
    /// For each triangle, the places of its vertices in `nodes`.
    slots: Vec<[u32; 3]>,
    rest: f64,
}

impl GlobalVolume {
    /// Bytes that it takes.
    pub(crate) fn bytes(&self) -> usize {
        bytes::of(&self.triangles) + bytes::of(&self.nodes) + bytes::of(&self.slots)
    }

    /// From outward triangles.
    pub(crate) fn new(triangles: Vec<[u32; 3]>, rest: &[[f32; 4]]) -> Self {
        let mut nodes: Vec<u32> = triangles.iter().flatten().copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        let slot = |v: u32| nodes.partition_point(|&n| n < v) as u32;
        let slots = triangles.iter().map(|t| t.map(slot)).collect();
        let mut out = Self { triangles, nodes, slots, rest: 0.0 };
        let mut gradients = Vec::new();
        out.rest = out.value(rest, &mut gradients);
        out
    }

    /// Volume minus that at rest; fills one gradient per vertex of the surface.
    fn value(&self, positions: &[[f32; 4]], gradients: &mut Vec<V3>) -> f64 {
        gradients.clear();
        gradients.resize(self.nodes.len(), [0.0; 3]);
        // Any reference point gives the same volume of a closed surface; a near one loses no digits.
        let base = self.triangles.first().map_or([0.0; 3], |t| xyz(positions[t[0] as usize]));
        let mut six = 0f64;
        for (t, slots) in self.triangles.iter().zip(&self.slots) {
            let p = t.map(|v| sub(xyz(positions[v as usize]), base));
            six += f64::from(dot(cross(p[0], p[1]), p[2]));
            for i in 0..3 {
                let g = cross(p[(i + 1) % 3], p[(i + 2) % 3]);
                let sum = &mut gradients[slots[i] as usize];
                *sum = crate::vec3::axpy(*sum, 1.0 / 6.0, g);
            }
        }
        six / 6.0 - self.rest
    }

    /// Satisfies the share `k` of the constraint.
    pub(crate) fn project(&self, positions: &mut [[f32; 4]], k: f32, gradients: &mut Vec<V3>) {
        let value = self.value(positions, gradients) as f32;
        let weight: f32 =
            self.nodes.iter().zip(&*gradients).map(|(&n, g)| positions[n as usize][3] * dot(*g, *g)).sum();
        let s = -k * value / weight;
        if !s.is_finite() {
            return;
        }
        for (&n, g) in self.nodes.iter().zip(&*gradients) {
            let p = &mut positions[n as usize];
            shift(p, 1.0, scale(*g, s * p[3]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::block;

    fn surface() -> (GlobalVolume, Vec<[f32; 4]>) {
        let mesh = block([2, 2, 2], 1.0);
        let p: Vec<[f32; 4]> = mesh.vertices.iter().map(|v| [v.x as f32, v.y as f32, v.z as f32, 1.0]).collect();
        (GlobalVolume::new(mesh.boundary(|_| true), &p), p)
    }

    #[test]
    fn the_volume_is_that_of_the_block_with_the_factor_of_one_sixth() {
        let (g, p) = surface();
        assert!((g.rest - 8.0).abs() < 1e-5);
        let grown: Vec<[f32; 4]> = p.iter().map(|q| [2.0 * q[0], q[1] + 5.0, q[2], 1.0]).collect();
        assert!((g.value(&grown, &mut Vec::new()) - 8.0).abs() < 1e-4);
    }

    #[test]
    fn the_gradient_agrees_with_finite_differences_and_projection_restores_the_volume() {
        let (g, mut p) = surface();
        p[0][0] -= 0.3;
        p[7][2] += 0.2;
        let mut gradients = Vec::new();
        g.value(&p, &mut gradients);
        for (i, &n) in g.nodes.iter().enumerate() {
            for a in 0..3 {
                let at = |h: f32| {
                    let mut q = p.clone();
                    q[n as usize][a] += h;
                    g.value(&q, &mut Vec::new())
                };
                let slope = (at(0.01) - at(-0.01)) / 0.02;
                assert!((slope - f64::from(gradients[i][a])).abs() < 1e-3);
            }
        }
        for _ in 0..5 {
            g.project(&mut p, 1.0, &mut gradients);
        }
        assert!(g.value(&p, &mut gradients).abs() < 1e-4);
    }
}
