//! What makes a mesh from elsewhere plainly broken, besides faulty numbers: nothing sensible can be done with such a mesh.
//! Meshes that are merely odd (open, pinched, badly shaped) pass.

use crate::tetrahedra::{TET_FACES, sorted, unused};
use crate::{TetMesh, TetMeshError, TriangleMesh, TriangleMeshError};
use std::collections::HashMap;

impl TriangleMesh {
    /// Checks of a surface from elsewhere, after [`TriangleMesh::validate`], that its triangles fit together: no two with the
    /// same corners, neighbours that agree on which side is outside, each vertex of a triangle. Edges of more than two
    /// triangles are passed over.
    ///
    /// # Errors
    /// The first fault found, with its triangles or vertex.
    pub fn check_sound(&self) -> Result<(), TriangleMeshError> {
        let vertices = self.vertices.len();
        if let Some((vertex, count)) = unused(vertices, self.triangles.as_flattened()) {
            return Err(TriangleMeshError::Unused { vertex, count, vertices });
        }
        if let Some((first, second)) = same_corners(self.triangles.iter().copied()) {
            return Err(TriangleMeshError::Duplicate { first, second });
        }
        self.check_orientation()
    }

    /// Names the triangle that most of its neighbours disagree with.
    fn check_orientation(&self) -> Result<(), TriangleMeshError> {
        let half_edges = self.sorted_half_edges();
        let edges = half_edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1));
        let wrong: Vec<_> = edges.filter_map(|e| <&[_; 2]>::try_from(e).ok()).filter(|[a, b]| a.2 == b.2).collect();
        let mut faults = vec![0u8; self.triangles.len()];
        wrong.iter().flat_map(|pair| pair.iter()).for_each(|e| faults[e.3 as usize] += 1);
        let worst = (0..faults.len()).rev().max_by_key(|&t| faults[t]);
        let Some((triangle, [a, b])) =
            worst.and_then(|t| Some((t, wrong.iter().find(|e| e.iter().any(|h| h.3 as usize == t))?)))
        else {
            return Ok(());
        };
        let neighbour = if a.3 as usize == triangle { b.3 } else { a.3 } as usize;
        Err(TriangleMeshError::Orientation { triangle, neighbour, edge: [a.0, a.1], edges: wrong.len() })
    }
}

impl TetMesh {
    /// Checks of a mesh from elsewhere, after [`TetMesh::check_conforming`], that it is not torn: that no two elements meet in
    /// a face each with vertices of its own in the same places. Vertices in one place that part no face are passed over:
    /// bodies may touch.
    ///
    /// # Errors
    /// A face that is torn, with its elements and two of its vertices.
    pub fn check_joined(&self) -> Result<(), TetMeshError> {
        let mut first_at: HashMap<[u64; 3], u32> = HashMap::with_capacity(self.vertices.len());
        // Zero has two signs.
        let bits = |v: usize| self.vertices[v].to_array().map(|c| (c + 0.0).to_bits());
        let place: Vec<u32> = (0..self.vertices.len()).map(|v| *first_at.entry(bits(v)).or_insert(v as u32)).collect();
        if first_at.len() == self.vertices.len() {
            return Ok(());
        }
        let mut faces: Vec<([u32; 3], [u32; 3], u32)> = Vec::with_capacity(4 * self.tets.len());
        for (t, tet) in (0u32..).zip(&self.tets) {
            for face in TET_FACES.map(|f| f.map(|i| tet[i])) {
                faces.push((sorted(face.map(|v| place[v as usize])), sorted(face), t));
            }
        }
        faces.sort_unstable();
        let mut torn = faces.chunk_by(|a, b| a.0 == b.0).filter(|same| same.iter().any(|f| f.1 != same[0].1));
        let Some(face) = torn.next() else { return Ok(()) };
        let other = face.iter().find(|f| f.1 != face[0].1).unwrap_or(&face[0]);
        let own = |of: [u32; 3], not: [u32; 3]| of.into_iter().find(|v| !not.contains(v)).unwrap_or(of[0]);
        let vertices = [own(face[0].1, other.1), own(other.1, face[0].1)];
        let tets = [face[0].2, other.2].map(|t| t as usize);
        let at = self.vertices[vertices[0] as usize].to_array();
        Err(TetMeshError::Torn { tets, vertices, at, faces: 1 + torn.count() })
    }
}

/// Two triangles with the same corners in any order.
fn same_corners(triangles: impl Iterator<Item = [u32; 3]>) -> Option<(usize, usize)> {
    let mut keys: Vec<([u32; 3], usize)> = triangles.map(sorted).zip(0..).collect();
    keys.sort_unstable();
    keys.windows(2).find(|w| w[0].0 == w[1].0).map(|w| (w[0].1, w[1].1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Point;
    use crate::triangles::tests::octahedron;

    #[test]
    fn a_triangle_that_is_there_twice_was_taken() {
        let mut twice = octahedron();
        twice.triangles.push([4, 0, 2]);
        assert_eq!(twice.check_sound(), Err(TriangleMeshError::Duplicate { first: 0, second: 8 }));
        assert_eq!(octahedron().check_sound(), Ok(()));
    }

    #[test]
    fn a_turned_triangle_was_taken() {
        let mut turned = octahedron();
        turned.triangles[3].swap(0, 1);
        assert!(matches!(turned.check_sound(), Err(TriangleMeshError::Orientation { triangle: 3, edges: 3, .. })));
        // Inside out as a whole, or open, is another matter.
        let mut inward = octahedron();
        inward.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        inward.triangles.pop();
        assert_eq!(inward.check_sound(), Ok(()));
    }

    #[test]
    fn a_vertex_of_no_triangle_was_taken() {
        let mut loose = octahedron();
        loose.vertices.push(Point::new(9.0, 9.0, 9.0));
        assert_eq!(loose.check_sound(), Err(TriangleMeshError::Unused { vertex: 6, count: 1, vertices: 7 }));
    }

    fn two() -> TetMesh {
        let vertices =
            [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [0., 0., -1.]].map(Point::from_array).to_vec();
        TetMesh { vertices, tets: vec![[0, 1, 2, 3], [0, 2, 1, 4]], labels: vec![4, 5] }
    }

    #[test]
    fn a_mesh_torn_by_doubled_vertices_was_taken() {
        let mut torn = two();
        torn.vertices.push(torn.vertices[2]);
        torn.tets[1][1] = 5;
        torn.check_conforming().expect("each face is whole in itself");
        let error = TetMeshError::Torn { tets: [0, 1], vertices: [2, 5], at: [0.0, 1.0, 0.0], faces: 1 };
        assert_eq!(torn.check_joined(), Err(error));
        assert_eq!(two().check_joined(), Ok(()));
    }

    #[test]
    fn bodies_that_touch_in_a_point_are_not_torn() {
        let mut touching = two();
        touching.vertices.extend([[0., 0., 1.], [1., 0., 1.], [0., 1., 1.], [0., 0., 2.]].map(Point::from_array));
        touching.tets.push([5, 6, 7, 8]);
        touching.labels.push(4);
        assert_eq!(touching.check_joined(), Ok(()));
    }
}
