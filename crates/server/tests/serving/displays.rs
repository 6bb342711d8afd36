//! Displays at the WebSocket: the newest wins, and a stalled one delays nobody.

use crate::common::{options, request, write_case};
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

/// The four bytes there, as a number.
fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

/// Asks for a snapshot and takes it.
async fn asked(socket: &mut Socket, with: &str) -> Vec<u8> {
    socket.send(Message::text(with)).await.expect("send");
    loop {
        if let Message::Binary(bytes) = socket.next().await.expect("open").expect("message") {
            return bytes.to_vec();
        }
    }
}

/// Sequence number and JSON of the next snapshot.
async fn snapshot(socket: &mut Socket) -> (u32, serde_json::Value) {
    let b = asked(socket, "next").await;
    let json = &b[56 + 6 * word(&b, 48) as usize..];
    assert_eq!((b[0], json.len()), (1, word(&b, 52) as usize));
    (word(&b, 4), serde_json::from_slice(json).expect("json"))
}

/// What a snapshot moves: displacements, mm, and half a quantum.
fn moved(b: &[u8]) -> (Vec<[f64; 3]>, f64) {
    let quantum = f64::from(f32::from_le_bytes([b[44], b[45], b[46], b[47]]));
    let value = |at: usize| f64::from(i16::from_le_bytes([b[at], b[at + 1]])) * quantum;
    let point = |i: usize| core::array::from_fn(|a| value(56 + 6 * i + 2 * a));
    ((0..word(b, 48) as usize).map(point).collect(), quantum / 2.0)
}

/// Nodes and weights of all vertices of the soft surfaces, as `/api/scene` tells them.
async fn bindings(running: &Running) -> Vec<[(usize, f64); 4]> {
    let address = running.ready().url.strip_prefix("http://").expect("http");
    let head = format!("GET /api/scene HTTP/1.1\r\nHost: {address}\r\nAuthorization: Bearer {}", running.ready().token);
    let (_, _, b) = request(address, &head, "").await;
    let start = 8 + word(&b, 4) as usize;
    let header: serde_json::Value = serde_json::from_slice(&b[8..start]).expect("json");
    let mut all = Vec::new();
    for surface in header["surfaces"].as_array().expect("surfaces") {
        let (Some(nodes), Some(weights)) = (surface["nodes_at"].as_u64(), surface["weights_at"].as_u64()) else {
            continue;
        };
        let at = |from: u64, i: usize| word(&b, start + from as usize + 4 * i);
        let one = |i: usize| (at(nodes, i) as usize, f64::from(f32::from_bits(at(weights, i))));
        let count = surface["vertices"].as_u64().expect("vertices") as usize;
        all.extend((0..count).map(|v| core::array::from_fn(|k| one(4 * v + k))));
    }
    all
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_display_that_cannot_move_surfaces_gets_their_vertices_moved() {
    let (running, _dir) = served().await;
    let (mut socket, bound) = (display(&running).await, bindings(&running).await);
    // Until the tissue has moved, and both snapshots show the same step of it.
    for _ in 0..2000 {
        let (nodes, whole) = (asked(&mut socket, "next").await, asked(&mut socket, "vertices").await);
        assert_eq!((nodes[3] & 4, whole[3] & 4), (0, 4));
        if word(&nodes, 40) != word(&whole, 40) {
            continue;
        }
        let ((nodes, half), (vertices, half_too)) = (moved(&nodes), moved(&whole));
        if nodes.as_flattened().iter().all(|d| d.abs() < 0.1) {
            continue;
        }
        assert_eq!(vertices.len(), bound.len());
        for (vertex, four) in vertices.iter().zip(&bound) {
            let weight = four.iter().map(|(_, w)| w.abs()).sum::<f64>();
            for (a, shown) in vertex.iter().enumerate() {
                let wanted = four.iter().map(|(n, w)| nodes[*n][a] * w).sum::<f64>();
                assert!((wanted - shown).abs() <= weight * half + half_too + 1e-5, "{wanted} {shown}");
            }
        }
        return;
    }
    panic!("the tissue never moved");
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
