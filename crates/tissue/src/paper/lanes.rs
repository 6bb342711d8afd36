//! The constraints of equations (6), (7), (8), (10) and (11), sixteen at a time.
//!
//! Each function moves the vertices that it is given: `p[i]` holds x, y, z and inverse mass of corner `i` in all lanes. The
//! plain functions of `constraints` are the truth; tests hold the two together. A step that is not a number (no free vertex,
//! or no gradient) is none.

use crate::fast::{Lanes, dot};

/// A vertex in each lane: x, y, z, inverse mass.
pub(super) type Corner<V> = [V; 4];
type Vector<V> = [V; 3];

#[inline(always)]
fn sub<V: Lanes>(p: &Corner<V>, q: &Corner<V>) -> Vector<V> {
    [p[0] - q[0], p[1] - q[1], p[2] - q[2]]
}

/// With each product rounded: of edges along one line it is zero, and what has no area has no gradient.
#[inline(always)]
fn cross<V: Lanes>(a: Vector<V>, b: Vector<V>) -> Vector<V> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
fn scale<V: Lanes>(a: Vector<V>, s: V) -> Vector<V> {
    [a[0] * s, a[1] * s, a[2] * s]
}

#[inline(always)]
fn add<V: Lanes>(a: Vector<V>, b: Vector<V>) -> Vector<V> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// `p += s * d`.
#[inline(always)]
fn shift<V: Lanes>(p: &mut Corner<V>, s: V, d: Vector<V>) {
    for a in 0..3 {
        p[a] = s.mul_add(d[a], p[a]);
    }
}

/// Moves the corners along their gradients until the share `k` of the constraint is satisfied.
#[inline(always)]
fn project<V: Lanes, const N: usize>(p: &mut [Corner<V>; N], value: V, gradients: &[Vector<V>; N], k: V) {
    let mut weight = V::splat(0.0);
    for i in 0..N {
        weight = p[i][3].mul_add(dot(gradients[i], gradients[i]), weight);
    }
    let s = (V::splat(0.0) - k * value / weight).or_zero();
    for i in 0..N {
        let step = s * p[i][3];
        shift(&mut p[i], step, gradients[i]);
    }
}

/// Distance of two vertices.
#[inline(always)]
pub(super) fn length<V: Lanes>(p: &Corner<V>, q: &Corner<V>) -> V {
    let d = sub(p, q);
    dot(d, d).sqrt()
}

/// Equation (6): the edge from `p` to `q`.
#[inline(always)]
pub(super) fn stretch<V: Lanes>(p: &mut Corner<V>, q: &mut Corner<V>, rest: V, k: V) {
    let d = sub(p, q);
    let length = dot(d, d).sqrt();
    let s = (k * (length - rest) / (length * (p[3] + q[3]))).or_zero();
    let (back, forth) = (V::splat(0.0) - s * p[3], s * q[3]);
    shift(p, back, d);
    shift(q, forth, d);
}

/// Equation (6): an edge by itself.
#[inline(always)]
pub(super) fn stretch_pair<V: Lanes>([p, q]: &mut [Corner<V>; 2], rest: V, k: V) {
    stretch(p, q, rest, k);
}

/// Six times the volume, and six times its gradients by the last three corners.
#[inline(always)]
fn six_volume<V: Lanes>(p: &[Corner<V>; 4]) -> (V, [Vector<V>; 3]) {
    let [a, b, c] = [sub(&p[1], &p[0]), sub(&p[2], &p[0]), sub(&p[3], &p[0])];
    let last = cross(a, b);
    (dot(last, c), [cross(b, c), cross(c, a), last])
}

/// Six times the volume.
#[inline(always)]
pub(super) fn six_volumes<V: Lanes>(p: &[Corner<V>; 4]) -> V {
    six_volume(p).0
}

/// Equation (10): the volume, here and at rest six times over (so no factor of 1/6 is needed).
#[inline(always)]
pub(super) fn inflate<V: Lanes>(p: &mut [Corner<V>; 4], rest: V, k: V) {
    let (value, [g1, g2, g3]) = six_volume(p);
    let g0 = scale(add(add(g1, g2), g3), V::splat(-1.0));
    project(p, value - rest, &[g0, g1, g2, g3], k);
}

/// Distance of each corner from the centroid.
#[inline(always)]
pub(super) fn centroid_distances<V: Lanes>(p: &[Corner<V>; 4]) -> [V; 4] {
    let [a, b, c, d] = spokes(p);
    [dot(a, a).sqrt(), dot(b, b).sqrt(), dot(c, c).sqrt(), dot(d, d).sqrt()]
}

