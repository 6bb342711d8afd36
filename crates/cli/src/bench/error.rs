//! `monro bench error`: how far each solver is from the reference of a scene, against the time it took.

use crate::bench::args::ErrorArgs;
use crate::columns::{Column, column, table};
use crate::console::Console;
use crate::output_file;
use crate::solve::scene::{self, Scene};
use crate::solve::{physical, stepping::Stepping};
use anyhow::{Context, Result, ensure};
use monro_case::vtu;
use monro_cli::report::{LinePlot, Series};
use monro_geometry::{Patient, Vector, tet_signed_volume};
use monro_tissue::{Finer, FrameSettings, Mode, PaperOptions, PhysicalOptions};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// First budget of the equilibrium, s; each next one is twice as long.
const FIRST_S: f64 = 0.004;
/// Frames over which imposed motion grows when stepping.
const RAMP: u32 = 10;
/// What is stepped: name, substeps and iterations of a frame of 1/60 s.
const STEPPED: [(&str, u32, u32); 3] =
    [("stepping, 1 x 10", 1, 10), ("stepping, 1 x 40", 1, 40), ("stepping, 4 x 10", 4, 10)];

/// The converged answer and the weights of the nodes that are scored.
struct Reference {
    /// mm.
    displacement: Vec<Vector<Patient>>,
    weight: Vec<f64>,
}

/// Runs the bench.
pub(super) fn run(args: &ErrorArgs, console: &Console) -> Result<()> {
    ensure!(args.seconds.is_finite() && args.seconds > 0.0, "--seconds {}: wanted a time above 0", args.seconds);
    let scene = scene::read(&args.of.scene, &args.of.mesh, &args.of.case)?;
    let sources: Vec<&Path> = scene.sources.iter().map(PathBuf::as_path).collect();
    args.svg.as_deref().map_or(Ok(()), |svg| output_file::check(svg, args.force, &sources))?;
    let reference = Reference::of(&scene, &args.of.case)?;
    let mut series = console.stage("equilibrium", || equilibria(&scene, &reference, args.seconds))?;
    let physical = Mode::Physical(PhysicalOptions::default());
    let paper = ("paper mode, 1 x 10", Mode::Paper(PaperOptions::default()), 1, 10);
    let modes = STEPPED.map(|(name, substeps, iterations)| (name, physical, substeps, iterations));
    for (name, mode, substeps, iterations) in modes.into_iter().chain([paper]) {
        let settings = FrameSettings { substeps, iterations, ..FrameSettings::default() };
        let points = console.stage(name, || stepped(&scene, &reference, mode, settings, args.seconds))?;
        series.push(Series { name: name.into(), points });
    }
    series.extend(baselines(args, &series));
    let plot = LinePlot {
        caption: format!("{}, mesh {}: relative L2 error against time on this machine", args.of.case, args.of.mesh),
        x_label: "time, ms".into(),
        y_label: "error, %".into(),
        log_x: true,
        log_y: true,
        series,
        events: Vec::new(),
    };
    if let Some(path) = &args.svg {
        output_file::write(path, plot.figure().standalone().as_bytes())?;
    }
    let all = plot.series.iter().map(|s| json!({ "solver": s.name, "ms_and_error_percent": s.points }));
    let result = json!({ "case": args.of.case, "mesh": args.of.mesh, "series": all.collect::<Vec<Value>>() });
    let rows: Vec<Value> = plot.series.iter().map(best).collect();
    console.result(&result, &table(&rows, &columns()));
    Ok(())
}

/// The least error of a solver, and when it came within a tenth of that.
fn best(series: &Series) -> Value {
    let least = series.points.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
    let first = series.points.iter().find(|p| p[1] <= 1.1 * least);
    json!({ "solver": series.name, "percent": first.map(|_| least), "ms": first.map(|p| p[0]), "tries": series.points.len() })
}

fn columns() -> [Column; 4] {
    [
        column("solver", "/solver"),
        column("least error %", "/percent"),
        column("within a tenth of it after ms", "/ms"),
        column("points", "/tries"),
    ]
}

