//! Strain and stress of the elements of a displacement, for looking at.

use super::scene::Scene;
use monro_case::vtu::{DataArray, Kind};
use monro_geometry::{Patient, TetMesh, Vector};

type Matrix = [[f64; 3]; 3];

/// Cell arrays of a displacement (mm) at the nodes of a scene: `volume_ratio`, the volume over that at rest, and `von_mises`,
/// sqrt(3/2) times the norm of the deviator of the Cauchy stress mu/J dev(F F^T), Pa. An element that is flat or turned inside out
/// has no stress: NaN.
pub(super) fn arrays(scene: &Scene, displacement: &[Vector<Patient>]) -> [DataArray; 2] {
    let (mut ratio, mut stress) = (Vec::new(), Vec::new());
    for (t, label) in scene.mesh.labels.iter().enumerate() {
        let f = gradient(&scene.mesh, t, displacement);
        let j = determinant(f);
        ratio.push(j);
        stress.push(if j > 0.0 { 1e3 * scene.materials[label].shear_kpa() / j * deviator(f) } else { f64::NAN });
    }
    [("volume_ratio", ratio), ("von_mises", stress)].map(|(name, of)| DataArray::scalars(name, Kind::Float64, of))
}

/// The deformation gradient of an element.
fn gradient(mesh: &TetMesh, tet: usize, displacement: &[Vector<Patient>]) -> Matrix {
    let [a, b, c, d] = mesh.tets[tet].map(|v| v as usize);
    let rest = [b, c, d].map(|v| mesh.vertices[v] - mesh.vertices[a]);
    let moved = [b, c, d].map(|v| displacement[v] - displacement[a]);
    // Rows of the inverse of the matrix whose columns are the edges at rest.
    let volume6 = rest[0].dot(rest[1].cross(rest[2]));
    let inverse = [rest[1].cross(rest[2]), rest[2].cross(rest[0]), rest[0].cross(rest[1])].map(|v| v * (1.0 / volume6));
    let mut f = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for (u, w) in moved.map(Vector::to_array).iter().zip(inverse.map(Vector::to_array)) {
        for (row, u) in f.iter_mut().zip(u) {
            row.iter_mut().zip(w).for_each(|(of, w)| *of += u * w);
        }
    }
    f
}

fn determinant([a, b, c]: Matrix) -> f64 {
    let [a, b, c] = [a, b, c].map(Vector::<Patient>::from_array);
    a.dot(b.cross(c))
}

/// sqrt(3/2) times the norm of the deviator of F F^T.
fn deviator(f: Matrix) -> f64 {
    let left: Matrix = f.map(|r| f.map(|s| r.iter().zip(s).map(|(a, b)| a * b).sum()));
    let mean = (left[0][0] + left[1][1] + left[2][2]) / 3.0;
    let part = |i: usize, k: usize| left[i][k] - if i == k { mean } else { 0.0 };
    let square: f64 = (0..9).map(|n| part(n / 3, n % 3).powi(2)).sum();
    (1.5 * square).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Point;

    #[test]
    fn a_stretched_element_has_the_gradient_and_the_stress_of_its_stretch() {
        let corners = [[1.0, 2.0, 3.0], [4.0, 2.0, 3.5], [1.0, 6.0, 3.0], [0.5, 2.0, 9.0]];
        let mesh =
            TetMesh { vertices: corners.map(Point::from_array).to_vec(), tets: vec![[0, 1, 2, 3]], labels: vec![1] };
        // Stretched by 2 and 0.5 along x and y, turned about z.
        let turn = |[x, y, z]: [f64; 3]| [0.6 * x - 0.8 * y, 0.8 * x + 0.6 * y, z];
        let moved = corners.map(|[x, y, z]| Point::from_array(turn([2.0 * x, 0.5 * y, z])));
        let displacement: Vec<_> = moved.iter().zip(&mesh.vertices).map(|(m, p)| *m - *p).collect();
        let f = gradient(&mesh, 0, &displacement);
        assert!((determinant(f) - 1.0).abs() < 1e-12);
        // Principal values of F F^T: 4, 1/4 and 1.
        let [a, b, c] = [4.0, 0.25, 1.0f64];
        let wanted = (0.5 * ((a - b).powi(2) + (b - c).powi(2) + (c - a).powi(2))).sqrt();
        assert!((deviator(f) - wanted).abs() < 1e-12, "{} for {wanted}", deviator(f));
    }
}
