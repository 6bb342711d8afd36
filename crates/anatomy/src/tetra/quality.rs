//! One number for the shape of a tetrahedron.

use monro_geometry::d3::D3;
use std::array::from_fn;

/// Weight of the radius ratio: a quality of 0.426 stands for a sine of 25.2 degrees and for a radius ratio of 0.203, a little
/// more than is asked for in each.
const RATIO_WEIGHT: f64 = 0.895;

/// A number for each of several tetrahedra that are looked at together.
type Lanes<const N: usize> = [f64; N];

/// So many tetrahedra take about as long as two: roots and divisions are done in pairs, and none waits for another.
pub(super) const TOGETHER: usize = 4;

/// The smaller of the sine of the worst dihedral angle (small or large alike) and the root of the weighted radius ratio (three
/// times the inscribed over the circumscribed radius); 0 or less for a flat or inverted element. The sine alone does not
/// see needles, the radius ratio alone not single bad angles. A regular tetrahedron has 0.943.
#[inline]
pub(super) fn quality(corners: [D3; 4]) -> f64 {
    let [q] = qualities(&corners.map(|p| p.map(|x| [x])));
    q
}

/// [`quality`] of [`TOGETHER`] tetrahedra, to the same bits.
#[inline]
pub(super) fn quality_of_all(tets: [[D3; 4]; TOGETHER]) -> [f64; TOGETHER] {
    qualities(&from_fn(|i| from_fn(|a| from_fn(|n| tets[n][i][a]))))
}

/// [`quality`] with the corner `k` moved by `h` along each axis.
#[inline]
pub(super) fn quality_beside(corners: [D3; 4], k: usize, h: f64) -> D3 {
    let mut moved: [[Lanes<TOGETHER>; 3]; 4] = corners.map(|p| p.map(|x| [x; TOGETHER]));
    (0..3).for_each(|a| moved[k][a][a] += h);
    let [x, y, z, _] = qualities(&moved);
    [x, y, z]
}

#[inline(always)]
fn less<const N: usize>(a: [Lanes<N>; 3], b: [Lanes<N>; 3]) -> [Lanes<N>; 3] {
    from_fn(|i| from_fn(|n| a[i][n] - b[i][n]))
}

#[inline(always)]
fn inner<const N: usize>(a: [Lanes<N>; 3], b: [Lanes<N>; 3]) -> Lanes<N> {
    from_fn(|n| a[0][n] * b[0][n] + a[1][n] * b[1][n] + a[2][n] * b[2][n])
}

#[inline(always)]
fn outer<const N: usize>(a: [Lanes<N>; 3], b: [Lanes<N>; 3]) -> [Lanes<N>; 3] {
    from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        from_fn(|n| a[j][n] * b[k][n] - a[k][n] * b[j][n])
    })
}

#[inline(always)]
fn qualities<const N: usize>(corners: &[[Lanes<N>; 3]; 4]) -> Lanes<N> {
    let [a, b, c, d] = *corners;
    let (ab, ac, ad) = (less(b, a), less(c, a), less(d, a));
    let (bc, bd, cd) = (less(c, b), less(d, b), less(d, c));
    // Normals of the faces, twice as long as their areas, by the opposite corner.
    let (na, nb, nc, nd) = (outer(bc, bd), outer(ac, ad), outer(ab, ad), outer(ab, ac));
    let volume6 = inner(nd, ad);
    let l = [ab, ac, ad, bc, bd, cd].map(|e| inner(e, e));
    // The circumradius is |R| / 12 V, the inscribed one 3 V over the areas.
    let r: [Lanes<N>; 3] = from_fn(|i| from_fn(|n| l[0][n] * nb[i][n] - l[1][n] * nc[i][n] + l[2][n] * nd[i][n]));
    let (squares, r2) = ([na, nb, nc, nd].map(|f| inner(f, f)), inner(r, r));
    from_fn(|n| worst(volume6[n], l.map(|l| l[n]), squares.map(|s| s[n]), r2[n]))
}

