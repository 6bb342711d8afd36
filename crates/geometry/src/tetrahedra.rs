//! Labelled tetrahedral meshes.

use crate::buckets::sorted_by_point;
use crate::triangles::is_somewhere;
use crate::{Patient, Point, TriangleMesh};
use thiserror::Error;

/// Corners of the face of a tetrahedron opposite to each of its corners, counter-clockwise as seen from outside of a positively
/// oriented one.
pub const TET_FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// Corners of the edges of a tetrahedron, the lower one first.
pub const TET_EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// Corners in order: the same for all that share them.
pub(crate) fn sorted<const N: usize>(mut corners: [u32; N]) -> [u32; N] {
    corners.sort_unstable();
    corners
}

/// The first vertex that is no corner of anything, and how many there are.
pub(crate) fn unused(vertices: usize, corners: &[u32]) -> Option<(usize, usize)> {
    let mut used = vec![false; vertices];
    corners.iter().for_each(|&v| used[v as usize] = true);
    let vertex = used.iter().position(|u| !u)?;
    Some((vertex, used.iter().filter(|u| !**u).count()))
}

/// A tetrahedral mesh in the patient frame (mm) with one label per element. Element `[a, b, c, d]` has positive volume:
/// `(b - a) x (c - a) . (d - a) > 0`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TetMesh {
    /// Vertex positions, mm.
    pub vertices: Vec<Point<Patient>>,
    /// Vertex indices of each tetrahedron.
    pub tets: Vec<[u32; 4]>,
    /// Label of each tetrahedron: the value in the label volume it was made from.
    pub labels: Vec<u16>,
}

/// Why a tetrahedral mesh was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum TetMeshError {
    /// A tetrahedron names a vertex that does not exist.
    #[error("tetrahedron {tet} uses vertex {vertex}, but there are only {vertices}")]
    Index {
        /// The element.
        tet: usize,
        /// The vertex it names.
        vertex: u32,
        /// Vertices in the mesh.
        vertices: usize,
    },
    /// A vertex is nowhere.
    #[error("vertex {0} has a coordinate that is not finite, or beyond 1e100 mm")]
    NotFinite(usize),
    /// An element is flat or inverted.
    #[error("tetrahedron {tet} has volume {volume} mm3")]
    Inverted {
        /// The element.
        tet: usize,
        /// Its signed volume in mm3.
        volume: f64,
    },
    /// Labels and elements differ in number.
    #[error("{labels} labels for {tets} tetrahedra")]
    Labels {
        /// Labels given.
        labels: usize,
        /// Elements given.
        tets: usize,
    },
    /// There is no element.
    #[error("the mesh has no tetrahedra")]
    Empty,
    /// Two elements have the same corners.
    #[error("tetrahedra {first} and {second} have the same four vertices; remove one")]
    Duplicate {
        /// The first.
        first: usize,
        /// The second.
        second: usize,
    },
    /// A face belongs to more than two elements.
    #[error("tetrahedra {tets:?} share the face of vertices {face:?}; at most two may, one on either side")]
    Face {
        /// Three of the elements.
        tets: [usize; 3],
        /// The corners of the face.
        face: [u32; 3],
    },
    /// Two elements lie on the same side of their common face.
    #[error("tetrahedra {first} and {second} overlap: both lie on the same side of the face of vertices {face:?}")]
    Overlap {
        /// The first.
        first: usize,
        /// The second.
        second: usize,
        /// The corners of the face.
        face: [u32; 3],
    },
    /// Elements meet in a face, each with vertices of its own.
    #[error(
        "tetrahedra {} and {} meet in a face without sharing it: vertices {} and {} are both at ({:.3}, {:.3}, {:.3}) mm ({faces} such face(s)); merge vertices in the same place",
        tets[0], tets[1], vertices[0], vertices[1], at[0], at[1], at[2]
    )]
    Torn {
        /// The elements.
        tets: [usize; 2],
        /// Vertices in the same place.
        vertices: [u32; 2],
        /// The place, mm.
        at: [f64; 3],
        /// How many faces are torn.
        faces: usize,
    },
    /// A vertex belongs to no element.
    #[error(
        "vertex {vertex} belongs to no tetrahedron ({count} of {vertices} vertices do not); remove unused vertices"
    )]
    Unused {
        /// The first such vertex.
        vertex: usize,
        /// How many there are.
        count: usize,
        /// Vertices in the mesh.
        vertices: usize,
    },
}

