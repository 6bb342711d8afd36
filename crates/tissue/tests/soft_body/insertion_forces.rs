//! What a catheter feels on its way: as much at any speed, as much after a rest, and nothing that the tissue does not bear.

use crate::common::{cube_with_horn, options, physical, rod};
use monro_geometry::{Point, Vector};
use monro_tissue::{
    Event, FrameSettings, Insertion, Material, Model, State, StepReport, Stepper, TipShape, Tool, ToolMotion, ToolPose,
};
use std::ops::Range;

/// Of the cube, mm.
const EDGE: f64 = 48.0;
/// Radius of the horn, mm.
const HORN: f64 = 7.0;

/// A cube of brain held at its sides and bottom, in so many cells along each edge and skewed by that share of them, with a
/// horn of a ventricle along y at a height of `horn` mm; none below zero.
fn cube(cells: (usize, f64), horn: f64, brain: Insertion, ventricle: Insertion) -> Model {
    let (mesh, fixed) = cube_with_horn(EDGE, cells, [HORN, horn]);
    let mut options = options(physical(), &fixed);
    options.materials.insert(4, Material { insertion: brain, ..Material::BRAIN });
    options.materials.insert(5, Material { insertion: ventricle, ..Material::VENTRICLE });
    if horn < 0.0 {
        options.materials.remove(&5);
    }
    Model::new(&mesh, &options).expect("model")
}

/// Moves a catheter down at `place` from one height of its tip to another in so many frames.
fn go(model: &Model, state: &mut State, place: [f64; 2], heights: Range<f64>, frames: i32) -> Vec<StepReport> {
    let mut stepper = Stepper::new(model);
    let at = |f: i32| {
        let t = f64::from(f) / f64::from(frames);
        [place[0], place[1], heights.start + t * (heights.end - heights.start)]
    };
    let step = |f| stepper.step(model, state, &[rod(at(f), at(f + 1))], &FrameSettings::default());
    (0..frames).map(step).collect()
}

fn axial(report: &StepReport) -> f64 {
    report.tools[0].axial_force_mn
}

/// Rubs, and does nothing else.
const RUBS: Insertion = Insertion {
    puncture_force_mn: 1.0,
    puncture_depth_mm: 0.1,
    cut_force_mn: 0.0,
    static_friction_mn_per_mm: 1.0,
    dynamic_friction_mn_per_mm: 1.0,
};

#[test]
fn friction_of_a_millimetre_was_that_of_four_thirds_where_a_catheter_went_slowly() {
    let model = cube((8, 0.0), -HORN, RUBS, Insertion::VENTRICLE);
    for mm_s in [2.0, 10.0, 40.0, 150.0] {
        let mut state = model.rest_state();
        let (from, to) = (EDGE + 1.0, EDGE - 36.0);
        let reports = go(&model, &mut state, [23.3, 24.7], from..to, ((from - to) / mm_s * 60.0) as i32);
        let felt: Vec<_> = reports.iter().map(|r| (r.tools[0].inserted_mm, axial(r))).filter(|f| f.0 > 24.0).collect();
        let mean = felt.iter().map(|f| f.1 / f.0).sum::<f64>() / felt.len() as f64;
        println!("{mm_s} mm/s: {mean} mN per mm, {} frames", felt.len());
        assert!((mean - 1.0).abs() < 0.06, "{mm_s} mm/s: {mean} mN per mm");
    }
}

#[test]
fn a_tip_met_less_than_the_force_that_cuts_the_finer_the_elements() {
    let rubs = RUBS.dynamic_friction_mn_per_mm;
    for (cells, asked, mm_s) in
        [(10, 80.0, 10.0), (16, 80.0, 10.0), (24, 80.0, 10.0), (16, 80.0, 3.0), (16, 30.0, 20.0)]
    {
        let brain = Insertion { puncture_force_mn: 40.0, cut_force_mn: asked, ..RUBS };
        let model = cube((cells, 0.2), -HORN, brain, Insertion::VENTRICLE);
        let mut state = model.rest_state();
        let (from, to) = (EDGE + 1.0, 12.0);
        let reports = go(&model, &mut state, [23.3, 24.7], from..to, ((from - to) / mm_s * 60.0) as i32);
        let way = reports.iter().map(|r| (r.tools[0].inserted_mm, axial(r))).filter(|f| f.0 > 10.0);
        let met: Vec<_> = way.map(|(inserted, felt)| felt - rubs * inserted).collect();
        let mean = met.iter().sum::<f64>() / met.len() as f64;
        println!("{cells} cells, {mm_s} mm/s: {mean} of {asked} mN");
        assert!((0.93..1.03).contains(&(mean / asked)), "{cells} cells, {mm_s} mm/s: {mean} of {asked} mN");
    }
}

