//! `monro calibrate`: tips and shafts from live or recorded poses, cameras and see-through displays from lists of points.

mod table;

use crate::args::{CalibrateCommand, PosesArgs};
use crate::columns;
use crate::console::Console;
use anyhow::{Context, Result, bail};
use monro_cli::track::TrackOptions;
use monro_geometry::{Point, Rigid, Tool, Tracker};
use monro_guidance::calibration::{PivotOptions, calibrate_axis, calibrate_pivot, distinct};
use monro_guidance::optics::{CameraOptions, Correspondence, calibrate_camera, calibrate_display};
use monro_tracking::{Bodies, Clock, Rivals, TrackerUrl, is_tool, never_seen, open};
use monro_wire::Quality;
use serde_json::{Value, json};
use std::path::Path;
use std::time::{Duration, Instant};

pub(crate) use table::{named_points, point, rows};

/// Largest error of a see-through display, pixels: a hand that aligns a cross is worse than a camera.
const ALIGNMENT_PX: f64 = 10.0;

/// Runs one of the calibrations.
pub(crate) fn run(command: &CalibrateCommand, console: &Console) -> Result<()> {
    let result = match command {
        CalibrateCommand::Pivot(args) => pivot(&watch(args, console)?, console)?,
        CalibrateCommand::Axis { poses: args, hub, tip } => axis(&watch(args, console)?, (point(hub)?, point(tip)?))?,
        CalibrateCommand::Camera { corners, size } => camera(corners, size)?,
        CalibrateCommand::Display { alignments } => display(alignments)?,
    };
    console.result(&result, &words(&result, whither(command)));
    Ok(())
}

/// What a result is for.
fn whither(command: &CalibrateCommand) -> &'static str {
    match command {
        CalibrateCommand::Pivot(_) => {
            "; \"tip_mm\" is what \"monro calibrate axis --tip\" takes, which gives what a live session takes"
        }
        CalibrateCommand::Axis { .. } => ", and \"session_event\", what a live session takes at /api/session",
        CalibrateCommand::Camera { .. } => "",
        CalibrateCommand::Display { .. } => {
            "; \"quaternion_wxyz\" and \"translation_mm\" are what a live session takes at /api/glasses"
        }
    }
}

/// For people; the whole covariance is for programs.
fn words(result: &Value, whither: &str) -> String {
    let mut told = result.clone();
    if let Some(all) = told.as_object_mut() {
        all.remove("covariance_mm2");
        // On stderr already.
        all.remove("remark");
        all.remove("session_event");
        all.remove("markers_mm");
    }
    format!("{}\nWith --json: all digits{whither}.", columns::lines(&told))
}

/// What was seen of a tool.
struct Watched {
    poses: Vec<Rigid<Tracker, Tool>>,
    /// Where its markers lie in its frame, mm, where the server tells.
    markers: Option<Vec<[f64; 3]>>,
}

/// The poses of one tool while it is seen, from a tracker for some seconds or from the whole of a recording.
fn watch(args: &PosesArgs, console: &Console) -> Result<Watched> {
    let url: TrackerUrl = args.url.parse()?;
    let mut source = open(&url, Clock::new(), None)?;
    let (begun, mut all, mut others) = (Instant::now(), Vec::new(), std::collections::BTreeSet::new());
    let (mut missing, mut rivals, mut bodies) = (None, Rivals::default(), Bodies::default());
    let patience = TrackOptions::default().patience;
    let mut last = Instant::now();
    let replayed = matches!(url, TrackerUrl::Replay(_));
    let span = if replayed { "the whole recording".to_owned() } else { format!("{} s", args.seconds) };
    console.note(&format!("collecting poses of {} for {span}", args.tool));
    while replayed || begun.elapsed().as_secs_f64() < args.seconds {
        let Some(mut batch) = source.next(Duration::from_millis(100))? else { break };
        rivals.settle(&mut batch);
        if let Some(words) = rivals.words(&[&args.tool]) {
            bail!("{words}");
        }
        if let Some(anew) = bodies.take(&batch).iter().find(|b| is_tool(&b.name, &args.tool)) {
            bail!("'{}' was defined anew while it was watched ({}): do it again", anew.name, anew.words);
        }
        if !batch.poses.is_empty() {
            last = Instant::now();
        } else if !replayed && last.elapsed() > patience {
            bail!("{}", source.diagnosis(&[args.tool.as_str()]));
        }
        for pose in batch.poses {
            let is_it = is_tool(&pose.name, &args.tool);
            match (pose.tracker_from_tool, pose.quality) {
                (Some(p), _) if is_it => all.push(p),
                (_, Quality::Missing(why)) if is_it => missing = Some(why),
                _ => drop(others.insert(pose.name)),
            }
        }
    }
    if let (true, Some(why)) = (all.is_empty(), missing) {
        bail!("{}", never_seen(&args.tool, why, ""));
    }
    if all.is_empty() {
        let others: Vec<_> = others.into_iter().collect();
        bail!(
            "no pose of '{}' came (others: {}); {}",
            args.tool,
            others.join(", "),
            source.diagnosis(&[args.tool.as_str()])
        );
    }
    let health = source.diagnosis(&[args.tool.as_str()]);
    if replayed && !health.well {
        console.warn(&health.words);
    }
    let (came, all) = (all.len(), distinct(all));
    if all.len() < came {
        console.warn(&format!("{} of {came} poses only came again, unchanged, and do not count", came - all.len()));
    }
    Ok(Watched { poses: all, markers: bodies.markers_mm(&args.tool) })
}

