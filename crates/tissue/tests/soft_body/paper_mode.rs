//! Behaviour of paper mode as a whole.

use crate::common::{block, nodes, options, paper, rod};
use monro_geometry::{Point, Vector};
use monro_tissue::{
    CollisionResponse, Event, FrameSettings, Mode, Model, ModelError, PaperOptions, PhysicalOptions, State, Stepper,
};

fn bits(model: &Model, state: &State) -> Vec<u64> {
    let mut p = Vec::new();
    model.positions_into(state, &mut p);
    p.iter().flat_map(|p| p.to_array().map(f64::to_bits)).collect()
}

#[test]
fn rest_stays_at_rest_for_ten_thousand_frames() {
    let mesh = block([2, 2, 2], 10.0, |_| 4);
    let model = Model::new(&mesh, &options(paper(), &nodes(&mesh, |p| p.z == 0.0))).expect("model");
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
    let settings = FrameSettings { iterations: 2, ..FrameSettings::default() };
    let mut last = 0.0;
    for _ in 0..10_000 {
        last = stepper.step(&model, &mut state, &[], &settings).max_displacement_mm;
    }
    assert!(last < 1e-6 * 20.0, "drift {last} mm");
}

#[test]
fn internal_constraints_keep_momentum_and_angular_momentum() {
    let mesh = block([3, 2, 2], 5.0, |c| if c[0] == 1 { 5 } else { 4 });
    let mode = Mode::Paper(PaperOptions { damping: 0.5, ..PaperOptions::default() });
    let model = Model::new(&mesh, &options(mode, &[])).expect("model");
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
    // Gravity for one frame gives momentum; a squeeze by two plain tools would not: nothing else acts.
    let kick = FrameSettings { gravity_mm_s2: [3000.0, -1000.0, 500.0], ..FrameSettings::default() };
    stepper.step(&model, &mut state, &[], &kick);
    let momentum = |s: &State| {
        let zero = (Vector::ZERO, Vector::ZERO);
        (0..mesh.vertices.len()).fold(zero, |(p, l), v| {
            let velocity = model.velocity(s, v);
            (p + velocity, l + (model.position(s, v) - Point::ORIGIN).cross(velocity))
        })
    };
    let before = momentum(&state);
    for _ in 0..50 {
        stepper.step(&model, &mut state, &[], &FrameSettings::default());
    }
    let after = momentum(&state);
    assert!((after.0 - before.0).norm() < 1e-3 * before.0.norm(), "{before:?} {after:?}");
}

/// A block of brain with a ventricle inside; the rod goes in to the ventricle and back out.
fn insertion(collision: CollisionResponse) -> (Vec<Event>, usize, f64) {
    let mesh = block([10, 10, 8], 5.0, |c| {
        if (3..7).contains(&c[0]) && (3..7).contains(&c[1]) && (2..5).contains(&c[2]) { 5 } else { 4 }
    });
    let fixed = nodes(&mesh, |p| p.z == 0.0 || p.x == 0.0 || p.x == 50.0);
    let mut o = options(paper(), &fixed);
    o.collision = collision;
    let model = Model::new(&mesh, &o).expect("model");
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
    let settings = FrameSettings { iterations: 5, ..FrameSettings::default() };
    let depth = |f: f64| if f < 90.0 { 43.0 - f / 3.0 } else { 13.0 + (f - 90.0) / 3.0 };
    let (mut events, mut worst, mut volume) = (Vec::new(), 0, 0f64);
    for f in 0..200 {
        let (from, to) = (depth(f as f64), depth((f + 1) as f64));
        let motion = rod([23.1, 26.3, from], [23.1, 26.3, to]);
        let report = stepper.step(&model, &mut state, &[motion], &settings);
        worst = worst.max(report.inverted);
        volume = volume.max(report.volume_change.abs());
        events.extend(report.events);
    }
    (events, worst, volume)
}

#[test]
fn a_rod_dimples_punctures_reaches_the_ventricle_and_comes_out_again() {
    let (events, worst, volume) = insertion(CollisionResponse::Insertion);
    let walls: Vec<(Option<u16>, Option<u16>)> = events
        .iter()
        .filter_map(|e| match *e {
            Event::Punctured { from, to, .. } => Some((from, Some(to))),
            Event::Withdrawn { from, to, .. } => Some((Some(from), to)),
            _ => None,
        })
        .collect();
    assert_eq!(walls, [(None, Some(4)), (Some(4), Some(5)), (Some(5), Some(4)), (Some(4), None)], "{events:?}");
    for e in &events {
        if let Event::Punctured { to, point, depth_mm, .. } = e {
            let (surface, limit) = if *to == 4 { (40.0, 5.0) } else { (25.0, 4.0) };
            // The tip lies below the wall by the dimple at which it yields.
            assert!((depth_mm - limit).abs() < 0.5, "{depth_mm}");
            assert!(point.z < surface && point.z > surface - limit - 3.0, "{point:?}");
        }
    }
    assert_eq!(worst, 0);
    assert!(volume < 0.01);
}

