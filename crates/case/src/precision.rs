//! What becomes of a surface in single precision: 24 bits lose a micrometre beyond 33 m from the origin.

use monro_geometry::TriangleMesh;

/// Points may move by this without anybody caring, mm,
const MOST_MOVED: f64 = 1e-3;
/// and by this part of the mean edge, for surfaces of next to no size.
const MOST_OF_EDGE: f64 = 1e-3;

/// How single precision changes a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rounding {
    /// Most that a coordinate changes, mm.
    pub moved: f64,
    /// Mean edge of the triangles, mm.
    pub mean_edge: f64,
    /// The first triangle two corners of which become one.
    pub collapsed: Option<usize>,
}

impl Rounding {
    /// Measures a surface.
    pub fn of(mesh: &TriangleMesh) -> Self {
        let moved = |c: f64| (f64::from(c as f32) - c).abs();
        let edges = |t: usize| {
            let [a, b, c] = mesh.corners(t);
            a.distance(b) + b.distance(c) + c.distance(a)
        };
        let n = mesh.triangles.len();
        let collapses = |t: &usize| {
            let [a, b, c] = mesh.corners(*t).map(|p| p.to_array().map(|x| x as f32));
            a == b || b == c || c == a
        };
        Self {
            moved: mesh.vertices.iter().flat_map(|p| p.to_array()).map(moved).fold(0.0, f64::max),
            mean_edge: (0..n).map(edges).sum::<f64>() / (3 * n.max(1)) as f64,
            collapsed: (0..n).find(collapses),
        }
    }

    /// Single precision does: points hardly move, and no triangle collapses.
    pub fn is_fine(&self) -> bool {
        self.collapsed.is_none() && self.moved <= MOST_MOVED && self.moved <= MOST_OF_EDGE * self.mean_edge
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{obj, ply};
    use monro_geometry::Point;

    fn triangle(far: f64, edge: f64) -> TriangleMesh {
        let vertices = [[far, 0., 0.], [far + edge, 0., 0.], [far, edge, 0.]].map(Point::from_array).to_vec();
        TriangleMesh { vertices, triangles: vec![[0, 1, 2]] }
    }

    #[test]
    fn a_head_is_fine_in_single_precision_and_what_is_far_or_minute_is_not() {
        assert!(Rounding::of(&triangle(123.4, 2.7)).is_fine());
        let far = Rounding::of(&triangle(1e8, 2.7));
        assert!(!far.is_fine() && far.collapsed == Some(0), "{far:?}");
        assert!(!Rounding::of(&triangle(7e4 + 0.3, 40.0)).is_fine());
        assert!(!Rounding::of(&triangle(123.4, 1e-3)).is_fine());
        assert!(Rounding::of(&triangle(0.0, 1e-3)).is_fine());
    }

    #[test]
    fn a_surface_far_from_the_origin_collapsed_in_silence() {
        let far = triangle(1e8, 2.7);
        assert_eq!(ply::decode(&ply::encode(&far, None)).expect("PLY"), far);
        let values = [1.0, 2.0, 3.0];
        assert_eq!(ply::decode(&ply::encode(&far, Some(("v", &values)))).expect("PLY"), far);
        let text = String::from_utf8(obj::encode(&[("far", &far)])).expect("text");
        assert!(text.contains("v 100000002.7 0 0"), "{text}");
    }
}
