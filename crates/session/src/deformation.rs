//! What follows the soft body: high-resolution surfaces, single points, and the CT itself.

use monro_geometry::{Embedding, EmbeddingError, Patient, Point, TetLocator, TetMesh, TetMeshError, Vector};
use monro_tissue::Stepper;

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

    /// Moves the points with the nodes (mm from any one origin), on the threads that have just made the step: others would
    /// have to be woken, and share the processors with those that still wait for work. The same bits on any number of them.
    pub fn follow(&mut self, stepper: &Stepper, nodes: &[[f32; 4]]) {
        stepper.move_points(&self.embedding, nodes, &mut self.moved);
    }

    /// Where one of the points is in the patient frame, from the nodes' origin.
    ///
    /// # Panics
    /// When there are not so many points.
    pub fn point(&self, index: usize, origin: Point<Patient>) -> Point<Patient> {
        at(&self.moved[index], origin)
    }

    /// Where the points are in the patient frame, from the nodes' origin.
    pub fn points(&self, origin: Point<Patient>) -> impl ExactSizeIterator<Item = Point<Patient>> {
        self.moved.iter().map(move |p| at(p, origin))
    }
}

/// A node or bound point (mm from `origin`) in the patient frame.
pub(crate) fn at(p: &[f32; 4], origin: Point<Patient>) -> Point<Patient> {
    origin + Vector::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]))
}

/// Answers where the tissue that is now at a point came from: the way to look up a deformed CT in the original one.
/// Inverted elements are left out, since no place in them has one origin; [`DeformedSampler::left_out`] counts them.
#[derive(Debug)]
pub struct DeformedSampler {
    locator: TetLocator,
    at_rest: TetLocator,
    rest: TetMesh,
    left_out: usize,
}

impl DeformedSampler {
    /// From the mesh at rest and the same mesh deformed.
    ///
    /// # Errors
    /// When the deformed mesh is broken otherwise: coordinates that are not finite.
    pub fn new(rest: &TetMesh, deformed: &TetMesh) -> Result<Self, TetMeshError> {
        let upright: Vec<usize> = (0..deformed.tets.len()).filter(|&t| deformed.volume(t) > 0.0).collect();
        let part = |mesh: &TetMesh| TetMesh {
            vertices: mesh.vertices.clone(),
            tets: upright.iter().map(|&t| mesh.tets[t]).collect(),
            labels: upright.iter().map(|&t| mesh.labels[t]).collect(),
        };
        let left_out = deformed.tets.len() - upright.len();
        let rest = part(rest);
        Ok(Self { locator: TetLocator::new(&part(deformed))?, at_rest: TetLocator::new(&rest)?, rest, left_out })
    }

    /// Inverted elements, in which positions are not looked up.
    pub const fn left_out(&self) -> usize {
        self.left_out
    }

    /// Rest position of the tissue now at `p`; `p` itself outside of the mesh, where nothing moves; `None` where tissue was and is
    /// no more.
    pub fn rest_position(&self, p: Point<Patient>) -> Option<Point<Patient>> {
        let Some(found) = self.locator.locate(p) else {
            return self.at_rest.locate(p).is_none().then_some(p);
        };
        let corners = self.rest.corners(found.tet);
        let sum = corners.iter().zip(found.weights).fold(Vector::ZERO, |s, (c, w)| s + (*c - Point::ORIGIN) * w);
        Some(Point::ORIGIN + sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Structure;
    use monro_tissue::{CollisionResponse, Material, Mode, Model, ModelOptions, PhysicalOptions};
    use std::collections::BTreeMap;

    fn block() -> TetMesh {
        // Five elements that fill a cube of 2 mm.
        let vertices = (0..8)
            .map(|i| Point::new(f64::from(i & 1) * 2.0, f64::from(i >> 1 & 1) * 2.0, f64::from(i >> 2) * 2.0))
            .collect();
        let tets = vec![[0, 1, 2, 4], [3, 2, 1, 7], [5, 4, 7, 1], [6, 7, 4, 2], [1, 2, 4, 7]];
        TetMesh { vertices, tets, labels: vec![4; 5] }
    }

    fn bent(p: Point<Patient>) -> Point<Patient> {
        Point::new(p.x * 1.2 + 0.1 * p.z, p.y * 0.9 - 3.0, p.z + 0.2 * p.x + 5.0)
    }

    #[test]
    fn an_affine_deformation_is_undone_exactly() {
        let rest = block();
        let deformed = TetMesh { vertices: rest.vertices.iter().map(|&p| bent(p)).collect(), ..rest.clone() };
        let sampler = DeformedSampler::new(&rest, &deformed).expect("sound");
        for p in [Point::new(0.3, 0.4, 0.5), Point::new(1.9, 1.1, 0.2), Point::new(1.0, 1.0, 1.0)] {
            assert!(sampler.rest_position(bent(p)).is_some_and(|found| found.distance(p) < 1e-9), "{p:?}");
        }
        let far = Point::new(50.0, 0.0, 0.0);
        assert_eq!(sampler.rest_position(far), Some(far));
        // All of the block has moved away by five millimetres.
        assert_eq!(sampler.rest_position(Point::new(1.0, 1.0, 1.0)), None);
        assert_eq!(sampler.left_out(), 0);
    }

    #[test]
    fn an_inverted_element_is_left_out_not_fatal() {
        let rest = block();
        let mut deformed = rest.clone();
        deformed.vertices[0] = Point::new(3.0, 3.0, 3.0);
        let sampler = DeformedSampler::new(&rest, &deformed).expect("sound");
        assert_eq!(sampler.left_out(), 1);
        let p = Point::new(1.9, 1.9, 0.2);
        assert!(sampler.rest_position(p).is_some_and(|found| found.distance(p) < 1e-9));
    }

    #[test]
    fn followers_move_with_the_nodes_around_any_origin() {
        let rest = block();
        // More than a thread takes at a time.
        let points: Vec<_> = (0..3000)
            .map(|i| Point::new((i % 41) as f64 * 0.04, (i % 37) as f64 * 0.05, (i % 29) as f64 * 0.06))
            .collect();
        let mut follower = Follower::new(&rest, &points).expect("sound");
        let origin = Point::new(-7.0, 8.0, 9.0);
        let nodes: Vec<[f32; 4]> = rest
            .vertices
            .iter()
            .map(|&p| {
                let d = bent(p) - origin;
                [d.x as f32, d.y as f32, d.z as f32, 0.0]
            })
            .collect();
        let brain = BTreeMap::from([(u16::from(Structure::Brain.label()), Material::BRAIN)]);
        let options = ModelOptions {
            mode: Mode::Physical(PhysicalOptions::default()),
            materials: brain,
            attachments: Vec::new(),
            collision: CollisionResponse::Insertion,
        };
        let model = Model::new(&rest, &options).expect("sound");
        follower.follow(&Stepper::new(&model), &nodes);
        for (moved, p) in follower.points(origin).zip(points) {
            assert!(moved.distance(bent(p)) < 1e-5, "{moved:?}");
        }
    }
}
