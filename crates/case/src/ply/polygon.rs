//! Polygons of a surface in triangles.

use monro_geometry::{Patient, Point, TriangleMesh, Vector};

/// Polygons with more corners that bend inwards stay fans: cutting off ears looks at all of the others for each.
const MOST: usize = 2000;

/// A polygon of more than three corners, and the first of the triangles of its fan.
pub(super) struct Polygon {
    pub(super) corners: Vec<u32>,
    pub(super) first: usize,
}

impl Polygon {
    /// Puts other triangles in the place of those of the fan, where these do not all face as the polygon does: it bends inwards.
    pub(super) fn mend(&self, mesh: &mut TriangleMesh) {
        let at = |v: u32| mesh.vertices[v as usize];
        let first = at(self.corners[0]);
        let fan = self.corners[1..].windows(2).map(|w| (at(w[0]) - first).cross(at(w[1]) - first));
        let normal = fan.clone().fold(Vector::ZERO, |sum, n| sum + n);
        if self.corners.len() > MOST || fan.clone().all(|n| n.dot(normal) >= 0.0) {
            return;
        }
        if let Some(triangles) = ears(&self.corners, normal, at) {
            mesh.triangles.splice(self.first..self.first + triangles.len(), triangles);
        }
    }
}

/// Cuts off corner after corner that no other lies in (Meisters 1975); `None` where there is none, as where the polygon crosses
/// itself.
fn ears(corners: &[u32], normal: Vector<Patient>, at: impl Fn(u32) -> Point<Patient>) -> Option<Vec<[u32; 3]>> {
    let side = |[a, b]: [u32; 2], p: u32| (at(b) - at(a)).cross(at(p) - at(b)).dot(normal);
    let within = |[a, b, c]: [u32; 3], p: u32| [[a, b], [b, c], [c, a]].into_iter().all(|e| side(e, p) >= 0.0);
    let (mut left, mut out) = (corners.to_vec(), Vec::new());
    while left.len() > 3 {
        let n = left.len();
        let corner = |i: usize| [left[(i + n - 1) % n], left[i], left[(i + 1) % n]];
        let is_ear = |&i: &usize| {
            let ear @ [a, b, c] = corner(i);
            side([a, b], c) > 0.0 && left.iter().all(|p| ear.contains(p) || !within(ear, *p))
        };
        let i = (0..n).find(is_ear)?;
        out.push(corner(i));
        left.remove(i);
    }
    out.push([left[0], left[1], left[2]]);
    Some(out)
}