impl Reference {
    fn of(scene: &Scene, case: &str) -> Result<Self> {
        let name = format!("ref_{case}");
        let array = vtu::find(&scene.grid.point_data, &name)
            .with_context(|| format!("the mesh has no point array \"{name}\", so there is nothing to compare with"))?;
        let metres = array.values.as_chunks::<3>().0.iter();
        let mut weight = vec![0.0; scene.mesh.vertices.len()];
        for tet in &scene.mesh.tets {
            let volume = tet_signed_volume(tet.map(|v| scene.mesh.vertices[v as usize]));
            tet.iter().for_each(|&v| weight[v as usize] += volume / 4.0);
        }
        // Nodes that are prescribed altogether are not scored.
        for s in scene.problem.supports.iter().filter(|s| s.displacement_mm.iter().all(Option::is_some)) {
            weight[s.node as usize] = 0.0;
        }
        Ok(Self { displacement: metres.map(|&d| Vector::from_array(d.map(|v| v * 1e3))).collect(), weight })
    }

    /// Relative L2 error, %.
    fn error(&self, found: &[Vector<Patient>]) -> f64 {
        let nodes = || found.iter().zip(&self.displacement).zip(&self.weight);
        let off: f64 = nodes().map(|((f, r), w)| w * (*f - *r).norm_squared()).sum();
        let size: f64 = nodes().map(|((_, r), w)| w * r.norm_squared()).sum();
        100.0 * (off / size.max(f64::MIN_POSITIVE)).sqrt()
    }
}

/// The equilibrium on the mesh as given and one level finer, under growing budgets.
fn equilibria(scene: &Scene, reference: &Reference, longest_s: f64) -> Result<Vec<Series>> {
    let mut out = Vec::new();
    for (name, times) in [("equilibrium", 0), ("equilibrium, cut into eight", 1)] {
        let (mut points, mut budget) = (Vec::new(), FIRST_S);
        while budget <= longest_s {
            let start = Instant::now();
            let mut keep_going = || start.elapsed() < Duration::from_secs_f64(budget);
            let found = physical(scene, Finer::Times(times), &mut keep_going)?;
            points.push([start.elapsed().as_secs_f64() * 1e3, reference.error(&found.displacement)]);
            if found.json["converged"] == Value::Bool(true) {
                break;
            }
            budget *= 2.0;
        }
        out.push(Series { name: name.into(), points });
    }
    Ok(out)
}

/// Frame after frame from rest, at times that grow by a tenth.
fn stepped(
    scene: &Scene,
    reference: &Reference,
    mode: Mode,
    settings: FrameSettings,
    longest_s: f64,
) -> Result<Vec<[f64; 2]>> {
    let stepping = Stepping::new(scene, mode, settings, RAMP)?;
    let (mut points, mut next, start) = (Vec::new(), 0.0, Instant::now());
    let mut scoring = Duration::ZERO;
    stepping.run(|state, frame, _| {
        // What the scoring takes is not the solver's time.
        let seconds = (start.elapsed() - scoring).as_secs_f64();
        if frame > 0 && seconds >= next {
            let scored = Instant::now();
            points.push([seconds * 1e3, reference.error(&stepping.displacement(state))]);
            next = seconds * 1.1;
            scoring += scored.elapsed();
        }
        seconds < longest_s
    });
    Ok(points)
}

/// What linear elements reach when converged, from the scene's own file where it has one.
fn baselines(args: &ErrorArgs, series: &[Series]) -> Vec<Series> {
    let folder = if args.of.scene.is_dir() { Some(args.of.scene.as_path()) } else { args.of.scene.parent() };
    let read =
        || -> Option<Value> { serde_json::from_str(&fs::read_to_string(folder?.join("baselines.json")).ok()?).ok() };
    let Some(known) = read() else { return Vec::new() };
    let times = || series.iter().flat_map(|s| &s.points).map(|p| p[0]);
    let (first, last) = (times().fold(f64::INFINITY, f64::min), times().fold(0.0, f64::max));
    let one = |kind: &str, name: &str| {
        let error = known[format!("{}/{}/{kind}", args.of.mesh, args.of.case)]["relative_L2_pct"].as_f64()?;
        Some(Series { name: name.into(), points: vec![[first, error], [last, error]] })
    };
    [one("standard", "standard linear elements, converged"), one("nodal_averaged", "nodal-averaged, converged")]
        .into_iter()
        .flatten()
        .collect()
}
