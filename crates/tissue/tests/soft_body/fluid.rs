//! Ventricle pressure, drainage, and the forces at attachments, against closed forms.

use crate::common::{block, nodes, options, physical};
use monro_geometry::{Patient, Point, TetMesh, Vector};
use monro_tissue::{Csf, FrameSettings, Material, Model, ModelOptions, State, Stepper};

const INNER: f64 = 20.0;
const OUTER: f64 = 60.0;

/// A ball of tissue (4) around a ball of fluid (5): the cubes of a block drawn out to spherical shells.
fn ball(cells: usize) -> TetMesh {
    let half = cells as f64 / 2.0;
    let inner = cells as f64 * INNER / OUTER / 2.0;
    let shell = |c: [usize; 3]| c.iter().map(|&v| (v as f64 + 0.5 - half).abs()).fold(0.0, f64::max);
    let mut mesh = block([cells; 3], 1.0, |c| if shell(c) < inner { 5 } else { 4 });
    for p in &mut mesh.vertices {
        let q = p.to_array().map(|v| v - half);
        let most = q.iter().fold(0f64, |m, v| m.max(v.abs()));
        let length = q.iter().map(|v| v * v).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
        *p = Point::from_array(q.map(|v| v * most / length * OUTER / half));
    }
    mesh
}

fn radius(p: Point<Patient>) -> f64 {
    (p - Point::ORIGIN).norm()
}

/// Tissue of nu 0.45 with the outside held, around a fluid that resists nothing itself.
fn model(mesh: &TetMesh) -> (Model, ModelOptions) {
    let mut o = options(physical(), &nodes(mesh, |p| radius(p) > OUTER - 1e-6));
    o.materials.insert(4, Material { poisson: 0.45, ..Material::BRAIN });
    o.materials.insert(5, Material { young_kpa: 1e-3, poisson: 0.0, ..Material::VENTRICLE });
    (Model::new(mesh, &o).expect("model"), o)
}

/// Lame: `u = a r + b / r^2` with the outside held and the wall moved by `wall`; the pressure that does it.
fn lame(m: &Material, wall: f64) -> (impl Fn(f64) -> f64, f64) {
    let b = wall / (INNER.powi(-2) - INNER * OUTER.powi(-3));
    let a = -b * OUTER.powi(-3);
    let (mu, lam) = (m.shear_kpa(), m.lame_kpa());
    let stress = (3.0 * lam + 2.0 * mu) * a - 4.0 * mu * b * INNER.powi(-3);
    (move |r: f64| a * r + b / (r * r), -stress)
}

fn settle(model: &Model, settings: &FrameSettings) -> (State, monro_tissue::StepReport) {
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(model));
    let mut last = monro_tissue::StepReport::default();
    for _ in 0..150 {
        last = stepper.step(model, &mut state, &[], settings);
    }
    (state, last)
}

/// Mean outward displacement of the vertices at this distance from the centre.
fn swelling(mesh: &TetMesh, model: &Model, state: &State, r: f64) -> f64 {
    let at = nodes(mesh, |p| (radius(p) - r).abs() < 1e-6);
    let out = |&v: &u32| {
        let p = mesh.vertices[v as usize] - Point::ORIGIN;
        model.displacement(state, v as usize).dot(p) / p.norm()
    };
    at.iter().map(out).sum::<f64>() / at.len() as f64
}

#[test]
fn a_drained_ventricle_gives_the_volume_and_its_wall_follows_as_lame_says() {
    let mesh = ball(12);
    let (model, o) = model(&mesh);
    let ml = 1.0;
    let (state, report) = settle(&model, &FrameSettings { csf: Csf::Drained { ml }, ..FrameSettings::default() });
    assert!((report.csf_change_ml + ml).abs() < 0.01 * ml, "{} ml", report.csf_change_ml);
    // The cavity of this mesh is a little smaller than its ball: take the wall's motion from the volume.
    let wall = swelling(&mesh, &model, &state, INNER);
    assert!((wall * 4.0 * core::f64::consts::PI * INNER.powi(2) / -1000.0 / ml - 1.0).abs() < 0.1, "{wall} mm");
    let (u, pressure) = lame(&o.materials[&4], wall);
    for r in [30.0, 40.0, 50.0] {
        let moved = swelling(&mesh, &model, &state, r);
        assert!((moved - u(r)).abs() < 0.05 * wall.abs(), "at {r}: {moved} mm, Lame {} mm", u(r));
    }
    // The wall of this mesh has 192 facets and does not move evenly; the pressure feels that more than the motion does.
    assert!((report.csf_kpa / pressure - 1.0).abs() < 0.2, "{} kPa, Lame {pressure} kPa", report.csf_kpa);
}

