//! Polygons of a surface in triangles.

use monro_geometry::{Patient, Point, TriangleMesh, Vector};

/// Polygons with more corners that bend inwards stay fans: for each ear that is cut off, all corners may be looked at against all
/// others.
const MOST: u32 = 256;

/// A polygon of more than three corners, which are those of the triangles of its fan from `first` on.
pub(super) struct Polygon {
    pub(super) first: usize,
    pub(super) corners: u32,
}

impl Polygon {
    /// Puts other triangles in the place of those of the fan, where these do not all face as the polygon does: it bends inwards.
    pub(super) fn mend(&self, mesh: &mut TriangleMesh) {
        let at = |v: u32| mesh.vertices[v as usize];
        let range = self.first..self.first + self.corners as usize - 2;
        let fan = &mesh.triangles[range.clone()];
        let normals = fan.iter().map(|&[a, b, c]| (at(b) - at(a)).cross(at(c) - at(a)));
        let normal = normals.clone().fold(Vector::ZERO, |sum, n| sum + n);
        if self.corners > MOST || normals.clone().all(|n| n.dot(normal) >= 0.0) {
            return;
        }
        let corners: Vec<u32> = fan[0][..2].iter().copied().chain(fan.iter().map(|t| t[2])).collect();
        if let Some(triangles) = ears(&corners, normal, at) {
            mesh.triangles.splice(range, triangles);
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
