//! How a displacement deforms the elements of a mesh.

use crate::{Patient, TetMesh, Vector};

impl TetMesh {
    /// Gradient of a displacement (mm, one for each vertex) in tetrahedron `tet`: row by component, column by axis.
    ///
    /// # Panics
    /// When the element or a displacement of its corners does not exist.
    pub fn displacement_gradient(&self, tet: usize, displacement: &[Vector<Patient>]) -> [[f64; 3]; 3] {
        let [p, q, r, s] = self.corners(tet);
        let edges = [q - p, r - p, s - p];
        let six = edges[0].dot(edges[1].cross(edges[2]));
        let [first, others @ ..] = self.tets[tet].map(|v| displacement[v as usize]);
        let mut out = [[0.0; 3]; 3];
        for (k, other) in others.into_iter().enumerate() {
            // What grows by one along this edge and by nothing along the others.
            let slope = (edges[(k + 1) % 3].cross(edges[(k + 2) % 3]) * (1.0 / six)).to_array();
            for (row, c) in out.iter_mut().zip((other - first).to_array()) {
                row.iter_mut().zip(slope).for_each(|(g, s)| *g += c * s);
            }
        }
        out
    }
}

/// The deformation gradient of a displacement's.
pub fn deformation_gradient(displacement: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|a| [0, 1, 2].map(|b| displacement[a][b] + f64::from(u8::from(a == b))))
}

/// Volume over that at rest: the determinant of a deformation gradient.
pub fn volume_ratio(deformation: [[f64; 3]; 3]) -> f64 {
    let [x, y, z] = deformation.map(Vector::<Patient>::from_array);
    x.dot(y.cross(z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Point;

    #[test]
    fn an_element_has_the_gradient_of_an_even_deformation() {
        let corners = [[1.0, 2.0, 3.0], [4.0, 2.0, 3.5], [1.0, 6.0, 3.0], [0.5, 2.0, 9.0]];
        let vertices = corners.map(Point::from_array).to_vec();
        let mesh = TetMesh { vertices, tets: vec![[0, 1, 2, 3]], labels: vec![1] };
        let field = |[x, y, z]: [f64; 3]| [0.1 * x - 0.2 * y + 7.0, 0.3 * z, 0.05 * x + 0.4 * y];
        let g = mesh.displacement_gradient(0, &corners.map(|x| Vector::from_array(field(x))));
        let expected = [[0.1, -0.2, 0.0], [0.0, 0.0, 0.3], [0.05, 0.4, 0.0]];
        assert!(g.as_flattened().iter().zip(expected.as_flattened()).all(|(g, e)| (g - e).abs() < 1e-12), "{g:?}");
        let ratio = volume_ratio(deformation_gradient(g));
        assert!((ratio - 1.1 * (1.0 - 0.12) - 0.2 * (0.0 - 0.015)).abs() < 1e-12, "{ratio}");
    }
}
