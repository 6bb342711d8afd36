//! Whether the elements along the path are small enough for where the catheter breaks through not to depend on them.

use monro_geometry::TetMesh;
use monro_guidance::Plan;

/// Distance from the path, mm, within which elements count.
const NEAR_MM: f64 = 4.0;
/// Mean edge from which it is told, mm: a head of 5,824 tetrahedra has 5 to 6 mm, one of 37,336 has 2.7 mm, and of 20,677 3.4.
const COARSE_MM: f64 = 4.5;

/// A remark on a mesh that is coarse along the path.
pub(super) fn remark(rest: &TetMesh, plan: &Plan) -> Option<String> {
    let mean = mean_edge_mm(rest, plan).filter(|mm| *mm > COARSE_MM)?;
    Some(format!(
        "The tetrahedra along the path have edges of {mean:.1} mm on average: where the wall gives way, and with it the depth of \
         CSF, then depends on the mesh by some millimetres. In a head of usual size 37336 tetrahedra have some \
         2.7 mm there: \"monro prepare --elements\"."
    ))
}

/// Mean edge of the elements whose middle lies near the path, mm; `None` where none does.
fn mean_edge_mm(rest: &TetMesh, plan: &Plan) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0.0);
    for t in 0..rest.tets.len() {
        let p = rest.corners(t);
        let middle = p[0] + ((p[1] - p[0]) + (p[2] - p[0]) + (p[3] - p[0])) * 0.25;
        if middle.distance(middle.nearest_on_segment(plan.entry(), plan.target())) > NEAR_MM {
            continue;
        }
        for (a, b) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            sum += p[a].distance(p[b]);
            count += 1.0;
        }
    }
    (count > 0.0).then(|| sum / count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Point;
    use monro_guidance::Side;

    #[test]
    fn a_mesh_that_is_coarse_along_the_path_is_told_and_one_that_is_fine_there_is_not() {
        let plan = Plan::new(Side::Right, Point::new(0.0, 0.0, 60.0), Point::new(0.0, 0.0, 0.0)).expect("a plan");
        let at = |z: f64, size: f64, x: f64| {
            [[0.0; 3], [size, 0.0, 0.0], [0.0, size, 0.0], [0.0, 0.0, size]]
                .map(|c| Point::new(x + c[0], c[1], z + c[2]))
        };
        let mesh = |near: f64, far: f64| TetMesh {
            vertices: [at(20.0, near, 0.0), at(40.0, near, 0.0), at(20.0, far, 30.0)].concat(),
            tets: vec![[0, 1, 2, 3], [4, 5, 6, 7], [8, 9, 10, 11]],
            labels: vec![4; 3],
        };
        // Mean of three edges of one length and three of its root-of-two-fold: 1.207 times it.
        let said = remark(&mesh(5.0, 1.0), &plan).expect("told");
        assert!(said.contains("6.0 mm on average"), "{said}");
        assert_eq!(remark(&mesh(2.0, 20.0), &plan), None);
    }
}
