//! A server that others can reach: encryption, pairing, roles, limits.

use crate::common::{exchange, options, write_case};
use futures_util::{SinkExt, StreamExt};
use monro_server::{Certificate, Running, ServeError, ServeOptions, start};
use rustls::pki_types::{CertificateDer, ServerName};
use rustls::{ClientConfig, RootCertStore};
use serde_json::{Value, json};
use std::sync::Arc;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;
use tokio_rustls::client::TlsStream;
use tokio_tungstenite::client_async;
use tokio_tungstenite::tungstenite::{Error, Message};

struct Served {
    running: Running,
    dir: tempfile::TempDir,
}

async fn serve(change: impl FnOnce(&mut ServeOptions)) -> Served {
    let dir = tempfile::tempdir().expect("temp");
    let mut o = options(write_case(dir.path(), false));
    o.listen = "0.0.0.0:0".parse().expect("address");
    change(&mut o);
    Served { running: start(o).await.expect("start"), dir }
}

impl Served {
    fn address(&self) -> String {
        let port = self.running.ready().url.rsplit_once(':').expect("port").1;
        format!("127.0.0.1:{port}")
    }

    /// A connection over TLS that trusts the server's certificate and nothing else.
    async fn connect(&self) -> TlsStream<TcpStream> {
        let mut roots = RootCertStore::empty();
        let certificate = self.running.ready().invitation.as_ref().expect("encrypted").certificate.clone();
        roots.add(CertificateDer::from(certificate)).expect("certificate");
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let config =
            ClientConfig::builder_with_provider(provider).with_safe_default_protocol_versions().expect("versions");
        let config = config.with_root_certificates(roots).with_no_client_auth();
        let stream = TcpStream::connect(self.address()).await.expect("connect");
        let name = ServerName::try_from("localhost").expect("name");
        TlsConnector::from(Arc::new(config)).connect(name, stream).await.expect("handshake")
    }

    /// Status and JSON of a request.
    async fn ask(&self, method: &str, path: &str, token: &str, body: &str) -> (u16, Value) {
        let head = format!(
            "{method} {path} HTTP/1.1\r\nHost: {}\r\nAuthorization: Bearer {token}\r\nContent-Type: application/json",
            self.address()
        );
        let (status, _, body) = exchange(self.connect().await, &head, body).await;
        (status, serde_json::from_slice(&body).unwrap_or_default())
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_others_can_reach_speaks_tls_only() {
    let served = serve(|_| ()).await;
    let ready = served.running.ready();
    assert!(ready.url.starts_with("https://") && !ready.url.contains("0.0.0.0"), "{}", ready.url);
    assert_eq!(served.ask("GET", "/api/status", &ready.token, "").await.0, 200);
    let mut plain = TcpStream::connect(served.address()).await.expect("connect");
    let request = format!(
        "GET /api/status HTTP/1.1\r\nHost: {}\r\nAuthorization: Bearer {}\r\n\r\n",
        served.address(),
        ready.token
    );
    plain.write_all(request.as_bytes()).await.expect("send");
    let mut answer = Vec::new();
    // An alert of TLS, or nothing.
    let _ = plain.read_to_end(&mut answer).await;
    assert!(!String::from_utf8_lossy(&answer).contains("tracker"), "{answer:?}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn snapshots_come_over_tls_to_who_has_a_ticket() {
    let served = serve(|_| ()).await;
    let (_, ticket) = served.ask("POST", "/api/ticket", &served.running.ready().token, "").await;
    let url = format!("wss://{}/live?ticket={}", served.address(), ticket["ticket"].as_str().expect("ticket"));
    let (mut socket, _) = client_async(&url, served.connect().await).await.expect("a display");
    socket.send(Message::text("next")).await.expect("send");
    let snapshot = socket.next().await.expect("open").expect("message").into_data();
    assert!(snapshot.len() > 56 && snapshot[0] == 1, "{}", snapshot.len());
    let again = client_async(&url, served.connect().await).await;
    assert!(matches!(again, Err(Error::Http(r)) if r.status() == 401), "a ticket is good once");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_paired_device_may_look_once_per_code_and_not_touch() {
    let served = serve(|_| ()).await;
    let ready = served.running.ready();
    let invitation = ready.invitation.as_ref().expect("encrypted");
    assert!(invitation.url.ends_with(&format!("/#pair={}", invitation.code)));
    let code = json!({ "code": invitation.code }).to_string();
    let (status, paired) = served.ask("POST", "/api/pair", "", &code).await;
    assert_eq!((status, &paired["role"]), (200, &json!("viewer")));
    assert_eq!(served.ask("POST", "/api/pair", "", &code).await.0, 401, "good once");
    let viewer = paired["token"].as_str().expect("token");
    assert_ne!(viewer, ready.token);
    for path in ["/api/guidance", "/api/case", "/api/scene"] {
        assert_eq!(served.ask("GET", path, viewer, "").await.0, 200, "{path}");
    }
    assert_eq!(served.ask("POST", "/api/ticket", viewer, "").await.0, 200);
    for (path, body) in [
        ("/api/session", r#"{"event":"stopped"}"#),
        ("/api/tracker", r#"{"paused":true}"#),
        ("/api/pairing", r#"{"role":"operator"}"#),
    ] {
        let (status, said) = served.ask("POST", path, viewer, body).await;
        assert!(
            status == 403 && said["error"].as_str().is_some_and(|e| e.contains("operator")),
            "{path} {status} {said}"
        );
    }
    // The operator lets a second operator in.
    let (status, offered) = served.ask("POST", "/api/pairing", &ready.token, r#"{"role":"operator"}"#).await;
    assert_eq!(status, 200);
    let code = json!({ "code": offered["code"] }).to_string();
    let (_, paired) = served.ask("POST", "/api/pair", "", &code).await;
    let second = paired["token"].as_str().expect("token");
    assert_eq!(served.ask("POST", "/api/session", second, r#"{"event":"stopped"}"#).await.0, 200);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_certificate_from_files_is_used_and_a_faulty_one_named() {
    let made = rcgen::generate_simple_self_signed(vec!["localhost".to_owned()]).expect("certificate");
    let folder = tempfile::tempdir().expect("temp");
    let (cert, key) = (folder.path().join("c.pem"), folder.path().join("k.pem"));
    let pem = |tag: &str, der: &[u8]| {
        use base64::Engine;
        let text = base64::engine::general_purpose::STANDARD.encode(der);
        let lines: Vec<_> = text.as_bytes().chunks(64).map(|c| String::from_utf8_lossy(c).into_owned()).collect();
        format!("-----BEGIN {tag}-----\n{}\n-----END {tag}-----\n", lines.join("\n"))
    };
    std::fs::write(&cert, pem("CERTIFICATE", made.cert.der())).expect("write");
    std::fs::write(&key, pem("PRIVATE KEY", &made.signing_key.serialize_der())).expect("write");
    let files = Certificate::Files { cert: cert.clone(), key: key.clone() };
    let served = serve(|o| {
        o.listen = "127.0.0.1:0".parse().expect("address");
        o.certificate = Some(files);
    })
    .await;
    assert_eq!(served.running.ready().invitation.as_ref().expect("encrypted").certificate, made.cert.der().to_vec());
    assert_eq!(served.ask("GET", "/api/case", &served.running.ready().token, "").await.0, 200);
    let mut o = options(served.dir.path().join("case"));
    o.certificate = Some(Certificate::Files { cert: key, key: cert });
    assert!(matches!(start(o).await, Err(ServeError::Certificate(why)) if why.contains(".pem")));
}
