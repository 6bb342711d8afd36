//! A server with the scripted tracker, seen from outside.

#[path = "../common/mod.rs"]
mod common;
mod displays;
mod network;
mod recording;
mod tissue;
mod trackers;

use common::{options, request, write_case};
use monro_server::{Running, ServeError, start};
use monro_wire::openigtlink::{Content, Message, Parser, Verb};
use serde_json::Value;
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

struct Served {
    running: Running,
    _dir: tempfile::TempDir,
}

async fn serve(with_ct: bool) -> Served {
    let dir = tempfile::tempdir().expect("temp");
    let case = write_case(dir.path(), with_ct);
    Served { running: start(options(case)).await.expect("start"), _dir: dir }
}

impl Served {
    fn address(&self) -> &str {
        self.running.ready().url.strip_prefix("http://").expect("http")
    }

    fn head(&self, method: &str, path: &str) -> String {
        let token = &self.running.ready().token;
        format!("{method} {path} HTTP/1.1\r\nHost: {}\r\nAuthorization: Bearer {token}", self.address())
    }

    async fn get(&self, path: &str) -> Value {
        let (status, _, body) = request(self.address(), &self.head("GET", path), "").await;
        assert_eq!(status, 200, "{path}");
        serde_json::from_slice(&body).expect("json")
    }

    async fn post(&self, path: &str, body: &str) -> (u16, Value) {
        let head = format!("{}\r\nContent-Type: application/json", self.head("POST", path));
        let (status, _, body) = request(self.address(), &head, body).await;
        (status, serde_json::from_slice(&body).expect("json"))
    }

    async fn status(&self, head: &str) -> u16 {
        request(self.address(), head, "").await.0
    }

