//! Eight vertices at a time: the gradient and the second derivative that a sweep needs.
//!
//! A batch holds up to eight vertices of one colour and, record by record, one element around each of them. Everything is
//! written as loops over eight lanes of plain arrays; the compiler makes vector instructions of whatever width it may use
//! (see `simd`). Each lane does the same operations in the same order whatever the width, so the bits never change.

use super::elastic::Elastic;
use crate::vec3::{V3, xyz};

pub(crate) const LANES: usize = 8;
pub(crate) type Lane = [f32; LANES];

/// Vertices are put into batches only with vertices as near as this in the model's order, so that a batch has a place.
const NEIGHBOURHOOD: usize = 32;

/// One element around each of eight vertices.
#[derive(Debug, Clone, Copy)]
struct Record {
    /// The other three vertices, so that `(b - a) x (c - a)` is six times the gradient of the volume. An empty place
    /// repeats the vertex itself: its gradient is zero.
    others: [[u32; LANES]; 3],
    tet: [u32; LANES],
    /// Volume at rest by the arithmetic of the sweep: at rest the growth is then exactly zero.
    volume: Lane,
}

/// Up to eight vertices of one colour.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Batch {
    pub(crate) vertices: [u32; LANES],
    pub(crate) count: u8,
    first: u32,
    last: u32,
}

/// All batches, colour by colour.
#[derive(Debug, Clone, Default)]
pub(crate) struct Batches {
    pub(crate) batches: Vec<Batch>,
    records: Vec<Record>,
}

/// What the elements around eight vertices say: sums of pressure times area, elastic and viscous, and the second
/// derivative of both, the viscous one scaled by the damping (xx, yy, zz, xy, xz, yz).
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Sums {
    pub(crate) elastic: [Lane; 3],
    pub(crate) viscous: [Lane; 3],
    pub(crate) hessian: [Lane; 6],
}

/// What changes from sweep to sweep in an element: its pressure without its own growth, shear modulus (kPa), volumetric
/// stiffness and penalty over its volume (kPa/mm3).
pub(crate) type Element = [f32; 4];

impl Batches {
    /// `groups` are vertices of one colour each.
    pub(crate) fn new(elastic: &Elastic, rest: &[[f32; 4]], groups: Vec<Vec<u32>>) -> Self {
        let around = around(elastic, rest.len());
        let mut out = Self::default();
        for mut group in groups {
            for near in group.chunks_mut(NEIGHBOURHOOD) {
                // Vertices with as many elements side by side leave few empty places.
                near.sort_by_key(|&v| (around[v as usize].len(), v));
                for chunk in near.chunks(LANES) {
                    out.push(chunk, &around, rest);
                }
            }
        }
        out
    }

    fn push(&mut self, chunk: &[u32], around: &[Vec<(u32, [u32; 3])>], rest: &[[f32; 4]]) {
        let mut vertices = [chunk[0]; LANES];
        vertices[..chunk.len()].copy_from_slice(chunk);
        let first = self.records.len() as u32;
        let most = chunk.iter().map(|&v| around[v as usize].len()).max().unwrap_or(0);
        for k in 0..most {
            let mut record = Record { others: [vertices; 3], tet: [0; LANES], volume: [0.0; LANES] };
            for (lane, &v) in chunk.iter().enumerate() {
                if let Some(&(tet, others)) = around[v as usize].get(k) {
                    (0..3).for_each(|i| record.others[i][lane] = others[i]);
                    record.tet[lane] = tet;
                }
            }
            self.records.push(record);
        }
        let last = self.records.len() as u32;
        let batch = Batch { vertices, count: chunk.len() as u8, first, last };
        self.batches.push(batch);
        // The volumes at rest come from the sweep's own arithmetic.
        for r in first as usize..last as usize {
            let (volume, _) = self.records[r].volume_and_area(&gather3(&vertices, rest), rest);
            self.records[r].volume = volume;
        }
    }

    /// Calls `found` with each element around the vertices of a batch.
    pub(crate) fn elements(&self, batch: &Batch, mut found: impl FnMut(u32)) {
        for record in &self.records[batch.first as usize..batch.last as usize] {
            for lane in 0..batch.count as usize {
                // An empty place repeats its own vertex.
                if record.others[0][lane] != batch.vertices[lane] {
                    found(record.tet[lane]);
                }
            }
        }
    }

