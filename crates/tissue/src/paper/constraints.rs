//! The constraints of equations (6), (7), (8), (10) and (11), each as value and gradients: the plain twins of `lanes`.

use crate::vec3::{V3, add, cross, dot, norm, scale, sub};

/// Equation (6): distance of two vertices minus its initial value. `None` when they coincide.
#[inline(always)]
pub(crate) fn stretch([p1, p2]: [V3; 2], rest: f32) -> Option<(f32, [V3; 2])> {
    let d = sub(p1, p2);
    let length = norm(d);
    if length <= 1e-6 * rest {
        return None;
    }
    let n = scale(d, 1.0 / length);
    Some((length - rest, [n, scale(n, -1.0)]))
}

/// Equation (7): angle between the normals of the triangles `p1 p2 p3` and `p1 p2 p4`, minus its initial value. `None` when
/// a triangle has no area. The angle comes from sine and cosine: the paper's arc cosine loses all digits near 0 and pi.
pub(crate) fn dihedral(p: [V3; 4], rest: f32) -> Option<(f32, [V3; 4])> {
    let (angle, gradients) = angle_with_gradients(p)?;
    Some((angle - rest, gradients))
}

/// The angle of equation (7) and its gradients (Bridson et al. 2003 in the paper's numbering).
pub(crate) fn angle_with_gradients([p1, p2, p3, p4]: [V3; 4]) -> Option<(f32, [V3; 4])> {
    let e = sub(p2, p1);
    let (n3, n4) = (cross(e, sub(p3, p1)), cross(e, sub(p4, p1)));
    let (e2, a3, a4) = (dot(e, e), dot(n3, n3), dot(n4, n4));
    if a3 <= 1e-12 * e2 * e2 || a4 <= 1e-12 * e2 * e2 {
        return None;
    }
    let length = e2.sqrt();
    let sine = dot(cross(n3, n4), e) / length;
    let angle = sine.abs().atan2(dot(n3, n4));
    let sign = if sine < 0.0 { -1.0 } else { 1.0 };
    // Lifting p3 off its plane turns n3 about the edge: the angle from n3 to n4 shrinks, that of p4 grows.
    let g3 = scale(n3, -sign * length / a3);
    let g4 = scale(n4, sign * length / a4);
    // The edge's ends balance them: no net force, no net torque.
    let share = |p: V3| dot(sub(p, p1), e) / e2;
    let (s3, s4) = (share(p3), share(p4));
    let g2 = add(scale(g3, -s3), scale(g4, -s4));
    let g1 = add(scale(g3, s3 - 1.0), scale(g4, s4 - 1.0));
    Some((angle, [g1, g2, g3, g4]))
}

/// Equation (8): distance of the vertex `v` from the centroid of the triangle `p0 p1 v` minus its initial value.
pub(crate) fn triangle([p0, p1, v]: [V3; 3], rest: f32) -> Option<(f32, [V3; 3])> {
    let c = scale(add(add(p0, p1), v), 1.0 / 3.0);
    let d = sub(v, c);
    let h = norm(d);
    if h <= 1e-6 * rest || h == 0.0 {
        return None;
    }
    let n = scale(d, 1.0 / h);
    Some((h - rest, [scale(n, -1.0 / 3.0), scale(n, -1.0 / 3.0), scale(n, 2.0 / 3.0)]))
}

/// Equation (10): volume of a tetrahedron minus its initial value.
#[inline(always)]
pub(crate) fn volume([p1, p2, p3, p4]: [V3; 4], rest: f32) -> (f32, [V3; 4]) {
    let (a, b, c) = (sub(p2, p1), sub(p3, p1), sub(p4, p1));
    let g2 = scale(cross(b, c), 1.0 / 6.0);
    let g3 = scale(cross(c, a), 1.0 / 6.0);
    let g4 = scale(cross(a, b), 1.0 / 6.0);
    let g1 = scale(add(add(g2, g3), g4), -1.0);
    (dot(g4, c) - rest, [g1, g2, g3, g4])
}

