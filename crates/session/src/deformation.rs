//! What follows the soft body: high-resolution surfaces, single points, and the CT itself.

use monro_geometry::{Embedding, EmbeddingError, Patient, Point, TetLocator, TetMesh, TetMeshError, Vector};

/// Points bound to the tetrahedra of a case (paper, section II.2), moved with them.
#[derive(Debug, Clone)]
pub struct Follower {
    embedding: Embedding,
    moved: Vec<[f32; 4]>,
}

impl Follower {
    /// Binds points to the mesh at rest.
    ///
    /// # Errors
    /// When a point or the mesh is not usable.
    pub fn new(tets: &TetMesh, points: &[Point<Patient>]) -> Result<Self, EmbeddingError> {
        Ok(Self { embedding: Embedding::new(tets, points)?, moved: vec![[0.0; 4]; points.len()] })
    }

    /// Moves the points with the nodes (mm from `origin`) and returns them in the patient frame.
    pub fn follow(&mut self, nodes: &[[f32; 4]], origin: Point<Patient>) -> Vec<Point<Patient>> {
        self.embedding.apply(nodes, &mut self.moved);
        self.moved.iter().map(|p| at(p, origin)).collect()
    }
}

/// A node or bound point (mm from `origin`) in the patient frame.
pub(crate) fn at(p: &[f32; 4], origin: Point<Patient>) -> Point<Patient> {
    origin + Vector::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]))
}

/// Answers where the tissue that is now at a point came from: the way to look up a deformed CT in the original one.
#[derive(Debug)]
pub struct DeformedSampler {
    locator: TetLocator,
    rest: TetMesh,
}

impl DeformedSampler {
    /// From the mesh at rest and the same mesh deformed.
    ///
    /// # Errors
    /// When the deformed mesh has inverted elements: no place in them has one origin.
    pub fn new(rest: TetMesh, deformed: &TetMesh) -> Result<Self, TetMeshError> {
        Ok(Self { locator: TetLocator::new(deformed)?, rest })
    }

    /// Rest position of the tissue now at `p`; `p` itself outside of the mesh, where nothing moves.
    pub fn rest_position(&self, p: Point<Patient>) -> Point<Patient> {
        let Some(found) = self.locator.locate(p) else { return p };
        let corners = self.rest.corners(found.tet);
        let sum = corners.iter().zip(found.weights).fold(Vector::ZERO, |s, (c, w)| s + (*c - Point::ORIGIN) * w);
        Point::ORIGIN + sum
    }
}