    /// Sums over the elements around the vertices of a batch.
    #[inline(always)]
    pub(crate) fn sums(&self, batch: &Batch, positions: &[[f32; 4]], elements: &[Element], damping: f32) -> Sums {
        let p = gather3(&batch.vertices, positions);
        let mut s = Sums::default();
        for record in &self.records[batch.first as usize..batch.last as usize] {
            let (volume, n) = record.volume_and_area(&p, positions);
            let mut e = [[0f32; LANES]; 4];
            for l in 0..LANES {
                let element = elements[record.tet[l] as usize];
                for k in 0..4 {
                    e[k][l] = element[k];
                }
            }
            let [pressure, mu, stiffness, penalty] = e;
            for l in 0..LANES {
                let growth = volume[l] - record.volume[l];
                let elastic = pressure[l] + (stiffness[l] + penalty[l]) * growth;
                let viscous = stiffness[l] * growth - mu[l];
                let second = stiffness[l] * (1.0 + damping) + penalty[l];
                let (x, y, z) = (n[0][l], n[1][l], n[2][l]);
                let (sx, sy, sz) = (second * x, second * y, second * z);
                s.elastic[0][l] += elastic * x;
                s.elastic[1][l] += elastic * y;
                s.elastic[2][l] += elastic * z;
                s.viscous[0][l] += viscous * x;
                s.viscous[1][l] += viscous * y;
                s.viscous[2][l] += viscous * z;
                s.hessian[0][l] += sx * x;
                s.hessian[1][l] += sy * y;
                s.hessian[2][l] += sz * z;
                s.hessian[3][l] += sx * y;
                s.hessian[4][l] += sx * z;
                s.hessian[5][l] += sy * z;
            }
        }
        s
    }
}

impl Record {
    /// Volume of each element and its gradient by the vertex of its lane.
    #[inline(always)]
    fn volume_and_area(&self, p: &[Lane; 3], positions: &[[f32; 4]]) -> (Lane, [Lane; 3]) {
        let [a, b, c] = [0, 1, 2].map(|i| gather3(&self.others[i], positions));
        let (mut volume, mut n) = ([0f32; LANES], [[0f32; LANES]; 3]);
        for l in 0..LANES {
            let (ux, uy, uz) = (b[0][l] - a[0][l], b[1][l] - a[1][l], b[2][l] - a[2][l]);
            let (vx, vy, vz) = (c[0][l] - a[0][l], c[1][l] - a[1][l], c[2][l] - a[2][l]);
            let nx = (uy * vz - uz * vy) * (1.0 / 6.0);
            let ny = (uz * vx - ux * vz) * (1.0 / 6.0);
            let nz = (ux * vy - uy * vx) * (1.0 / 6.0);
            volume[l] = nx * (p[0][l] - a[0][l]) + ny * (p[1][l] - a[1][l]) + nz * (p[2][l] - a[2][l]);
            (n[0][l], n[1][l], n[2][l]) = (nx, ny, nz);
        }
        (volume, n)
    }
}

/// The coordinates of eight vertices, by axis.
#[inline(always)]
pub(crate) fn gather3(vertices: &[u32; LANES], from: &[[f32; 4]]) -> [Lane; 3] {
    let mut out = [[0f32; LANES]; 3];
    for l in 0..LANES {
        let p = from[vertices[l] as usize];
        out[0][l] = p[0];
        out[1][l] = p[1];
        out[2][l] = p[2];
    }
    out
}

/// The elements around each vertex with their other three corners, in order.
fn around(elastic: &Elastic, nodes: usize) -> Vec<Vec<(u32, [u32; 3])>> {
    // The other three corners as seen from each corner of a positive tetrahedron.
    const OTHERS: [[usize; 3]; 4] = [[1, 3, 2], [0, 2, 3], [0, 3, 1], [0, 1, 2]];
    let mut out = vec![Vec::new(); nodes];
    for (t, tet) in elastic.tets.iter().enumerate() {
        for (corner, others) in OTHERS.iter().enumerate() {
            out[tet[corner] as usize].push((t as u32, others.map(|k| tet[k])));
        }
    }
    out
}

/// Solves eight symmetric positive definite 3x3 systems `h d = g`.
#[inline(always)]
pub(crate) fn solve(h: &[Lane; 6], g: &[Lane; 3]) -> [Lane; 3] {
    let mut d = [[0f32; LANES]; 3];
    for l in 0..LANES {
        let (xx, yy, zz, xy, xz, yz) = (h[0][l], h[1][l], h[2][l], h[3][l], h[4][l], h[5][l]);
        let (cx, cy, cz) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
        let inverse = 1.0 / (xx * cx + xy * cy + xz * cz);
        let (dy, dz, e) = (xx * zz - xz * xz, xx * yy - xy * xy, xy * xz - xx * yz);
        d[0][l] = (cx * g[0][l] + cy * g[1][l] + cz * g[2][l]) * inverse;
        d[1][l] = (cy * g[0][l] + dy * g[1][l] + e * g[2][l]) * inverse;
        d[2][l] = (cz * g[0][l] + e * g[1][l] + dz * g[2][l]) * inverse;
    }
    d
}

/// Displacement of a vertex.
#[inline(always)]
pub(crate) fn displacement(p: [f32; 4], rest: [f32; 4]) -> [f32; 4] {
    let d: V3 = crate::vec3::sub(xyz(p), xyz(rest));
    [d[0], d[1], d[2], 0.0]
}
