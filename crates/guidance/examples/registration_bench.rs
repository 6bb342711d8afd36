//! Monte-Carlo of calibration and registration: `cargo run --release -p monro-guidance --example registration_bench`.
//!
//! Prints one JSON object. `basin` says how often refinement by the surface alone comes home from a start that is turned
//! by so many degrees about a random axis.

use monro_guidance::Random;
use monro_guidance::simulation::{Scene, Trial, TrialOptions, quantile, rms};
use std::time::Instant;

fn run(scene: &Scene, options: &TrialOptions, n: usize, seed: u64) -> Vec<Option<Trial>> {
    let mut random = Random::new(seed);
    (0..n).map(|_| scene.trial(options, &mut random)).collect()
}

fn main() {
    let n = std::env::args().nth(1).and_then(|a| a.parse().ok()).unwrap_or(300);
    let scene = Scene::new();
    let begun = Instant::now();
    let mut all = Vec::new();
    let mut failed = 0;
    for degrees in [5.0f64, 10.0, 15.0, 20.0, 25.0, 30.0] {
        let options = TrialOptions { start_error: degrees.to_radians(), ..TrialOptions::default() };
        let trials = run(&scene, &options, n / 6, degrees as u64);
        failed += trials.iter().filter(|t| t.is_none()).count();
        all.extend(trials.into_iter().flatten());
    }
    let each = |f: fn(&Trial) -> f64| all.iter().map(f).collect::<Vec<f64>>();
    let (tre, landmark) = (each(|t| t.tre), each(|t| t.landmark_tre));
    println!("{{");
    println!("  \"trials\": {}, \"failed\": {failed},", all.len());
    println!("  \"tip_rms_mm\": {:.3},", rms(&each(|t| t.tip)));
    println!("  \"tre_median_mm\": {:.3}, \"tre_p95_mm\": {:.3},", quantile(&tre, 0.5), quantile(&tre, 0.95));
    println!("  \"entry_tre_median_mm\": {:.3},", quantile(&each(|t| t.entry_tre), 0.5));
    println!("  \"predicted_over_actual\": {:.3},", rms(&each(|t| t.predicted)) / rms(&tre));
    println!(
        "  \"landmarks_only\": {{\"tre_median_mm\": {:.3}, \"tre_p95_mm\": {:.3}, \"predicted_over_actual\": {:.3}}},",
        quantile(&landmark, 0.5),
        quantile(&landmark, 0.95),
        rms(&each(|t| t.landmark_predicted)) / rms(&landmark)
    );
    let basin: Vec<String> = [5.0f64, 10.0, 15.0, 20.0, 30.0]
        .iter()
        .map(|degrees| {
            let start_error = degrees.to_radians();
            let alone = TrialOptions { start_error, with_landmarks: false, ..TrialOptions::default() };
            let trials = run(&scene, &alone, n / 6, 100 + *degrees as u64);
            let home = trials.iter().flatten().filter(|t| t.tre < 2.0).count();
            format!("\"{degrees}\": {:.2}", home as f64 / trials.len() as f64)
        })
        .collect();
    println!("  \"basin_surface_alone\": {{{}}},", basin.join(", "));
    println!("  \"seconds\": {:.1}", begun.elapsed().as_secs_f64());
    println!("}}");
}
