//! One number for the shape of a tetrahedron.

use super::vec3::{V3, cross, dot, sub};

/// The smaller of the sine of the worst dihedral angle (small or large alike) and the mean ratio; 0 or less for a flat
/// or inverted element. The sine alone does not see needles, the mean ratio alone not single bad angles. A regular
/// tetrahedron has 0.943.
pub(super) fn quality([a, b, c, d]: [V3; 4]) -> f64 {
    let (ab, ac, ad) = (sub(b, a), sub(c, a), sub(d, a));
    let (bc, bd, cd) = (sub(c, b), sub(d, b), sub(d, c));
    let volume6 = dot(cross(ab, ac), ad);
    if volume6 <= 0.0 {
        return volume6.min(0.0);
    }
    // Squares of twice the face areas, by the opposite corner.
    let (na, nb, nc, nd) = (cross(bc, bd), cross(ac, ad), cross(ab, ad), cross(ab, ac));
    let (na, nb, nc, nd) = (dot(na, na), dot(nb, nb), dot(nc, nc), dot(nd, nd));
    let l = [dot(ab, ab), dot(ac, ac), dot(ad, ad), dot(bc, bc), dot(bd, bd), dot(cd, cd)];
    // sin = 3 V l / (2 A1 A2) = 6V l / (2A1 2A2); the faces at edge ab are those opposite c and d, and so on.
    let products = [nc * nd, nb * nd, nb * nc, na * nd, na * nc, na * nb];
    let mut least = f64::INFINITY;
    for i in 0..6 {
        least = least.min(l[i] / products[i]);
    }
    let sine = volume6 * least.sqrt();
    let mean = 12.0 * (0.25 * volume6 * volume6).cbrt() / l.iter().sum::<f64>();
    sine.min(mean)
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::{Point, TetMesh};
    use proptest::prelude::*;

    #[test]
    fn a_regular_tetrahedron_has_the_sine_of_its_dihedral() {
        let q = quality([[1., 1., 1.], [-1., -1., 1.], [-1., 1., -1.], [1., -1., -1.]]);
        assert!((q - 8f64.sqrt() / 3.0).abs() < 1e-12, "{q}");
    }

    proptest! {
        #[test]
        fn the_sine_is_that_of_the_dihedral_angles(p in proptest::array::uniform12(-1.0..1.0f64)) {
            let mut t = [[p[0], p[1], p[2]], [p[3], p[4], p[5]], [p[6], p[7], p[8]], [p[9], p[10], p[11]]];
            if super::super::vec3::volume6(t) < 0.0 { t.swap(0, 1); }
            let mesh = TetMesh { vertices: t.map(Point::from_array).to_vec(), tets: vec![[0, 1, 2, 3]], labels: vec![0] };
            let q = mesh.quality(0);
            let sine = q.min_dihedral.sin().min(q.max_dihedral.sin());
            let found = quality(t);
            prop_assert!(found <= sine + 1e-9);
            // Where the mean ratio does not undercut it, it is the sine.
            let l: f64 = mesh.edges().iter().map(|e| mesh.vertices[e[0] as usize].distance(mesh.vertices[e[1] as usize]).powi(2)).sum();
            let mean = 12.0 * (3.0 * mesh.volume(0)).powf(2.0 / 3.0) / l;
            prop_assert!((found - sine.min(mean)).abs() < 1e-6);
        }
    }
}
