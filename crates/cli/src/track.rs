//! `monro track URL`: live poses with age and quality.

use anyhow::{Result, bail};
use monro_guidance::clock::{Expiry, age};
use monro_tracking::{Batch, Source};
use monro_wire::{Quality, TimedPose};
use serde_json::json;
use std::collections::BTreeMap;
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// What is printed, and for how long.
#[derive(Debug, Clone, Copy)]
pub struct TrackOptions {
    /// Frames to print; all when `None`.
    pub frames: Option<u64>,
    /// One JSON object a pose instead of words.
    pub json: bool,
    /// Ages at which poses expire.
    pub expiry: Expiry,
    /// Gives up when nothing has come for this long.
    pub patience: Duration,
}

impl Default for TrackOptions {
    fn default() -> Self {
        Self { frames: None, json: false, expiry: Expiry::default(), patience: Duration::from_secs(10) }
    }
}

/// When a tool was last seen, s on our clock.
type Seen = BTreeMap<String, f64>;

/// Prints poses as they come until the frames are through, the source ends, or `stop` is set.
///
/// # Errors
/// When nothing comes for too long (with the reason, as far as it is known), or the output is closed.
pub fn track(source: &mut dyn Source, options: &TrackOptions, stop: &AtomicBool, out: &mut dyn Write) -> Result<u64> {
    let (mut frames, mut seen, mut last) = (0, Seen::new(), Instant::now());
    while !stop.load(Ordering::Relaxed) && options.frames.is_none_or(|n| frames < n) {
        let Some(batch) = source.next(Duration::from_millis(100))? else { break };
        if batch.poses.is_empty() {
            if last.elapsed() >= options.patience {
                bail!("{}", source.diagnosis(&[]));
            }
            continue;
        }
        (frames, last) = (frames + 1, Instant::now());
        let now = source.now();
        for pose in &batch.poses {
            let line = line(pose, &batch, now, options, &mut seen);
            writeln!(out, "{line}")?;
        }
        out.flush()?;
    }
    Ok(frames)
}

fn line(pose: &TimedPose, batch: &Batch, now: f64, options: &TrackOptions, seen: &mut Seen) -> String {
    let own_age = age(now, pose.arrival_time, pose.source_time, batch.clock.as_ref());
    if pose.tracker_from_tool.is_some() {
        seen.insert(pose.name.clone(), now - own_age);
    }
    let age = seen.get(&pose.name).map(|t| now - t);
    let state = options.expiry.state(age).name();
    // A tool that is not seen now has no pose, however young its last one is.
    let position = pose.tracker_from_tool.map(|p| p.translation().to_array());
    let quaternion = pose.tracker_from_tool.map(|p| p.quaternion_wxyz());
    let error = match pose.quality {
        Quality::Tracked { error } => error,
        Quality::Missing(_) => None,
    };
    if options.json {
        return json!({
            "name": pose.name,
            "time_s": now - own_age,
            "position_mm": position,
            "quaternion_wxyz": quaternion,
            "state": state,
            "age_ms": age.map(|a| 1e3 * a),
            "error_mm": error,
        })
        .to_string();
    }
    let age = age.map_or("never seen".to_owned(), |a| format!("{:6.1} ms", 1e3 * a));
    let place = match (position, pose.quality) {
        (Some([x, y, z]), _) => format!("{x:9.2} {y:9.2} {z:9.2} mm"),
        (None, Quality::Missing(why)) => why.name().to_owned(),
        (None, Quality::Tracked { .. }) => String::new(),
    };
    format!("{:<24} {state:<5} {age:>12}  {place}", pose.name)
}
