//! Tools as hands move them: trembling, in tissue that has shifted, through to the far side, and pointed.

use crate::common::{block, nodes, options, physical, rod};
use monro_geometry::{Point, TetMesh};
use monro_tissue::{Event, FrameSettings, Model, State, StepReport, Stepper, TipShape, Tool, ToolMotion, ToolPose};

const SIZE: f64 = 40.0;

/// A cube of brain, held but for its top, with a ventricle in the middle if asked for.
fn cube(ventricle: bool) -> (TetMesh, Vec<u32>, Model) {
    let within = |c: [usize; 3]| (3..7).contains(&c[0]) && (3..7).contains(&c[1]) && (2..6).contains(&c[2]);
    let mesh = block([10; 3], SIZE / 10.0, |c| if ventricle && within(c) { 5 } else { 4 });
    let side = |v: f64| v <= 0.0 || v >= SIZE;
    let held = nodes(&mesh, |p| side(p.x) || side(p.y) || p.z == 0.0);
    let model = Model::new(&mesh, &options(physical(), &held)).expect("model");
    (mesh, held, model)
}

/// A body in which a rod goes along z.
struct Scene<'a> {
    model: &'a Model,
    state: State,
    stepper: Stepper,
    at: [f64; 3],
    events: Vec<Event>,
}

impl<'a> Scene<'a> {
    fn new(model: &'a Model, at: [f64; 3]) -> Self {
        Self { model, state: model.rest_state(), stepper: Stepper::new(model), at, events: Vec::new() }
    }

    fn to(&mut self, at: [f64; 3]) -> StepReport {
        let motion = rod(self.at, at);
        self.at = at;
        let report = self.stepper.step(self.model, &mut self.state, &[motion], &FrameSettings::default());
        self.events.extend(report.events.iter().cloned());
        report
    }

    /// Goes along z in frames of at most `step` mm; the last report.
    fn along(&mut self, z: f64, step: f64) -> StepReport {
        let (from, frames) = (self.at[2], ((self.at[2] - z).abs() / step).ceil());
        let way = |f: u32| from + (z - from) * f64::from(f) / frames;
        (1..=frames as u32).map(|f| self.to([self.at[0], self.at[1], way(f)])).last().expect("frames")
    }

    /// Goes on from the surface until the wall of the ventricle is pressed, and a little further.
    fn dimple(&mut self) -> f64 {
        while !self.along(self.at[2] - 0.1, 0.1).tools.iter().any(|t| t.dimpling && t.inserted_mm > 5.0) {
            assert!(self.at[2] > 15.0, "no wall is met: {:?}", self.events);
        }
        self.along(self.at[2] - 0.5, 0.1);
        self.at[2]
    }
}

fn withdrawn(events: &[Event]) -> bool {
    events.iter().any(|e| matches!(e, Event::Withdrawn { .. }))
}

#[test]
fn a_trembling_tip_was_in_the_ventricle_without_having_punctured_its_wall() {
    let (_, _, model) = cube(true);
    let depth = Scene::new(&model, [20.3, 19.6, 42.0]).dimple();
    let held_still = {
        let mut still = Scene::new(&model, [20.3, 19.6, 42.0]);
        still.along(depth, 0.1);
        (0..60).map(|_| still.to(still.at).tools[0].axial_force_mn).last().expect("frames")
    };
    for tremor in [0.005, 0.05, 0.25] {
        let mut scene = Scene::new(&model, [20.3, 19.6, 42.0]);
        scene.along(depth, 0.1);
        scene.events.clear();
        let hold = |i: i32| if i % 2 == 0 { depth + tremor } else { depth };
        let last = (0..60).map(|i| scene.to([20.3, 19.6, hold(i)])).last().expect("frames");
        assert!(scene.events.is_empty(), "{tremor} mm: {:?}", scene.events);
        assert_eq!(last.tools[0].label, Some(4), "{tremor} mm");
        let felt = last.tools[0].axial_force_mn;
        assert!(tremor > 0.1 || (felt / held_still - 1.0).abs() < 0.25, "{tremor} mm: {felt}, at rest {held_still} mN");
    }
}

#[test]
fn a_tip_drawn_back_from_a_wall_that_it_dimples_was_taken_for_one_that_has_gone_through() {
    let (_, _, model) = cube(true);
    let mut scene = Scene::new(&model, [20.3, 19.6, 42.0]);
    let depth = scene.dimple();
    scene.events.clear();
    for z in [depth + 0.6, depth + 2.0, 30.0] {
        let report = scene.along(z, 0.1);
        assert_eq!(report.tools[0].label, Some(4), "at {z} mm");
    }
    assert!(scene.events.is_empty(), "{:?}", scene.events);
    // Through the wall and back, it has been in the ventricle and left it.
    scene.along(14.0, 0.1);
    let punctured = scene.events.iter().any(|e| matches!(e, Event::Punctured { from: Some(4), to: 5, .. }));
    assert!(punctured && !withdrawn(&scene.events), "{:?}", scene.events);
    scene.along(30.0, 0.1);
    assert!(scene.events.iter().any(|e| matches!(e, Event::Withdrawn { from: 5, to: Some(4), .. })));
}

