//! The room that a catheter takes up: tissue is pushed apart by what is not tissue.

use crate::common::{cube_with_horn, nodes, options, physical, rod};
use monro_tissue::{FrameSettings, Insertion, Material, Model, State, Stepper};

/// Of the cube, and where the catheter goes down, mm.
const EDGE: f64 = 48.0;
const PLACE: [f64; 2] = [23.3, 24.7];
const RADIUS: f64 = 1.5;

/// Cuts and rubs with next to no force.
const SMOOTH: Insertion = Insertion {
    puncture_force_mn: 1.0,
    puncture_depth_mm: 0.1,
    cut_force_mn: 0.1,
    static_friction_mn_per_mm: 0.01,
    dynamic_friction_mn_per_mm: 0.01,
};

/// A cube of so many cells along each edge that is held at its bottom.
fn cube(cells: usize, poisson: f64) -> Model {
    let (mesh, _) = cube_with_horn(EDGE, (cells, 0.2), [7.0, -7.0]);
    let fixed = nodes(&mesh, |p| p.z == 0.0);
    let mut options = options(physical(), &fixed);
    options.materials.insert(4, Material { insertion: SMOOTH, poisson, ..Material::BRAIN });
    options.materials.remove(&5);
    Model::new(&mesh, &options).expect("model")
}

fn go(model: &Model, state: &mut State, heights: [f64; 2], frames: i32) {
    let mut stepper = Stepper::new(model);
    let at = |f: i32| [PLACE[0], PLACE[1], heights[0] + f64::from(f) / f64::from(frames) * (heights[1] - heights[0])];
    for f in 0..frames {
        let report = stepper.step(model, state, &[rod(at(f), at(f + 1))], &FrameSettings::default());
        assert!(report.inverted == 0, "{report:?}");
    }
}

/// Mean way outwards of the nodes between two distances from the axis, beside the middle of the shaft, and what it would be
/// where nothing changes its volume, mm.
fn outwards(model: &Model, state: &State, [near, far]: [f64; 2]) -> [f64; 2] {
    let rest = model.rest_state();
    let mut sums = [0.0; 3];
    for i in 0..model.node_count() {
        let (r, p) = (model.position(&rest, i), model.position(state, i));
        let (x, y) = (r.x - PLACE[0], r.y - PLACE[1]);
        let d = x.hypot(y);
        if (near..far).contains(&d) && (18.0..30.0).contains(&r.z) {
            let way = p.x - PLACE[0];
            let out = way.hypot(p.y - PLACE[1]) - d;
            let asked = (d * d + RADIUS * RADIUS).sqrt() - d;
            sums = [sums[0] + out, sums[1] + asked, sums[2] + 1.0];
        }
    }
    [sums[0] / sums[2], sums[1] / sums[2]]
}

#[test]
fn tissue_beside_a_catheter_stayed_where_it_was_as_if_that_were_a_line() {
    for (cells, poisson) in [(12, 0.49), (16, 0.49), (16, 0.45), (16, 0.499), (24, 0.49)] {
        let model = cube(cells, poisson);
        let mut state = model.rest_state();
        go(&model, &mut state, [EDGE + 1.0, 8.0], 120);
        for ring in [[2.0, 4.0], [4.0, 8.0]] {
            let [out, asked] = outwards(&model, &state, ring);
            println!("{cells} cells, {poisson}, {ring:?} mm: {out} mm for {asked}");
            assert!(
                (0.8..1.25).contains(&(out / asked)),
                "{cells} cells, {poisson}, {ring:?} mm: {out} mm for {asked}"
            );
        }
        go(&model, &mut state, [8.0, EDGE + 1.0], 120);
        let [left, _] = outwards(&model, &state, [2.0, 8.0]);
        assert!(left.abs() < 0.02, "{cells} cells, {poisson}: {left} mm left");
    }
}
