//! Sessions are recorded, survive a killed program, and are replayed bit for bit.

use crate::common::{options, request, write_case};
use futures_util::{SinkExt, StreamExt};
use monro_server::{Recording, Replayed, ServeError, ServeOptions, replay, serve, start};
use monro_session::{FrameSettings, ModelSettings};
use monro_tissue::{Mode, PhysicalOptions};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use tokio_tungstenite::connect_async;
use tokio_tungstenite::tungstenite::Message;

/// The soft bodies, as recordings name them.
const MODES: [&str; 2] = ["paper", "physical"];

/// One that is solved otherwise than usual.
const PREDICTED: &str = "predicted";

fn soft_body(name: &str) -> (ModelSettings, FrameSettings) {
    let (paper, usual) = (options(PathBuf::new()).model, FrameSettings::default());
    let physical = ModelSettings { mode: Mode::Physical(PhysicalOptions::default()), ..paper };
    match name {
        "paper" => (paper, usual),
        PREDICTED => (physical, FrameSettings { iterations: 7, predicted_space: true, ..usual }),
        _ => (physical, usual),
    }
}

fn recorded(case: PathBuf, file: &Path, name: &str) -> ServeOptions {
    let recording = Some(Recording { path: file.to_owned(), settings: name.into() });
    let (model, frame) = soft_body(name);
    ServeOptions { recording, model, frame, ..options(case) }
}

/// Whether the catheter has moved the tissue.
fn touched(g: &Value) -> bool {
    g["largest_displacement_mm"].as_f64().is_some_and(|d| d > 0.01)
}

/// As a display reads the numbers: from their text.
fn read_again(guidance: &Value) -> Value {
    serde_json::from_str(&guidance.to_string()).expect("json")
}

fn played(file: &Path, case: Option<&Path>) -> Result<(Replayed, Vec<Value>), ServeError> {
    played_as(file, case, |name| Some(soft_body(name)))
}

pub(super) fn played_as(
    file: &Path,
    case: Option<&Path>,
    known: impl Fn(&str) -> Option<(ModelSettings, FrameSettings)>,
) -> Result<(Replayed, Vec<Value>), ServeError> {
    let mut shown = Vec::new();
    let done = replay(file, case, known, |g| shown.push(read_again(g)), |_| {})?;
    Ok((done, shown))
}