/// Vectors from the centroid to the corners.
#[inline(always)]
fn spokes<V: Lanes>(p: &[Corner<V>; 4]) -> [Vector<V>; 4] {
    let mut out = [[V::splat(0.0); 3]; 4];
    for a in 0..3 {
        let q = ((p[0][a] + p[1][a]) + (p[2][a] + p[3][a])) * V::splat(0.25);
        for i in 0..4 {
            out[i][a] = p[i][a] - q;
        }
    }
    out
}

/// Equation (11): springs from the centroid to the corners.
#[inline(always)]
pub(super) fn pull<V: Lanes>(p: &mut [Corner<V>; 4], rest: [V; 4], k: V) {
    let mut pulls = spokes(p);
    let (mut value, mut sum) = (V::splat(0.0), [V::splat(0.0); 3]);
    for i in 0..4 {
        let length = dot(pulls[i], pulls[i]).sqrt();
        let stretch = length - rest[i];
        value = value + V::splat(0.5) * stretch * stretch;
        pulls[i] = scale(pulls[i], (stretch / length).or_zero());
        sum = add(sum, pulls[i]);
    }
    // The centroid moves with each vertex by a quarter.
    let quarter = scale(sum, V::splat(-0.25));
    for g in &mut pulls {
        *g = add(*g, quarter);
    }
    project(p, value, &pulls, k);
}

/// The angle of equation (7) and its gradients, as in `constraints`.
#[inline(always)]
pub(super) fn angle<V: Lanes>(p: &[Corner<V>; 4]) -> (V, [Vector<V>; 4]) {
    let [e, d3, d4] = [sub(&p[1], &p[0]), sub(&p[2], &p[0]), sub(&p[3], &p[0])];
    let (n3, n4) = (cross(e, d3), cross(e, d4));
    let e2 = dot(e, e);
    let length = e2.sqrt();
    let sine = (dot(cross(n3, n4), e) / length).or_zero();
    let zero = V::splat(0.0);
    let angle = arc(sine.max(zero - sine), dot(n3, n4));
    let turned = sine.if_negative(zero - length, length);
    let g3 = scale(n3, zero - (turned / dot(n3, n3)).or_zero());
    let g4 = scale(n4, (turned / dot(n4, n4)).or_zero());
    let (s3, s4) = ((dot(d3, e) / e2).or_zero(), (dot(d4, e) / e2).or_zero());
    let one = V::splat(1.0);
    let g2 = add(scale(g3, zero - s3), scale(g4, zero - s4));
    let g1 = add(scale(g3, s3 - one), scale(g4, s4 - one));
    (angle, [g1, g2, g3, g4])
}

/// Angle of the point (`x`, `y`) with `y` not negative, 0 to pi (the polynomial of Cephes' `atanf`: error below 2e-7).
#[inline(always)]
fn arc<V: Lanes>(y: V, x: V) -> V {
    let zero = V::splat(0.0);
    let ax = x.max(zero - x);
    let r = (y.min(ax) / y.max(ax)).or_zero();
    let above = V::splat(0.414_213_57) - r;
    let one = V::splat(1.0);
    let t = above.if_negative((r - one) / (r + one), r);
    let base = above.if_negative(V::splat(core::f32::consts::FRAC_PI_4), zero);
    let z = t * t;
    let series = ((V::splat(8.053_744_5e-2) * z - V::splat(1.387_768_6e-1)) * z + V::splat(1.997_771_1e-1)) * z;
    let a = base + ((series - V::splat(3.333_295e-1)) * z * t + t);
    let a = (ax - y).if_negative(V::splat(core::f32::consts::FRAC_PI_2) - a, a);
    x.if_negative(V::splat(core::f32::consts::PI) - a, a)
}

/// Equation (7).
#[inline(always)]
pub(super) fn fold<V: Lanes>(p: &mut [Corner<V>; 4], rest: V, k: V) {
    let (angle, gradients) = angle(p);
    project(p, angle - rest, &gradients, k);
}

/// Distance of the last vertex from the centroid of all three.
#[inline(always)]
pub(super) fn height<V: Lanes>(p: &[Corner<V>; 3]) -> (V, Vector<V>) {
    let mut d = [V::splat(0.0); 3];
    for a in 0..3 {
        d[a] = p[2][a] - (p[0][a] + p[1][a] + p[2][a]) * V::splat(1.0 / 3.0);
    }
    (dot(d, d).sqrt(), d)
}

/// Equation (8).
#[inline(always)]
pub(super) fn bend<V: Lanes>(p: &mut [Corner<V>; 3], rest: V, k: V) {
    let (h, d) = height(p);
    let n = scale(d, (V::splat(1.0) / h).or_zero());
    let side = scale(n, V::splat(-1.0 / 3.0));
    project(p, h - rest, &[side, side, scale(n, V::splat(2.0 / 3.0))], k);
}
