//! Whatever has moved tissue, it comes to rest: no step may add to its energy.

use crate::common::{block, nodes, options, physical};
use monro_geometry::Point;
use monro_tissue::{FrameSettings, Material, Model, Stepper};

/// As large as a head, mm: the longer a wave, the later pressures follow it.
const SIDE: f64 = 140.0;

/// A block of so many cells along an edge, held all around, of which a part of one side is pushed in by 2 mm within 0.2 s.
/// Returns the largest speed of the vertices (root of the mean square, mm/s) within each quarter of three seconds.
fn speeds(cells: usize, material: Material, settings: &FrameSettings) -> Vec<f64> {
    let mesh = block([cells; 3], SIDE / cells as f64, |_| 4);
    let outside = |p: Point<_>| p.to_array().iter().any(|v: &f64| v.abs() < 1e-6 || (v - SIDE).abs() < 1e-6);
    let held = nodes(&mesh, outside);
    let mut o = options(physical(), &held);
    o.materials.insert(4, material);
    let model = Model::new(&mesh, &o).expect("model");
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
    let middle = |v: f64| (v - SIDE / 2.0).abs() < SIDE / 4.0;
    let pushed = nodes(&mesh, |p| (p.y - SIDE).abs() < 1e-6 && middle(p.x) && middle(p.z));
    let count = mesh.vertices.len();
    let all = |state: &_| (0..count).map(|v| model.position(state, v)).collect::<Vec<_>>();
    let (mut before, mut speeds) = (all(&state), Vec::new());
    for frame in 0..(3.0 / settings.dt_s) as u32 {
        let way = 2.0 * (f64::from(frame) * settings.dt_s / 0.2).min(1.0);
        for &v in &pushed {
            let p = mesh.vertices[v as usize];
            model.place_fixed(&mut state, v as usize, Point::new(p.x, p.y - way, p.z));
        }
        stepper.step(&model, &mut state, &[], settings);
        let now = all(&state);
        let squares = now.iter().zip(&before).map(|(a, b)| (*a - *b).norm_squared()).sum::<f64>();
        speeds.push((squares / count as f64).sqrt() / settings.dt_s);
        before = now;
    }
    let quarter = speeds.len() / 12;
    speeds.chunks(quarter).map(|c| c.iter().copied().fold(0.0, f64::max)).collect()
}

/// Soft tissue that hardly changes its volume swung ever more, at any number of sweeps, and stiffer tissue in short time steps,
/// until it was turned inside out: its pressures came late.
#[test]
fn soft_tissue_that_hardly_changes_its_volume_comes_to_rest_in_any_time_step() {
    for (young_kpa, poisson, rate, iterations, predicted_space) in [
        (0.5, 0.499, 60.0, 10, false),
        (0.5, 0.499, 60.0, 2, false),
        (0.5, 0.499, 120.0, 40, false),
        (0.5, 0.499, 240.0, 10, true),
        (0.2, 0.49, 60.0, 10, false),
        (3.0, 0.499, 240.0, 10, false),
        (3.0, 0.499, 1000.0, 10, false),
    ] {
        let material = Material { young_kpa, poisson, ..Material::BRAIN };
        let settings = FrameSettings { dt_s: 1.0 / rate, iterations, predicted_space, ..FrameSettings::default() };
        let speeds = speeds(10, material, &settings);
        let case =
            format!("E {young_kpa}, nu {poisson}, {rate} Hz, {iterations} iterations, {predicted_space}: {speeds:.3?}");
        // Pushed by 2 mm in 0.2 s, a part of it moves by 10 mm/s.
        assert!(speeds[0] > 1.0 && speeds[0] < 5.0, "{case}");
        let last = speeds.len() - 1;
        assert!(speeds[4] < 0.2 * speeds[0] && speeds[last] < 0.01 * speeds[0], "{case}");
    }
}
