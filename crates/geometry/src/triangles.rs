//! Triangle meshes and what can be said of their topology.

use crate::buckets::sorted_by_point;
use crate::disjoint_sets::DisjointSets;
use crate::{Patient, Point, Vector};
use thiserror::Error;

/// A triangle mesh in the patient frame (mm). Triangles run counter-clockwise seen from outside.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TriangleMesh {
    /// Vertex positions, mm.
    pub vertices: Vec<Point<Patient>>,
    /// Vertex indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

/// Why a triangle mesh was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum TriangleMeshError {
    /// A triangle names a vertex that does not exist.
    #[error("triangle {triangle} uses vertex {vertex}, but there are only {vertices}")]
    Index {
        /// The triangle.
        triangle: usize,
        /// The vertex it names.
        vertex: u32,
        /// Vertices in the mesh.
        vertices: usize,
    },
    /// A vertex is nowhere.
    #[error("vertex {0} has a coordinate that is not finite, or beyond 1e100 mm")]
    NotFinite(usize),
    /// A triangle uses one vertex twice.
    #[error("triangle {0} uses a vertex twice")]
    Degenerate(usize),
    /// Two triangles have the same corners.
    #[error("triangles {first} and {second} have the same three vertices; remove one")]
    Duplicate {
        /// The first.
        first: usize,
        /// The second.
        second: usize,
    },
    /// Neighbours disagree on which side is outside.
    #[error(
        "triangle {triangle} is turned against its neighbour {neighbour}: both run through the edge of vertices {edge:?} in the same direction ({edges} such edge(s)); orient all triangles alike"
    )]
    Orientation {
        /// The triangle that most neighbours disagree with.
        triangle: usize,
        /// One of these.
        neighbour: usize,
        /// Their edge.
        edge: [u32; 2],
        /// How many such edges there are.
        edges: usize,
    },
    /// A vertex belongs to no triangle.
    #[error("vertex {vertex} belongs to no triangle ({count} of {vertices} vertices do not); remove unused vertices")]
    Unused {
        /// The first such vertex.
        vertex: usize,
        /// How many there are.
        count: usize,
        /// Vertices in the mesh.
        vertices: usize,
    },
}

/// Counts that say whether a surface is closed, oriented and two-manifold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Topology {
    /// Vertices that some triangle uses.
    pub vertices: usize,
    /// Distinct edges.
    pub edges: usize,
    /// Triangles.
    pub triangles: usize,
    /// Edges with one triangle.
    pub boundary_edges: usize,
    /// Edges with more than two triangles.
    pub non_manifold_edges: usize,
    /// Edges whose two triangles run through them in the same direction.
    pub misoriented_edges: usize,
    /// Vertices whose triangles do not form one fan (a disc, or half a disc at a boundary).
    pub non_manifold_vertices: usize,
    /// Connected pieces.
    pub components: usize,
}

impl Topology {
    /// No boundary edge.
    pub const fn is_closed(&self) -> bool {
        self.boundary_edges == 0
    }

    /// Each edge has at most two triangles and each vertex one fan.
    pub const fn is_manifold(&self) -> bool {
        self.non_manifold_edges == 0 && self.non_manifold_vertices == 0
    }

    /// Neighbouring triangles agree on which side is outside.
    pub const fn is_oriented(&self) -> bool {
        self.misoriented_edges == 0
    }

    /// V - E + F; 2 for each closed piece without handles.
    pub const fn euler(&self) -> i64 {
        self.vertices as i64 - self.edges as i64 + self.triangles as i64
    }
}

/// Coordinates beyond this are no numbers that a volume could be made of, mm.
const FURTHEST: f64 = 1e100;

/// Whether a point has coordinates that areas and volumes can be made of.
pub(crate) fn is_somewhere(p: Point<Patient>) -> bool {
    p.to_array().iter().all(|v| v.abs() <= FURTHEST)
}

impl TriangleMesh {
    /// Checks indices, coordinates and repeated vertices.
    ///
    /// # Errors
    /// The first fault found, with its number.
    pub fn validate(&self) -> Result<(), TriangleMeshError> {
        if let Some(i) = self.vertices.iter().position(|p| !is_somewhere(*p)) {
            return Err(TriangleMeshError::NotFinite(i));
        }
        for (triangle, t) in self.triangles.iter().enumerate() {
            if let Some(&vertex) = t.iter().find(|&&v| v as usize >= self.vertices.len()) {
                return Err(TriangleMeshError::Index { triangle, vertex, vertices: self.vertices.len() });
            }
            if t[0] == t[1] || t[1] == t[2] || t[2] == t[0] {
                return Err(TriangleMeshError::Degenerate(triangle));
            }
        }
        Ok(())
    }