/// Shows snapshots on a display that asks with `word` until there are `count` and `enough` says so; their numbers.
pub(super) async fn watch(url: &str, token: &str, word: &str, count: usize, enough: fn(&Value) -> bool) -> Vec<Value> {
    let address = url.strip_prefix("http://").expect("http");
    let head = format!("POST /api/ticket HTTP/1.1\r\nHost: {address}\r\nAuthorization: Bearer {token}");
    let (_, _, body) = request(address, &head, "").await;
    let ticket = serde_json::from_slice::<Value>(&body).expect("json")["ticket"].as_str().expect("ticket").to_owned();
    let (mut socket, _) = connect_async(format!("ws://{address}/live?ticket={ticket}")).await.expect("connect");
    let mut all = Vec::new();
    while all.len() < count || !all.last().is_some_and(enough) {
        socket.send(Message::text(word)).await.expect("send");
        if let Message::Binary(b) = socket.next().await.expect("open").expect("message") {
            let nodes = u32::from_le_bytes([b[48], b[49], b[50], b[51]]) as usize;
            all.push(serde_json::from_slice(&b[56 + 6 * nodes..]).expect("json"));
        }
    }
    all
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_recorded_session_replays_to_the_snapshots_that_were_shown() {
    let dir = tempfile::tempdir().expect("temp");
    let (case, file) = (write_case(dir.path(), false), dir.path().join("sessions/a.mnrs"));
    let running = start(recorded(case.clone(), &file, "paper")).await.expect("start");
    let ready = running.ready().clone();
    assert_eq!(ready.recording.as_deref(), Some(&*file));
    let first = watch(&ready.url, &ready.token, "next", 120, touched);
    let both = (first, watch(&ready.url, &ready.token, "vertices", 60, |_| true));
    let (first, second) = tokio::join!(both.0, both.1);
    drop(running);
    tokio::time::sleep(Duration::from_millis(200)).await;
    let (done, shown) = played(&file, None).expect("replay");
    assert!(done.snapshots >= 180 && done.identical == done.snapshots && done.differs_at_s.is_none(), "{done:?}");
    assert!(done.frames > 0 && done.steps > 0 && done.events == 5, "{done:?}");
    // What the displays saw is among what the replay gives, number for number.
    assert!(first.iter().chain(&second).all(|g| shown.contains(g)));
    assert!(shown.iter().any(touched));

    // Recording and case are moved together.
    let moved = tempfile::tempdir().expect("temp");
    std::fs::rename(dir.path(), moved.path().join("elsewhere")).expect("move");
    let (again, _) = played(&moved.path().join("elsewhere/sessions/a.mnrs"), None).expect("replay");
    assert_eq!(Replayed { case_dir: done.case_dir.clone(), ..again }, done);
    std::fs::rename(moved.path().join("elsewhere"), dir.path()).expect("move back");

    assert!(
        matches!(start(recorded(case.clone(), &file, "paper")).await, Err(ServeError::Recording { .. })),
        "overwritten"
    );
    // The beginning will do to see which case is taken.
    let file = dir.path().join("beginning.mnrs");
    std::fs::write(&file, &std::fs::read(dir.path().join("sessions/a.mnrs")).expect("recording")[..3000])
        .expect("write");
    let other = dir.path().join("other");
    std::fs::create_dir(&other).expect("folder");
    let plan = std::fs::read_to_string(case.join("case.toml")).expect("manifest");
    for entry in std::fs::read_dir(&case).expect("case") {
        let entry = entry.expect("file");
        std::fs::copy(entry.path(), other.join(entry.file_name())).expect("copy");
    }
    assert!(played(&file, Some(&other)).is_ok(), "the same case elsewhere");
    let at = plan.rfind("sha256").expect("hashes");
    std::fs::write(other.join("case.toml"), format!("{}{}", &plan[..at], plan[at..].replacen('a', "b", 1)))
        .expect("write");
    assert!(played(&file, Some(&other)).is_err());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_session_of_the_physical_soft_body_replays_bit_for_bit_too() {
    let dir = tempfile::tempdir().expect("temp");
    let case = write_case(dir.path(), false);
    for name in ["physical", PREDICTED] {
        let file = dir.path().join(name).with_extension("mnrs");
        let running = start(recorded(case.clone(), &file, name)).await.expect("start");
        let ready = running.ready().clone();
        let seen = watch(&ready.url, &ready.token, "next", 60, touched).await;
        drop(running);
        tokio::time::sleep(Duration::from_millis(200)).await;
        let (done, shown) = played(&file, None).expect("replay");
        assert!(done.identical == done.snapshots && done.snapshots >= 60 && done.differs_at_s.is_none(), "{done:?}");
        assert!(seen.iter().all(|g| shown.contains(g)));
    }
    // How it was solved counts.
    let file = dir.path().join(PREDICTED).with_extension("mnrs");
    let (other, _) = played_as(&file, None, |_| Some(soft_body("physical"))).expect("replay");
    assert!(other.identical < other.snapshots, "{other:?}");
}

/// Run by the test below in a process of its own.
#[test]
#[ignore = "a helper: serves the case in MONRO_TEST_CASE until it is killed"]
fn a_server_to_be_killed() {
    let Ok(case) = std::env::var("MONRO_TEST_CASE") else { return };
    let [file, mode] = ["MONRO_TEST_FILE", "MONRO_TEST_MODE"].map(|name| std::env::var(name).expect(name));
    serve(recorded(case.into(), Path::new(&file), &mode), |r| println!("READY {} {}", r.url, r.token)).expect("serve");
}

struct Killed(Child);

impl Drop for Killed {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Serves the case until a display has seen so many snapshots, kills the server, and gives them.
async fn kill_after(snapshots: usize, case: &Path, file: &Path, mode: &str) -> Vec<Value> {
    let mut command = Command::new(std::env::current_exe().expect("this test"));
    command.args(["--exact", "recording::a_server_to_be_killed", "--ignored", "--nocapture"]).stdout(Stdio::piped());
    command.env("MONRO_TEST_CASE", case).env("MONRO_TEST_FILE", file).env("MONRO_TEST_MODE", mode);
    let mut child = Killed(command.spawn().expect("spawn"));
    let out = BufReader::new(child.0.stdout.take().expect("stdout"));
    let line = out.lines().map_while(Result::ok).find_map(|l| l.split_once("READY ").map(|(_, r)| r.to_owned()));
    let line = line.expect("ready");
    let (url, token) = line.split_once(' ').expect("url and token");
    let seen = if snapshots > 0 { watch(url, token, "next", snapshots, |_| true).await } else { Vec::new() };
    child.0.kill().expect("kill");
    child.0.wait().expect("end");
    seen
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_killed_server_loses_no_more_than_a_tenth_of_a_second_and_no_case() {
    let dir = tempfile::tempdir().expect("temp");
    let case = write_case(dir.path(), false);
    for (n, snapshots) in [0, 1, 3, 17, 60, 140].into_iter().enumerate() {
        let (file, mode) = (dir.path().join(format!("killed-{n}.mnrs")), MODES[n % 2]);
        let seen = kill_after(snapshots, &case, &file, mode).await;
        let (done, shown) = played(&file, None).expect("replay");
        assert_eq!(done.identical, done.snapshots, "{mode}, {snapshots} snapshots");
        let time = |g: &Value| g["time_s"].as_f64().expect("time");
        let end = seen.last().map_or(0.0, time);
        for lost in seen.iter().filter(|g| !shown.contains(g)) {
            assert!(time(lost) > end - 0.1, "{mode}, {snapshots} snapshots, the last at {end} s: {lost}");
        }
    }
    assert!(start(options(case)).await.is_ok(), "the case is whole");
}