/// Shape of one tetrahedron.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TetQuality {
    /// Smallest dihedral angle, radians.
    pub min_dihedral: f64,
    /// Largest dihedral angle, radians.
    pub max_dihedral: f64,
    /// Three times the inscribed over the circumscribed radius: 1 for a regular tetrahedron, 0 for a flat one.
    pub radius_ratio: f64,
}

/// Signed volume in mm3 of the tetrahedron `a b c d`.
pub fn tet_signed_volume([a, b, c, d]: [Point<Patient>; 4]) -> f64 {
    (b - a).cross(c - a).dot(d - a) / 6.0
}

impl TetMesh {
    /// Checks indices, coordinates, label count and orientation.
    ///
    /// # Errors
    /// The first fault found, with its number.
    pub fn validate(&self) -> Result<(), TetMeshError> {
        if self.labels.len() != self.tets.len() {
            return Err(TetMeshError::Labels { labels: self.labels.len(), tets: self.tets.len() });
        }
        if let Some(i) = self.vertices.iter().position(|p| !is_somewhere(*p)) {
            return Err(TetMeshError::NotFinite(i));
        }
        for (tet, t) in self.tets.iter().enumerate() {
            if let Some(&vertex) = t.iter().find(|&&v| v as usize >= self.vertices.len()) {
                return Err(TetMeshError::Index { tet, vertex, vertices: self.vertices.len() });
            }
            let volume = self.volume(tet);
            if volume <= 0.0 {
                return Err(TetMeshError::Inverted { tet, volume });
            }
        }
        Ok(())
    }

    /// Checks of a mesh from elsewhere, after [`TetMesh::validate`], that its elements fit together: at least one element,
    /// no two with the same corners, each face of at most two elements on either side of it, each vertex of an element.
    ///
    /// # Errors
    /// The first fault found, with its elements or vertex.
    pub fn check_conforming(&self) -> Result<(), TetMeshError> {
        if self.tets.is_empty() {
            return Err(TetMeshError::Empty);
        }
        let vertices = self.vertices.len();
        if let Some((vertex, count)) = unused(vertices, self.tets.as_flattened()) {
            return Err(TetMeshError::Unused { vertex, count, vertices });
        }
        // The corners of each face in order, whether the element lies on the side from which they run clockwise, the element.
        let mut faces: Vec<([u32; 3], bool, u32)> = Vec::with_capacity(4 * self.tets.len());
        for (t, tet) in (0u32..).zip(&self.tets) {
            for [a, b, c] in TET_FACES.map(|f| f.map(|i| tet[i])) {
                faces.push((sorted([a, b, c]), (a > b) ^ (b > c) ^ (a > c), t));
            }
        }
        // In place: there may be a hundred million of them.
        faces.sort_unstable();
        faces.chunk_by(|a, b| a.0 == b.0).try_for_each(|around| self.check_face(around))
    }

    /// The elements around one face: as in [`TetMesh::check_conforming`].
    fn check_face(&self, around: &[([u32; 3], bool, u32)]) -> Result<(), TetMeshError> {
        let corners = |i: usize| sorted(self.tets[around[i].2 as usize]);
        let tet = |i: usize| around[i].2 as usize;
        for i in 1..around.len() {
            if let Some(j) = (0..i).find(|&j| corners(i) == corners(j)) {
                let (first, second) = (tet(i).min(tet(j)), tet(i).max(tet(j)));
                return Err(TetMeshError::Duplicate { first, second });
            }
        }
        let face = around[0].0;
        match around {
            [_] => Ok(()),
            [a, b] if a.1 != b.1 => Ok(()),
            [_, _] => Err(TetMeshError::Overlap { first: tet(0), second: tet(1), face }),
            _ => Err(TetMeshError::Face { tets: [tet(0), tet(1), tet(2)], face }),
        }
    }

    /// The corners of tetrahedron `t`.
    pub fn corners(&self, t: usize) -> [Point<Patient>; 4] {
        self.tets[t].map(|v| self.vertices[v as usize])
    }

    /// Signed volume of tetrahedron `t`, mm3.
    pub fn volume(&self, t: usize) -> f64 {
        tet_signed_volume(self.corners(t))
    }

