//! A rod that lies along no axis of coordinates feels what an upright one does; one that is no rod is told.

use crate::common::{block, nodes, options, physical};
use monro_geometry::{Patient, Point, Rigid, TetMesh, Vector};
use monro_tissue::{Event, FrameSettings, Model, Stepper, TipShape, Tool, ToolMotion, ToolPose};

/// Frames in, 0.25 mm each, and as many out.
const FRAMES: i32 = 100;

/// Axial force on the tool (mN) and shaft held (mm) in each frame of a rod that goes 25 mm into a block and out again; block
/// and rod are turned together by `turn`.
fn in_and_out(turn: &Rigid<Patient, Patient>) -> Vec<(f64, f64)> {
    let upright = block([8; 3], 6.0, |_| 4);
    let fixed = nodes(&upright, |p| p.z == 0.0 || p.x == 0.0 || p.x == 48.0 || p.y == 0.0 || p.y == 48.0);
    let vertices = upright.vertices.iter().map(|&p| turn.point(p)).collect();
    let mesh = TetMesh { vertices, ..upright };
    let model = Model::new(&mesh, &options(physical(), &fixed)).expect("model");
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
    let pose = |frame: i32| {
        let depth = 0.25 * f64::from(if frame < FRAMES { frame } else { 2 * FRAMES - frame });
        let at = |z: f64| turn.point(Point::new(23.3, 24.7, z));
        ToolPose { tip: at(48.0 - depth), tail: at(168.0 - depth) }
    };
    let tool = Tool { tip: TipShape::Round, radius_mm: 1.5 };
    let mut step = |f: i32| {
        let motion = ToolMotion { tool, from: pose(f), to: pose(f + 1) };
        let report = stepper.step(&model, &mut state, &[motion], &FrameSettings::default());
        (report.tools[0].axial_force_mn, report.tools[0].inserted_mm)
    };
    (0..2 * FRAMES).map(&mut step).collect()
}

#[test]
fn an_oblique_rod_still_held_the_shaft_that_it_had_drawn_out_of_the_tissue() {
    let mean = |felt: &[(f64, f64)]| felt.iter().map(|f| f.0).sum::<f64>() / felt.len() as f64;
    let turned = |axis, angle| Rigid::from_axis_angle(axis, angle, Vector::new(-40.0, 30.0, 900.0)).expect("a turn");
    let upright = in_and_out(&turned(Vector::new(0.0, 0.0, 1.0), 0.0));
    for axis in [[1.0, 2.0, 3.0], [-2.0, 1.0, 0.3], [0.7, -1.0, 2.0]] {
        let oblique = in_and_out(&turned(Vector::from_array(axis), 1.1));
        for (frame, felt) in oblique.iter().enumerate().skip(FRAMES as usize + 20) {
            let depth = 0.25 * (2 * FRAMES - frame as i32) as f64;
            assert!(felt.1 < depth + 1.5, "{axis:?}: {} mm held at a depth of {depth} mm", felt.1);
        }
        // Where it sticks and slips is a matter of chance: the means of whole ways.
        for (from, to) in [(40, 100), (120, 160), (160, 195)] {
            let (one, other) = (mean(&upright[from..to]), mean(&oblique[from..to]));
            println!("{axis:?} {from} to {to}: {one} {other}");
            assert!((other / one - 1.0).abs() < 0.15, "{axis:?}, frames {from} to {to}: {other} mN, upright {one} mN");
        }
    }
}

#[test]
fn a_cone_of_30_degrees_given_as_30_radians_was_a_flat_end_without_a_word() {
    let mesh = block([2; 3], 6.0, |_| 4);
    let model = Model::new(&mesh, &options(physical(), &nodes(&mesh, |p| p.z == 0.0))).expect("model");
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
    let pose = |z: f64| ToolPose { tip: Point::new(5.0, 5.0, z), tail: Point::new(5.0, 5.0, z + 50.0) };
    for (half_angle, ignored) in [(0.5, false), (30.0, true), (f64::NAN, true), (0.0, true), (-0.5, true)] {
        let tool = Tool { tip: TipShape::Cone { half_angle }, radius_mm: 1.5 };
        let motion = ToolMotion { tool, from: pose(13.0), to: pose(12.5) };
        let report = stepper.step(&model, &mut state, &[motion], &FrameSettings::default());
        assert_eq!(report.events.contains(&Event::BadPose { tool: 0 }), ignored, "{half_angle}: {report:?}");
    }
}
