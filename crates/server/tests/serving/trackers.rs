//! Trackers that others run, with a server between them and the one who looks.

use crate::common::{options, write_case};
use crate::{Served, numbers, until_all};
use monro_geometry::{Point, Rigid, Tool, Tracker as TrackerFrame, Vector};
use monro_server::{Tracker, start};
use monro_tracking::{Batch, Health, Source, TrackingError};
use monro_wire::TimedPose;
use monro_wire::natnet::{MarkerDefinition, RigidBodyDefinition};
use monro_wire::openigtlink::{Message, ToolStatus};
use serde_json::Value;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;
use tokio::io::AsyncWriteExt;
use tokio::net::{TcpListener, TcpStream};

/// A catheter 10 mm from the reference along x.
fn poses(time: f64) -> Vec<TimedPose> {
    let pose = |name: &str, x: f64| {
        let rigid = Rigid::from_quaternion([1.0, 0.0, 0.0, 0.0], Vector::new(x, 0.0, 0.0)).expect("pose");
        TimedPose::new(name, None, time, Ok((rigid, None)))
    };
    vec![pose("Catheter", 110.0), pose("Reference", 100.0)]
}

/// The same poses again and again, each 2 ms old.
struct Still;

impl Source for Still {
    fn next(&mut self, _: Duration) -> Result<Option<Batch>, TrackingError> {
        std::thread::sleep(Duration::from_millis(5));
        Ok(Some(Batch { poses: poses(1e9), ..Batch::default() }))
    }

    fn now(&self) -> f64 {
        1e9 + 0.002
    }

    fn diagnosis(&self, wanted: &[&str]) -> Health {
        Health::well(format!("still, asked for {}", wanted.join(" and ")))
    }

