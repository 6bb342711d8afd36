//! Displays at the WebSocket: the newest wins, and a stalled one delays nobody.

mod common;

use common::{options, request, write_case};
use futures_util::{SinkExt, StreamExt};
use monro_server::{Running, start};
use std::time::{Duration, Instant};
use tokio::net::TcpStream;
use tokio_tungstenite::tungstenite::{Error, Message};
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async};

type Socket = WebSocketStream<MaybeTlsStream<TcpStream>>;

async fn ticket(running: &Running) -> String {
    let ready = running.ready();
    let address = ready.url.strip_prefix("http://").expect("http");
    let head = format!("POST /api/ticket HTTP/1.1\r\nHost: {address}\r\nAuthorization: Bearer {}", ready.token);
    let (status, _, body) = request(address, &head, "").await;
    assert_eq!(status, 200);
    let json: serde_json::Value = serde_json::from_slice(&body).expect("json");
    json["ticket"].as_str().expect("ticket").to_owned()
}

async fn connect(running: &Running, ticket: &str) -> Result<Socket, Error> {
    let url = format!("{}/live?ticket={ticket}", running.ready().url.replace("http://", "ws://"));
    connect_async(url).await.map(|(socket, _)| socket)
}

async fn display(running: &Running) -> Socket {
    connect(running, &ticket(running).await).await.expect("connect")
}

async fn served() -> (Running, tempfile::TempDir) {
    let dir = tempfile::tempdir().expect("temp");
    let case = write_case(dir.path(), false);
    (start(options(case)).await.expect("start"), dir)
}

/// Asks for a snapshot and takes it: sequence number and JSON.
async fn snapshot(socket: &mut Socket) -> (u32, serde_json::Value) {
    socket.send(Message::text("next")).await.expect("send");
    loop {
        if let Message::Binary(b) = socket.next().await.expect("open").expect("message") {
            let word = |at: usize| u32::from_le_bytes([b[at], b[at + 1], b[at + 2], b[at + 3]]);
            let json = &b[56 + 6 * word(48) as usize..];
            assert_eq!((b[0], json.len()), (1, word(52) as usize));
            return (word(4), serde_json::from_slice(json).expect("json"));
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_snapshot_comes_for_each_request_and_always_a_newer_one() {
    let (running, _dir) = served().await;
    let mut socket = display(&running).await;
    let (mut last, mut time) = (None, 0.0);
    for _ in 0..30 {
        let (sequence, json) = snapshot(&mut socket).await;
        assert!(last.is_none_or(|l| sequence > l), "{last:?} {sequence}");
        let now = json["time_s"].as_f64().expect("time");
        assert!(now > time);
        (last, time) = (Some(sequence), now);
    }
    // After a pause the newest comes, not the one that was new when the pause began.
    tokio::time::sleep(Duration::from_millis(400)).await;
    let (_, json) = snapshot(&mut socket).await;
    assert!(json["time_s"].as_f64().expect("time") >= time + 0.4);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stalled_display_delays_no_other_and_a_late_one_joins() {
    let (running, _dir) = served().await;
    // This one asks and asks, and never reads.
    let mut stalled = display(&running).await;
    for _ in 0..2000 {
        stalled.feed(Message::text("next")).await.expect("feed");
    }
    stalled.flush().await.expect("flush");
    let mut first = display(&running).await;
    let before = snapshot(&mut first).await.0;
    let start = Instant::now();
    for _ in 0..20 {
        snapshot(&mut first).await;
    }
    let mut late = display(&running).await;
    assert!(snapshot(&mut late).await.0 > before);
    // Far below the patience with the stalled one, far above what 20 snapshots take on a busy machine.
    assert!(start.elapsed() < Duration::from_secs(15));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_ticket_opens_one_display_only() {
    let (running, _dir) = served().await;
    let once = ticket(&running).await;
    assert!(connect(&running, &once).await.is_ok());
    assert!(matches!(connect(&running, &once).await, Err(Error::Http(r)) if r.status() == 401));
    assert!(matches!(connect(&running, "").await, Err(Error::Http(r)) if r.status() == 401));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_seventeenth_display_is_told_so_and_a_freed_seat_is_taken() {
    let (running, _dir) = served().await;
    let mut all = Vec::new();
    for _ in 0..16 {
        all.push(display(&running).await);
    }
    let one_more = connect(&running, &ticket(&running).await).await;
    assert!(matches!(one_more, Err(Error::Http(r)) if r.status() == 503));
    all.pop().expect("one").close(None).await.expect("closed");
    for _ in 0..100 {
        if let Ok(mut socket) = connect(&running, &ticket(&running).await).await {
            snapshot(&mut socket).await;
            return;
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    panic!("the seat was not given back");
}
