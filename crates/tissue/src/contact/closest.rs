//! Closest points of a segment and a triangle.

use crate::vec3::{V3, axpy, cross, dot, sub};

/// The closest pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Closest {
    /// Share of the way along the segment.
    pub(crate) t: f32,
    /// Barycentric coordinates in the triangle.
    pub(crate) weights: [f32; 3],
    /// Squared distance.
    pub(crate) distance2: f32,
}

/// Closest points of segment `p q` and the triangle; distance 0 where they cross.
pub(crate) fn segment_triangle(p: V3, q: V3, tri: [V3; 3]) -> Closest {
    if let Some(hit) = crossing(p, q, tri) {
        return hit;
    }
    let mut best = point_triangle(p, tri, 0.0);
    best = nearer(best, point_triangle(q, tri, 1.0));
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        best = nearer(best, segment_edge(p, q, tri, i, j));
    }
    best
}

fn nearer(a: Closest, b: Closest) -> Closest {
    if b.distance2 < a.distance2 { b } else { a }
}

fn crossing(p: V3, q: V3, [a, b, c]: [V3; 3]) -> Option<Closest> {
    let (d, e1, e2) = (sub(q, p), sub(b, a), sub(c, a));
    let h = cross(d, e2);
    let det = dot(e1, h);
    if det == 0.0 {
        return None;
    }
    let s = sub(p, a);
    let k = cross(s, e1);
    let (u, v, t) = (dot(s, h) / det, dot(d, k) / det, dot(e2, k) / det);
    let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && (0.0..=1.0).contains(&t);
    inside.then_some(Closest { t, weights: [1.0 - u - v, u, v], distance2: 0.0 })
}

/// Nearest point of a triangle (Ericson, Real-Time Collision Detection, 5.1.5).
pub(crate) fn point_triangle(p: V3, [a, b, c]: [V3; 3], t: f32) -> Closest {
    let weights = nearest_weights(p, a, b, c);
    let at = axpy(axpy(core::array::from_fn(|i| a[i] * weights[0]), weights[1], b), weights[2], c);
    let d = sub(p, at);
    Closest { t, weights, distance2: dot(d, d) }
}

fn nearest_weights(p: V3, a: V3, b: V3, c: V3) -> [f32; 3] {
    let (ab, ac, ap) = (sub(b, a), sub(c, a), sub(p, a));
    let (d1, d2) = (dot(ab, ap), dot(ac, ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let bp = sub(p, b);
    let (d3, d4) = (dot(ab, bp), dot(ac, bp));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let v = d1 / (d1 - d3);
        return [1.0 - v, v, 0.0];
    }
    let cp = sub(p, c);
    let (d5, d6) = (dot(ab, cp), dot(ac, cp));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let w = d2 / (d2 - d6);
        return [1.0 - w, 0.0, w];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - w, w];
    }
    let sum = va + vb + vc;
    [va / sum, vb / sum, vc / sum]
}

/// Closest points of segment `p q` and edge `i j` of the triangle (Ericson, 5.1.9).
fn segment_edge(p: V3, q: V3, tri: [V3; 3], i: usize, j: usize) -> Closest {
    let (d1, d2, r) = (sub(q, p), sub(tri[j], tri[i]), sub(p, tri[i]));
    let (a, e, f) = (dot(d1, d1), dot(d2, d2), dot(d2, r));
    let (b, c) = (dot(d1, d2), dot(d1, r));
    let denominator = a * e - b * b;
    // Nearly parallel: any pair of opposite points will do; the end points are looked at elsewhere.
    let mut t = if denominator > 1e-6 * a * e { ((b * f - c * e) / denominator).clamp(0.0, 1.0) } else { 0.5 };
    let mut s = if e > 0.0 { (b * t + f) / e } else { 0.0 };
    if !(0.0..=1.0).contains(&s) {
        s = s.clamp(0.0, 1.0);
        t = if a > 0.0 { ((b * s - c) / a).clamp(0.0, 1.0) } else { 0.0 };
    }
    let d = sub(axpy(p, t, d1), axpy(tri[i], s, d2));
    let mut weights = [0.0; 3];
    weights[i] = 1.0 - s;
    weights[j] = s;
    Closest { t, weights, distance2: dot(d, d) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_pair_of_sampled_points_is_closer(
            p in proptest::array::uniform3(-5.0..5.0f32),
            q in proptest::array::uniform3(-5.0..5.0f32),
            a in proptest::array::uniform3(-5.0..5.0f32),
            b in proptest::array::uniform3(-5.0..5.0f32),
            c in proptest::array::uniform3(-5.0..5.0f32),
        ) {
            let found = segment_triangle(p, q, [a, b, c]);
            let at = |t: f32, w: [f32; 3]| {
                let x = axpy(axpy(core::array::from_fn(|i| a[i] * w[0]), w[1], b), w[2], c);
                let d = sub(axpy(p, t, sub(q, p)), x);
                dot(d, d)
            };
            prop_assert!((at(found.t, found.weights) - found.distance2).abs() < 1e-3);
            for i in 0..=20u8 {
                for j in 0..=20u8 {
                    for k in 0..=(20 - j) {
                        let (t, u, v) = (f32::from(i) / 20.0, f32::from(j) / 20.0, f32::from(k) / 20.0);
                        prop_assert!(found.distance2.sqrt() <= at(t, [1.0 - u - v, u, v]).sqrt() + 1e-3);
                    }
                }
            }
        }
    }
}