    /// The corners of triangle `t`.
    pub fn corners(&self, t: usize) -> [Point<Patient>; 3] {
        self.triangles[t].map(|v| self.vertices[v as usize])
    }

    /// Enclosed volume in mm3 (divergence theorem); meaningful for closed, oriented meshes, positive when normals point out.
    pub fn signed_volume(&self) -> f64 {
        let o = self.vertices.first().copied().unwrap_or(Point::ORIGIN);
        let six = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| self.vertices[v as usize] - o);
            a.cross(b).dot(c)
        };
        self.triangles.iter().map(six).sum::<f64>() / 6.0
    }

    /// Surface area, mm2.
    pub fn area(&self) -> f64 {
        // From 0, for a sum of nothing is -0.
        (0..self.triangles.len()).map(|t| self.area_vector(t).norm()).fold(0.0, |sum, area| sum + area)
    }

    /// Normal of triangle `t` times its area (mm2).
    pub fn area_vector(&self, t: usize) -> Vector<Patient> {
        let [a, b, c] = self.corners(t);
        (b - a).cross(c - a) * 0.5
    }

    /// Area-weighted unit normals at the vertices; zero where a vertex has no area around it.
    pub fn vertex_normals(&self) -> Vec<Vector<Patient>> {
        let mut normals = vec![Vector::ZERO; self.vertices.len()];
        for (t, triangle) in self.triangles.iter().enumerate() {
            let n = self.area_vector(t);
            for &v in triangle {
                normals[v as usize] += n;
            }
        }
        normals.into_iter().map(|n| n.normalized().unwrap_or(Vector::ZERO)).collect()
    }

    /// Counts edges, fans and pieces. Deterministic; O(n log n).
    pub fn topology(&self) -> Topology {
        let half_edges = self.sorted_half_edges();
        let mut t = Topology {
            vertices: 0,
            edges: 0,
            triangles: self.triangles.len(),
            boundary_edges: 0,
            non_manifold_edges: 0,
            misoriented_edges: 0,
            non_manifold_vertices: 0,
            components: 0,
        };
        for edge in half_edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            t.edges += 1;
            match edge {
                [_] => t.boundary_edges += 1,
                [a, b] => t.misoriented_edges += usize::from(a.2 == b.2),
                _ => t.non_manifold_edges += 1,
            }
        }
        let fans = self.fans(&half_edges);
        t.vertices = fans.iter().filter(|&&n| n > 0).count();
        t.non_manifold_vertices = fans.iter().filter(|&&n| n > 1).count();
        t.components = self.components().1;
        t
    }

    /// `(lower vertex, higher vertex, runs upwards, triangle)`, sorted.
    pub(crate) fn sorted_half_edges(&self) -> Vec<(u32, u32, bool, u32)> {
        let mut out = Vec::with_capacity(self.triangles.len() * 3);
        for (i, t) in self.triangles.iter().enumerate() {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                out.push((a.min(b), a.max(b), a < b, i as u32));
            }
        }
        sorted_by_point(&out, self.vertices.len(), |edge| edge.0)
    }

    /// A place where the surface is not closed and two-manifold: the middle of an edge without exactly two triangles, else
    /// a vertex whose triangles do not form one fan. `None` where there is no such place.
    pub fn defect(&self) -> Option<Point<Patient>> {
        let half_edges = self.sorted_half_edges();
        let bad = half_edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).find(|edge| edge.len() != 2);
        let at = |v: u32| self.vertices[v as usize];
        let vertex = || self.fans(&half_edges).iter().position(|&n| n > 1).map(|v| self.vertices[v]);
        bad.map(|edge| at(edge[0].0).lerp(at(edge[0].1), 0.5)).or_else(vertex)
    }

    /// The number of fans that the triangles around each vertex fall into: corners of one vertex are joined over shared
    /// edges, so a clean vertex ends with one class of corners, one without triangles with none.
    fn fans(&self, half_edges: &[(u32, u32, bool, u32)]) -> Vec<u32> {
        let mut corners = DisjointSets::new(self.triangles.len() * 3);
        let corner = |triangle: u32, v: u32| {
            let at = self.triangles[triangle as usize].iter().position(|&x| x == v).unwrap_or(0);
            triangle * 3 + at as u32
        };
        for edge in half_edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            for pair in edge.windows(2) {
                for v in [pair[0].0, pair[0].1] {
                    corners.join(corner(pair[0].3, v), corner(pair[1].3, v));
                }
            }
        }
        let mut fans = vec![0u32; self.vertices.len()];
        for c in 0..self.triangles.len() * 3 {
            if corners.root(c as u32) as usize == c {
                fans[self.triangles[c / 3][c % 3] as usize] += 1;
            }
        }
        fans
    }

    /// The connected piece of each triangle, numbered in order of first appearance, and how many there are.
    pub fn components(&self) -> (Vec<u32>, usize) {
        let mut pieces = DisjointSets::new(self.vertices.len());
        for t in &self.triangles {
            pieces.join(t[0], t[1]);
            pieces.join(t[0], t[2]);
        }
        let mut number = vec![u32::MAX; self.vertices.len()];
        let mut count = 0;
        let of = self.triangles.iter().map(|t| {
            let root = pieces.root(t[0]) as usize;
            if number[root] == u32::MAX {
                number[root] = count;
                count += 1;
            }
            number[root]
        });
        (of.collect(), count as usize)
    }

    /// Appends another mesh.
    pub fn append(&mut self, other: &Self) {
        let offset = self.vertices.len() as u32;
        self.vertices.extend_from_slice(&other.vertices);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + offset)));
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// An octahedron of radius 1: closed, 8 triangles, volume 4/3.
    pub(crate) fn octahedron() -> TriangleMesh {
        let vertices = [[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]]
            .map(Point::from_array)
            .to_vec();
        let triangles = vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
        TriangleMesh { vertices, triangles }
    }

    #[test]
    fn an_octahedron_is_closed_manifold_oriented_and_has_its_volume() {
        let m = octahedron();
        let t = m.topology();
        assert!(t.is_closed() && t.is_manifold() && t.is_oriented());
        assert_eq!((t.euler(), t.components), (2, 1));
        assert!((m.signed_volume() - 4.0 / 3.0).abs() < 1e-12);
        assert!((m.area() - 8.0 * 3f64.sqrt() / 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_hole_a_flip_and_a_pinched_vertex_are_seen() {
        let mut open = octahedron();
        open.triangles.pop();
        assert_eq!(open.topology().boundary_edges, 3);
        let mut flipped = octahedron();
        flipped.triangles[0].swap(0, 1);
        assert_eq!(flipped.topology().misoriented_edges, 3);
        let mut pinched = octahedron();
        let other = octahedron();
        pinched.append(&other);
        for t in &mut pinched.triangles[8..] {
            *t = t.map(|v| if v == 6 { 0 } else { v });
        }
        let t = pinched.topology();
        assert_eq!((t.non_manifold_vertices, t.non_manifold_edges, t.components), (1, 0, 1));
        assert_eq!(octahedron().defect(), None);
        assert_eq!(pinched.defect(), Some(Point::new(1.0, 0.0, 0.0)));
        // The triangle taken away was the one of (1, 0, 0), (0, -1, 0) and (0, 0, -1).
        assert_eq!(open.defect(), Some(Point::new(0.5, -0.5, 0.0)));
    }

    #[test]
    fn three_triangles_on_an_edge_are_non_manifold() {
        let vertices =
            [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.]].map(Point::from_array).to_vec();
        let m = TriangleMesh { vertices, triangles: vec![[0, 1, 2], [1, 0, 3], [0, 1, 4]] };
        assert_eq!(m.topology().non_manifold_edges, 1);
    }

    #[test]
    fn bad_indices_and_coordinates_are_named() {
        let mut m = octahedron();
        m.triangles[3][1] = 77;
        assert_eq!(m.validate(), Err(TriangleMeshError::Index { triangle: 3, vertex: 77, vertices: 6 }));
        let mut m = octahedron();
        m.vertices[2].y = f64::INFINITY;
        assert_eq!(m.validate(), Err(TriangleMeshError::NotFinite(2)));
        let mut m = octahedron();
        m.triangles[5] = [1, 1, 2];
        assert_eq!(m.validate(), Err(TriangleMeshError::Degenerate(5)));
    }
}