/// Side force after a rod of radius `radius`, 26 mm deep, has gone 2 mm sideways in a body that has shifted by `shift`.
fn side_force(shift: f64, radius: f64) -> f64 {
    let (mesh, held, model) = cube(false);
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
    let settings = FrameSettings::default();
    for frame in 0..120 {
        let d = shift * (f64::from(frame + 1) / 60.0).min(1.0);
        for &v in &held {
            let p = mesh.vertices[v as usize];
            model.place_fixed(&mut state, v as usize, Point::new(p.x + d, p.y, p.z));
        }
        stepper.step(&model, &mut state, &[], &settings);
    }
    let tool = Tool { tip: TipShape::Round, radius_mm: radius };
    let pose = |z: f64, x: f64| {
        let x = 20.3 + shift + x;
        ToolPose { tip: Point::new(x, 19.6, z), tail: Point::new(x, 19.6, z + 100.0) }
    };
    let mut go = |from: (f64, f64), to: (f64, f64)| {
        let motion = ToolMotion { tool, from: pose(from.0, from.1), to: pose(to.0, to.1) };
        stepper.step(&model, &mut state, &[motion], &settings).tools[0].force_mn.x
    };
    let depth = |f: i32| 41.0 - 0.1 * f64::from(f);
    for f in 0..280 {
        go((depth(f), 0.0), (depth(f + 1), 0.0));
    }
    let aside = |f: i32| (depth(280), f64::from(f.min(30)) / 15.0);
    (0..60).map(|f| go(aside(f), aside(f + 1))).last().expect("frames")
}

#[test]
fn a_shaft_in_tissue_that_had_shifted_by_ten_radii_held_nothing() {
    for (radius, shift) in [(1.5, 16.0), (0.65, 7.0)] {
        let (here, there) = (side_force(0.0, radius), side_force(shift, radius));
        assert!(here.abs() > 50.0, "{here} mN");
        assert!((there / here - 1.0).abs() < 0.4, "radius {radius}: {here} mN, shifted by {shift} mm {there} mN");
    }
}

#[test]
fn a_rod_through_a_slab_shook_it_for_ever_and_was_called_withdrawn() {
    let mesh = block([10, 10, 5], 4.0, |_| 4);
    let side = |v: f64| v <= 0.0 || v >= SIZE;
    let model = Model::new(&mesh, &options(physical(), &nodes(&mesh, |p| side(p.x) || side(p.y)))).expect("model");
    let mut scene = Scene::new(&model, [20.3, 19.6, 21.5]);
    scene.along(-14.0, 0.12);
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for frame in 0..120 {
        let report = scene.to(scene.at);
        assert_eq!((report.rollbacks, report.inverted), (0, 0), "frame {frame}");
        let tool = &report.tools[0];
        assert!(tool.label.is_none() && tool.inserted_mm > 15.0, "{tool:?}");
        if frame >= 60 {
            (low, high) = (low.min(tool.axial_force_mn), high.max(tool.axial_force_mn));
        }
    }
    assert!(high - low < 5.0, "{low} to {high} mN under a rod at rest");
    assert!(!withdrawn(&scene.events), "{:?}", scene.events);
    // Back into the slab and out at the top.
    assert_eq!(scene.along(10.0, 0.12).tools[0].label, Some(4));
    assert!(!withdrawn(&scene.events), "{:?}", scene.events);
    let out = scene.along(24.0, 0.12);
    assert_eq!((out.tools[0].label, out.tools[0].inserted_mm), (None, 0.0));
    let left = scene.events.iter().filter(|e| matches!(e, Event::Withdrawn { from: 4, to: None, .. })).count();
    assert_eq!(left, 1, "{:?}", scene.events);
}

/// Force and dimple at the puncture of a tool that comes from `start` with so many mm/s.
fn puncture(tip: TipShape, start: f64, speed: f64) -> (f64, f64) {
    let (_, _, model) = cube(false);
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
    let tool = Tool { tip, radius_mm: 1.5 };
    let pose = |f: u32| {
        let z = start - f64::from(f) * speed / 60.0;
        ToolPose { tip: Point::new(20.3, 19.6, z), tail: Point::new(20.3, 19.6, z + 100.0) }
    };
    for f in 0..(11.0 * 60.0 / speed) as u32 {
        let motion = ToolMotion { tool, from: pose(f), to: pose(f + 1) };
        let report = stepper.step(&model, &mut state, &[motion], &FrameSettings::default());
        assert_eq!(report.rollbacks, 0, "{tip:?} at {speed} mm/s: {:?}", report.events);
        let found = report.events.iter().find_map(|e| match *e {
            Event::Punctured { force_mn, depth_mm, .. } => Some((force_mn, depth_mm)),
            _ => None,
        });
        if let Some(found) = found {
            return found;
        }
    }
    panic!("{tip:?} at {speed} mm/s punctures nothing")
}

#[test]
fn a_cone_that_met_a_face_exactly_had_forces_that_are_no_numbers() {
    for half_angle in [0.3, 1.0] {
        // The tip is on the face after whole frames.
        puncture(TipShape::Cone { half_angle }, 41.0, 20.0);
    }
}

#[test]
fn a_slender_cone_went_through_a_membrane_as_if_there_were_none() {
    for half_angle in [0.1, 0.3, 0.6] {
        for speed in [5.0, 20.0] {
            let (force, dimple) = puncture(TipShape::Cone { half_angle }, 41.0137, speed);
            assert!(force > 40.0 && dimple > 2.0, "{half_angle} at {speed} mm/s: {force} mN, {dimple} mm");
        }
    }
}
