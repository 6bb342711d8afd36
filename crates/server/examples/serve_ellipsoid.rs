//! Serves a made-up head without preparing anything: for the browser tests and for work on the web app.
//!
//! `serve_ellipsoid [--hand] [CASE]` prints one JSON line {url, token, open, case, igtl} when it is ready. With a folder, serves
//! that case instead; with `--hand`, the catheter's tip is held where stdin says, a line "X Y Z" (patient, mm) a place.

#[path = "../tests/common/mod.rs"]
mod common;

use monro_geometry::{Patient, Point, Rigid, Tool, Tracker as TrackerFrame, Vector};
use monro_server::Tracker;
use monro_tracking::{Batch, Clock, Source, TrackingError};
use monro_wire::TimedPose;
use std::sync::{Arc, Mutex};
use std::time::Duration;

fn main() {
    let dir = tempfile::tempdir().expect("temp");
    let (flags, folders): (Vec<_>, Vec<_>) = std::env::args_os().skip(1).partition(|a| a == "--hand");
    let case = folders.first().map_or_else(|| common::write_case(dir.path(), true), std::path::PathBuf::from);
    let mut options = common::options(case.clone());
    options.igtl = Some(([127, 0, 0, 1], 0).into());
    if !flags.is_empty() {
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

/// Holds the catheter, pointing down, with its tip where stdin says.
struct Hand {
    tip: Arc<Mutex<Point<Patient>>>,
    clock: Clock,
    frames: u64,
}

/// Tip in the catheter's tracked body, for whoever calibrates it.
const TIP: Point<Tool> = Point::new(0.0, 0.0, -20.0);

impl Hand {
    fn new() -> Self {
        let tip = Arc::new(Mutex::new(Point::new(0.0, 0.0, 200.0)));
        let told = Arc::clone(&tip);
        std::thread::spawn(move || {
            for line in std::io::stdin().lines().map_while(Result::ok) {
                let numbers: Vec<f64> = line.split_whitespace().map_while(|n| n.parse().ok()).collect();
                if let [x, y, z] = numbers[..] {
                    *told.lock().expect("lock") = Point::new(x, y, z);
                }
            }
        });
        Self { tip, clock: Clock::new(), frames: 0 }
    }

    /// Where the patient lies, and the reference on the head.
    fn tracker_from_patient() -> Rigid<TrackerFrame, Patient> {
        Rigid::from_axis_angle(Vector::new(0.2, 1.0, -0.4), 1.3, Vector::new(50.0, 800.0, -300.0)).expect("axis")
    }

    fn tracker_from_reference() -> Rigid<TrackerFrame, Tool> {
        Rigid::from_axis_angle(Vector::new(1.0, 0.3, 0.1), 0.6, Vector::new(90.0, 700.0, -250.0)).expect("axis")
    }
}

impl Source for Hand {
    fn next(&mut self, wait: Duration) -> Result<Option<Batch>, TrackingError> {
        std::thread::sleep(wait.min(Duration::from_millis(10)));
        self.frames += 1;
        // It trembles by 0.1 mm.
        let tremble = Vector::new(if self.frames.is_multiple_of(2) { 0.1 } else { -0.1 }, 0.0, 0.0);
        let at = Self::tracker_from_patient().point(*self.tip.lock().expect("lock")) + tremble;
        let body = Vector::from_array((at - Point::ORIGIN).to_array()) - Vector::from_array(TIP.to_array());
        let catheter = Rigid::from_quaternion([1.0, 0.0, 0.0, 0.0], body).expect("pose");
        let now = self.clock.now();
        let pose = |name: &str, rigid| TimedPose::new(name, None, now, Ok((rigid, None)));
        let poses = vec![pose("Catheter", catheter), pose("Reference", Self::tracker_from_reference())];
        Ok(Some(Batch { poses, clock: None }))
    }

    fn now(&self) -> f64 {
        self.clock.now()
    }

    fn diagnosis(&self, _: &[&str]) -> String {
        "held by hand".into()
    }

    fn facts(&self) -> Vec<String> {
        Vec::new()
    }
}