#[test]
fn the_plain_response_never_punctures() {
    let (events, ..) = insertion(CollisionResponse::Plain);
    assert!(!events.iter().any(|e| matches!(e, Event::Punctured { .. })), "{events:?}");
}

#[test]
fn the_same_steps_give_the_same_bits_and_a_snapshot_goes_on_as_the_original() {
    let mesh = block([5, 5, 4], 6.0, |c| if c[2] == 1 { 5 } else { 4 });
    let model = Model::new(&mesh, &options(paper(), &nodes(&mesh, |p| p.z == 0.0))).expect("model");
    let at = |f: i32| [14.0, 16.0, 26.0 - f64::from(f) * 0.2];
    let run = |state: &mut State, frames: core::ops::Range<i32>| {
        let mut stepper = Stepper::new(&model);
        for f in frames {
            stepper.step(&model, state, &[rod(at(f), at(f + 1))], &FrameSettings::default());
        }
    };
    let mut whole = model.rest_state();
    run(&mut whole, 0..60);
    let mut half = model.rest_state();
    run(&mut half, 0..30);
    let mut rest = half.clone();
    run(&mut rest, 30..60);
    assert_eq!(bits(&model, &whole), bits(&model, &rest));
}

#[test]
fn poses_that_are_not_poses_are_reported_and_change_nothing() {
    let mesh = block([2, 2, 2], 5.0, |_| 4);
    let model = Model::new(&mesh, &options(paper(), &[])).expect("model");
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
    let mut nan = rod([5.0, 5.0, 8.0], [5.0, 5.0, 8.0]);
    nan.to.tip.x = f64::NAN;
    let mut flat = rod([5.0, 5.0, 8.0], [5.0, 5.0, 8.0]);
    flat.from.tail = flat.from.tip;
    flat.to.tail = flat.to.tip;
    let report = stepper.step(&model, &mut state, &[nan, flat], &FrameSettings::default());
    let bad: Vec<_> = report.events.iter().filter(|e| matches!(e, Event::BadPose { .. })).collect();
    assert_eq!(bad.len(), 2, "{report:?}");
    assert!(report.max_displacement_mm < 1e-4);
}

#[test]
fn a_block_on_rollers_slides_in_their_plane_only() {
    let mesh = block([2, 2, 2], 10.0, |_| 4);
    let kind = monro_tissue::AttachmentKind::Guided { held: [false, false, true] };
    let floor = |v: &u32| mesh.vertices[*v as usize].z == 0.0;
    let mut o = options(paper(), &[]);
    o.attachments = (0..27).filter(floor).map(|node| monro_tissue::Attachment { node, kind }).collect();
    let model = Model::new(&mesh, &o).expect("model");
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
    let settings = FrameSettings { gravity_mm_s2: [1000.0, 0.0, -1000.0], ..FrameSettings::default() };
    for _ in 0..30 {
        stepper.step(&model, &mut state, &[], &settings);
    }
    // Half a second of free sliding, x = g t^2 / 2 and half a step more (implicit Euler), while nothing sinks.
    let expected = 0.5 * 1000.0 * 0.5 * (0.5 + 1.0 / 60.0);
    for v in (0..27).filter(floor) {
        let d = model.displacement(&state, v as usize);
        assert!(d.z == 0.0, "{v}: {d:?}");
        assert!((d.x / expected - 1.0).abs() < 0.05, "{v}: {} mm, expected {expected}", d.x);
    }
    let elsewhere = model.position(&state, 0) + Vector::new(5.0, 5.0, 1.0);
    assert!(model.place_fixed(&mut state, 0, elsewhere));
    assert_eq!(model.displacement(&state, 0).z, 1.0, "only what is held is put elsewhere");
    let mut bad = options(Mode::Physical(PhysicalOptions::default()), &[]);
    bad.attachments = o.attachments;
    assert_eq!(Model::new(&mesh, &bad).err(), Some(ModelError::Guided { attachment: 0 }));
}

#[test]
fn springs_hold_against_gravity_with_their_stiffness() {
    let mesh = block([1, 1, 1], 10.0, |_| 4);
    let mut o = options(paper(), &[]);
    o.attachments = (0..8)
        .map(|node| monro_tissue::Attachment {
            node,
            kind: monro_tissue::AttachmentKind::Spring { stiffness_mn_per_mm: 2.0 },
        })
        .collect();
    let model = Model::new(&mesh, &o).expect("model");
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
    let settings = FrameSettings { gravity_mm_s2: [0.0, 0.0, -9810.0], ..FrameSettings::default() };
    for _ in 0..600 {
        stepper.step(&model, &mut state, &[], &settings);
    }
    let mean = (0..8).map(|v| model.displacement(&state, v).z).sum::<f64>() / 8.0;
    // Weight over stiffness: 1000 mm3 of 1040 kg/m3 on eight springs.
    let expected = -1000.0 * 1040e-9 * 9810.0 / 16.0;
    assert!((mean / expected - 1.0).abs() < 0.02, "{mean} mm, expected {expected}");
}
