//! Physical mode stepped through time gives back the moduli and the damping that were asked for.

use crate::common::{block, nodes, options, physical};
use monro_geometry::{Point, TetMesh};
use monro_tissue::{FrameSettings, Material, Model, ModelOptions, State, Stepper};

const SIDE: f64 = 20.0;

fn material(poisson: f64) -> Material {
    Material { poisson, ..Material::BRAIN }
}

/// The vertices inside pushed about, so that nothing is exact by symmetry.
fn shaken(cells: usize) -> TetMesh {
    let size = SIDE / cells as f64;
    let mut mesh = block([cells; 3], size, |_| 4);
    for (i, p) in mesh.vertices.iter_mut().enumerate() {
        if !outside(*p) {
            let noise = |k: usize| (((i * 7919 + k * 104_729) % 1000) as f64 / 500.0 - 1.0) * 0.15 * size;
            *p = Point::new(p.x + noise(0), p.y + noise(1), p.z + noise(2));
        }
    }
    mesh
}

fn outside<F>(p: Point<F>) -> bool {
    p.to_array().iter().any(|v| v.abs() < 1e-9 || (v - SIDE).abs() < 1e-9)
}

/// Leads the surface through an affine field in half a second, lets the inside rest, and returns the largest error of
/// an inner vertex (mm) and the moment of the attachments' forces, `sum of r_i x_j` over the volume: the mean stress.
fn affine(cells: usize, rate: f64, iterations: u32, poisson: f64, f: [[f64; 3]; 3]) -> (f64, [[f64; 3]; 3]) {
    let mesh = shaken(cells);
    let held = nodes(&mesh, outside);
    let mut o: ModelOptions = options(physical(), &held);
    o.materials.insert(4, material(poisson));
    let model = Model::new(&mesh, &o).expect("model");
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
    let settings = FrameSettings { dt_s: 1.0 / rate, iterations, ..FrameSettings::default() };
    let target = |p: [f64; 3]| f.map(|row| (0..3).map(|k| row[k] * p[k]).sum::<f64>());
    for frame in 0..(2.0 * rate) as u32 {
        let share = (f64::from(frame + 1) / (0.5 * rate)).min(1.0);
        for &v in &held {
            let (p, to) = (mesh.vertices[v as usize].to_array(), target(mesh.vertices[v as usize].to_array()));
            let at = core::array::from_fn(|a| p[a] + share * (to[a] - p[a]));
            model.place_fixed(&mut state, v as usize, Point::from_array(at));
        }
        stepper.step(&model, &mut state, &[], &settings);
    }
    let off = |v: usize| model.position(&state, v).distance(Point::from_array(target(mesh.vertices[v].to_array())));
    let worst = (0..mesh.vertices.len()).map(off).fold(0.0, f64::max);
    (worst, stress(&mesh, &model, &state, &settings))
}

fn stress(mesh: &TetMesh, model: &Model, state: &State, settings: &FrameSettings) -> [[f64; 3]; 3] {
    let reactions = model.reactions(state, settings).expect("physical");
    let mut out = [[0.0; 3]; 3];
    for (r, p) in reactions.iter().zip(&mesh.vertices) {
        let (r, p) = (r.to_array(), p.to_array());
        (0..9).for_each(|k| out[k / 3][k % 3] += r[k / 3] * p[k % 3] / SIDE.powi(3));
    }
    out
}

