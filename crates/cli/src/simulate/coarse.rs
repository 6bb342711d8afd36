//! Whether the elements along the path are small enough for where the catheter breaks through not to depend on them.

use monro_geometry::{TET_EDGES, TetLocator, TetMesh};
use monro_guidance::Plan;

/// The elements that hold the path are looked at in such steps, mm.
const STEP_MM: f64 = 0.5;
/// Mean edge from which it is told, mm: paths of heads have 2.3 to 2.9 mm at 37,336 tetrahedra, 2.9 to 4.5 mm at 20,677 and up to 7.8 at
/// 5,824; with 8.4 mm the largest force was up to twice as large.
const COARSE_MM: f64 = 7.0;

/// A remark on a mesh that is coarse along the path.
pub(super) fn remark(rest: &TetMesh, plan: &Plan) -> Option<String> {
    let mean = too_large(rest, plan)?;
    Some(format!(
        "The tetrahedra that the path goes through have edges of {mean:.1} mm on average: where the wall gives way, and with it the depth of \
         CSF, then depends on the mesh by some millimetres, and the largest force is up to twice as large. In a head of usual size 37336 \
         tetrahedra have some 3 mm there: \"monro prepare --elements\"."
    ))
}

/// Mean edge along a path, mm, where it is too large.
pub(super) fn too_large(rest: &TetMesh, plan: &Plan) -> Option<f64> {
    mean_edge_mm(rest, plan).filter(|mm| *mm > COARSE_MM)
}

/// Mean edge along the path of the elements that hold it, mm; `None` where none does.
fn mean_edge_mm(rest: &TetMesh, plan: &Plan) -> Option<f64> {
    let locator = TetLocator::new(rest).ok()?;
    let steps = (plan.length() / STEP_MM).ceil() as usize;
    let (mut sum, mut count) = (0.0, 0.0);
    for located in (0..=steps).filter_map(|i| locator.locate(plan.at_depth(i as f64 * STEP_MM))) {
        let p = rest.corners(located.tet);
        for [a, b] in TET_EDGES {
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
        let plan = Plan::new(Side::Right, Point::new(0.1, 0.1, 60.0), Point::new(0.1, 0.1, 0.0)).expect("a plan");
        // One at the path from z on, and a finer one beside it, which does not count however many there are.
        let at = |z: f64, size: f64, x: f64| {
            [[0.0; 3], [size, 0.0, 0.0], [0.0, size, 0.0], [0.0, 0.0, size]]
                .map(|c| Point::new(x + c[0], c[1], z + c[2]))
        };
        let mesh = |on: f64, beside: f64| TetMesh {
            vertices: [at(20.0, on, 0.0), at(45.0, on, 0.0), at(20.0, beside, 3.0), at(30.0, beside, 3.0)].concat(),
            tets: (0..4).map(|t| [4 * t, 4 * t + 1, 4 * t + 2, 4 * t + 3]).collect(),
            labels: vec![4; 4],
        };
        // Mean of three edges of one length and three of its root-of-two-fold: 1.207 times it.
        let said = remark(&mesh(10.0, 1.0), &plan).expect("told");
        assert!(said.contains("12.1 mm on average"), "{said}");
        assert_eq!(remark(&mesh(2.0, 20.0), &plan), None);
    }
}
