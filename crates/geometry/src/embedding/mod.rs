//! Binding of surface points to tetrahedra (the hybrid model).

mod binder;
mod locator;
mod overlap;

pub use binder::{Binder, BoundChunk};
pub use locator::{Located, NearestFace, TetLocator};
pub use overlap::Overlap;

use crate::d3::{cross, dot, norm, sub};
use crate::{Patient, Point, TetMesh, TetMeshError};
use thiserror::Error;

/// Linear extrapolation out of an element is used while no barycentric weight falls below this: the point then moves
/// with the element as a whole, and can stray from it by no more than this fraction of its height.
const LINEAR: f64 = -0.3;

/// Why points could not be bound.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum EmbeddingError {
    /// The mesh has no element.
    #[error("cannot bind {points} points to a mesh without elements")]
    NoElements {
        /// Points given.
        points: usize,
    },
    /// The mesh is broken.
    #[error(transparent)]
    Mesh(#[from] TetMeshError),
    /// A point is not finite.
    #[error("point {0} has a coordinate that is not finite")]
    NotFinite(usize),
}

/// Four nodes and their weights.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Binding {
    nodes: [u32; 4],
    weights: [f32; 4],
}

impl Binding {
    fn new(nodes: [u32; 4], weights: [f64; 4]) -> Self {
        Self { nodes, weights: weights.map(|w| w as f32) }
    }
}

/// A point too far outside to be extrapolated: it rides on a boundary face, at a fixed offset in the face's own frame.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Rider {
    point: u32,
    face: [u32; 3],
    offset: [f32; 3],
}

/// Points bound to the elements of a mesh, to be moved with its nodes.
///
/// A point inside an element, or just outside of the mesh, is a weighted sum of four nodes. A point further out keeps
/// its place in the orthonormal frame of the nearest boundary face: it can turn with the face but never be flung away by
/// a squeezed element.
///
/// ```
/// use monro_geometry::{Embedding, Point, TetMesh};
///
/// let vertices = [[0.0, 0.0, 0.0], [8.0, 0.0, 0.0], [0.0, 8.0, 0.0], [0.0, 0.0, 8.0]].map(Point::from_array).to_vec();
/// let mesh = TetMesh { vertices, tets: vec![[0, 1, 2, 3]], labels: vec![4] };
/// let surface = [Point::new(1.0, 2.0, 1.0), Point::new(2.0, 1.0, 3.0)];
/// let bound = Embedding::new(&mesh, &surface)?;
///
/// // The nodes in their order, moved: here all heights are doubled.
/// let nodes: Vec<[f32; 4]> =
///     mesh.vertices.iter().map(|p| [p.x as f32, p.y as f32, 2.0 * p.z as f32, 0.0]).collect();
/// let mut moved = vec![[0.0; 4]; bound.points()];
/// bound.apply(&nodes, &mut moved);
/// assert!((moved[1][2] - 6.0).abs() < 1e-5);
/// # Ok::<(), monro_geometry::EmbeddingError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Embedding {
    bindings: Vec<Binding>,
    riders: Vec<Rider>,
    nodes: usize,
    outside: usize,
    farthest: f64,
}

impl Embedding {
    /// Binds `points` (patient mm, as the mesh at rest). Points in a coherent order, as on a surface, are found fastest.
    ///
    /// # Errors
    /// An empty or broken mesh, a non-finite point.
    pub fn new(tets: &TetMesh, points: &[Point<Patient>]) -> Result<Self, EmbeddingError> {
        if tets.tets.is_empty() {
            return Err(EmbeddingError::NoElements { points: points.len() });
        }
        Self::with_locator(&TetLocator::new(tets)?, tets, points)
    }

    /// As [`Embedding::new`] with the mesh's locator at hand.
    ///
    /// # Errors
    /// A non-finite point.
    pub fn with_locator(
        locator: &TetLocator,
        tets: &TetMesh,
        points: &[Point<Patient>],
    ) -> Result<Self, EmbeddingError> {
        let binder = Binder::new(locator, tets, points)?;
        let chunks = (0..binder.chunks()).map(|c| binder.bind(c)).collect::<Result<_, _>>()?;
        Ok(binder.join(chunks))
    }

    /// Number of bound points.
    pub const fn points(&self) -> usize {
        self.bindings.len()
    }

    /// The four nodes and weights of a point, for who moves points elsewhere (a GPU). For a point that rides on a face
    /// they are those of the nearest place of the mesh: they give its displacement, but for the turn of the face.
    ///
    /// # Panics
    /// When there is no such point.
    pub fn binding(&self, point: usize) -> ([u32; 4], [f32; 4]) {
        let b = self.bindings[point];
        (b.nodes, b.weights)
    }

    /// Number of nodes the mesh must have.
    pub const fn nodes(&self) -> usize {
        self.nodes
    }

    /// Points that lay outside the mesh.
    pub const fn outside(&self) -> usize {
        self.outside
    }

    /// Largest distance of a bound point from the mesh, mm; 0 when all lie inside.
    pub const fn max_extrapolation(&self) -> f64 {
        self.farthest
    }

    /// Positions of all points for the given nodes (`[x, y, z, unused]`, any frame and unit shared by all nodes). No
    /// allocation. The fourth lane of `out` is the weighted sum of the nodes' fourth lanes.
    ///
    /// # Panics
    /// When `nodes` is shorter than the mesh's vertices or `out` longer than the points.
    pub fn apply(&self, nodes: &[[f32; 4]], out: &mut [[f32; 4]]) {
        self.apply_from(0, nodes, out);
    }

    /// As [`Embedding::apply`] for the points `first..first + out.len()`, so that threads can share the work.
    ///
    /// # Panics
    /// As [`Embedding::apply`].
    pub fn apply_from(&self, first: usize, nodes: &[[f32; 4]], out: &mut [[f32; 4]]) {
        let nodes = &nodes[..self.nodes];
        let bindings = &self.bindings[first..first + out.len()];
        for (o, b) in out.iter_mut().zip(bindings) {
            let [p, q, r, s] = b.nodes.map(|n| nodes[n as usize]);
            let w = b.weights;
            *o = core::array::from_fn(|a| (w[0] * p[a] + w[1] * q[a]) + (w[2] * r[a] + w[3] * s[a]));
        }
        let end = first + out.len();
        let start = self.riders.partition_point(|r| (r.point as usize) < first);
        for r in self.riders[start..].iter().take_while(|r| (r.point as usize) < end) {
            let at = r.face.map(|n| {
                let p = nodes[n as usize];
                [f64::from(p[0]), f64::from(p[1]), f64::from(p[2])]
            });
            // A face squeezed to a line has no frame; the point then stays on it.
            if let Some(frame) = face_frame(at) {
                let o = &mut out[r.point as usize - first];
                for a in 0..3 {
                    let d: f64 = (0..3).map(|i| frame[i][a] * f64::from(r.offset[i])).sum();
                    o[a] += d as f32;
                }
            }
        }
    }
}

fn unit(a: [f64; 3]) -> Option<[f64; 3]> {
    let n = norm(a);
    (n > 1e-30).then(|| a.map(|x| x / n))
}

/// Orthonormal axes of a triangle: along its first edge, in its plane, along its normal.
fn face_frame([a, b, c]: [[f64; 3]; 3]) -> Option<[[f64; 3]; 3]> {
    let along = unit(sub(b, a))?;
    let normal = unit(cross(sub(b, a), sub(c, a)))?;
    Some([along, cross(normal, along), normal])
}

#[cfg(test)]
pub(crate) mod tests;