#[test]
fn a_catheter_that_rested_slid_on_without_breaking_away() {
    let insertion = Insertion { static_friction_mn_per_mm: 2.0, ..RUBS };
    let model = cube((8, 0.0), -HORN, insertion, Insertion::VENTRICLE);
    let mut state = model.rest_state();
    let place = [23.3, 24.7];
    go(&model, &mut state, place, EDGE + 1.0..20.0, 180);
    let slid = go(&model, &mut state, place, 20.0..18.0, 60);
    let rested = go(&model, &mut state, place, 18.0..18.0, 60);
    let on = go(&model, &mut state, place, 18.0..13.0, 150);
    let most = on.iter().map(axial).fold(0.0, f64::max);
    let (before, still, after) = (axial(&slid[59]), axial(&rested[59]), axial(&on[149]));
    println!("before {before}, at rest {still}, most {most}, after {after}");
    assert!((still / before - 1.0).abs() < 0.15, "it is held as it stopped: {before} mN, then {still}");
    assert!(most > 1.4 * before && most < 2.2 * before, "{before}, then {most} mN");
    assert!((after / before - 1.0).abs() < 0.35, "{before} mN before, {after} after");
}

#[test]
fn a_catheter_put_into_tissue_felt_twenty_newtons() {
    let model = cube((8, 0.0), -HORN, Insertion::BRAIN, Insertion::VENTRICLE);
    for first in [[23.3, 24.7, EDGE + 80.0], [23.3, 24.7, 20.0]] {
        let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
        let deep = [23.3, 24.7, 20.0];
        let mut report = stepper.step(&model, &mut state, &[rod(first, deep)], &FrameSettings::default());
        assert!(report.events.iter().any(|e| matches!(e, Event::Found { tool: 0, label: 4, .. })), "{report:?}");
        let mut way = 0.0;
        for f in 0..40 {
            // The tissue makes room for the shaft, and then is at rest.
            let moved = report.max_displacement_mm - core::mem::replace(&mut way, report.max_displacement_mm);
            assert!(report.tools[0].force_mn.norm() < 10.0 && way < 1.0, "{report:?}");
            assert!(f < 30 || moved.abs() < 1e-3, "{report:?}");
            assert!(report.tools[0].label == Some(4) && report.tools[0].inserted_mm > 25.0, "{report:?}");
            report = stepper.step(&model, &mut state, &[rod(deep, deep)], &FrameSettings::default());
        }
        // From there it goes on as any other.
        let on = go(&model, &mut state, [23.3, 24.7], 20.0..15.0, 30);
        assert!(axial(&on[29]) > Insertion::BRAIN.cut_force_mn, "{:?}", on[29]);
    }
}

/// A catheter so tilted whose tip is so far from the middle of the cube.
fn askew(tilt: f64, far: f64) -> ToolPose {
    let back = Vector::new(tilt, 0.6 * tilt, 1.0).normalized().expect("a direction");
    let tip = Point::new(23.3, 24.7, 24.0) + back * far;
    ToolPose { tip, tail: tip + back * 120.0 }
}

/// Bears whatever comes.
const FIRM: Insertion = Insertion { puncture_force_mn: 1e6, puncture_depth_mm: 40.0, ..Insertion::VENTRICLE };