    /// The labels in order, each with its number of elements.
    pub fn label_counts(&self) -> Vec<(u16, usize)> {
        let mut labels = self.labels.clone();
        labels.sort_unstable();
        labels.chunk_by(|a, b| a == b).map(|same| (same[0], same.len())).collect()
    }

    /// Total signed volume of the elements with the given label, mm3.
    pub fn label_volume(&self, label: u16) -> f64 {
        (0..self.tets.len()).filter(|&t| self.labels[t] == label).map(|t| self.volume(t)).sum()
    }

    /// Boundary of the elements that `keep` accepts, as a surface with outward normals. Vertex numbers are those of the
    /// mesh, so unused vertices remain; use [`TetMesh::surface`] for a compact one.
    pub fn boundary(&self, keep: impl Fn(u16) -> bool) -> Vec<[u32; 3]> {
        let mut faces: Vec<([u32; 3], [u32; 3])> = Vec::new();
        for (t, &label) in self.tets.iter().zip(&self.labels) {
            if keep(label) {
                for f in TET_FACES {
                    let face = f.map(|i| t[i]);
                    faces.push((sorted(face), face));
                }
            }
        }
        // In place: there may be a hundred million of them.
        faces.sort_unstable();
        faces.chunk_by(|a, b| a.0 == b.0).filter(|c| c.len() == 1).map(|c| c[0].1).collect()
    }

    /// The boundary of the elements that `keep` accepts, with its own compact vertices.
    pub fn surface(&self, keep: impl Fn(u16) -> bool) -> TriangleMesh {
        let mut number = vec![u32::MAX; self.vertices.len()];
        let mut out = TriangleMesh::default();
        for face in self.boundary(keep) {
            let triangle = face.map(|v| {
                if number[v as usize] == u32::MAX {
                    number[v as usize] = out.vertices.len() as u32;
                    out.vertices.push(self.vertices[v as usize]);
                }
                number[v as usize]
            });
            out.triangles.push(triangle);
        }
        out
    }

    /// Distinct edges, each `[lower, higher]`, sorted.
    pub fn edges(&self) -> Vec<[u32; 2]> {
        let mut edges: Vec<[u32; 2]> = Vec::with_capacity(self.tets.len() * 6);
        for t in &self.tets {
            edges.extend(TET_EDGES.map(|[a, b]| [t[a].min(t[b]), t[a].max(t[b])]));
        }
        let mut edges = sorted_by_point(&edges, self.vertices.len(), |edge| edge[0]);
        edges.dedup();
        edges
    }

    /// Shape measures of tetrahedron `t`.
    pub fn quality(&self, t: usize) -> TetQuality {
        quality(self.corners(t))
    }
}