    async fn until(&self, wanted: impl Fn(&Value) -> bool) -> Value {
        for _ in 0..400 {
            let g = self.get("/api/guidance").await;
            if wanted(&g) {
                return g;
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        panic!("waited in vain; last: {}", self.get("/api/guidance").await);
    }
}

fn numbers(v: &Value) -> Vec<f64> {
    v.as_array().expect("array").iter().map(|x| x.as_f64().expect("number")).collect()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn numbers_move_vanish_when_lost_and_come_back() {
    let served = serve(false).await;
    let g = served.until(|g| g["state"] == "live" && g["depth_mm"].is_number()).await;
    assert_eq!((&g["phase"], &g["predicted_tre_mm"]), (&"navigating".into(), &0.0.into()));
    let first = g["depth_mm"].as_f64().expect("depth");
    let later = served.until(|g| g["depth_mm"].as_f64().is_some_and(|d| (d - first).abs() > 1.0)).await;
    let tip = numbers(&later["tip_lps_mm"]);
    let target = numbers(&served.get("/api/case").await["plan"]["target_lps_mm"]);
    let distance = tip.iter().zip(&target).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    let told = later["distance_to_target_rigid_mm"].as_f64().expect("distance");
    assert!((distance - told).abs() < 1e-9, "{distance} {told}");

    assert_eq!(served.post("/api/tracker", r#"{"paused":true}"#).await.0, 200);
    let lost = served.until(|g| g["state"] == "lost").await;
    for field in ["distance_to_target_mm", "distance_to_target_rigid_mm", "depth_mm", "in_ventricle", "tip_lps_mm"] {
        assert!(lost[field].is_null(), "{field}: {}", lost[field]);
    }
    assert!(lost["age_ms"].as_f64().is_some_and(|a| a >= 500.0));
    assert_eq!(served.post("/api/tracker", r#"{"paused":false}"#).await.0, 200);
    served.until(|g| g["state"] == "live" && g["depth_mm"].is_number()).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_procedure_follows_its_phases_and_refuses_with_a_way_out() {
    let served = serve(false).await;
    let (status, said) = served.post("/api/session", r#"{"event":"reference_moved"}"#).await;
    assert_eq!((status, &said["phase"]), (200, &"calibrated".into()));
    let (status, said) = served.post("/api/session", r#"{"event":"started"}"#).await;
    assert_eq!(status, 409);
    assert!(said["error"].as_str().is_some_and(|e| e.contains("first register the patient")), "{said}");
    assert!(served.get("/api/guidance").await["distance_to_target_mm"].is_null());
    let register =
        r#"{"event":"registered","quaternion_wxyz":[1,0,0,0],"translation_mm":[0,0,0],"predicted_tre_mm":1.5}"#;
    assert_eq!(served.post("/api/session", register).await.0, 200);
    assert_eq!(served.get("/api/guidance").await["predicted_tre_mm"], 1.5);
    for (bad, wanted) in [
        ("{", 400),
        (r#"{"event":"flown"}"#, 422),
        (r#"{"event":"registered","quaternion_wxyz":[0,0,0,0],"translation_mm":[0,0,0]}"#, 422),
        (r#"{"event":"calibrated","tip_mm":[0,0,0],"axis":[0,0,0]}"#, 422),
        // From the tip to the hub: it navigated, turned by 180 degrees.
        (r#"{"event":"calibrated","tip_mm":[2,-1,-180],"axis":[0,0,1]}"#, 422),
        (r#"{"event":"started","paused":true}"#, 422),
        (r#"{"event":"check_passed","x":1}"#, 422),
        // Ten kilometres, and an error of as many.
        (r#"{"event":"calibrated","tip_mm":[0,0,1e7],"axis":[0,0,1]}"#, 422),
        (r#"{"event":"registered","quaternion_wxyz":[1,0,0,0],"translation_mm":[1e9,0,0]}"#, 422),
        (r#"{"event":"registered","quaternion_wxyz":[1,0,0,0],"translation_mm":[0,0,0],"predicted_tre_mm":1e7}"#, 422),
        (r#"{"event":"registered","quaternion_wxyz":[1,0,0,0],"translation_mm":[0,0,0],"predicted_tre_mm":-1}"#, 422),
    ] {
        assert_eq!(served.post("/api/session", bad).await.0, wanted, "{bad}");
    }
    assert_eq!(served.post("/api/session", &"x".repeat(20 << 10)).await.0, 413);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_door_checks_token_host_and_origin() {
    let served = serve(false).await;
    let host = served.address().to_owned();
    let port = host.rsplit_once(':').expect("port").1.to_owned();
    let token = &served.running.ready().token;
    let line = |path: &str, host: &str, more: &str| format!("GET {path} HTTP/1.1\r\nHost: {host}{more}");
    let auth = format!("\r\nAuthorization: Bearer {token}");
    assert_eq!(served.status(&line("/", &host, "")).await, 200);
    assert_eq!(served.status(&line("/api/guidance", &host, &auth)).await, 200);
    assert_eq!(served.status(&line("/api/guidance", &format!("localhost:{port}"), &auth)).await, 200);
    for more in ["", "\r\nAuthorization: Bearer ", "\r\nAuthorization: Bearer 0123", "\r\nAuthorization: Basic x"] {
        for path in ["/api/guidance", "/api/ct", "/api/openapi.json", "/api/nothing", "/api", "/live"] {
            assert_eq!(served.status(&line(path, &host, more)).await, 401, "{path} {more}");
        }
    }
    assert_eq!(served.status(&line("/live?ticket=0123", &host, "")).await, 401);
    assert_eq!(served.status(&line("/api/guidance", "evil.example", &auth)).await, 421);
    assert_eq!(served.status(&line("/", &format!("evil.example:{port}"), "")).await, 421);
    let origin = |o: &str| format!("{auth}\r\nOrigin: {o}");
    assert_eq!(served.status(&line("/api/case", &host, &origin(&format!("http://{host}")))).await, 200);
    for bad in ["http://evil.example", "null", "http://127.0.0.1:1", &format!("https://{host}")] {
        assert_eq!(served.status(&line("/api/case", &host, &origin(bad))).await, 403, "{bad}");
    }
    // A page of another origin has no token, but it might have a ticket.
    for bad in ["http://evil.example", "null"] {
        let upgrade =
            "\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: bW9ucm8gYmVuY2ggbGl2ZQ==";
        let ticket = served.post("/api/ticket", "").await.1["ticket"].as_str().expect("ticket").to_owned();
        let path = format!("/live?ticket={ticket}");
        assert_eq!(served.status(&line(&path, &host, &format!("{upgrade}\r\nOrigin: {bad}"))).await, 403, "{bad}");
    }
    assert_eq!(served.status(&line("/api/nothing", &host, &auth)).await, 404);
    assert_eq!(served.status(&line("/nothing.js", &host, "")).await, 404);
    assert_eq!(served.status(&line("/../Cargo.toml", &host, "")).await, 404);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_flood_of_requests_is_told_to_wait() {
    const FLOOD: usize = 4000;
    let served = serve(false).await;
    let mut stream = TcpStream::connect(served.address()).await.expect("connect");
    let one = format!("GET /api/nothing HTTP/1.1\r\nHost: {}\r\n", served.address());
    let flood = format!("{one}\r\n").repeat(FLOOD - 1) + &one + "Connection: close\r\n\r\n";
    let (mut reading, mut writing) = stream.split();
    let mut answers = String::new();
    let (sent, read) = tokio::join!(writing.write_all(flood.as_bytes()), reading.read_to_string(&mut answers));
    assert!(sent.is_ok() && read.is_ok());
    let count = |status: &str| answers.matches(&format!("HTTP/1.1 {status}")).count();
    let (refused, waits) = (count("401"), count("429"));
    assert_eq!(refused + waits, FLOOD);
    // What is let through at once, and what comes again while the flood lasts.
    assert!(refused >= 1500 && waits > 0, "{refused} {waits}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_answer_carries_the_headers_of_a_closed_page() {
    let served = serve(false).await;
    let (_, headers, _) = request(served.address(), &format!("GET / HTTP/1.1\r\nHost: {}", served.address()), "").await;
    let headers = headers.to_ascii_lowercase();
    for wanted in ["content-security-policy: default-src 'self'", "x-content-type-options: nosniff", "cache-control:"] {
        assert!(headers.contains(wanted), "{wanted}: {headers}");
    }
}

/// Paths and methods of the router, read from where it is made: the router itself does not list them.
fn routes() -> Vec<(String, &'static str)> {
    let sources = [include_str!("../../src/api.rs"), include_str!("../../src/server.rs")];
    let preparing = include_str!("../../src/preparing/routes.rs").lines().filter(|l| l.contains("\"/api/prepare\""));
    let lines = sources
        .into_iter()
        .flat_map(str::lines)
        .chain(preparing)
        .filter_map(|l| l.split_once(".route(\"")?.1.split_once('"'));
    let methods = |rest: &'static str| {
        ["get", "post", "put", "delete", "patch"].map(|m| rest.contains(&format!("{m}(")).then_some(m))
    };
    let known = lines.filter(|(path, _)| !path.contains('{'));
    known
        .flat_map(|(path, rest)| methods(rest).into_iter().flatten().map(|m| (path.to_owned(), m)).collect::<Vec<_>>())
        .collect()
}

#[test]
fn every_route_is_documented_and_nothing_else() {
    let api: Value = serde_json::from_str(include_str!("../../src/openapi.json")).expect("json");
    let paths = api["paths"].as_object().expect("paths");
    let method = |m: &'static str, o: &Value| o.get(m).is_some();
    let all = ["get", "post", "put", "delete", "patch"];
    let mut documented: Vec<(String, &str)> =
        paths.iter().flat_map(|(p, o)| all.into_iter().filter(|m| method(m, o)).map(|m| (p.clone(), m))).collect();
    let mut there = routes();
    documented.sort();
    there.sort();
    assert!(there.len() > 12, "{there:?}");
    assert_eq!(documented, there);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_documented_path_is_there_and_answers_with_its_documented_fields() {
    let served = serve(true).await;
    let api = served.get("/api/openapi.json").await;
    for (path, methods) in api["paths"].as_object().expect("paths") {
        for method in methods.as_object().expect("methods").keys() {
            let status = served.status(&served.head(&method.to_ascii_uppercase(), path)).await;
            // An event without a body is refused for that, not for its path.
            // So is a WebSocket that is asked for as a page.
            let is_socket = path == "/live" && status == 400;
            // The made-up head has none, and is prepared already.
            let absent = ["/report", "/api/prepare"].contains(&path.as_str()) && status == 404;
            assert!(status == 200 || status == 415 || is_socket || absent, "{method} {path}: {status}");
        }
    }
    for (path, schema) in
        [("/api/guidance", "Guidance"), ("/api/case", "Case"), ("/api/status", "Status"), ("/api/tissue", "Tissue")]
    {
        let answer = served.get(path).await;
        let documented = &api["components"]["schemas"][schema];
        let mut names: Vec<&String> = answer.as_object().expect("object").keys().collect();
        let mut wanted: Vec<&String> = documented["properties"].as_object().expect("properties").keys().collect();
        names.sort();
        wanted.sort();
        assert_eq!(names, wanted, "{path}");
    }
    let (_, _, ct) = request(served.address(), &served.head("GET", "/api/ct"), "").await;
    assert_eq!(&ct[..4], b"MNRB");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_case_without_images_says_so() {
    let served = serve(false).await;
    assert_eq!(served.get("/api/case").await["has_ct"], false);
    let (status, _, body) = request(served.address(), &served.head("GET", "/api/ct"), "").await;
    assert_eq!(status, 404);
    assert!(String::from_utf8_lossy(&body).contains("without its images"));
}

#[tokio::test]
async fn a_folder_that_is_no_case_is_refused() {
    let dir = tempfile::tempdir().expect("temp");
    assert!(matches!(start(options(dir.path().to_owned())).await, Err(ServeError::Case(_))));
}

/// Reads messages until one of each kind has come; names and contents.
async fn until_all(stream: &mut TcpStream, wanted: &[&str]) -> Vec<Message> {
    let (mut parser, mut buffer, mut all) = (Parser::new(64 << 20), vec![0; 1 << 16], Vec::<Message>::new());
    while !wanted.iter().all(|w| all.iter().any(|m| m.device == *w)) {
        let count = stream.read(&mut buffer).await.expect("read");
        assert!(count > 0, "closed after {} messages", all.len());
        parser.push(&buffer[..count]);
        while let Some(message) = parser.next_message() {
            all.push(message.expect("message"));
        }
    }
    all
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn slicer_gets_catheter_deformed_ventricles_plan_numbers_and_ct() {
    let dir = tempfile::tempdir().expect("temp");
    let mut o = options(write_case(dir.path(), true));
    o.igtl = Some("127.0.0.1:0".parse().expect("address"));
    let served = Served { running: start(o).await.expect("start"), _dir: dir };
    let address = served.running.ready().igtl.expect("served");
    assert_eq!(served.get("/api/status").await["igtl"], address.to_string());
    served.until(|g| g["state"] == "live" && g["largest_displacement_mm"].as_f64().is_some_and(|d| d > 0.05)).await;
    let mut stream = TcpStream::connect(address).await.expect("connect");
    let all = until_all(&mut stream, &["CT", "Catheter", "Ventricles", "Plan", "Guidance", "Monro"]).await;
    let of = |device: &str| all.iter().find(|m| m.device == device).expect("sent");
    assert_eq!(of("Catheter").meta("TransformStatus"), Some("OK"));
    let (case, g) = (common::case(), served.get("/api/guidance").await);
    let Content::Transform(m) = &of("Catheter").content else { panic!("transform") };
    let tip = numbers(&g["tip_lps_mm"]);
    let off = f64::from(m.columns[3][0] + tip[0] as f32).hypot(f64::from(m.columns[3][2] - tip[2] as f32));
    // The hand moves on at no more than 20 mm/s while we ask.
    assert!(off < 20.0, "{off}");
    let Content::PolyData(mesh) = &of("Ventricles").content else { panic!("polydata") };
    assert_eq!(
        (mesh.points.len(), mesh.polygons.len()),
        (case.ventricles.vertices.len(), case.ventricles.triangles.len())
    );
    let moved =
        mesh.to_mesh().vertices.iter().zip(&case.ventricles.vertices).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    // The ventricles lie centimetres from where the tip presses first, and the message may be from then.
    assert!(moved > 1e-5 && moved < 30.0, "{moved}");
    let Content::Points(points) = &of("Plan").content else { panic!("point") };
    assert_eq!(points.iter().map(|p| p.name.as_str()).collect::<Vec<_>>(), ["Entry", "Target", "Target deformed"]);
    let Content::Text(text) = &of("Guidance").content else { panic!("string") };
    assert!(text.text.contains("live, navigating; to target"), "{}", text.text);
    let Content::Image(ct) = &of("CT").content else { panic!("image") };
    assert_eq!(ct.size, [64, 80, 60]);

    // Asked again, it comes again; a stalled peer has not delayed anybody.
    let query = Content::Query { verb: Verb::Get, of: "IMAGE".into(), stream: None };
    stream.write_all(&Message::v1("Slicer", None, query).encode().expect("query")).await.expect("ask");
    until_all(&mut stream, &["CT"]).await;

    // Who says too much is not listened to any more, but still shown what there is.
    let much = Message::v1("Slicer", None, Content::Image(ct.clone())).encode().expect("image");
    stream.write_all(&much).await.expect("say");
    for _ in 0..5 {
        until_all(&mut stream, &["Catheter", "Guidance", "Monro"]).await;
    }
}

#[tokio::test]
async fn openigtlink_for_others_is_refused() {
    let dir = tempfile::tempdir().expect("temp");
    let mut o = options(write_case(dir.path(), false));
    o.igtl = Some("0.0.0.0:0".parse().expect("address"));
    assert!(matches!(start(o).await, Err(ServeError::OpenIgtLink(_))));
}