/// Reports of a catheter that comes askew upon the wall of a ventricle in elements of many shapes, from 4 mm before it to
/// `deep` mm behind its place at rest.
fn press_on_wall(cells: usize, tilt: f64, deep: f64, wall: Insertion) -> Vec<StepReport> {
    let brain = Insertion { puncture_force_mn: 1.0, cut_force_mn: 1.0, ..RUBS };
    let model = cube((cells, 0.2), 24.0 - HORN, brain, wall);
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
    let tool = Tool { tip: TipShape::Round, radius_mm: 1.5 };
    let way = |f: i32| askew(tilt, 30.0 - f64::from(f) / 6.0);
    let mut step = |f| {
        let motion = ToolMotion { tool, from: way(f), to: way(f + 1) };
        stepper.step(&model, &mut state, &[motion], &FrameSettings::default())
    };
    let reports: Vec<_> = (0..180 + (deep * 6.0) as i32).map(&mut step).collect();
    reports[150..].to_vec()
}

#[test]
fn a_wall_that_bears_much_was_passed_beside_the_tip() {
    for (cells, least) in [(6, 300.0), (12, 150.0), (18, 100.0)] {
        for tilt in [0.0, 0.2, 0.5, 0.8] {
            let reports = press_on_wall(cells, tilt, 8.0, FIRM);
            let last = reports.last().expect("frames");
            println!("{cells} cells at {tilt}: {} mN", axial(last));
            assert!(axial(last) > least && last.tools[0].dimpling, "{cells} cells at {tilt}: {last:?}");
            let mut events = reports.iter().flat_map(|r| &r.events);
            assert!(!events.any(|e| matches!(e, Event::Punctured { .. })), "{cells} cells at {tilt}");
        }
    }
}

/// A head's insertion counted seven punctures of one wall, every other at no force: the tip was still on its near side.
#[test]
fn a_wall_that_yields_is_gone_through_once() {
    let mut all = Vec::new();
    for (cells, tilt) in [6, 9, 12, 18].into_iter().flat_map(|c| [0.0, 0.2, 0.5, 0.8].map(|t| (c, t))) {
        for most in [60.0, 120.0] {
            let wall = Insertion { puncture_force_mn: most, ..Insertion::VENTRICLE };
            let reports = press_on_wall(cells, tilt, 6.0, wall);
            let punctures = reports.iter().flat_map(|r| &r.events).filter_map(|e| match e {
                Event::Punctured { from, to, force_mn, depth_mm, .. } => Some((*from, *to, *force_mn, *depth_mm)),
                _ => None,
            });
            all.push((cells, tilt, most, punctures.collect::<Vec<_>>()));
        }
    }
    // Where the catheter comes out again at a corner of coarse elements, it is pressed on.
    let once = |p: &[(Option<u16>, u16, f64, f64)]| {
        p.iter().filter(|(_, to, ..)| *to == 5).count() <= 1 && p.iter().all(|(.., force, _)| *force > 0.0)
    };
    let others: Vec<_> = all.iter().filter(|(.., p)| !once(p)).collect();
    assert!(others.is_empty(), "{others:?}");
    assert!(all.iter().filter(|(.., p)| !p.is_empty()).count() > all.len() / 2, "{all:?}");
}

/// Every other frame it felt nothing, and the surface sprang back: what had just been pushed before it was not seen there.
#[test]
fn a_cone_presses_on_the_surface_in_every_frame() {
    for half_angle in [0.4, 0.8, 1.2] {
        let model = cube((16, 0.2), -HORN, FIRM, Insertion::VENTRICLE);
        let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
        let tool = Tool { tip: TipShape::Cone { half_angle }, radius_mm: 0.8 };
        let mut step = |f: i32| {
            let at = |f: i32| askew(0.05, 25.0 - 0.15 * f64::from(f));
            let motion = ToolMotion { tool, from: at(f), to: at(f + 1) };
            stepper.step(&model, &mut state, &[motion], &FrameSettings::default())
        };
        let reports: Vec<_> = (0..24).map(&mut step).collect();
        let pressing = reports.iter().skip_while(|r| !r.tools[0].dimpling);
        let forces: Vec<f64> = pressing.map(axial).collect();
        assert!(forces.len() > 12 && forces.iter().all(|f| *f > 0.0), "{half_angle}: {forces:.1?}");
    }
}
