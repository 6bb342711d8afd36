//! Triangles that pass through each other.
//!
//! Two triangles cross where their insides (without edges and corners) meet. Then no plane parts them: not that of either
//! one, none across one of them along an edge, none along an edge of each. These seventeen directions are all that need be
//! tried (Gottschalk, Lin and Manocha 1996), and nothing need be known of shared corners: neighbours in a surface are parted
//! by one of them. The depth along a direction is how far the triangles would have to be moved to be parted, so a bound on it
//! keeps rounding from being taken for crossing.

mod finder;

pub use finder::CrossingFinder;

use crate::{Patient, Point, TriangleMesh, Vector};
use std::fmt;

/// What is parted by a shift of this share of the larger triangle's extent does not cross: well above what single precision
/// makes of a clean surface.
const SHIFT: f64 = 1e-6;
/// Heights below this share of the longest edge are none: the triangle has no inside.
const FLAT: f64 = 1e-9;

/// Pairs of triangles that cross.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Crossings {
    /// The triangles of each pair, the lower one first, in order.
    pub pairs: Vec<[u32; 2]>,
    /// The search ended after a million pairs: there may be others.
    pub cut_short: bool,
}

/// Where a surface passes through itself, in short.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SelfCrossing {
    /// Pairs of triangles that cross or lie on each other.
    pub pairs: usize,
    /// There may be more of them: the search was cut short.
    pub or_more: bool,
    /// Where the first of them do, mm.
    pub at: Point<Patient>,
}

impl fmt::Display for SelfCrossing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (pairs, more, [x, y, z]) = (self.pairs, if self.or_more { " or more" } else { "" }, self.at.to_array());
        write!(
            f,
            "surface passes through itself: {pairs}{more} pair(s) of triangles cross or lie on each other, the first at \
             ({x:.1}, {y:.1}, {z:.1}) mm"
        )
    }
}

impl TriangleMesh {
    /// Where the surface passes through itself: its [`TriangleMesh::crossings`] in short. `None` where it does not.
    ///
    /// # Panics
    /// As those do.
    pub fn self_crossing(&self) -> Option<SelfCrossing> {
        let Crossings { pairs, cut_short } = self.crossings();
        let first = *pairs.first()?;
        Some(SelfCrossing { pairs: pairs.len(), or_more: cut_short, at: self.crossing_place(first) })
    }

    /// All pairs of triangles that cross, as [`triangles_cross`] has it; neighbours that only share a corner or an edge do
    /// not, triangles that lie on each other do. O(n log n) for surfaces; the same for the same mesh.
    ///
    /// # Panics
    /// When a triangle names a vertex that does not exist: see [`TriangleMesh::validate`].
    pub fn crossings(&self) -> Crossings {
        CrossingFinder::new(self).all()
    }

    /// A point that two crossing triangles have in common, mm; between their middles where they do not cross.
    ///
    /// # Panics
    /// When there is no such triangle.
    pub fn crossing_place(&self, pair: [u32; 2]) -> Point<Patient> {
        let [a, b] = pair.map(|t| self.corners(t as usize));
        let origin = a[0];
        let of = |t: [Point<Patient>; 3]| t.map(|p| p - origin);
        let common = Pair::of(&a, &b).map(|pair| pair.common()).unwrap_or_default();
        let mean = |points: &[Vector<Patient>]| {
            points.iter().fold(Vector::ZERO, |sum, &p| sum + p) * (1.0 / points.len().max(1) as f64)
        };
        origin + if common.is_empty() { mean(&[of(a), of(b)].concat()) } else { mean(&common) }
    }
}

/// Whether the insides of two triangles (mm) meet, in a line or in the plane of both, so that moving one by a millionth of the
/// larger one's extent (and by what rounding of the coordinates leaves open) does not part them. Triangles without area, or
/// with coordinates that are not finite, have no inside.
pub fn triangles_cross(a: &[Point<Patient>; 3], b: &[Point<Patient>; 3]) -> bool {
    Pair::of(a, b).is_some_and(|pair| pair.crosses())
}

/// Two triangles seen from a corner of the first.
struct Pair {
    corners: [[Vector<Patient>; 3]; 2],
    edges: [[Vector<Patient>; 3]; 2],
    normals: [Vector<Patient>; 2],
    /// Depths up to this do not count, mm.
    shift: f64,
}