/// Equation (11): energy of four springs from the centroid `q` to the vertices, `1/2 sum k_i (|p_i - q| - d_i)^2`.
#[inline(always)]
pub(crate) fn hetero(p: [V3; 4], rest: [f32; 4], k: [f32; 4]) -> (f32, [V3; 4]) {
    let q = scale(add(add(p[0], p[1]), add(p[2], p[3])), 0.25);
    let (mut value, mut pulls, mut sum) = (0.0, [[0.0; 3]; 4], [0.0; 3]);
    for i in 0..4 {
        let d = sub(p[i], q);
        let length = norm(d);
        let stretch = length - rest[i];
        value += 0.5 * k[i] * stretch * stretch;
        pulls[i] = if length > 0.0 { scale(d, k[i] * stretch / length) } else { [0.0; 3] };
        sum = add(sum, pulls[i]);
    }
    // The centroid moves with each vertex by a quarter.
    (value, pulls.map(|f| sub(f, scale(sum, 0.25))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Central differences of a constraint against its gradients, at a scale of `unit` mm.
    fn check<const N: usize>(p: [V3; N], unit: f32, f: impl Fn([V3; N]) -> Option<(f32, [V3; N])>) {
        let Some((_, gradients)) = f(p) else { return };
        let h = 2e-3 * unit;
        let size = gradients.iter().map(|g| norm(*g)).fold(0.0, f32::max);
        for i in 0..N {
            for a in 0..3 {
                let at = |s: f32| {
                    let mut q = p;
                    q[i][a] += s * h;
                    f(q).map(|v| v.0)
                };
                if let (Some(up), Some(down)) = (at(1.0), at(-1.0)) {
                    let slope = (up - down) / (2.0 * h);
                    assert!((slope - gradients[i][a]).abs() < 0.02 * size, "{i} {a}: {slope} {:?}", gradients[i]);
                }
            }
        }
    }

    /// A tetrahedron that is not too flat, at a scale of `unit`.
    fn corners(d: [[f32; 3]; 4], unit: f32) -> [V3; 4] {
        let base = [[0., 0., 0.], [1., 0., 0.], [0.3, 1., 0.], [0.4, 0.3, 0.9]];
        core::array::from_fn(|i| core::array::from_fn(|a| unit * (base[i][a] + 0.2 * d[i][a])))
    }

    proptest! {
        #[test]
        fn gradients_agree_with_finite_differences_in_any_unit(
            d in proptest::array::uniform4(proptest::array::uniform3(-1.0..1.0f32)),
            unit in prop_oneof![Just(1e-3f32), Just(1.0), Just(1e3)],
        ) {
            let p = corners(d, unit);
            check([p[0], p[1]], unit, |q| stretch(q, 0.7 * unit));
            check([p[0], p[1], p[2]], unit, |q| triangle(q, 0.5 * unit));
            check(p, unit, |q| dihedral(q, 0.4));
            check(p, unit, |q| Some(volume(q, 0.1 * unit.powi(3))));
            check(p, unit, |q| Some(hetero(q, [0.3 * unit, 0.5 * unit, 0.9 * unit, 0.2 * unit], [1.0, 0.5, 2.0, 0.1])));
        }

        #[test]
        fn gradients_sum_to_nothing_and_make_no_torque(d in proptest::array::uniform4(proptest::array::uniform3(-1.0..1.0f32))) {
            let p = corners(d, 1.0);
            let all = [
                dihedral(p, 0.0).map(|c| c.1),
                Some(volume(p, 0.0).1),
                Some(hetero(p, [0.3; 4], [1.0, 2.0, 3.0, 4.0]).1),
            ];
            for g in all.into_iter().flatten() {
                let force = (0..4).fold([0.0; 3], |s, i| add(s, g[i]));
                let torque = (0..4).fold([0.0; 3], |s, i| add(s, cross(p[i], g[i])));
                prop_assert!(norm(force) < 1e-4 && norm(torque) < 1e-4, "{force:?} {torque:?}");
            }
        }
    }

    #[test]
    fn values_are_those_of_known_figures() {
        let [o, x, y, z] = [[0.; 3], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]];
        assert!((stretch([x, y], 1.0).expect("apart").0 - (2f32.sqrt() - 1.0)).abs() < 1e-6);
        assert!((volume([o, x, y, z], 0.0).0 - 1.0 / 6.0).abs() < 1e-7);
        // The normals of two faces of a cube's corner about the x axis are perpendicular.
        let quarter = dihedral([o, x, y, z], 0.0).expect("areas").0;
        assert!((quarter - core::f32::consts::FRAC_PI_2).abs() < 1e-6);
        // Flat triangles on both sides of an edge: normals are opposite, the angle is pi.
        let flat = dihedral([o, x, y, [0.3, -1.0, 0.0]], 0.0).expect("areas").0;
        assert!((flat - core::f32::consts::PI).abs() < 1e-6);
        // The centroid of a triangle is two thirds down the median.
        let median = triangle([x, y, o], 0.0).expect("apart").0;
        assert!((median - 2.0 / 3.0 * 0.5f32.sqrt()).abs() < 1e-6);
        // A regular tetrahedron scaled by 2: each spring is stretched by its own length.
        let p = [[1., 1., 1.], [1., -1., -1.], [-1., 1., -1.], [-1., -1., 1.]].map(|v: V3| scale(v, 2.0));
        let (value, g) = hetero(p, [3f32.sqrt(); 4], [1.0; 4]);
        assert!((value - 4.0 * 0.5 * 3.0).abs() < 1e-5);
        assert!((norm(g[0]) - 3f32.sqrt()).abs() < 1e-5);
    }

    #[test]
    fn degenerate_figures_are_skipped_not_divided_by() {
        let o = [0.; 3];
        assert!(stretch([o, o], 1.0).is_none());
        assert!(triangle([o, o, o], 1.0).is_none());
        assert!(dihedral([o, [1., 0., 0.], [2., 0., 0.], [0., 1., 0.]], 0.0).is_none());
        assert!(hetero([o; 4], [1.0; 4], [1.0; 4]).1.iter().flatten().all(|v| v.is_finite()));
    }
}
