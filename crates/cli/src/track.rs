//! `monro track URL`: live poses with age and quality.

use anyhow::{Result, bail};
use monro_guidance::clock::{Expiry, Freshness, age};
use monro_tracking::{Batch, Source};
use monro_wire::{Missing, Quality, TimedPose};
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

/// Silence after which people are told why nothing comes, rather than left to wait.
const SILENCE: Duration = Duration::from_secs(2);

/// A tool that has been seen.
#[derive(Debug, Clone, Copy)]
struct Seen {
    /// When last, s on our clock.
    at: f64,
    /// How fresh the last line about it said that it was.
    told: Freshness,
}

/// What is known of the tools, and where it is printed.
struct Printer<'a> {
    options: &'a TrackOptions,
    seen: BTreeMap<String, Seen>,
    out: &'a mut dyn Write,
}

/// Prints poses as they come until the frames are through, the source ends, or `stop` is set; when a tool becomes stale or
/// lost because nothing more is told of it, a line says that too. What concerns the source goes to `notes`.
///
/// # Errors
/// When nothing comes for too long (with the reason, as far as it is known), or the output is closed.
pub fn track(
    source: &mut dyn Source,
    options: &TrackOptions,
    stop: &AtomicBool,
    out: &mut dyn Write,
    notes: &mut dyn Write,
) -> Result<u64> {
    let mut printer = Printer { options, seen: BTreeMap::new(), out };
    let (mut frames, mut last, mut told) = (Frames::default(), Instant::now(), false);
    while !stop.load(Ordering::Relaxed) && options.frames.is_none_or(|n| !frames.are_complete(n)) {
        let Some(batch) = source.next(Duration::from_millis(100))? else {
            let end = source.diagnosis(&[]);
            if !end.well {
                writeln!(notes, "warning: {end}")?;
            }
            break;
        };
        if options.frames.is_some_and(|n| frames.is_beyond(n, &batch)) {
            break;
        }
        printer.frame(&batch, source.now())?;
        if !batch.poses.is_empty() {
            frames.add(&batch);
            (last, told) = (Instant::now(), false);
        } else if last.elapsed() >= options.patience {
            bail!("{}", source.diagnosis(&[]));
        } else if !told && last.elapsed() >= SILENCE {
            told = true;
            writeln!(notes, "waiting: {}", source.diagnosis(&[]))?;
        }
    }
    Ok(frames.most())
}

/// Frames of each tool: a source may send each tool in a message, and so in a batch, of its own.
#[derive(Debug, Default)]
struct Frames(BTreeMap<String, u64>);

impl Frames {
    fn add(&mut self, batch: &Batch) {
        batch.poses.iter().for_each(|p| *self.0.entry(p.name.clone()).or_default() += 1);
    }

    fn most(&self) -> u64 {
        self.0.values().copied().max().unwrap_or(0)
    }

    /// Whether all tools told of so far had `n` frames.
    fn are_complete(&self, n: u64) -> bool {
        !self.0.is_empty() && self.0.values().all(|&f| f >= n)
    }

    /// Whether a batch begins another frame after `n`.
    fn is_beyond(&self, n: u64, batch: &Batch) -> bool {
        batch.poses.iter().any(|p| self.0.get(&p.name).is_some_and(|&f| f >= n))
    }
}

impl Printer<'_> {
    /// All poses of a frame, and the tools that have become stale or lost without being in it.
    fn frame(&mut self, batch: &Batch, now: f64) -> Result<()> {
        for pose in &batch.poses {
            let own_age = age(now, (pose.arrival_time, pose.lag), pose.source_time, batch.clock.as_ref());
            self.pose(pose, now, own_age)?;
        }
        let expiry = self.options.expiry;
        let is_worse = |s: &Seen| expiry.state(Some(now - s.at)) > s.told;
        let silent: Vec<_> = self.seen.iter().filter(|(_, s)| is_worse(s)).map(|(n, _)| n.clone()).collect();
        for name in silent {
            let nothing = TimedPose::new(name, None, now, Err(Missing::NotSent));
            self.pose(&nothing, now, 0.0)?;
        }
        Ok(self.out.flush()?)
    }

    fn pose(&mut self, pose: &TimedPose, now: f64, own_age: f64) -> Result<()> {
        let before = self.seen.get(&pose.name).copied();
        let at = if pose.tracker_from_tool.is_some() { Some(now - own_age) } else { before.map(|s| s.at) };
        let age = at.map(|t| now - t);
        // What is not seen now has no pose to be live with, however young its last one is.
        let least = if pose.tracker_from_tool.is_some() { Freshness::Live } else { Freshness::Stale };
        let told = self.options.expiry.state(age).max(least);
        if let Some(at) = at {
            self.seen.insert(pose.name.clone(), Seen { at, told });
        }
        let line = if self.options.json { json(pose, told, now - own_age, age) } else { words(pose, told, age) };
        Ok(writeln!(self.out, "{line}")?)
    }
}

fn json(pose: &TimedPose, state: Freshness, time: f64, age: Option<f64>) -> String {
    let (error, why) = match pose.quality {
        Quality::Tracked { error } => (error, None),
        Quality::Missing(why) => (None, Some(why.name())),
    };
    json!({
        "name": pose.name,
        "time_s": time,
        "position_mm": pose.tracker_from_tool.map(|p| p.translation().to_array()),
        "quaternion_wxyz": pose.tracker_from_tool.map(|p| p.quaternion_wxyz()),
        "state": state.name(),
        "age_ms": age.map(|a| 1e3 * a),
        "error_mm": error,
        "why_missing": why,
    })
    .to_string()
}

fn words(pose: &TimedPose, state: Freshness, age: Option<f64>) -> String {
    let age = age.map_or("never seen".to_owned(), |a| format!("{:6.1} ms", 1e3 * a));
    let place = match (pose.tracker_from_tool.map(|p| p.translation().to_array()), pose.quality) {
        (Some([x, y, z]), _) => format!("{x:9.2} {y:9.2} {z:9.2} mm"),
        (None, Quality::Missing(why)) => why.name().to_owned(),
        (None, Quality::Tracked { .. }) => String::new(),
    };
    format!("{:<24} {:<5} {age:>12}  {place}", pose.name, state.name())
}
