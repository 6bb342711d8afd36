//! Serves a made-up head without preparing anything: for the browser tests and for work on the web app.
//!
//! `serve_ellipsoid [--hand] [--sliding] [CASE]` prints one JSON line {url, token, open, case, igtl} when it is ready. With a folder, serves
//! that case instead; with `--hand`, the catheter's tip is held where stdin says, a line "X Y Z" (patient, mm) a place; a line
//! "pivot", "turn" or "hold" says how it moves there, and "bump X Y Z" shifts the patient's reference (mm); with `--sliding`, the
//! soft body has units and slides along the skull.

#[path = "../tests/common/mod.rs"]
mod common;

use monro_geometry::{Patient, Point, Rigid, Tool, Tracker as TrackerFrame, Vector};
use monro_server::Tracker;
use monro_tracking::{Batch, Clock, Health, Source, TrackingError};
use monro_wire::TimedPose;
use std::sync::{Arc, Mutex};
use std::time::Duration;

fn main() {
    let dir = tempfile::tempdir().expect("temp");
    let (flags, folders): (Vec<_>, Vec<_>) =
        std::env::args_os().skip(1).partition(|a| a == "--hand" || a == "--sliding");
    let case = folders.first().map_or_else(|| common::write_case(dir.path(), true), std::path::PathBuf::from);
    let mut options = common::options(case.clone());
    options.igtl = Some(([127, 0, 0, 1], 0).into());
    if flags.iter().any(|f| f == "--sliding") {
        options.model = common::sliding();
    }
    if flags.iter().any(|f| f == "--hand") {
        options.tracker = Tracker::Source { name: "hand:".into(), source: Box::new(Hand::new()) };
    }
    let done = monro_server::serve(options, |ready| {
        let open = ready.browser_url();
        let line = serde_json::json!({ "url": ready.url, "token": ready.token, "open": open, "case": case, "igtl": ready.igtl });
        println!("{line}");
    });
    if let Err(error) = done {
        eprintln!("{error}");
        std::process::exit(1);
    }
}

/// What the hand does with the catheter while its tip rests.
#[derive(Clone, Copy)]
enum Motion {
    Hold,
    /// Swings it in a cone, which opens and closes.
    Pivot,
    /// Turns it about its own axis.
    Turn,
}

/// What stdin has asked for.
#[derive(Clone, Copy)]
struct Wish {
    tip: Point<Patient>,
    motion: Motion,
    bump: Vector<TrackerFrame>,
}

impl Wish {
    fn take(&mut self, line: &str) {
        let numbers: Vec<f64> = line.split_whitespace().filter_map(|n| n.parse().ok()).collect();
        match (line.split_whitespace().next(), &numbers[..]) {
            (Some("pivot"), _) => self.motion = Motion::Pivot,
            (Some("turn"), _) => self.motion = Motion::Turn,
            (Some("hold"), _) => self.motion = Motion::Hold,
            (Some("bump"), &[x, y, z]) => self.bump = Vector::new(x, y, z),
            (_, &[x, y, z]) => self.tip = Point::new(x, y, z),
            _ => eprintln!("not understood: {line}"),
        }
    }
}

/// Holds the catheter, pointing down, with its tip where stdin says.
struct Hand {
    wish: Arc<Mutex<Wish>>,
    clock: Clock,
    frames: u64,
}

/// Tip in the catheter's tracked body, for whoever calibrates it.
const TIP: Point<Tool> = Point::new(0.0, 0.0, -20.0);

impl Hand {
    fn new() -> Self {
        let wish = Wish { tip: Point::new(0.0, 0.0, 200.0), motion: Motion::Hold, bump: Vector::ZERO };
        let wish = Arc::new(Mutex::new(wish));
        let told = Arc::clone(&wish);
        std::thread::spawn(move || {
            for line in std::io::stdin().lines().map_while(Result::ok) {
                told.lock().expect("lock").take(&line);
            }
        });
        Self { wish, clock: Clock::new(), frames: 0 }
    }

    /// Where the patient lies, and the reference on the head.
    fn tracker_from_patient() -> Rigid<TrackerFrame, Patient> {
        Rigid::from_axis_angle(Vector::new(0.2, 1.0, -0.4), 1.3, Vector::new(50.0, 800.0, -300.0)).expect("axis")
    }

    fn tracker_from_reference(bump: Vector<TrackerFrame>) -> Rigid<TrackerFrame, Tool> {
        let at = Vector::new(90.0, 700.0, -250.0) + bump;
        Rigid::from_axis_angle(Vector::new(1.0, 0.3, 0.1), 0.6, at).expect("axis")
    }

    /// How the catheter is turned.
    fn turned(&self, motion: Motion) -> Rigid<TrackerFrame, Tool> {
        let round = self.frames as f64 * 0.05;
        let (axis, angle) = match motion {
            Motion::Hold => (Vector::new(0.0, 0.0, 1.0), 0.0),
            Motion::Pivot => (Vector::new(round.cos(), round.sin(), 0.0), 0.6 * (0.23 * round).sin()),
            Motion::Turn => (Vector::new(0.0, 0.0, 1.0), round),
        };
        Rigid::from_axis_angle(axis, angle, Vector::ZERO).expect("axis")
    }
}

impl Source for Hand {
    fn next(&mut self, wait: Duration) -> Result<Option<Batch>, TrackingError> {
        std::thread::sleep(wait.min(Duration::from_millis(10)));
        self.frames += 1;
        // It trembles by 0.1 mm.
        let tremble = [12.9, 78.2, 37.7].map(|w| 0.1 * (w * self.frames as f64).sin());
        let tremble = Vector::from_array(tremble);
        let Wish { tip, motion, bump } = *self.wish.lock().expect("lock");
        let at = Self::tracker_from_patient().point(tip) + tremble;
        let turned = self.turned(motion);
        let catheter = Rigid::from_quaternion(turned.quaternion_wxyz(), at - turned.point(TIP)).expect("pose");
        let now = self.clock.now();
        let pose = |name: &str, rigid| TimedPose::new(name, None, now, Ok((rigid, None)));
        let poses = vec![pose("Catheter", catheter), pose("Reference", Self::tracker_from_reference(bump))];
        Ok(Some(Batch { poses, ..Batch::default() }))
    }

    fn now(&self) -> f64 {
        self.clock.now()
    }

    fn diagnosis(&self, _: &[&str]) -> Health {
        Health::well("held by hand")
    }

    fn facts(&self) -> Vec<String> {
        Vec::new()
    }
}