#[test]
fn a_ventricle_under_pressure_swells_as_lame_says_and_the_skull_bears_it() {
    let mesh = ball(12);
    let (model, o) = model(&mesh);
    let kpa = 0.05;
    let settings = FrameSettings { csf: Csf::Pressure { kpa }, ..FrameSettings::default() };
    let (state, report) = settle(&model, &settings);
    assert_eq!(report.csf_kpa, kpa);
    let wall = swelling(&mesh, &model, &state, INNER);
    let (_, per_mm) = lame(&o.materials[&4], 1.0);
    assert!((wall * per_mm / kpa - 1.0).abs() < 0.12, "{wall} mm, Lame {} mm", kpa / per_mm);
    // Each half of the skull bears the stress that Lame gives there, times the area of the great circle.
    let reactions = model.reactions(&state, &settings).expect("physical");
    let half = reactions.iter().zip(&mesh.vertices).filter(|(_, p)| p.x > 1e-6).map(|(r, _)| r.x).sum::<f64>();
    let (b, m) = (wall / (INNER.powi(-2) - INNER * OUTER.powi(-3)), &o.materials[&4]);
    let a = -b * OUTER.powi(-3);
    let stress = (3.0 * m.lame_kpa() + 2.0 * m.shear_kpa()) * a - 4.0 * m.shear_kpa() * b * OUTER.powi(-3);
    let borne = stress * core::f64::consts::PI * OUTER.powi(2);
    assert!((half / borne - 1.0).abs() < 0.15, "{half} mN, Lame {borne} mN");
}

#[test]
fn attachments_bear_the_weight() {
    let mesh = block([3, 3, 3], 6.0, |_| 4);
    let model = Model::new(&mesh, &options(physical(), &nodes(&mesh, |p| p.z == 0.0))).expect("model");
    let settings = FrameSettings { gravity_mm_s2: [0.0, 0.0, -9810.0], ..FrameSettings::default() };
    let (state, _) = settle(&model, &settings);
    let reactions = model.reactions(&state, &settings).expect("physical");
    let sum = reactions.iter().fold(Vector::ZERO, |s, &r| s + r);
    let weight = model.mass_kg() * 9810.0;
    assert!((sum.z / weight - 1.0).abs() < 1e-3 && sum.x.abs() + sum.y.abs() < 1e-3 * weight, "{sum:?}, {weight} mN");
}

/// It weighed on the wall that it had left: as much as without a drain.
#[test]
fn fluid_that_has_been_drained_weighs_nothing() {
    let mesh = ball(12);
    let mut o = options(physical(), &nodes(&mesh, |p| radius(p) > OUTER - 1e-6));
    o.materials.insert(4, Material { poisson: 0.45, ..Material::BRAIN });
    let model = Model::new(&mesh, &o).expect("model");
    let [g, ml] = [9810.0, 6.0];
    let settings =
        FrameSettings { csf: Csf::Drained { ml }, gravity_mm_s2: [0.0, -g, 0.0], ..FrameSettings::default() };
    let (state, report) = settle(&model, &settings);
    assert!((report.csf_change_ml + ml).abs() < 0.01 * ml, "{} ml", report.csf_change_ml);
    let reactions = model.reactions(&state, &settings).expect("physical");
    let lighter = model.mass_kg() * g - reactions.iter().map(|r| r.y).sum::<f64>();
    let drained = -report.csf_change_ml * 1e-6 * Material::VENTRICLE.density_kg_m3 * g;
    assert!((lighter / drained - 1.0).abs() < 0.02, "{lighter} mN lighter, {drained} mN were drained");
}

/// It had one pressure everywhere, and its weight drew the lower wall down and the upper one in, by 2.7 mm.
#[test]
fn fluid_as_heavy_as_the_tissue_around_it_floats() {
    let (cells, edge) = (8, 10.0);
    let within = |c: [usize; 3]| c.iter().all(|&v| (2..6).contains(&v));
    let mesh = block([cells; 3], edge, |c| if within(c) { 5 } else { 4 });
    let outside = |p: Point<Patient>| p.to_array().iter().any(|&v| v == 0.0 || v == edge * cells as f64);
    let mut o = options(physical(), &nodes(&mesh, outside));
    // What can hardly be compressed and is held all around does not sink.
    let tissue = Material { poisson: 0.495, ..Material::BRAIN };
    o.materials.insert(4, tissue);
    o.materials.insert(5, Material { density_kg_m3: tissue.density_kg_m3, ..Material::VENTRICLE });
    let model = Model::new(&mesh, &o).expect("model");
    let down = [3000.0, -4000.0, 8500.0];
    let (_, report) = settle(&model, &FrameSettings { gravity_mm_s2: down, ..FrameSettings::default() });
    assert!(report.max_displacement_mm < 0.2, "{} mm", report.max_displacement_mm);
    assert!(report.csf_change_ml.abs() < 0.01, "{} ml", report.csf_change_ml);
}