#[test]
fn young_and_shear_modulus_come_out_over_meshes_steps_and_iterations() {
    for (cells, rate, iterations) in [2, 3, 4].into_iter().flat_map(|c| {
        [30.0, 60.0, 120.0].into_iter().flat_map(move |r| [5, 10, 20].into_iter().map(move |i| (c, r, i)))
    }) {
        let m = material(0.45);
        let strain = 0.002;
        // Uniaxial to first order: the sides go in by Poisson's ratio, and bear nothing.
        let side = 1.0 - 0.45 * strain;
        let (_, p) =
            affine(cells, rate, iterations, 0.45, [[1.0 + strain, 0.0, 0.0], [0.0, side, 0.0], [0.0, 0.0, side]]);
        // Young's modulus from the mean stresses, whatever the sides bear.
        let young = (p[0][0] - 0.45 * (p[1][1] + p[2][2])) / strain;
        let case = format!("{cells} cells, {rate} Hz, {iterations} iterations");
        assert!((young / m.young_kpa - 1.0).abs() < 0.01, "{case}: E = {young} kPa");
        let (_, p) = affine(cells, rate, iterations, 0.45, [[1.0, 0.02, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        let shear = p[0][1] / 0.02;
        assert!((shear / m.shear_kpa() - 1.0).abs() < 0.01, "{case}: G = {shear} kPa");
    }
}

#[test]
fn affine_fields_pass_the_patch_test_at_large_stretch_and_near_incompressibility() {
    for poisson in [0.30, 0.45, 0.49] {
        for stretch in [0.8, 1.3f64] {
            let side = 1.0 / stretch.sqrt();
            let (worst, _) = affine(3, 60.0, 20, poisson, [[stretch, 0.1, 0.0], [0.0, side, 0.05], [0.0, 0.0, side]]);
            let imposed = SIDE * (stretch - 1.0).abs();
            assert!(worst < 1e-3 * imposed, "nu {poisson}, stretch {stretch}: {worst} of {imposed} mm");
        }
    }
}

/// A bar that is let go swings along its axis; the decay from one turning point to the next gives the damping time.
#[test]
fn a_decaying_bar_has_the_damping_asked_for() {
    for damping_s in [0.004, 0.008] {
        let mesh = block([8, 2, 2], 5.0, |_| 4);
        let mut o = options(physical(), &nodes(&mesh, |p| p.x == 0.0));
        let m = Material { poisson: 0.3, damping_s, ..Material::BRAIN };
        o.materials.insert(4, m);
        let model = Model::new(&mesh, &o).expect("model");
        let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
        let free = FrameSettings { dt_s: 1.0 / 1920.0, iterations: 40, ..FrameSettings::default() };
        let pulled = FrameSettings { gravity_mm_s2: [2000.0, 0.0, 0.0], dt_s: 1.0 / 240.0, ..free };
        (0..240).for_each(|_| drop(stepper.step(&model, &mut state, &[], &pulled)));
        let tip = nodes(&mesh, |p| p.to_array() == [40.0, 5.0, 5.0])[0] as usize;
        let mut path = Vec::new();
        for _ in 0..480 {
            path.push(model.displacement(&state, tip).x);
            stepper.step(&model, &mut state, &[], &free);
        }
        let turns: Vec<(usize, f64)> = (1..path.len() - 1)
            .filter(|&i| (path[i] - path[i - 1]) * (path[i + 1] - path[i]) < 0.0)
            .map(|i| (i, path[i]))
            .collect();
        assert!(turns.len() >= 3, "{turns:?}");
        let half_period = (turns[2].0 - turns[0].0) as f64 / 2.0 / 1920.0;
        let decrement = (turns[0].1 / turns[2].1).ln() / 2.0;
        // u ~ exp(-z w t): decrement = pi z / sqrt(1 - z^2) over half a period, and z = w tau / 2.
        let ratio = decrement / (core::f64::consts::PI.powi(2) + decrement * decrement).sqrt();
        let natural = core::f64::consts::PI / half_period / (1.0 - ratio * ratio).sqrt();
        let measured = 2.0 * ratio / natural;
        // Viscosity resists the change of shape, which stores 3 K / (3 K + mu) of the energy of a stretched bar.
        let bulk = m.lame_kpa() + 2.0 / 3.0 * m.shear_kpa();
        let asked = damping_s * 3.0 * bulk / (3.0 * bulk + m.shear_kpa());
        assert!((measured / asked - 1.0).abs() < 0.05, "{measured} s, asked {asked} s");
    }
}
