//! Strain and stress of the elements of a displacement, for looking at.

use super::scene::Scene;
use monro_case::vtu::{DataArray, Kind};
use monro_geometry::{Patient, Vector, deformation_gradient, volume_ratio};

/// Cell arrays of a displacement (mm) at the nodes of a scene: `volume_ratio`, the volume over that at rest, and `von_mises`,
/// sqrt(3/2) times the norm of the deviator of the Cauchy stress mu/J dev(F F^T), Pa. An element that is flat or turned inside out
/// has no stress: NaN.
pub(super) fn arrays(scene: &Scene, displacement: &[Vector<Patient>]) -> [DataArray; 2] {
    let (mut ratio, mut stress) = (Vec::new(), Vec::new());
    for (t, label) in scene.mesh.labels.iter().enumerate() {
        let f = deformation_gradient(scene.mesh.displacement_gradient(t, displacement));
        let j = volume_ratio(f);
        ratio.push(j);
        stress.push(if j > 0.0 { 1e3 * scene.materials[label].shear_kpa() / j * deviator(f) } else { f64::NAN });
    }
    [("volume_ratio", ratio), ("von_mises", stress)].map(|(name, of)| DataArray::scalars(name, Kind::Float64, of))
}

/// sqrt(3/2) times the norm of the deviator of F F^T.
fn deviator(f: [[f64; 3]; 3]) -> f64 {
    let left: [[f64; 3]; 3] = f.map(|r| f.map(|s| r.iter().zip(s).map(|(a, b)| a * b).sum()));
    let mean = (left[0][0] + left[1][1] + left[2][2]) / 3.0;
    let part = |i: usize, k: usize| left[i][k] - if i == k { mean } else { 0.0 };
    let square: f64 = (0..9).map(|n| part(n / 3, n % 3).powi(2)).sum();
    (1.5 * square).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stretch_has_the_deviator_of_its_principal_values_however_it_is_turned() {
        // Stretched by 2 and 0.5 along x and y, then turned about z.
        let f = [[0.6 * 2.0, -0.8 * 0.5, 0.0], [0.8 * 2.0, 0.6 * 0.5, 0.0], [0.0, 0.0, 1.0]];
        // Principal values of F F^T: 4, 1/4 and 1.
        let [a, b, c] = [4.0, 0.25, 1.0f64];
        let wanted = (0.5 * ((a - b).powi(2) + (b - c).powi(2) + (c - a).powi(2))).sqrt();
        assert!((deviator(f) - wanted).abs() < 1e-12, "{} for {wanted}", deviator(f));
    }
}