#[test]
fn walls_folded_and_elements_turned_over_under_fifty_millimetres_of_mercury() {
    let mesh = ball(12);
    // A hole in the skull, as of a drill: without it little could move at all.
    let held = |p: Point<Patient>| radius(p) > OUTER - 1e-6 && (p.x - OUTER).hypot(p.y).hypot(p.z) > 6.0;
    let model = Model::new(&mesh, &options(physical(), &nodes(&mesh, held))).expect("model");
    for mmhg in [30.0, 50.0, 150.0] {
        let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
        for frame in 0..120 {
            let kpa = mmhg * 0.133_322 * (f64::from(frame + 1) / 60.0).min(1.0);
            let settings = FrameSettings { csf: Csf::Pressure { kpa }, ..FrameSettings::default() };
            let report = stepper.step(&model, &mut state, &[], &settings);
            assert_eq!((report.inverted, report.rollbacks), (0, 0), "{mmhg} mmHg, frame {frame}");
            assert!(report.max_displacement_mm < OUTER - INNER, "{} mm", report.max_displacement_mm);
        }
    }
}

#[test]
fn draining_all_but_a_tenth_turned_elements_inside_out() {
    let mesh = ball(12);
    let model = Model::new(&mesh, &options(physical(), &nodes(&mesh, |p| radius(p) > OUTER - 1e-6))).expect("model");
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
    let holds = 4.0 / 3.0 * core::f64::consts::PI * INNER.powi(3) * 1e-3;
    let (mut most, mut last) = (0.0_f64, monro_tissue::StepReport::default());
    for frame in 0..180 {
        let ml = 0.9 * holds * (f64::from(frame + 1) / 60.0).min(1.0);
        let settings = FrameSettings { csf: Csf::Drained { ml }, ..FrameSettings::default() };
        last = stepper.step(&model, &mut state, &[], &settings);
        assert_eq!(last.inverted, 0, "frame {frame}, {last:?}");
        most = most.max(last.max_displacement_mm);
    }
    // Suction ends at three times the shear modulus, and what was not drained is told.
    assert!((last.csf_kpa + 3.0 * Material::BRAIN.shear_kpa()).abs() < 1e-9, "{last:?}");
    assert!(last.csf_change_ml > -0.9 * holds && most < INNER, "{most} mm, {last:?}");
}

/// A ball of fluid in brain with a sheet of `stiff` at its outside, of which `ml` are drained within a second.
fn drained(stiff: Material, ml: f64) -> (monro_tissue::StepReport, u32) {
    let mesh = ball(12);
    let mut sheet = mesh.clone();
    for t in 0..sheet.tets.len() {
        if mesh.tets[t].iter().all(|&v| mesh.vertices[v as usize].x > 45.0) {
            sheet.labels[t] = 9;
        }
    }
    assert!(sheet.labels.contains(&9), "a sheet");
    let mut o = options(physical(), &nodes(&sheet, |p| radius(p) > OUTER - 1e-6));
    o.materials.insert(9, stiff);
    let model = Model::new(&sheet, &o).expect("model");
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
    let (mut last, mut trouble) = (monro_tissue::StepReport::default(), 0);
    for frame in 0..150 {
        let csf = Csf::Drained { ml: ml * (f64::from(frame + 1) / 60.0).min(1.0) };
        last = stepper.step(&model, &mut state, &[], &FrameSettings { csf, ..FrameSettings::default() });
        trouble += last.rollbacks;
    }
    (last, trouble)
}

#[test]
fn draining_beside_a_dura_shook_all_tissue() {
    let (soft, _) = drained(Material::BRAIN, 4.0);
    let (stiff, trouble) = drained(Material::DURA, 4.0);
    assert_eq!(trouble, 0);
    assert!((stiff.csf_change_ml + 4.0).abs() < 0.1, "{} ml", stiff.csf_change_ml);
    assert!((stiff.csf_kpa / soft.csf_kpa - 1.0).abs() < 0.2, "{} and {} kPa", stiff.csf_kpa, soft.csf_kpa);
}

#[test]
fn infusing_into_a_closed_skull_had_no_bound() {
    let (report, _) = drained(Material::BRAIN, -5000.0);
    assert!(report.csf_kpa > 50.0 && report.csf_kpa <= 100.0, "{} kPa", report.csf_kpa);
}