impl Pair {
    /// `None` where one of them has no inside.
    fn of(a: &[Point<Patient>; 3], b: &[Point<Patient>; 3]) -> Option<Self> {
        let largest = |of: f64, v: [f64; 3]| v.iter().fold(of, |m, c| m.max(c.abs()));
        let corners = [a, b].map(|t| t.map(|p| p - a[0]));
        let edges = corners.map(|[p, q, r]| [q - p, r - q, p - r]);
        let normals = edges.map(|[e, f, _]| e.cross(f));
        let has_inside = |k: usize| {
            let longest = edges[k].iter().map(|e| e.norm_squared()).fold(0.0, f64::max);
            let twice = normals[k].norm();
            twice.is_finite() && twice > FLAT * longest
        };
        if !has_inside(0) || !has_inside(1) {
            return None;
        }
        let extent = edges.iter().flatten().fold(0.0, |m, e| largest(m, e.to_array()));
        let far = a.iter().chain(b).fold(0.0, |m, p| largest(m, p.to_array()));
        Some(Self { corners, edges, normals, shift: SHIFT * extent + 16.0 * f64::EPSILON * far })
    }

    fn crosses(&self) -> bool {
        let [n, m] = self.normals;
        let in_plane = || (0..2).flat_map(|k| self.edges[k].map(|e| self.normals[k].cross(e)));
        if self.in_one_plane() {
            return !in_plane().any(|axis| self.parted(axis));
        }
        let across = || self.edges[0].iter().flat_map(|e| self.edges[1].iter().map(|f| e.cross(*f)));
        ![n, m].into_iter().chain(in_plane()).chain(across()).any(|axis| self.parted(axis))
    }

    /// From where to where a triangle reaches along a direction, in lengths of it.
    fn span(&self, which: usize, axis: Vector<Patient>) -> [f64; 2] {
        let [p, q, r] = self.corners[which].map(|c| c.dot(axis));
        [p.min(q).min(r), p.max(q).max(r)]
    }

    /// Whether the triangles lie beside each other along a direction, or overlap by so little that it does not count.
    fn parted(&self, axis: Vector<Patient>) -> bool {
        let [[a, b], [c, d]] = [0, 1].map(|k| self.span(k, axis));
        let depth = (b - c).min(d - a);
        // Parallel edges make a direction without length, which says nothing.
        depth < 0.0 || depth <= self.shift * axis.norm() && axis != Vector::ZERO
    }

    /// Whether each lies in the plane of the other.
    fn in_one_plane(&self) -> bool {
        (0..2).all(|k| {
            let ([low, high], own) = (self.span(1 - k, self.normals[k]), self.corners[k][0].dot(self.normals[k]));
            let most = self.shift * self.normals[k].norm();
            high - own <= most && own - low <= most
        })
    }

    /// Points around what the triangles have in common: a line, or a polygon where they lie in one plane.
    fn common(&self) -> Vec<Vector<Patient>> {
        let [first, second] = self.corners;
        let m = self.normals[1];
        let mut out = if self.in_one_plane() { first.to_vec() } else { cut(&first, m, second[0]) };
        for (corner, edge) in second.into_iter().zip(self.edges[1]) {
            out = clipped(&out, m.cross(edge), corner);
        }
        out
    }
}

/// Where the lines between points in a row, and from the last to the first, pass through a plane.
fn cut(polygon: &[Vector<Patient>], normal: Vector<Patient>, at: Vector<Patient>) -> Vec<Vector<Patient>> {
    let height = |p: Vector<Patient>| (p - at).dot(normal);
    let next = polygon.iter().cycle().skip(1);
    let through = polygon.iter().zip(next).map(|(&p, &q)| (p, q, height(p), height(q)));
    through.filter(|(_, _, h, k)| (*h > 0.0) != (*k > 0.0)).map(|(p, q, h, k)| p + (q - p) * (h / (h - k))).collect()
}

/// The points on the side of a plane that its normal points to, with those where they pass through it.
fn clipped(polygon: &[Vector<Patient>], normal: Vector<Patient>, at: Vector<Patient>) -> Vec<Vector<Patient>> {
    let height = |p: Vector<Patient>| (p - at).dot(normal);
    let mut out: Vec<_> = polygon.iter().copied().filter(|&p| height(p) > 0.0).collect();
    out.extend(cut(polygon, normal, at));
    out
}

#[cfg(test)]
mod tests;
