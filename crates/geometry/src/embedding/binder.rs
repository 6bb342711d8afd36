//! Binding in chunks, for callers with threads.

use super::{Binding, Embedding, EmbeddingError, LINEAR, NearestFace, Rider, TetLocator, dot, face_frame};
use crate::{Patient, Point, TetMesh};

/// Points in a chunk: their number never depends on the threads, so neither do the bits.
const CHUNK: usize = 4096;

/// Points about to be bound, in chunks that threads may share: [`Binder::bind`] each, then [`Binder::join`] them.
///
/// Nearby points are in the same chunk, and each point is looked for from the element of the one before.
#[derive(Debug)]
pub struct Binder<'a> {
    locator: &'a TetLocator,
    tets: &'a TetMesh,
    points: &'a [Point<Patient>],
    /// Numbers of the points, neighbours following each other.
    order: Vec<u32>,
}

/// The points of one chunk, bound.
#[derive(Debug, Clone, PartialEq)]
pub struct BoundChunk {
    chunk: usize,
    /// In the binder's order.
    bindings: Vec<Binding>,
    riders: Vec<Rider>,
    outside: usize,
    farthest: f64,
}

impl<'a> Binder<'a> {
    /// For `points` in patient mm, as the mesh `tets` at rest, and the locator of that mesh.
    ///
    /// # Errors
    /// A non-finite point; an empty mesh.
    pub fn new(
        locator: &'a TetLocator,
        tets: &'a TetMesh,
        points: &'a [Point<Patient>],
    ) -> Result<Self, EmbeddingError> {
        if tets.tets.is_empty() {
            return Err(EmbeddingError::NoElements { points: points.len() });
        }
        if let Some(bad) = points.iter().position(|p| !p.is_finite()) {
            return Err(EmbeddingError::NotFinite(bad));
        }
        Ok(Self { locator, tets, points, order: locator.coherent_order(points) })
    }

    /// Number of chunks; 0 without points.
    pub const fn chunks(&self) -> usize {
        self.order.len().div_ceil(CHUNK)
    }

    /// Binds the points of a chunk.
    ///
    /// # Errors
    /// A point so far off that its distance is not finite.
    ///
    /// # Panics
    /// When there is no such chunk.
    pub fn bind(&self, chunk: usize) -> Result<BoundChunk, EmbeddingError> {
        let order = self.of(chunk);
        let mut out = BoundChunk {
            chunk,
            bindings: Vec::with_capacity(order.len()),
            riders: Vec::new(),
            outside: 0,
            farthest: 0.0,
        };
        let mut near = 0;
        for &i in order {
            let p = self.points[i as usize];
            near = match self.locator.locate_or_nearest(near, p).ok_or(EmbeddingError::NotFinite(i as usize))? {
                Ok(found) => {
                    out.bindings.push(Binding::new(self.locator.nodes(found.tet), found.weights));
                    found.tet
                }
                Err(face) => {
                    self.bind_outside(&mut out, i, p, &face);
                    face.tet
                }
            };
        }
        Ok(out)
    }

    fn of(&self, chunk: usize) -> &[u32] {
        let first = chunk * CHUNK;
        &self.order[first..(first + CHUNK).min(self.order.len())]
    }

    fn bind_outside(&self, out: &mut BoundChunk, i: u32, p: Point<Patient>, face: &NearestFace) {
        out.outside += 1;
        out.farthest = out.farthest.max(face.distance);
        let nodes = self.locator.nodes(face.tet);
        let weights = self.locator.weights(face.tet, p);
        if weights.iter().all(|&w| w >= LINEAR) {
            return out.bindings.push(Binding::new(nodes, weights));
        }
        out.bindings.push(Binding::new(nodes, self.locator.weights(face.tet, face.point)));
        let mut corners = (0..4).filter(|&c| c != face.opposite).map(|c| nodes[c]);
        let triangle: [u32; 3] = core::array::from_fn(|_| corners.next().unwrap_or(nodes[0]));
        let at = triangle.map(|v| self.tets.vertices[v as usize].to_array());
        let frame = face_frame(at).unwrap_or([[0.0; 3]; 3]);
        let offset = (p - face.point).to_array();
        let offset = frame.map(|axis| dot(axis, offset) as f32);
        out.riders.push(Rider { point: i, face: triangle, offset });
    }

    /// All points from all chunks, in any order.
    ///
    /// # Panics
    /// When a chunk is missing or given twice.
    pub fn join(&self, mut chunks: Vec<BoundChunk>) -> Embedding {
        chunks.sort_unstable_by_key(|c| c.chunk);
        assert!(chunks.iter().map(|c| c.chunk).eq(0..self.chunks()), "each chunk once");
        let mut out = Embedding {
            bindings: vec![Binding::new([0; 4], [0.0; 4]); self.points.len()],
            riders: chunks.iter().flat_map(|c| c.riders.iter().copied()).collect(),
            nodes: self.tets.vertices.len(),
            outside: chunks.iter().map(|c| c.outside).sum(),
            farthest: chunks.iter().map(|c| c.farthest).fold(0.0, f64::max),
        };
        for chunk in &chunks {
            for (&i, &b) in self.of(chunk.chunk).iter().zip(&chunk.bindings) {
                out.bindings[i as usize] = b;
            }
        }
        out.riders.sort_unstable_by_key(|r| r.point);
        out
    }
}