    fn facts(&self) -> Vec<String> {
        Vec::new()
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_foreign_tracker_is_calibrated_and_registered_over_the_api() {
    let dir = tempfile::tempdir().expect("temp");
    let mut o = options(write_case(dir.path(), false));
    // On a clock that started long ago.
    o.tracker = Tracker::Source { name: "test:".into(), source: Box::new(Still) };
    let served = Served { running: start(o).await.expect("start"), _dir: dir };
    let g = served.until(|g| g["state"] == "live").await;
    assert_eq!((&g["phase"], &g["tip_lps_mm"], &g["depth_mm"]), (&"case".into(), &Value::Null, &Value::Null));
    assert!(g["age_ms"].as_f64().is_some_and(|a| a >= 2.0));
    for event in [
        r#"{"event":"calibrated","tip_mm":[0,0,-20],"axis":[0,0,-1]}"#,
        r#"{"event":"registered","quaternion_wxyz":[1,0,0,0],"translation_mm":[1,2,90],"predicted_tre_mm":1.2}"#,
        r#"{"event":"check_passed"}"#,
        r#"{"event":"started"}"#,
    ] {
        assert_eq!(served.post("/api/session", event).await.0, 200, "{event}");
    }
    let g = served.until(|g| g["depth_mm"].is_number()).await;
    assert_eq!(numbers(&g["tip_lps_mm"]), [11.0, 2.0, 70.0]);
    assert_eq!(g["predicted_tre_mm"], 1.2);
    let status = served.get("/api/status").await;
    assert_eq!(status["tracker"], "test:");
    assert_eq!(status["tracker_diagnosis"], "still, asked for Catheter and Reference");
    assert_eq!(served.post("/api/tracker", r#"{"paused":true}"#).await.0, 409);
}

/// Where the catheter is after so many seconds.
type Motion = fn(f64) -> Rigid<TrackerFrame, Tool>;

/// A catheter that goes its way, seen anew every 5 ms.
struct Moving(std::time::Instant, Motion);

impl Moving {
    fn new(motion: Motion) -> Self {
        Self(std::time::Instant::now(), motion)
    }
}

impl Source for Moving {
    fn next(&mut self, _: Duration) -> Result<Option<Batch>, TrackingError> {
        std::thread::sleep(Duration::from_millis(5));
        let mut poses = poses(self.now());
        poses[0] = TimedPose::new("Catheter", None, self.now(), Ok((self.1(self.0.elapsed().as_secs_f64()), None)));
        Ok(Some(Batch { poses, ..Batch::default() }))
    }

    fn now(&self) -> f64 {
        1e9 + self.0.elapsed().as_secs_f64()
    }

    fn diagnosis(&self, _: &[&str]) -> Health {
        Health::well("moving")
    }

    fn facts(&self) -> Vec<String> {
        Vec::new()
    }
}

/// It rests.
fn resting(_: f64) -> Rigid<TrackerFrame, Tool> {
    Rigid::from_quaternion([1.0, 0.0, 0.0, 0.0], Vector::new(110.0, 0.0, 0.0)).expect("pose")
}

/// It is swung in a cone about its tip, 20 mm below its body, and turned meanwhile.
fn swinging(s: f64) -> Rigid<TrackerFrame, Tool> {
    let (tilt, along) = (Vector::new((3.0 * s).cos(), (3.0 * s).sin(), 0.0), Vector::new(0.0, 0.0, 1.0));
    let turned: Rigid<Tool, Tool> = Rigid::from_axis_angle(along, 2.0 * s, Vector::ZERO).expect("axis");
    let swung = Rigid::<TrackerFrame, Tool>::from_axis_angle(tilt, 0.5, Vector::ZERO).expect("axis").after(&turned);
    let tip = swung.point(Point::new(0.0, 0.0, -20.0)) - Point::ORIGIN;
    Rigid::from_quaternion(swung.quaternion_wxyz(), Vector::new(110.0, 0.0, -20.0) - tip).expect("pose")
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn landmarks_touched_with_the_old_tip_stayed_touched_when_the_catheter_was_calibrated_anew() {
    let dir = tempfile::tempdir().expect("temp");
    let mut o = options(write_case(dir.path(), false));
    o.tracker = Tracker::Source { name: "test:".into(), source: Box::new(Moving::new(resting)) };
    let served = Served { running: start(o).await.expect("start"), _dir: dir };
    served.until(|g| g["state"] == "live").await;
    let calibrated = |x: f64| format!(r#"{{"event":"calibrated","tip_mm":[{x},0,-20],"axis":[0,0,-1]}}"#);
    assert_eq!(served.post("/api/session", &calibrated(3.0)).await.0, 200);
    let landmarks = served.get("/api/registration").await["landmarks"].clone();
    let touch = format!(r#"{{"action":"touch","name":{}}}"#, landmarks[0]["name"]);
    let (status, said) = served.post("/api/registration", &touch).await;
    assert_eq!((status, &said["landmarks"][0]["touched"]), (200, &true.into()), "{said}");
    assert_eq!(served.post("/api/session", &calibrated(0.0)).await.0, 200);
    let said = served.get("/api/registration").await;
    assert_eq!(said["landmarks"][0]["touched"], false, "{said}");
    // A touch that is under way is as void.
    let again = async {
        tokio::time::sleep(Duration::from_millis(200)).await;
        served.post("/api/session", &calibrated(1.0)).await.0
    };
    let ((status, said), event) = tokio::join!(served.post("/api/registration", &touch), again);
    assert_eq!((status, event), (422, 200), "{said}");
    assert_eq!(served.get("/api/registration").await["landmarks"][0]["touched"], false);
    // What was found of a catheter is not another's.
    assert_eq!(served.post("/api/session", r#"{"event":"tool_changed"}"#).await.0, 200);
    assert_eq!(served.post("/api/calibration", r#"{"action":"accept"}"#).await.0, 422);
}

/// An axis turned about the old tip stood beside a tip that was found meanwhile, and was accepted with it.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_axis_that_is_watched_while_another_tip_is_found_is_void() {
    let dir = tempfile::tempdir().expect("temp");
    let mut o = options(write_case(dir.path(), false));
    let source = Box::new(Moving::new(swinging));
    o.tracker = Tracker::Source { name: "test:".into(), source };
    let served = Served { running: start(o).await.expect("start"), _dir: dir };
    served.until(|g| g["state"] == "live").await;
    let pivot = r#"{"action":"pivot","seconds":3}"#;
    let (status, said) = served.post("/api/calibration", pivot).await;
    let tip = numbers(&said["tip"]["tip_mm"]);
    assert!(status == 200 && tip.iter().zip([0.0, 0.0, -20.0]).all(|(a, b)| (a - b).abs() < 0.1), "{said}");
    let turn = r#"{"action":"turn","seconds":5,"hub_mm":[0,0,100]}"#;
    let ((turned, why), (pivoted, _)) =
        tokio::join!(served.post("/api/calibration", turn), served.post("/api/calibration", pivot));
    assert_eq!((turned, pivoted), (422, 200), "{why}");
    assert!(why["error"].as_str().is_some_and(|e| e.contains("another tip")), "{why}");
    assert_eq!(served.get("/api/calibration").await["axis"], Value::Null);
}

/// The same with something done to each frame.
struct Altered<F>(Moving, F);

impl<F: FnMut(&mut Batch) + Send> Source for Altered<F> {
    fn next(&mut self, wait: Duration) -> Result<Option<Batch>, TrackingError> {
        let mut batch = self.0.next(wait)?;
        batch.iter_mut().for_each(&mut self.1);
        Ok(batch)
    }

    fn now(&self) -> f64 {
        self.0.now()
    }

    fn diagnosis(&self, wanted: &[&str]) -> Health {
        self.0.diagnosis(wanted)
    }

    fn facts(&self) -> Vec<String> {
        Vec::new()
    }
}

/// How far (mm) the markers of each body lie from where they lay at first.
#[derive(Clone, Default)]
struct Moved(Arc<[AtomicU32; 3]>);

impl Moved {
    /// Tells of the bodies, as a server does.
    fn define(&self, batch: &mut Batch) {
        let body = |(i, name): (usize, &str)| {
            let offset = [1e-3 * self.0[i].load(Ordering::Relaxed) as f32, 0.0, 0.0];
            let markers = vec![MarkerDefinition { offset, ..MarkerDefinition::default() }];
            RigidBodyDefinition { name: name.to_owned(), markers, ..RigidBodyDefinition::default() }
        };
        batch.bodies = ["Catheter", "Reference", "Glasses"].into_iter().enumerate().map(body).collect();
    }
}

/// Guidance went on with the tip where the old body had it.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_body_that_is_defined_anew_voids_what_was_made_in_its_frame() {
    let (dir, moved) = (tempfile::tempdir().expect("temp"), Moved::default());
    let mut o = options(write_case(dir.path(), false));
    o.igtl = Some("127.0.0.1:0".parse().expect("address"));
    let defining = moved.clone();
    let source = Box::new(Altered(Moving::new(resting), move |batch: &mut Batch| defining.define(batch)));
    o.tracker = Tracker::Source { name: "test:".into(), source };
    let served = Served { running: start(o).await.expect("start"), _dir: dir };
    served.until(|g| g["state"] == "live").await;
    let calibrated = r#"{"event":"calibrated","tip_mm":[0,0,-20],"axis":[0,0,-1]}"#;
    let registered = r#"{"event":"registered","quaternion_wxyz":[1,0,0,0],"translation_mm":[1,2,90]}"#;
    for event in [calibrated, registered, r#"{"event":"check_passed"}"#, r#"{"event":"started"}"#] {
        assert_eq!(served.post("/api/session", event).await.0, 200, "{event}");
    }
    let trouble = async || served.get("/api/status").await["tracker_trouble"].as_str().map(str::to_owned);
    assert_eq!(trouble().await, None);

    moved.0[1].store(3, Ordering::Relaxed);
    served.until(|g| g["phase"] == "calibrated" && g["depth_mm"].is_null()).await;
    let said = trouble().await.expect("said");
    assert!(said.contains("'Reference' was defined anew") && said.contains("3.0 mm"), "{said}");
    let mut stream = TcpStream::connect(served.running.ready().igtl.expect("served")).await.expect("connect");
    let all = until_all(&mut stream, &["Guidance"]).await;
    let of_slicer = all.iter().find(|m| m.device == "Guidance").map(|m| format!("{:?}", m.content)).expect("sent");
    assert!(of_slicer.contains("register again"), "{of_slicer}");
    assert_eq!(served.post("/api/session", registered).await.0, 200);
    assert_eq!(trouble().await, None, "it has been done");

    let pivot = served.post("/api/calibration", r#"{"action":"pivot","seconds":1}"#);
    let anew = async {
        tokio::time::sleep(Duration::from_millis(300)).await;
        moved.0[0].store(40, Ordering::Relaxed);
    };
    let ((status, said), ()) = tokio::join!(pivot, anew);
    assert!(status == 422 && said["error"].as_str().is_some_and(|e| e.contains("defined anew")), "{said}");
    served.until(|g| g["phase"] == "case").await;
    assert!(trouble().await.is_some_and(|t| t.contains("calibrate it again")));
    // What it was calibrated with elsewhere is compared, too.
    let with = |x: u32| calibrated.replace("}", &format!(r#","markers_mm":[[{x},0,0]]}}"#));
    let (status, said) = served.post("/api/session", &with(0)).await;
    assert!(status == 422 && said["error"].as_str().is_some_and(|e| e.contains("40.0 mm")), "{said}");
    assert_eq!(served.post("/api/session", &with(40)).await.0, 200);
    assert_eq!(served.post("/api/session", calibrated).await.0, 200);
    assert_eq!(trouble().await, None);

    let worn = r#"{"quaternion_wxyz":[1,0,0,0],"translation_mm":[0,0,0]}"#;
    assert_eq!(served.post("/api/glasses", worn).await.0, 200);
    moved.0[2].store(1, Ordering::Relaxed);
    tokio::time::sleep(Duration::from_millis(100)).await;
    assert!(trouble().await.is_some_and(|t| t.contains("glasses again")));
    assert_eq!(served.post("/api/glasses", worn).await.0, 200);
    assert_eq!(trouble().await, None);
}

/// Moves the reference by so many mm.
fn bump(batch: &mut Batch, mm: f64) {
    for told in batch.poses.iter_mut().filter(|told| told.name == "Reference") {
        let moved = |p: Rigid<TrackerFrame, Tool>| {
            Rigid::from_quaternion(p.quaternion_wxyz(), p.translation() + Vector::new(mm, 0.0, 0.0))
        };
        told.tracker_from_tool = told.tracker_from_tool.and_then(moved);
    }
}

/// Posting the registration that was in use lowered the alarm, and so did a check of which nobody knew anything.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_registration_in_use_sent_again_silenced_the_alarm_of_the_reference() {
    let (dir, by) = (tempfile::tempdir().expect("temp"), Arc::new(AtomicU32::new(0)));
    let mut o = options(write_case(dir.path(), false));
    let bumping = Arc::clone(&by);
    let bumped = move |batch: &mut Batch| bump(batch, f64::from(bumping.load(Ordering::Relaxed)));
    let source = Box::new(Altered(Moving::new(resting), bumped));
    o.tracker = Tracker::Source { name: "test:".into(), source };
    let served = Served { running: start(o).await.expect("start"), _dir: dir };
    served.until(|g| g["state"] == "live").await;
    let calibrated = r#"{"event":"calibrated","tip_mm":[0,0,-20],"axis":[0,0,-1]}"#;
    let registered = r#"{"event":"registered","quaternion_wxyz":[1,0,0,0],"translation_mm":[1,2,90]}"#;
    let checked = r#"{"event":"check_passed"}"#;
    for event in [calibrated, registered, checked] {
        assert_eq!(served.post("/api/session", event).await.0, 200, "{event}");
    }
    // Time for where it belongs to be known.
    tokio::time::sleep(Duration::from_millis(500)).await;
    by.store(3, Ordering::Relaxed);
    served.until(|g| g["reference_moved_mm"].as_f64().is_some_and(|mm| mm > 2.9)).await;
    for event in [registered, checked] {
        let (status, said) = served.post("/api/session", event).await;
        assert!(status == 409 && said["error"].as_str().is_some_and(|e| e.contains("3.0 mm")), "{event}: {said}");
    }
    assert!(served.get("/api/guidance").await["reference_moved_mm"].is_number());
    for event in [r#"{"event":"reference_moved"}"#, registered, checked] {
        assert_eq!(served.post("/api/session", event).await.0, 200, "{event}");
    }
    assert_eq!(served.get("/api/guidance").await["reference_moved_mm"], Value::Null);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_openigtlink_server_feeds_the_session_and_is_found_again_when_it_comes_back() {
    let plus = TcpListener::bind("127.0.0.1:0").await.expect("bind");
    let address = plus.local_addr().expect("address");
    tokio::spawn(async move {
        // A first connection that ends in the middle of a header, then one that streams.
        let (mut first, _) = plus.accept().await.expect("accept");
        first.write_all(b"\0\x02TRANS").await.expect("write");
        drop(first);
        let (mut second, _) = plus.accept().await.expect("accept");
        let pose = Rigid::from_quaternion([1.0, 0.0, 0.0, 0.0], Vector::ZERO).expect("pose");
        for id in 0.. {
            for name in ["CatheterToTracker", "Reference"] {
                let message = Message::transform(name, None, id, Some(&pose), ToolStatus::Ok);
                if second.write_all(&message.encode().expect("message")).await.is_err() {
                    return;
                }
            }
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    });
    let dir = tempfile::tempdir().expect("temp");
    let mut o = options(write_case(dir.path(), false));
    o.tracker = format!("igtl://{address}").parse().expect("url");
    let served = Served { running: start(o).await.expect("start"), _dir: dir };
    served.until(|g| g["state"] == "live").await;
    assert_eq!(served.get("/api/status").await["tools"], serde_json::json!(["Catheter", "Reference"]));
}
