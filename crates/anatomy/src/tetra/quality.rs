//! One number for the shape of a tetrahedron.

use super::vec3::{V3, cross, dot, sub};

/// Weight of the radius ratio: a quality of 0.426 stands for a sine of 25.2 degrees and for a radius ratio of 0.203, a little
/// more than is asked for in each.
const RATIO_WEIGHT: f64 = 0.895;

/// The smaller of the sine of the worst dihedral angle (small or large alike) and the root of the weighted radius ratio (three
/// times the inscribed over the circumscribed radius); 0 or less for a flat or inverted element. The sine alone does not
/// see needles, the radius ratio alone not single bad angles. A regular tetrahedron has 0.943.
#[inline]
pub(super) fn quality([a, b, c, d]: [V3; 4]) -> f64 {
    let (ab, ac, ad) = (sub(b, a), sub(c, a), sub(d, a));
    let (bc, bd, cd) = (sub(c, b), sub(d, b), sub(d, c));
    // Normals of the faces, twice as long as their areas, by the opposite corner.
    let (na, nb, nc, nd) = (cross(bc, bd), cross(ac, ad), cross(ab, ad), cross(ab, ac));
    let volume6 = dot(nd, ad);
    if volume6 <= 0.0 {
        return volume6.min(0.0);
    }
    let l = [dot(ab, ab), dot(ac, ac), dot(ad, ad), dot(bc, bc), dot(bd, bd), dot(cd, cd)];
    // The circumradius is |R| / 12 V, the inscribed one 3 V over the areas.
    let r: V3 = std::array::from_fn(|i| l[0] * nb[i] - l[1] * nc[i] + l[2] * nd[i]);
    let squares = [dot(na, na), dot(nb, nb), dot(nc, nc), dot(nd, nd)];
    let areas2: f64 = squares.iter().map(|n| n.sqrt()).sum();
    let ratio = 6.0 * RATIO_WEIGHT * volume6 * volume6 / (areas2 * dot(r, r).sqrt());
    // sin = 3 V l / (2 A1 A2) = 6V l / (2A1 2A2); the faces at edge ab are those opposite c and d, and so on. One division
    // for all six: each is expanded by the two other faces.
    let [na, nb, nc, nd] = squares;
    let others = [na * nb, na * nc, na * nd, nb * nc, nb * nd, nc * nd];
    let least = (0..6).map(|i| l[i] * others[i]).fold(f64::INFINITY, f64::min) / (others[0] * others[5]);
    (volume6 * volume6 * least).min(ratio).sqrt()
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
            prop_assert!((found - sine.min((RATIO_WEIGHT * q.radius_ratio).sqrt())).abs() < 1e-6);
        }
    }
}
