//! Walls of a body that pass through each other when it deforms, for nothing keeps its parts from each other.

use crate::tetrahedra::{TET_FACES, sorted};
use crate::{Patient, Point, TetMesh, TriangleMesh};

/// A face at the boundary or between elements of different labels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wall {
    /// Its corners, numbered as the vertices of the mesh, seen from outside of `label`.
    pub corners: [u32; 3],
    /// The lower label of the two sides.
    pub label: u16,
    /// The other one; `None` is the outside.
    pub behind: Option<u16>,
}

impl TetMesh {
    /// Faces at the boundary and between elements of different labels, each once, in order of their corners' numbers.
    pub fn walls(&self) -> Vec<Wall> {
        let mut faces: Vec<([u32; 3], u16, [u32; 3])> = Vec::with_capacity(4 * self.tets.len());
        for (tet, &label) in self.tets.iter().zip(&self.labels) {
            for face in TET_FACES.map(|f| f.map(|i| tet[i])) {
                faces.push((sorted(face), label, face));
            }
        }
        faces.sort_unstable();
        let sides = faces.chunk_by(|a, b| a.0 == b.0).filter(|of| of.len() != 2 || of[0].1 != of[1].1);
        sides.map(|of| Wall { corners: of[0].2, label: of[0].1, behind: of.get(1).map(|f| f.1) }).collect()
    }
}

/// The walls of a body: its boundary and what parts its regions.
#[derive(Debug, Clone)]
pub struct Walls {
    rest: TriangleMesh,
}

/// Walls that pass through each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassedThrough {
    /// Pairs of triangles that cross and do not at rest; a million at most.
    pub pairs: usize,
    /// A point that the first pair has in common, LPS mm.
    pub at: Point<Patient>,
}

impl Walls {
    /// Of a body at rest.
    pub fn new(rest: &TetMesh) -> Self {
        let triangles = rest.walls().iter().map(|wall| wall.corners).collect();
        Self { rest: TriangleMesh { vertices: rest.vertices.clone(), triangles } }
    }

    /// Looks for triangles that cross with the vertices of the mesh where they are now (mm, in their order), and do not at
    /// rest: parts of a body may touch as they are made. `None` where there are none.
    ///
    /// # Panics
    /// When there are fewer vertices than at rest.
    pub fn passed_through(&self, now: &[Point<Patient>]) -> Option<PassedThrough> {
        let moved = TriangleMesh { vertices: now.to_vec(), triangles: self.rest.triangles.clone() };
        let found = moved.crossings().pairs;
        if found.is_empty() {
            return None;
        }
        let before = self.rest.crossings().pairs;
        let new = found.iter().filter(|pair| before.binary_search(pair).is_err());
        let first = new.clone().next()?;
        Some(PassedThrough { pairs: new.count(), at: moved.crossing_place(*first) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two elements of two labels, and one apart.
    fn body() -> TetMesh {
        let vertices = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [0., 0., -1.]].map(Point::from_array);
        let apart = vertices[..4].iter().map(|p| Point::new(p.x + 5.0, p.y, p.z)).collect::<Vec<_>>();
        let vertices = [&vertices[..], &apart].concat();
        TetMesh { vertices, tets: vec![[0, 1, 2, 3], [0, 2, 1, 4], [5, 6, 7, 8]], labels: vec![4, 5, 4] }
    }

    #[test]
    fn walls_are_the_boundary_and_what_parts_regions_each_once() {
        assert_eq!(body().walls().len(), 7 + 4);
        let whole = TetMesh { labels: vec![4; 3], ..body() };
        assert_eq!(whole.walls().len(), 6 + 4);
    }

    #[test]
    fn a_part_that_moves_into_another_is_told_with_a_place() {
        let (body, walls) = (body(), Walls::new(&body()));
        assert_eq!(walls.passed_through(&body.vertices), None);
        let moved = |x: f64| {
            let by =
                |(i, p): (usize, &Point<Patient>)| if i < 5 { *p } else { Point::new(p.x + x, p.y + 0.1, p.z + 0.1) };
            body.vertices.iter().enumerate().map(by).collect::<Vec<_>>()
        };
        assert_eq!(walls.passed_through(&moved(-3.0)), None);
        let found = walls.passed_through(&moved(-4.8)).expect("inside each other");
        assert!(found.pairs > 2 && found.at.distance(Point::new(0.4, 0.3, 0.3)) < 1.0, "{found:?}");
        assert_eq!(walls.passed_through(&vec![Point::new(f64::NAN, 0.0, 0.0); 9]), None);
    }

    /// What crosses as it is given says nothing of the motion.
    #[test]
    fn what_crosses_at_rest_is_not_told() {
        let mut rest = body();
        rest.vertices[5..].iter_mut().for_each(|p| *p = Point::new(p.x - 4.8, p.y + 0.1, p.z + 0.1));
        let carried: Vec<_> = rest.vertices.iter().map(|p| Point::new(p.x + 1.0, p.y, p.z)).collect();
        assert_eq!(Walls::new(&rest).passed_through(&carried), None);
    }
}