/// Of six times the volume, the squares of edges, of faces (twice their areas) and of what stands for the circumradius.
#[inline(always)]
fn worst(volume6: f64, l: [f64; 6], [na, nb, nc, nd]: [f64; 4], r2: f64) -> f64 {
    let areas2 = na.sqrt() + nb.sqrt() + nc.sqrt() + nd.sqrt();
    let ratio = 6.0 * RATIO_WEIGHT * volume6 * volume6 / (areas2 * r2.sqrt());
    // sin = 3 V l / (2 A1 A2) = 6V l / (2A1 2A2); the faces at edge ab are those opposite c and d, and so on. One division
    // for all six: each is expanded by the two other faces.
    let others = [na * nb, na * nc, na * nd, nb * nc, nb * nd, nc * nd];
    let smaller = |a: f64, b: f64| if b < a { b } else { a };
    let least = (0..6).map(|i| l[i] * others[i]).fold(f64::INFINITY, smaller) / (others[0] * others[5]);
    // A face without area leaves no number for the first, and next to nothing for the other.
    let q = smaller(ratio, volume6 * volume6 * least).sqrt();
    if volume6 <= 0.0 { volume6 } else { q }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::d3;
    use monro_geometry::{Point, TetMesh};
    use proptest::prelude::*;

    #[test]
    fn a_regular_tetrahedron_has_the_sine_of_its_dihedral() {
        let q = quality([[1., 1., 1.], [-1., -1., 1.], [-1., 1., -1.], [1., -1., -1.]]);
        assert!((q - 8f64.sqrt() / 3.0).abs() < 1e-12, "{q}");
    }

    #[test]
    fn a_face_without_area_made_an_element_of_no_quality_at_all() {
        // Flat, with a face whose corners are on a line: rounding leaves a volume, and nothing of the face.
        let flat = [
            [36.70294654803496, 29.19292269119282, 39.464613366324215],
            [38.12702565074801, 29.93102275810979, 39.464613366324215],
            [37.71596966037047, 30.20594580352833, 40.477636478659726],
            [37.414986099391484, 29.904962242549345, 40.17665291768074],
        ];
        let p = flat[2];
        let on_a_line = |s: f64| [p[0] + s, p[1] + s, p[2] + s];
        let mut flats = vec![flat];
        flats.extend((1..2000).map(|i| {
            let s = 1e-3 * f64::from(i);
            [flat[0], on_a_line(0.0), on_a_line(s), on_a_line(3.0 * s)]
        }));
        assert!(flats.iter().any(|f| d3::volume6(*f) > 0.0));
        for f in flats {
            let all = [quality(f), quality_of_all([f; TOGETHER])[3], quality_beside(f, 0, 0.0)[0]];
            assert!(all.iter().all(|q| q.abs() < 1e-6), "{f:?}: {all:?}");
        }
    }

    proptest! {
        #[test]
        fn the_sine_is_that_of_the_dihedral_angles(p in proptest::array::uniform12(-1.0..1.0f64)) {
            let mut t = [[p[0], p[1], p[2]], [p[3], p[4], p[5]], [p[6], p[7], p[8]], [p[9], p[10], p[11]]];
            if d3::volume6(t) < 0.0 { t.swap(0, 1); }
            let mesh = TetMesh { vertices: t.map(Point::from_array).to_vec(), tets: vec![[0, 1, 2, 3]], labels: vec![0] };
            let q = mesh.quality(0);
            let sine = q.min_dihedral.sin().min(q.max_dihedral.sin());
            let found = quality(t);
            prop_assert!(found <= sine + 1e-9);
            prop_assert!((found - sine.min((RATIO_WEIGHT * q.radius_ratio).sqrt())).abs() < 1e-6);
            // Several at once have the bits of one, turned or not.
            let turned = [t[1], t[0], t[2], t[3]];
            prop_assert_eq!(quality_of_all([t, turned, t, t]), [found, quality(turned), found, found]);
            let beside = |a: usize| { let mut t = t; t[2][a] += 1e-3; quality(t) };
            prop_assert_eq!(quality_beside(t, 2, 1e-3), [beside(0), beside(1), beside(2)]);
        }
    }
}
