//! Sessions are recorded, survive a killed program, and are replayed bit for bit.

mod common;

use common::{options, request, write_case};
use futures_util::{SinkExt, StreamExt};
use monro_server::{Recording, Replayed, ServeError, ServeOptions, replay, serve, start};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use tokio_tungstenite::connect_async;
use tokio_tungstenite::tungstenite::Message;

fn recorded(case: PathBuf, file: &Path) -> ServeOptions {
    let recording = Some(Recording { path: file.to_owned(), settings: "paper".into() });
    ServeOptions { recording, ..options(case) }
}

/// As a display reads the numbers: from their text.
fn read_again(guidance: &Value) -> Value {
    serde_json::from_str(&guidance.to_string()).expect("json")
}

fn played(file: &Path, case: Option<&Path>) -> Result<(Replayed, Vec<Value>), ServeError> {
    let mut shown = Vec::new();
    let model = options(PathBuf::new()).model;
    let done = replay(file, case, |name| (name == "paper").then_some(model), |g| shown.push(read_again(g)))?;
    Ok((done, shown))
}

/// Shows snapshots on a display until there are `count` and `enough` says so, and gives their numbers.
async fn watch(url: &str, token: &str, count: usize, enough: fn(&Value) -> bool) -> Vec<Value> {
    let address = url.strip_prefix("http://").expect("http");
    let head = format!("POST /api/ticket HTTP/1.1\r\nHost: {address}\r\nAuthorization: Bearer {token}");
    let (_, _, body) = request(address, &head, "").await;
    let ticket = serde_json::from_slice::<Value>(&body).expect("json")["ticket"].as_str().expect("ticket").to_owned();
    let (mut socket, _) = connect_async(format!("ws://{address}/live?ticket={ticket}")).await.expect("connect");
    let mut all = Vec::new();
    while all.len() < count || !all.last().is_some_and(enough) {
        socket.send(Message::text("next")).await.expect("send");
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
    let running = start(recorded(case.clone(), &file)).await.expect("start");
    let ready = running.ready().clone();
    assert_eq!(ready.recording.as_deref(), Some(&*file));
    let touched = |g: &Value| g["largest_displacement_mm"].as_f64().is_some_and(|d| d > 0.01);
    let both = (watch(&ready.url, &ready.token, 120, touched), watch(&ready.url, &ready.token, 60, |_| true));
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
    assert_eq!(again, done);
    std::fs::rename(moved.path().join("elsewhere"), dir.path()).expect("move back");

    assert!(matches!(start(recorded(case.clone(), &file)).await, Err(ServeError::Recording { .. })), "overwritten");
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

/// Run by the test below in a process of its own.
#[test]
#[ignore = "a helper: serves the case in MONRO_TEST_CASE until it is killed"]
fn a_server_to_be_killed() {
    let Ok(case) = std::env::var("MONRO_TEST_CASE") else { return };
    let file = std::env::var("MONRO_TEST_FILE").expect("file");
    serve(recorded(case.into(), Path::new(&file)), |r| println!("READY {} {}", r.url, r.token)).expect("serve");
}

struct Killed(Child);

impl Drop for Killed {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_killed_server_loses_no_more_than_a_tenth_of_a_second_and_no_case() {
    let dir = tempfile::tempdir().expect("temp");
    let (case, file) = (write_case(dir.path(), false), dir.path().join("killed.mnrs"));
    let mut command = Command::new(std::env::current_exe().expect("this test"));
    command.args(["--exact", "a_server_to_be_killed", "--ignored", "--nocapture"]);
    command.env("MONRO_TEST_CASE", &case).env("MONRO_TEST_FILE", &file).stdout(Stdio::piped());
    let mut child = Killed(command.spawn().expect("spawn"));
    let out = BufReader::new(child.0.stdout.take().expect("stdout"));
    let line = out.lines().map_while(Result::ok).find_map(|l| l.split_once("READY ").map(|(_, r)| r.to_owned()));
    let line = line.expect("ready");
    let (url, token) = line.split_once(' ').expect("url and token");
    let last = watch(url, token, 60, |_| true).await.pop().expect("snapshot");
    child.0.kill().expect("kill");
    child.0.wait().expect("end");
    let (done, shown) = played(&file, None).expect("replay");
    assert_eq!(done.identical, done.snapshots);
    let (seen, kept) = (last["time_s"].as_f64().expect("time"), shown.last().expect("kept")["time_s"].as_f64());
    assert!(kept.expect("time") >= seen - 0.1, "{seen} {kept:?}");
    assert!(start(options(case)).await.is_ok(), "the case is whole");
}