fn pivot(seen: &Watched, console: &Console) -> Result<Value> {
    let found = calibrate_pivot(&seen.poses, &PivotOptions::default())?;
    let remark = found.remark();
    remark.iter().for_each(|r| console.warn(r));
    Ok(json!({
        "tip_mm": found.tip.to_array(), "tip_sigma_mm": found.covariance.rms(),
        "covariance_mm2": found.covariance.matrix().rows, "residual_mm": found.residual,
        "tilt_deg": found.tilt.to_degrees(), "poses": seen.poses.len(), "used": found.used.iter().filter(|u| **u).count(),
        "divot_mm": found.divot.to_array(), "remark": remark, "markers_mm": seen.markers,
    }))
}

fn axis(seen: &Watched, (hub, tip): (Point<Tool>, Point<Tool>)) -> Result<Value> {
    let found = calibrate_axis(&seen.poses, (hub, tip))?;
    let (axis, tip) = (found.axis.to_array(), tip.to_array());
    Ok(json!({
        "axis": axis, "axis_sigma_deg": found.sigma.to_degrees(),
        "wobble_deg": found.wobble.to_degrees(), "tip_mm": tip, "poses": seen.poses.len(),
        "session_event": { "event": "calibrated", "tip_mm": tip, "axis": axis, "markers_mm": seen.markers },
    }))
}

/// Lines of a table as points and their pixels.
fn correspondences(path: &Path) -> Result<Vec<Correspondence<Tracker>>> {
    let one = |[x, y, z, u, v]: [f64; 5]| Correspondence { point: Point::new(x, y, z), pixel: [u, v] };
    Ok(rows::<5>(path, "x y z u v")?.into_iter().map(one).collect())
}

fn camera(path: &Path, size: &str) -> Result<Value> {
    let (width, height) = size.split_once('x').with_context(|| format!("--size {size} is not WIDTHxHEIGHT"))?;
    let read = |v: &str| v.parse().with_context(|| format!("--size {size} is not WIDTHxHEIGHT"));
    let found = calibrate_camera(&correspondences(path)?, &CameraOptions::new(read(width)?, read(height)?))?;
    let (lens, pose) = (found.camera.lens, found.camera.camera_from);
    Ok(json!({
        "focal_px": lens.focal, "focal_sigma_px": found.focal_sigma, "centre_px": lens.centre,
        "radial": lens.radial, "tangential": lens.tangential, "residual_px": found.residual, "coverage": found.coverage,
        "camera_from_tracker": { "quaternion_wxyz": pose.quaternion_wxyz(), "translation_mm": pose.translation().to_array() },
    }))
}

fn display(path: &Path) -> Result<Value> {
    let found = calibrate_display(&correspondences(path)?, ALIGNMENT_PX)?;
    let pose = found.display_from;
    Ok(json!({
        "intrinsics_px": found.intrinsics, "intrinsics_sigma_px": found.intrinsics_sigma, "residual_px": found.residual,
        "quaternion_wxyz": pose.quaternion_wxyz(), "translation_mm": pose.translation().to_array(),
    }))
}
