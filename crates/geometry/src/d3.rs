//! Plain arithmetic on `[f64; 3]` for inner loops, where every number is known to be in one frame.
//!
//! What crosses a function's border elsewhere is a [`Point`](crate::Point) or a [`Vector`](crate::Vector), which know
//! their frame.

/// Three numbers of one frame: a place, mm, or a difference of places.
pub type D3 = [f64; 3];

/// `a + b`.
#[inline]
pub fn add(a: D3, b: D3) -> D3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// `a - b`.
#[inline]
pub fn sub(a: D3, b: D3) -> D3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `s a`.
#[inline]
pub fn scale(a: D3, s: f64) -> D3 {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// `a + s b`.
#[inline]
pub fn axpy(a: D3, s: f64, b: D3) -> D3 {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}

/// Scalar product.
#[inline]
pub fn dot(a: D3, b: D3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product, right-handed.
#[inline]
pub fn cross(a: D3, b: D3) -> D3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Length.
#[inline]
pub fn norm(a: D3) -> f64 {
    dot(a, a).sqrt()
}

/// Distance of two places.
#[inline]
pub fn distance(a: D3, b: D3) -> f64 {
    norm(sub(a, b))
}

/// `a` at 0, `b` at 1.
#[inline]
pub fn lerp(a: D3, b: D3, t: f64) -> D3 {
    [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, a[2] + (b[2] - a[2]) * t]
}

/// Six times the signed volume of a tetrahedron: positive where `a`, `b`, `c` go counter-clockwise seen from `d`.
#[inline]
pub fn volume6([a, b, c, d]: [D3; 4]) -> f64 {
    dot(cross(sub(b, a), sub(c, a)), sub(d, a))
}
