//! Falx and tentorium as walls within the brain: neither side goes through them, both slide along, together, for the mesh is one on both
//! sides.
//!
//! Dura is some ten thousand times as stiff as brain, so they are taken to be rigid, as is usual in models of brain shift (Chen et al.,
//! "Intraoperative brain shift compensation: accounting for dural septa", 2011). What bends of them is left out: 1 mm for half a
//! kilopascal more on one side of a falx of 1 mm, 50 mm high.

use monro_geometry::{Bvh, Patient, TetMesh, TriangleMesh, Vector};
use monro_tissue::{Attachment, AttachmentKind};
use std::collections::BTreeMap;

/// Surfaces that meet at a node with normals further apart than this cosine are two.
const ONE_SURFACE: f64 = 0.7;
/// Surfaces that a node lies between at most: falx and both halves of the tentorium.
const MOST: usize = 3;

/// Of each edge of the mesh that goes through the septa the end that is nearer to them, if `free`, else the other one, slides along
/// planes of their direction, through its own place. Mesh and septa in the same frame, mm.
pub(crate) fn walls(
    tets: &TetMesh,
    septa: &TriangleMesh,
    free: impl Fn(u32) -> bool,
    drag_per_s: f64,
) -> Vec<Attachment> {
    let tree = Bvh::new(septa);
    let mut sums = BTreeMap::<u32, Vec<Vector<Patient>>>::new();
    for [a, b] in tets.edges() {
        let [from, to] = [a, b].map(|v| tets.vertices[v as usize]);
        let Some(hit) = tree.ray(from, to - from).filter(|hit| hit.t <= 1.0) else { continue };
        let ends = if hit.t <= 0.5 { [a, b] } else { [b, a] };
        let [p, q, r] = septa.corners(hit.triangle);
        if let (Some(node), Some(normal)) = (ends.into_iter().find(|v| free(*v)), (q - p).cross(r - p).normalized()) {
            add(sums.entry(node).or_default(), normal);
        }
    }
    let both = |n: Vector<Patient>| [n, -n].map(|n| AttachmentKind::Abutting { outward: n.to_array(), drag_per_s });
    let of = |(node, sums): (u32, Vec<Vector<Patient>>)| {
        sums.into_iter().filter_map(Vector::normalized).flat_map(both).map(move |kind| Attachment { node, kind })
    };
    sums.into_iter().flat_map(of).collect()
}

/// Counts a normal to the surface of its direction among those of a node.
fn add(sums: &mut Vec<Vector<Patient>>, normal: Vector<Patient>) {
    let along = |sum: Vector<Patient>| normal.dot(sum) / sum.norm();
    match sums.iter().position(|sum| along(*sum).abs() > ONE_SURFACE) {
        Some(i) if along(sums[i]) < 0.0 => sums[i] -= normal,
        Some(i) => sums[i] += normal,
        None if sums.len() < MOST => sums.push(normal),
        None => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::deformation::tests::tets;
    use monro_geometry::Point;

    /// A plane across the cube, its height so far under that of the nodes.
    fn level(z: f64) -> TriangleMesh {
        let at = |x: f64, y: f64| Point::new(x, y, z);
        let vertices = vec![at(-5.0, -5.0), at(65.0, -5.0), at(65.0, 65.0), at(-5.0, 65.0)];
        TriangleMesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] }
    }

    #[test]
    fn the_nearer_end_of_each_edge_through_a_sheet_slides_along_it() {
        let tets = tets();
        let all = walls(&tets, &level(37.0), |_| true, 3.0);
        assert_eq!(all.len(), 2 * 49);
        for pair in all.chunks(2) {
            assert_eq!(tets.vertices[pair[0].node as usize].z, 40.0);
            let outward = pair.iter().map(|a| match a.kind {
                AttachmentKind::Abutting { outward, drag_per_s: 3.0 } => outward[2],
                other => panic!("{other:?}"),
            });
            assert_eq!((pair[0].node, outward.map(f64::abs).sum::<f64>()), (pair[1].node, 2.0));
        }
        let lower = walls(&tets, &level(32.0), |_| true, 3.0);
        assert!(lower.iter().all(|a| tets.vertices[a.node as usize].z == 30.0));
        // Those that are held anyway leave it to the other end.
        let other = walls(&tets, &level(37.0), |v| tets.vertices[v as usize].z < 40.0, 3.0);
        assert!(other.len() >= 2 * 49 && other.iter().all(|a| tets.vertices[a.node as usize].z == 30.0));
        assert!(walls(&tets, &level(70.0), |_| true, 3.0).is_empty());
        assert!(walls(&tets, &TriangleMesh::default(), |_| true, 3.0).is_empty());
    }

    #[test]
    fn where_two_sheets_meet_a_node_keeps_the_planes_of_both() {
        let mut both = level(41.0);
        let turned = level(29.0);
        both.vertices.extend(turned.vertices.iter().map(|p| Point::new(p.z, p.y, p.x)));
        both.triangles.extend([[4, 5, 6], [4, 6, 7]]);
        let tets = tets();
        let all = walls(&tets, &both, |_| true, 0.0);
        let planes = |at: Point<Patient>| all.iter().filter(|a| tets.vertices[a.node as usize] == at).count();
        assert_eq!(planes(Point::new(30.0, 20.0, 40.0)), 4);
        assert_eq!(planes(Point::new(30.0, 20.0, 20.0)), 2);
        assert_eq!(planes(Point::new(10.0, 20.0, 20.0)), 0);
    }
}
