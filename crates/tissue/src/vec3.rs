//! Three-component arithmetic on plain arrays, in single precision for the running simulation.

pub(crate) type V3 = [f32; 3];

#[inline(always)]
pub(crate) fn xyz(p: [f32; 4]) -> V3 {
    [p[0], p[1], p[2]]
}

#[inline(always)]
pub(crate) fn add(a: V3, b: V3) -> V3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(crate) fn sub(a: V3, b: V3) -> V3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(crate) fn scale(a: V3, s: f32) -> V3 {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// `a + s * b`.
#[inline(always)]
pub(crate) fn axpy(a: V3, s: f32, b: V3) -> V3 {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}

#[inline(always)]
pub(crate) fn dot(a: V3, b: V3) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn cross(a: V3, b: V3) -> V3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
pub(crate) fn norm(a: V3) -> f32 {
    dot(a, a).sqrt()
}

/// The unit vector; `None` for a zero or non-finite one.
#[inline]
pub(crate) fn unit(a: V3) -> Option<V3> {
    let n = norm(a);
    (n.is_finite() && n > 0.0).then(|| scale(a, 1.0 / n))
}

/// Six times the signed volume of the tetrahedron `p`.
#[inline(always)]
pub(crate) fn six_volume(p: [V3; 4]) -> f32 {
    dot(cross(sub(p[1], p[0]), sub(p[2], p[0])), sub(p[3], p[0]))
}

/// The same with its gradients by the corners.
#[inline(always)]
pub(crate) fn six_volume_with_gradients(p: [V3; 4]) -> (f32, [V3; 4]) {
    let [a, b, c] = [sub(p[1], p[0]), sub(p[2], p[0]), sub(p[3], p[0])];
    let (g1, g2, g3) = (cross(b, c), cross(c, a), cross(a, b));
    (dot(g3, c), [scale(add(add(g1, g2), g3), -1.0), g1, g2, g3])
}

/// Adds `s * d` to the first three components of a vertex, leaving its fourth alone.
#[inline(always)]
pub(crate) fn shift(p: &mut [f32; 4], s: f32, d: V3) {
    p[0] += s * d[0];
    p[1] += s * d[1];
    p[2] += s * d[2];
}

/// The larger of two; the first where the second is not a number. Unlike `f32::max` a single instruction.
pub(crate) fn larger(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}
