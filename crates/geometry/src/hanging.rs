//! Elements that meet without sharing what they meet in: hanging nodes, and vertices that are doubled but for rounding.

use crate::tetrahedra::{TET_FACES, sorted};
use crate::{Bvh, NO_TET, Patient, Point, TetMesh, TriangleMesh, nearest_on_triangle, tet_neighbours};

/// Vertices within this share of a face's longest edge lie on it: single precision leaves a patient's coordinates 3e-5 mm.
const ON: f64 = 1e-4;

/// Vertices that lie on faces or edges of elements without being their corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HangingNode {
    /// How many vertices do.
    pub vertices: usize,
    /// The first of them.
    pub vertex: u32,
    /// An element on whose face it lies.
    pub tet: usize,
    /// Where it is, mm.
    pub at: Point<Patient>,
}

/// Faces that lie on each other with vertices of their own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LooseFaces {
    /// How many faces lie on others.
    pub faces: usize,
    /// The elements of the first of them and of the other one.
    pub tets: [usize; 2],
    /// A vertex of each in the same place but for rounding.
    pub vertices: [u32; 2],
    /// The place, mm.
    pub at: Point<Patient>,
}

impl TetMesh {
    /// Looks for elements that meet without sharing a face, edge or vertex, among what is at the boundary: a face that is not
    /// shared is there. Vertices that lie on faces or edges within a ten-thousandth of the face's longest edge, and faces that lie
    /// on each other with vertices of their own, apart from each other by no more than that. Vertices in one place that part
    /// no face are passed over: bodies may touch. A mesh that passed [`TetMesh::check_conforming`] is wanted.
    ///
    /// # Panics
    /// When an element names a vertex that does not exist.
    pub fn unshared(&self) -> (Option<HangingNode>, Option<LooseFaces>) {
        let boundary = Boundary::of(self);
        let mut place: Vec<u32> = (0..self.vertices.len() as u32).collect();
        let mut hanging: Option<HangingNode> = None;
        for vertex in boundary.vertices() {
            let (on, same) = boundary.met_by(vertex);
            // The lowest of all vertices in one place stands for them; lower ones have found theirs already.
            place[vertex as usize] = same.filter(|&v| v < vertex).map_or(vertex, |v| place[v as usize]);
            if let Some(face) = on {
                let (tet, at) = (boundary.tets[face as usize] as usize, self.vertices[vertex as usize]);
                hanging.get_or_insert(HangingNode { vertices: 0, vertex, tet, at }).vertices += 1;
            }
        }
        (hanging, boundary.loose(&place))
    }
}

/// The faces that no two elements share.
struct Boundary {
    surface: TriangleMesh,
    /// The element of each face.
    tets: Vec<u32>,
    tree: Bvh,
    /// How far from a vertex a face may be that it lies on, at most, mm.
    reach: f64,
}

impl Boundary {
    fn of(mesh: &TetMesh) -> Self {
        let behind = tet_neighbours(&mesh.tets, mesh.vertices.len());
        let (mut triangles, mut tets) = (Vec::new(), Vec::new());
        for ((t, tet), behind) in (0u32..).zip(&mesh.tets).zip(&behind) {
            for (face, _) in TET_FACES.iter().zip(behind).filter(|(_, b)| **b == NO_TET) {
                triangles.push(face.map(|i| tet[i]));
                tets.push(t);
            }
        }
        let surface = TriangleMesh { vertices: mesh.vertices.clone(), triangles };
        let reach = (0..tets.len()).map(|f| tolerance(&surface.corners(f))).fold(0.0, f64::max);
        Self { tree: Bvh::new(&surface), surface, tets, reach }
    }

    /// Its vertices, each once.
    fn vertices(&self) -> Vec<u32> {
        let mut out: Vec<u32> = self.surface.triangles.iter().flatten().copied().collect();
        out.sort_unstable();
        out.dedup();
        out
    }

    /// The first face that a vertex lies on away from its corners, and the lowest other vertex in the same place.
    fn met_by(&self, vertex: u32) -> (Option<u32>, Option<u32>) {
        let (mut on, mut same) = (None::<u32>, None::<u32>);
        let at = self.surface.vertices[vertex as usize];
        self.tree.near(at, self.reach, |face, corners| {
            let (own, near) = (self.surface.triangles[face as usize], tolerance(corners));
            if own.contains(&vertex) || at.distance(nearest_on_triangle(at, *corners)) > near {
                return;
            }
            let doubled = own.iter().zip(corners).filter(|(_, c)| at.distance(**c) <= near).map(|(&v, _)| v).min();
            match doubled {
                Some(v) => same = Some(same.map_or(v, |s| s.min(v))),
                None => on = Some(on.map_or(face, |f| f.min(face))),
            }
        });
        (on, same)
    }

