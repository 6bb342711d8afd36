//! `monro bench live`: the real server with its sockets, a camera system that sends datagrams, displays that take snapshots.
//!
//! A probe asks for the next snapshot as soon as it has one, so that one is always owed to it: the time from a datagram's
//! departure to the arrival of the first snapshot that shows its pose is what the server adds (with the loopback twice).
//! Three more displays ask at their own rate; one more asks and asks, and never reads. The session is recorded, and a peer
//! takes it over OpenIGTLink, as in use.

mod budget;
mod camera;
mod display;
mod http;
mod peer;

use crate::bench::args::LiveBenchArgs;
use crate::columns::lines;
use crate::console::Console;
use crate::{demo, prepare, recorded, soft_body};
use anyhow::{Context, Result, bail};
use budget::Sample;
use camera::Camera;
use display::{Display, Shown};
use http::Door;
use monro_case::{CASE, Case, Staging};
use monro_guidance::Plan;
use monro_guidance::simulation::quantile;
use monro_prepare::Request;
use monro_server::{Ready, Recording, ServeOptions};
use monro_session::live::Script;
use monro_tissue::FrameSettings;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;

/// Displays that keep up.
const DISPLAYS: usize = 3;

/// Runs the bench.
pub(crate) fn run(args: &LiveBenchArgs, console: &Console) -> Result<()> {
    let folder = tempfile::tempdir()?;
    let case_dir = match &args.case {
        Some(dir) => dir.clone(),
        None => phantom(folder.path(), args.elements, console)?,
    };
    let case = Case::open(&case_dir)?;
    let camera = Camera::open(case.plan, args.rate)?;
    let ready = serve(args, case_dir, folder.path().join("session.mnrs"), &camera)?;
    let result = console.stage("live", || measure(args, &case, camera, &ready))?;
    console.result(&result, &lines(&result));
    Ok(())
}

fn phantom(folder: &Path, elements: usize, console: &Console) -> Result<PathBuf> {
    let scan = demo::phantom_as_scan(&folder.join("phantom"), 0, console)?;
    let prepared = monro_prepare::build(scan, &Request { elements, ..Request::default() }, console)?;
    let staging = Staging::begin(&folder.join("case"), false, &CASE, &[])?;
    prepare::write(&prepared, &staging, console)?;
    Ok(staging.finish()?)
}

/// Starts the server in a thread that ends with the program.
fn serve(args: &LiveBenchArgs, case_dir: PathBuf, recording: PathBuf, camera: &Camera) -> Result<Ready> {
    let (model, frame) = (soft_body::of(args.mode), FrameSettings::default());
    let settings = recorded::name(&model, &frame)?;
    let options = ServeOptions {
        case_dir,
        listen: ([127, 0, 0, 1], 0).into(),
        certificate: None,
        names: Vec::new(),
        tracker: format!("natnet://{}?unicast=1&up=z", camera.address()).parse()?,
        model,
        frame,
        recording: Some(Recording { path: recording, settings }),
        igtl: Some(([127, 0, 0, 1], 0).into()),
    };
    let (sender, receiver) = channel();
    let run = move || {
        let told = sender.clone();
        let ended = monro_server::serve(options, move |ready| drop(told.send(Ok(ready.clone()))));
        drop(sender.send(ended.map_or_else(|e| Err(e.to_string()), |()| Err("the server ended".to_owned()))));
    };
    thread::Builder::new().name("server".into()).spawn(run)?;
    receiver.recv().context("the server ended without a word")?.map_err(anyhow::Error::msg)
}

