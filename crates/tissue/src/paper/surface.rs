//! Lists of the constraints that live on surfaces: pairs of triangles and strips of vertices.

use crate::membrane::{Membranes, OUTSIDE};
use crate::vec3::{dot, norm, sub, xyz};

/// Pairs of triangles that share an edge on the outer surface or on one wall between regions, as `[p1, p2, p3, p4]`: the
/// edge, then the opposite vertex of each triangle. The second value is the region inside.
pub(crate) fn hinges(membranes: &Membranes) -> Vec<([u32; 4], u8)> {
    let mut edges: Vec<([u32; 2], u8, u8, u32)> = Vec::new();
    for m in &membranes.faces {
        for i in 0..3 {
            let (a, b, c) = (m.nodes[i], m.nodes[(i + 1) % 3], m.nodes[(i + 2) % 3]);
            edges.push(([a.min(b), a.max(b)], m.inner, m.outer, c));
        }
    }
    edges.sort_unstable();
    let same = |a: &([u32; 2], u8, u8, u32), b: &([u32; 2], u8, u8, u32)| (a.0, a.1, a.2) == (b.0, b.1, b.2);
    // An edge where walls meet has more than two triangles: it is a corner, not a hinge.
    let pairs = edges.chunk_by(same).filter(|c| c.len() == 2);
    pairs.map(|c| ([c[0].0[0], c[0].0[1], c[0].3, c[1].3], c[0].1)).collect()
}

/// Strips `[p0, p1, v]` of the outer surface: each vertex `v` between two neighbours as nearly opposite as there are.
pub(crate) fn strips(membranes: &Membranes, rest: &[[f32; 4]]) -> Vec<([u32; 3], u8)> {
    let mut around: Vec<(u32, u32, u8)> = Vec::new();
    for m in membranes.faces.iter().filter(|m| m.outer == OUTSIDE) {
        for i in 0..3 {
            let (a, b) = (m.nodes[i], m.nodes[(i + 1) % 3]);
            around.extend([(a, b, m.inner), (b, a, m.inner)]);
        }
    }
    around.sort_unstable();
    around.dedup_by_key(|e| (e.0, e.1));
    let mut strips = Vec::new();
    for ring in around.chunk_by(|a, b| a.0 == b.0) {
        for &(v, p0, region) in ring {
            if let Some(p1) = opposite(v, p0, ring, rest) {
                strips.push(([p0.min(p1), p0.max(p1), v], region));
            }
        }
    }
    strips.sort_unstable();
    strips.dedup_by_key(|s| s.0);
    strips
}

/// The neighbour of `v` that lies most nearly opposite to `p0`; none when all are on the same side.
fn opposite(v: u32, p0: u32, ring: &[(u32, u32, u8)], rest: &[[f32; 4]]) -> Option<u32> {
    let towards = |n: u32| sub(xyz(rest[n as usize]), xyz(rest[v as usize]));
    let d0 = towards(p0);
    let cosine = |n: u32| dot(d0, towards(n)) / (norm(d0) * norm(towards(n)));
    let best = ring.iter().map(|r| (cosine(r.1), r.1)).min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))?;
    (best.0 < 0.0).then_some(best.1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::membrane;
    use crate::model::tests::block;

    /// Which side of each face was the inner one hung on the order of the elements; edges between unlike faces were no hinges.
    #[test]
    fn hinges_of_a_wall_between_regions_were_lost_by_the_order_of_the_elements() {
        let mesh = block([6, 6, 6], 1.0);
        let inside = |t: &[u32; 4]| {
            let centre = t.iter().map(|&v| mesh.vertices[v as usize].to_array());
            let sum = centre.fold([0.0; 3], |s, p| [s[0] + p[0], s[1] + p[1], s[2] + p[2]]);
            sum.iter().all(|c| (2.0..4.0).contains(&(c / 4.0)))
        };
        let region: Vec<u8> = mesh.tets.iter().map(|t| u8::from(!inside(t))).collect();
        for order in [0, 1] {
            let turned: Vec<u8> = region.iter().map(|r| if order == 0 { *r } else { 1 - r }).collect();
            let mut m = membrane::find(&mesh.tets, &turned);
            m.faces.retain(|f| f.outer != OUTSIDE);
            assert_eq!(hinges(&m).len(), m.faces.len() * 3 / 2);
            assert!(m.faces.iter().all(|f| (f.inner, f.outer) == (0, 1)));
        }
    }

    #[test]
    fn every_edge_of_a_closed_surface_is_one_hinge_and_strips_go_across() {
        let mesh = block([3, 3, 3], 1.0);
        let rest: Vec<[f32; 4]> = mesh.vertices.iter().map(|v| [v.x as f32, v.y as f32, v.z as f32, 1.0]).collect();
        let m = membrane::find(&mesh.tets, &vec![0; mesh.tets.len()]);
        assert_eq!(hinges(&m).len(), m.faces.len() * 3 / 2);
        let s = strips(&m, &rest);
        assert!(!s.is_empty());
        for ([p0, p1, v], _) in s {
            let d = |n: u32| sub(xyz(rest[n as usize]), xyz(rest[v as usize]));
            assert!(p0 < p1 && dot(d(p0), d(p1)) < 0.0);
        }
    }
}
