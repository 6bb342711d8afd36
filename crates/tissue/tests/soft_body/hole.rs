//! Tissue around the hole that a catheter made in a wall.

use crate::common::{cube_with_horn, options, physical};
use monro_geometry::{Patient, Point, Vector};
use monro_tissue::{FrameSettings, Model, State, Stepper, TipShape, Tool, ToolMotion, ToolPose};

/// Of the cube, the height of the horn's axis in it, and the horn's radius, mm.
const EDGE: f64 = 48.0;
const HORN: f64 = 18.0;
const RADIUS: f64 = 7.0;

/// Pushes a catheter, so tilted and so far beside the middle (mm), at `mm_s` through the brain to near the floor of the horn,
/// and lets the tissue come to rest. With the label that its tip is in.
fn push(model: &Model, (tilt, beside): (f64, f64), mm_s: f64) -> (State, Option<u16>) {
    let back = Vector::new(tilt, 0.6 * tilt, 1.0).normalized().expect("a direction");
    let target = Point::new(24.0 + beside, 23.3, HORN - 5.0);
    let at = |far: f64| ToolPose { tip: target + back * far, tail: target + back * (far + 120.0) };
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(model));
    let from = 1.2 * (EDGE - HORN + 5.0);
    let frames = (from / mm_s * 60.0) as i32;
    let far = |f: i32| from * (1.0 - f64::from(f.min(frames)) / f64::from(frames));
    let mut at_tip = None;
    for f in 0..frames + 30 {
        let tool = Tool { tip: TipShape::Round, radius_mm: 1.5 };
        let motion = ToolMotion { tool, from: at(far(f)), to: at(far(f + 1)) };
        at_tip = stepper.step(model, &mut state, &[motion], &FrameSettings::default()).tools[0].label;
    }
    (state, at_tip)
}

/// Six times the signed volume of an element.
fn volume(x: [Point<Patient>; 4]) -> f64 {
    let [a, b, c] = [1, 2, 3].map(|i| x[i] - x[0]);
    a.cross(b).dot(c)
}

/// Single elements had half of their volume left, and single vertices hung on 1.4 to 1.8 mm from where they belong.
#[test]
fn what_was_folded_around_the_tip_before_a_wall_gave_way_hung_on_to_the_shaft() {
    for (cells, beside) in [(16, 0.0), (18, -2.0), (18, 0.0)] {
        let (mesh, fixed) = cube_with_horn(EDGE, (cells, 0.2), [RADIUS, HORN]);
        let model = Model::new(&mesh, &options(physical(), &fixed)).expect("model");
        let (state, at_tip) = push(&model, (0.4, beside), 20.0);
        assert_eq!(at_tip, Some(5), "it has gone through the wall");
        let at = |v: u32| model.position(&state, v as usize);
        // Where it came in the shaft itself moves the surface by more.
        let far_in = |v: u32| mesh.vertices[v as usize].z < EDGE - 8.0;
        let tets = mesh.tets.iter().filter(|t| t.iter().all(|&v| far_in(v)));
        let left = tets.map(|t| volume(t.map(at)) / volume(t.map(|v| mesh.vertices[v as usize])));
        let least = left.fold(f64::INFINITY, f64::min);
        let within = (0..).zip(&mesh.vertices).filter(|(v, _)| far_in(*v));
        let moved = within.map(|(v, rest)| at(v).distance(*rest)).fold(0.0, f64::max);
        println!("{cells} cells, {beside} mm beside: {least} of a volume left, {moved} mm moved");
        assert!(least > 0.7 && moved < 1.3, "{cells} cells, {beside} mm beside: {least} left, {moved} mm");
    }
}