fn measure(args: &LiveBenchArgs, case: &Case, camera: Camera, ready: &Ready) -> Result<Value> {
    let door = Door::new(ready)?;
    calibrate(&door, case.plan)?;
    let stop = Arc::new(AtomicBool::new(false));
    let shows = |rate: Option<f64>| {
        let (display, stop) = (Display::open(&door)?, Arc::clone(&stop));
        let watch = thread::Builder::new().name("bench-display".into());
        Ok::<_, anyhow::Error>(watch.spawn(move || display.watch(rate, &stop))?)
    };
    let stalled = Display::open(&door)?;
    stalled.ask_forever()?;
    let peer = peer::watch(ready.igtl.context("OpenIGTLink is not served")?, Arc::clone(&stop))?;
    let filming = camera.film(args.seconds)?;
    let probe = shows(None)?;
    let displays = (0..DISPLAYS).map(|_| shows(Some(args.display_rate))).collect::<Result<Vec<_>>>()?;
    // A thread's time is gone with the thread, so it is looked at just before the camera stops.
    let begun = Sample::take();
    thread::sleep(Duration::from_secs_f64(0.98 * args.seconds));
    let used = Sample::take().since(&begun);
    let departures = filming.join().map_err(|_| anyhow::anyhow!("the camera's thread failed"))??;
    let status = door.get("/api/status")?;
    stop.store(true, Ordering::Relaxed);
    let seen = |t: thread::JoinHandle<Result<Vec<Shown>>>| t.join().map_err(|_| anyhow::anyhow!("a display failed"))?;
    let probed = seen(probe)?;
    let rates: Vec<f64> = displays.into_iter().map(|d| Ok(rate(&seen(d)?))).collect::<Result<_>>()?;
    drop(stalled);
    let messages = peer.join().map_err(|_| anyhow::anyhow!("the OpenIGTLink peer failed"))??;
    let recorded = std::fs::metadata(ready.recording.as_ref().context("nothing is recorded")?)?.len();
    let latencies = camera::latencies(case.plan, args.rate, &departures, &probed);
    if latencies.is_empty() {
        bail!("no snapshot showed a pose of the camera; /api/status says: {}", status["tracker_diagnosis"]);
    }
    let (air, tissue) = in_air_and_in_tissue(&case.plan, &probed);
    // Before the first pose nothing is lost.
    let shown = || probed.iter().skip_while(|s| s.lost);
    let lost = shown().filter(|s| s.lost).count() as f64 / shown().count().max(1) as f64;
    Ok(json!({
        "elements": case.tets.tets.len(), "nodes": case.tets.vertices.len(), "seconds": args.seconds,
        "tracker_hz": args.rate, "poses_measured": latencies.len(),
        "added_latency_p50_ms": 1e3 * quantile(&latencies, 0.5), "added_latency_p99_ms": 1e3 * quantile(&latencies, 0.99),
        "deformation_hz": steps_per_second(tissue), "deformation_hz_worst_second": worst_second(tissue),
        "deformation_hz_in_air": steps_per_second(air),
        "deformation_ms": status["deformation_ms"], "lost_share": lost,
        "snapshot_hz": rates, "probe_hz": rate(&probed), "stalled_displays": 1, "snapshot_ms": status["snapshot_ms"],
        "igtl_messages_per_s": messages as f64 / args.seconds, "recorded_bytes_per_s": recorded as f64 / args.seconds,
        "threads": thread::available_parallelism().map_or(1, usize::from), "core_ms_per_s": used,
    }))
}

/// The snapshots that show the catheter in the air before the insertion, and those with its tip under the entry.
fn in_air_and_in_tissue<'a>(plan: &Plan, shown: &'a [Shown]) -> (&'a [Shown], &'a [Shown]) {
    let deep = |s: &Shown| s.tip.is_some_and(|tip| camera::depth_mm(plan, tip) > 0.0);
    let first = shown.iter().position(deep).unwrap_or(shown.len());
    let end = shown.iter().rposition(deep).map_or(first, |last| last + 1);
    let seen = shown[..first].iter().position(|s| s.tip.is_some()).unwrap_or(first);
    (&shown[seen..first], &shown[first..end])
}

/// Steps of the soft body per second between the first and the last of these snapshots.
fn steps_per_second(shown: &[Shown]) -> f64 {
    let (Some(first), Some(last)) = (shown.first(), shown.last()) else { return 0.0 };
    f64::from(last.step - first.step) / Duration::max(last.at - first.at, Duration::from_millis(1)).as_secs_f64()
}

/// The same in the whole second in which there were fewest; `None` where there is no whole second.
fn worst_second(shown: &[Shown]) -> Option<f64> {
    let window = |i: usize| {
        let end = shown[i].at + Duration::from_secs(1);
        let last = shown.partition_point(|s| s.at < end);
        (last < shown.len()).then(|| steps_per_second(&shown[i..=last]))
    };
    (0..shown.len()).map_while(window).min_by(f64::total_cmp)
}

/// What the scripted hand's calibration and registration are, told as an operator tells it.
fn calibrate(door: &Door, plan: Plan) -> Result<()> {
    let truth = Script::new(plan).truth();
    let (calibration, registration) = (truth.calibration, truth.registration.patient_from_reference);
    for event in [
        json!({ "event": "calibrated", "tip_mm": calibration.tip.to_array(), "axis": calibration.axis.to_array() }),
        json!({
            "event": "registered", "quaternion_wxyz": registration.quaternion_wxyz(),
            "translation_mm": registration.translation().to_array(), "predicted_tre_mm": 0.0,
        }),
        json!({ "event": "check_passed" }),
        json!({ "event": "started" }),
    ] {
        door.post("/api/session", &event.to_string())?;
    }
    Ok(())
}

/// Snapshots per second.
fn rate(shown: &[Shown]) -> f64 {
    match (shown.first(), shown.last()) {
        (Some(first), Some(last)) if shown.len() > 1 => {
            (shown.len() - 1) as f64 / Duration::max(last.at - first.at, Duration::from_micros(1)).as_secs_f64()
        }
        _ => 0.0,
    }
}
