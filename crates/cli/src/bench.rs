//! `monro bench`: speed and memory on this machine. Nothing here is asserted by a test.

pub(crate) mod args;
mod ball;
mod error;
mod frame;
mod live;
mod livewire;
mod mesh;
mod samples;
mod segment;

use crate::args::ModeArg;
use crate::columns::{column, lines, short, table};
use crate::console::{Console, seconds_json};
use crate::{demo, simulate};
use anyhow::Result;
use args::BenchCommand;
use monro_case::Case;
use monro_guidance::Random;
use monro_guidance::simulation::{Scene, Trial, TrialOptions, quantile, rms};
use monro_prepare::Request;
use monro_scan::{ReadOptions, Scan};
use monro_tracking::latencies;
use serde_json::{Value, json};
use std::path::Path;

/// Runs one of the benches.
pub(crate) fn run(command: &BenchCommand, console: &Console) -> Result<()> {
    match command {
        BenchCommand::Prepare { scan, elements } => prepare_and_insert(scan.as_deref(), *elements, console),
        BenchCommand::Segment { seeds, against, dump } => segment::run(*seeds, against, dump.as_deref(), console),
        BenchCommand::Registration { case, trials } => registration(case.as_deref(), *trials, console),
        BenchCommand::Mesh(args) => mesh::run(args, console),
        BenchCommand::Latency { frames, rate } => latency(*frames, *rate, console),
        BenchCommand::Live(args) => live::run(args, console),
        BenchCommand::Frame(args) => frame::run(args, console),
        BenchCommand::Error(args) => error::run(args, console),
    }
}

/// Prepares a scan in memory, inserts in both modes, and prints seconds per stage and the peak memory.
fn prepare_and_insert(path: Option<&Path>, elements: usize, console: &Console) -> Result<()> {
    let scan = match path {
        Some(path) => console.stage("read", || monro_scan::read(path, &ReadOptions::default()))?,
        None => phantom(console)?,
    };
    let request = Request { elements, ..Request::default() };
    let prepared = monro_prepare::build(scan, &request, console)?;
    let stages = console.stages();
    let peak_mib = peak_memory_mib();
    let mut modes = serde_json::Map::new();
    for (name, mode) in [("paper", ModeArg::Paper), ("physical", ModeArg::Physical)] {
        let done = simulate::insert(&prepared.case, &[], &simulate::settings(mode, 10.0), console)?;
        let times =
            json!({ "frames": done.rows.len(), "ms_median": done.ms_quantile(0.5), "ms_p99": done.ms_quantile(0.99) });
        modes.insert(name.into(), times);
    }
    let total: f64 = stages.iter().map(|(_, s)| s).sum();
    let result = json!({
        "elements": prepared.case.tets.tets.len(), "seconds": seconds_json(&stages), "seconds_total": total,
        "peak_memory_mib": peak_mib, "threads": std::thread::available_parallelism().map_or(1, usize::from), "insertion": modes,
    });
    let rows = ["paper", "physical"].map(|mode| {
        let mut row = result["insertion"][mode].clone();
        row["mode"] = mode.into();
        row
    });
    let ms = [column("insertion", "/mode"), column("frames", "/frames"), column("ms median", "/ms_median")];
    let ms: Vec<_> = ms.into_iter().chain([column("ms 99 %", "/ms_p99")]).collect();
    let stage = |(name, s): &(String, f64)| json!({ "stage": name, "seconds": s });
    let seconds: Vec<Value> = stages.iter().map(stage).collect();
    let text = format!(
        "{} tetrahedra in {total:.2} s, peak memory {} MiB\n{}\n{}",
        result["elements"],
        short(&result["peak_memory_mib"]),
        table(&seconds, &[column("stage", "/stage"), column("seconds", "/seconds")]),
        table(&rows, &ms)
    );
    console.result(&result, &text);
    Ok(())
}

/// Prints the errors of simulated registrations: each trial begins its refinement 5 to 30 degrees off.
fn registration(case: Option<&Path>, trials: usize, console: &Console) -> Result<()> {
    let scene = match case {
        Some(dir) => {
            let case = Case::open(dir)?;
            let (target, entry) = (case.plan.target(), case.plan.entry());
            Scene::on_skin(&case.skin, target, target, entry)?
        }
        None => Scene::new(),
    };
    let (mut random, mut done, mut refused) = (Random::new(1), Vec::new(), 0usize);
    console.stage("registration", || {
        for _ in 0..trials {
            let start_error = random.between(5.0, 30.0).to_radians();
            match scene.trial(&TrialOptions { start_error, ..TrialOptions::default() }, &mut random) {
                Some(trial) => done.push(trial),
                None => refused += 1,
            }
        }
    });
    let each = |f: fn(&Trial) -> f64| done.iter().map(f).collect::<Vec<f64>>();
    let tre = each(|t| t.tre);
    let result = json!({
        "trials": done.len(), "refused": refused, "tip_rms_mm": rms(&each(|t| t.tip)),
        "tre_median_mm": quantile(&tre, 0.5), "tre_p95_mm": quantile(&tre, 0.95),
        "entry_tre_median_mm": quantile(&each(|t| t.entry_tre), 0.5),
        "landmarks_only_tre_median_mm": quantile(&each(|t| t.landmark_tre), 0.5),
        "predicted_over_actual": rms(&each(|t| t.predicted)) / rms(&tre).max(f64::MIN_POSITIVE),
        "basin": console.stage("basin", || basin(&scene, (trials / 10).max(5))),
    });
    console.result(&result, &lines(&result));
    Ok(())
}

/// How far off refinement may begin: the share of trials that come within 2 mm at the target, by the error of the start in
/// degrees, with the landmarks beside the surface and by the surface alone.
fn basin(scene: &Scene, trials: usize) -> Value {
    let share = |degrees: f64, with_landmarks: bool| {
        let options = TrialOptions { start_error: degrees.to_radians(), with_landmarks, ..TrialOptions::default() };
        let mut random = Random::new(degrees as u64);
        let home = (0..trials).filter_map(|_| scene.trial(&options, &mut random)).filter(|t| t.tre < 2.0).count();
        home as f64 / trials as f64
    };
    [10.0, 20.0, 30.0, 45.0, 60.0, 90.0]
        .map(|d| json!({ "start_deg": d, "with_landmarks": share(d, true), "surface_alone": share(d, false) }))
        .into()
}

/// Prints how long poses take from datagram to our hands.
fn latency(frames: u32, rate: f64, console: &Console) -> Result<()> {
    let all = latencies(frames, rate)?;
    let ms: Vec<f64> = all.seconds.iter().map(|s| 1e3 * s).collect();
    let result = json!({
        "frames": ms.len(), "before_names": all.before_names, "lost": all.lost, "rate_hz": rate,
        "ms_p50": quantile(&ms, 0.5), "ms_p99": quantile(&ms, 0.99),
    });
    console.result(&result, &lines(&result));
    Ok(())
}

fn phantom(console: &Console) -> Result<Scan> {
    let folder = tempfile::tempdir()?;
    demo::phantom_as_scan(folder.path(), 0, console)
}

/// Highest resident memory of this process so far, MiB; `None` where the system does not tell.
fn peak_memory_mib() -> Option<f64> {
    status_mib("VmHWM:")
}

fn status_mib(name: &str) -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with(name))?;
    line.split_whitespace().nth(1)?.parse::<f64>().ok().map(|kib| kib / 1024.0)
}