fn quality(p: [Point<Patient>; 4]) -> TetQuality {
    let areas = TET_FACES.map(|[a, b, c]: [usize; 3]| (p[b] - p[a]).cross(p[c] - p[a]) * 0.5);
    let (mut low, mut high) = (f64::INFINITY, 0f64);
    for i in 0..4 {
        for j in i + 1..4 {
            let angle = core::f64::consts::PI - areas[i].angle(areas[j]);
            (low, high) = (low.min(angle), high.max(angle));
        }
    }
    let volume = tet_signed_volume(p);
    let inscribed = 3.0 * volume / areas.iter().map(|a| a.norm()).sum::<f64>();
    // The circumcentre from a corner is this over twelve volumes. Products of opposite edges (Crelle) would be told apart by
    // rounding alone where four corners nearly lie on a circle.
    let [ab, ac, ad] = [1, 2, 3].map(|i| p[i] - p[0]);
    let centre = ac.cross(ad) * ab.norm_squared() + ad.cross(ab) * ac.norm_squared() + ab.cross(ac) * ad.norm_squared();
    let circumscribed = centre.norm() / (12.0 * volume.abs());
    let radius_ratio = if volume > 0.0 { 3.0 * inscribed / circumscribed } else { 0.0 };
    TetQuality { min_dihedral: low, max_dihedral: high, radius_ratio }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn regular() -> TetMesh {
        let vertices = [[1., 1., 1.], [1., -1., -1.], [-1., 1., -1.], [-1., -1., 1.]].map(Point::from_array).to_vec();
        TetMesh { vertices, tets: vec![[0, 1, 2, 3]], labels: vec![4] }
    }

    #[test]
    fn the_worst_of_shapes_had_an_infinite_radius_ratio() {
        for lifted in [1e-3, 1e-5, 1e-7] {
            let on = |degrees: f64, z: f64| {
                let (s, c) = f64::to_radians(degrees).sin_cos();
                Point::new(10.0 * c, 10.0 * s, z)
            };
            let mut m = regular();
            m.vertices = vec![on(0.0, 0.0), on(97.0, 0.0), on(181.0, lifted), on(268.0, 0.0)];
            if m.volume(0) < 0.0 {
                m.tets[0].swap(0, 1);
            }
            let q = m.quality(0);
            assert!(m.volume(0) > 0.0 && q.radius_ratio > 0.0 && q.radius_ratio < lifted, "{q:?}");
        }
    }

    #[test]
    fn a_regular_tetrahedron_has_ratio_one_and_dihedral_acos_one_third() {
        let mut m = regular();
        if m.volume(0) < 0.0 {
            m.tets[0].swap(0, 1);
        }
        let q = m.quality(0);
        let expected = (1.0f64 / 3.0).acos();
        assert!((q.radius_ratio - 1.0).abs() < 1e-12, "{q:?}");
        assert!((q.min_dihedral - expected).abs() < 1e-12 && (q.max_dihedral - expected).abs() < 1e-12);
        assert!((m.volume(0) - 8.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn the_boundary_of_two_glued_elements_is_closed_and_encloses_their_volume() {
        let vertices =
            [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [0., 0., -1.]].map(Point::from_array).to_vec();
        let m = TetMesh { vertices, tets: vec![[0, 1, 2, 3], [0, 2, 1, 4]], labels: vec![4, 5] };
        m.validate().expect("valid");
        let s = m.surface(|_| true);
        assert_eq!(s.triangles.len(), 6);
        assert!(s.topology().is_closed() && s.topology().is_oriented());
        assert!((s.signed_volume() - 1.0 / 3.0).abs() < 1e-12);
        assert!((m.surface(|l| l == 5).signed_volume() - 1.0 / 6.0).abs() < 1e-12);
        assert_eq!(m.edges().len(), 9);
    }

    #[test]
    fn what_does_not_fit_together_is_refused_with_its_elements() {
        let points = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [0., 0., -1.], [0.2, 0.2, 2.]];
        let mesh = |tets: &[[u32; 4]], vertices: usize| TetMesh {
            vertices: points[..vertices].iter().map(|&p| Point::from_array(p)).collect(),
            tets: tets.to_vec(),
            labels: vec![4; tets.len()],
        };
        let fault = |tets: &[[u32; 4]], vertices: usize| {
            let mesh = mesh(tets, vertices);
            mesh.validate().expect("positive volumes");
            mesh.check_conforming()
        };
        assert_eq!(fault(&[[0, 1, 2, 3], [0, 2, 1, 4]], 5), Ok(()));
        assert_eq!(fault(&[], 0), Err(TetMeshError::Empty));
        assert_eq!(
            fault(&[[0, 1, 2, 3], [0, 2, 1, 4], [1, 2, 0, 3]], 5),
            Err(TetMeshError::Duplicate { first: 0, second: 2 })
        );
        assert_eq!(
            fault(&[[0, 1, 2, 3], [0, 2, 1, 4], [0, 1, 2, 5]], 6),
            Err(TetMeshError::Face { tets: [1, 0, 2], face: [0, 1, 2] })
        );
        assert_eq!(
            fault(&[[0, 1, 2, 3], [0, 1, 2, 4 + 1]], 6),
            Err(TetMeshError::Unused { vertex: 4, count: 1, vertices: 6 })
        );
        let both = TetMesh {
            vertices: [0, 1, 2, 3, 5].map(|i| Point::from_array(points[i])).to_vec(),
            ..mesh(&[[0, 1, 2, 3], [0, 1, 2, 4]], 0)
        };
        assert_eq!(both.check_conforming(), Err(TetMeshError::Overlap { first: 0, second: 1, face: [0, 1, 2] }));
    }

    #[test]
    fn inverted_and_mislabelled_elements_are_named() {
        let mut m = regular();
        if m.volume(0) > 0.0 {
            m.tets[0].swap(0, 1);
        }
        assert!(matches!(m.validate(), Err(TetMeshError::Inverted { tet: 0, .. })));
        m.labels.push(1);
        assert_eq!(m.validate(), Err(TetMeshError::Labels { labels: 2, tets: 1 }));
    }
}