    /// Faces whose corners are in the same places.
    fn loose(&self, place: &[u32]) -> Option<LooseFaces> {
        let key = |t: &[u32; 3]| sorted(t.map(|v| place[v as usize]));
        let mut faces: Vec<([u32; 3], u32)> = self.surface.triangles.iter().map(key).zip(0..).collect();
        faces.sort_unstable();
        let on_others: Vec<_> = faces.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() > 1).collect();
        let first = on_others.iter().min_by_key(|same| same[0].1)?;
        let [one, other] = [first[0].1, first[1].1].map(|f| (f as usize, self.surface.triangles[f as usize]));
        let twin = |v: &u32| other.1.into_iter().find(|o| o != v && place[*o as usize] == place[*v as usize]);
        let vertices = one.1.iter().find_map(|v| Some([*v, twin(v)?]))?;
        let tets = [one.0, other.0].map(|f| self.tets[f] as usize);
        let at = self.surface.vertices[vertices[0] as usize];
        Some(LooseFaces { faces: on_others.iter().map(|same| same.len() - 1).sum(), tets, vertices, at })
    }
}

/// How far from a face what lies on it may be, mm.
fn tolerance([a, b, c]: &[Point<Patient>; 3]) -> f64 {
    ON * a.distance(*b).max(b.distance(*c)).max(c.distance(*a))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::embedding::tests::block;

    #[test]
    fn a_whole_mesh_has_no_hanging_nodes() {
        let mut far = block(3);
        far.vertices.iter_mut().for_each(|p| *p = Point::new(p.x * 1e-3 + 5e3, p.y * 1e-3, p.z * 1e-3 - 1e4));
        for mesh in [block(3), far] {
            assert_eq!(mesh.unshared(), (None, None));
        }
    }

    /// The element 0 1 2 3 and, beyond its face 1 2 3, what `beyond` makes of the far point 4 and the new ones.
    fn beyond(new: &[[f64; 3]], beyond: &[[u32; 4]]) -> TetMesh {
        let corners = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [1., 1., 1.]];
        let vertices = corners.iter().chain(new).map(|&p| Point::from_array(p)).collect();
        let tets: Vec<_> = [[0, 1, 2, 3]].iter().chain(beyond).copied().collect();
        let labels = vec![1; tets.len()];
        let mesh = TetMesh { vertices, tets, labels };
        mesh.validate().expect("valid");
        mesh.check_conforming().expect("no face is used wrongly");
        mesh
    }

    #[test]
    fn a_vertex_on_a_face_or_an_edge_of_another_element_was_taken() {
        let third = 1.0 / 3.0;
        let on_face = beyond(&[[third; 3]], &[[1, 2, 5, 4], [2, 3, 5, 4], [3, 1, 5, 4]]);
        let on_edge = beyond(&[[0.5, 0.5, 0.0]], &[[1, 5, 3, 4], [5, 2, 3, 4]]);
        for (mesh, at) in [(on_face, [third; 3]), (on_edge, [0.5, 0.5, 0.0])] {
            let (hanging, loose) = mesh.unshared();
            assert_eq!(hanging, Some(HangingNode { vertices: 1, vertex: 5, tet: 0, at: Point::from_array(at) }));
            assert_eq!(loose, None);
        }
    }

    #[test]
    fn vertices_doubled_but_for_rounding_were_taken() {
        let near = [[1.0 + 3e-8, 0., 0.], [0., 1.0 - 2e-8, 1e-8], [0., 0., 1.0]];
        let torn = beyond(&near, &[[5, 6, 7, 4]]);
        let (hanging, loose) = torn.unshared();
        assert_eq!(hanging, None);
        let loose = loose.expect("a face on another");
        assert_eq!((loose.faces, loose.tets, loose.vertices), (1, [0, 1], [1, 5]));
        // Half a percent away it is a gap, as they are between bodies.
        let apart = beyond(&near.map(|p| p.map(|c| c + 0.005)), &[[5, 6, 7, 4]]);
        assert_eq!(apart.unshared(), (None, None));
    }

    #[test]
    fn bodies_that_touch_in_a_corner_have_no_hanging_nodes() {
        let touching = beyond(&[[1., 0., 1e-9], [2., 0., 0.], [1., 1., 0.]], &[[5, 6, 7, 4]]);
        assert_eq!(touching.unshared(), (None, None));
    }
}
