//! What `monro track` prints.

use monro_cli::track::{TrackOptions, track};
use monro_geometry::{Rigid, Vector};
use monro_tracking::{Batch, Health, Source, TOOLS, TrackingError};
use monro_wire::{Missing, TimedPose};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// All tools in every frame, every fifth of them missed.
struct Every(u64);

impl Source for Every {
    fn next(&mut self, _: Duration) -> Result<Option<Batch>, TrackingError> {
        self.0 += 1;
        let pose = Rigid::from_quaternion([1.0, 0.0, 0.0, 0.0], Vector::new(1.0, 2.0, 3.0)).expect("pose");
        let one = |(i, name): (u64, &str)| {
            let seen = if (self.0 + i).is_multiple_of(5) { Err(Missing::NotTracked) } else { Ok((pose, Some(0.3))) };
            TimedPose::new(name, None, self.now() - 0.004, seen)
        };
        Ok(Some(Batch { poses: (0..).zip(TOOLS).map(one).collect(), ..Batch::default() }))
    }

    fn now(&self) -> f64 {
        1.7e9 + self.0 as f64 / 100.0
    }

    fn diagnosis(&self, _: &[&str]) -> Health {
        Health::well("well")
    }

    fn facts(&self) -> Vec<String> {
        Vec::new()
    }
}

/// Nothing at all.
struct Silent;

impl Source for Silent {
    fn next(&mut self, wait: Duration) -> Result<Option<Batch>, TrackingError> {
        std::thread::sleep(wait);
        Ok(Some(Batch::default()))
    }

    fn now(&self) -> f64 {
        0.0
    }

    fn diagnosis(&self, _: &[&str]) -> Health {
        Health::ill("the cable is out")
    }

    fn facts(&self) -> Vec<String> {
        Vec::new()
    }
}

#[test]
fn track_prints_one_json_object_a_pose() {
    let (mut out, never) = (Vec::new(), AtomicBool::new(false));
    let options = TrackOptions { frames: Some(30), json: true, ..TrackOptions::default() };
    assert_eq!(track(&mut Every(0), &options, &never, &mut out, &mut std::io::sink()).expect("track"), 30);
    let text = String::from_utf8(out).expect("text");
    let lines: Vec<serde_json::Value> = text.lines().map(|l| serde_json::from_str(l).expect("JSON")).collect();
    assert_eq!(lines.len(), 30 * TOOLS.len());
    for line in &lines {
        assert!(TOOLS.contains(&line["name"].as_str().expect("name")) && line["time_s"].as_f64().expect("time") > 1e9);
        let lost = line["position_mm"].is_null();
        assert_eq!(line["state"], if lost { "stale" } else { "live" }, "what has no pose is not live");
        assert_eq!(lost, line["quaternion_wxyz"].is_null());
        let age = line["age_ms"].as_f64().expect("age");
        // A missed tool is as old as the frame that last showed it.
        assert!((age - if lost { 14.0 } else { 4.0 }).abs() < 0.01, "{line}");
        if !lost {
            assert_eq!(line["position_mm"], serde_json::json!([1.0, 2.0, 3.0]));
            assert_eq!(line["quaternion_wxyz"], serde_json::json!([1.0, 0.0, 0.0, 0.0]));
        }
    }
    assert_eq!(lines.iter().filter(|l| l["position_mm"].is_null()).count(), 24);
}

/// Two tools, each in a batch of its own.
struct OneByOne(u64);

impl Source for OneByOne {
    fn next(&mut self, _: Duration) -> Result<Option<Batch>, TrackingError> {
        self.0 += 1;
        std::thread::sleep(Duration::from_millis(5));
        let pose = Rigid::from_quaternion([1.0, 0.0, 0.0, 0.0], Vector::new(1.0, 2.0, 3.0)).expect("pose");
        let name = TOOLS[self.0 as usize % 2];
        Ok(Some(Batch { poses: vec![TimedPose::new(name, None, self.now(), Ok((pose, None)))], ..Batch::default() }))
    }

    fn now(&self) -> f64 {
        1.7e9 + self.0 as f64 / 200.0
    }

    fn diagnosis(&self, _: &[&str]) -> Health {
        Health::well("well")
    }

    fn facts(&self) -> Vec<String> {
        Vec::new()
    }
}

/// A server that sends tools one by one had twice its rate, and `--frames` ended after half of them.
#[test]
fn messages_of_single_tools_were_counted_as_frames() {
    let (mut out, never) = (Vec::new(), AtomicBool::new(false));
    let options = TrackOptions { frames: Some(4), ..TrackOptions::default() };
    assert_eq!(track(&mut OneByOne(0), &options, &never, &mut out, &mut std::io::sink()).expect("track"), 4);
    let text = String::from_utf8(out).expect("text");
    assert_eq!([0, 1].map(|i| text.lines().filter(|l| l.starts_with(TOOLS[i])).count()), [4, 4], "{text}");
    let mut source = OneByOne(0);
    let found = monro_tracking::doctor(&mut source, &[], Duration::from_millis(400)).expect("doctor");
    let said = found.facts.iter().find_map(|f| f.strip_suffix(" frames a second")).expect("told");
    let messages = source.0 as f64 / 0.4;
    assert!((said.parse::<f64>().expect("number") / messages - 0.5).abs() < 0.1, "{said} of {messages}");
}

#[test]
fn silence_ends_with_the_reason() {
    let (mut out, never) = (Vec::new(), AtomicBool::new(false));
    let options = TrackOptions { patience: Duration::from_millis(150), ..TrackOptions::default() };
    let error = track(&mut Silent, &options, &never, &mut out, &mut std::io::sink()).expect_err("silent");
    assert!(error.to_string().contains("the cable is out") && out.is_empty());
}

/// Ten frames, then silence; the time goes on by itself.
struct Dying(u64);

impl Source for Dying {
    fn next(&mut self, wait: Duration) -> Result<Option<Batch>, TrackingError> {
        self.0 += 1;
        match self.0 {
            0..=10 => Every(0).next(wait),
            11..=70 => Ok(Some(Batch::default())),
            _ => Ok(None),
        }
    }

    fn now(&self) -> f64 {
        1.7e9 + self.0 as f64 / 100.0
    }

    fn diagnosis(&self, _: &[&str]) -> Health {
        Health::ill("its last record was cut short")
    }

    fn facts(&self) -> Vec<String> {
        Vec::new()
    }
}

/// A server that died used to be followed by nothing at all.
#[test]
fn tools_of_which_nothing_more_comes_become_stale_and_lost() {
    let (mut out, mut notes, never) = (Vec::new(), Vec::new(), AtomicBool::new(false));
    let options = TrackOptions { json: true, ..TrackOptions::default() };
    assert_eq!(track(&mut Dying(0), &options, &never, &mut out, &mut notes).expect("track"), 10);
    let text = String::from_utf8(out).expect("text");
    let lines: Vec<serde_json::Value> = text.lines().map(|l| serde_json::from_str(l).expect("JSON")).collect();
    let (frames, after) = lines.split_at(10 * TOOLS.len());
    assert!(frames.iter().any(|l| l["state"] == "live"));
    for tool in TOOLS {
        let states: Vec<_> = after.iter().filter(|l| l["name"] == tool).collect();
        assert_eq!(states.last().expect("told")["state"], "lost", "{tool}: {after:?}");
        assert!(states.iter().all(|l| l["position_mm"].is_null()) && states.len() <= 2, "{tool}: {states:?}");
    }
    assert!(String::from_utf8(notes).expect("text").contains("cut short"));
}
