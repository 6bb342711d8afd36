//! Serves on a bounded number of connections, with or without TLS; the next one waits in the system's queue. Handshakes go
//! on beside each other, and who does not finish a handshake or a request's headers in time gives the connection back.

use axum::extract::ConnectInfo;
use axum::{Extension, Router};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::future::Future;
use std::io;
use std::net::SocketAddr;
use std::pin::{Pin, pin};
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::task::JoinSet;
use tokio::time::{sleep, timeout};
use tokio_rustls::TlsAcceptor;
use tokio_rustls::server::TlsStream;

/// Connections at a time: browsers open up to six each.
const MOST_CONNECTIONS: usize = 96;
/// A handshake takes no longer.
const HANDSHAKE: Duration = Duration::from_secs(10);
/// Nor do the headers of a request, counted from the connection's beginning or the answer before.
const HEADERS: Duration = Duration::from_secs(15);
/// Pause when the system has no more sockets to give.
const PAUSE: Duration = Duration::from_millis(100);

/// Who is at the other end.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Peer(pub(crate) SocketAddr);

/// Serves until `stop`, then lets what has begun end. Dropped, it stops at once. With `tls`, nothing else is spoken.
pub(crate) async fn serve(
    listener: TcpListener,
    tls: Option<TlsAcceptor>,
    router: Router,
    stop: impl Future<Output = ()>,
) {
    serve_within(HEADERS, listener, tls, router, stop).await;
}

async fn serve_within(
    headers: Duration,
    listener: TcpListener,
    tls: Option<TlsAcceptor>,
    router: Router,
    stop: impl Future<Output = ()>,
) {
    let slots = Arc::new(Semaphore::new(MOST_CONNECTIONS));
    let (end, ending) = watch::channel(());
    let (mut open, mut stop) = (JoinSet::new(), pin!(stop));
    loop {
        let (stream, peer, slot) = tokio::select! {
            accepted = accept(&listener, &slots) => accepted,
            _ = open.join_next(), if !open.is_empty() => continue,
            () = &mut stop => break,
        };
        let (tls, router, ending) = (tls.clone(), router.clone(), ending.clone());
        open.spawn(async move {
            if let Some(connection) = Connection::begin(stream, tls, slot).await {
                talk(connection, headers, router.layer(Extension(ConnectInfo(Peer(peer)))), ending).await;
            }
        });
    }
    end.send_replace(());
    while open.join_next().await.is_some() {}
}

/// The next client, as soon as there is a place for one.
async fn accept(listener: &TcpListener, slots: &Arc<Semaphore>) -> (TcpStream, SocketAddr, OwnedSemaphorePermit) {
    loop {
        match (Arc::clone(slots).acquire_owned().await, listener.accept().await) {
            (Ok(slot), Ok((stream, peer))) => return (stream, peer, slot),
            _ => sleep(PAUSE).await,
        }
    }
}

/// Answers the requests of a connection.
async fn talk(connection: Connection, headers: Duration, router: Router, mut ending: watch::Receiver<()>) {
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(headers);
    let service = TowerToHyperService::new(router);
    let mut talking = pin!(http.serve_connection(TokioIo::new(connection), service).with_upgrades());
    // However a conversation ends, there is nobody left to be told.
    tokio::select! {
        _ = talking.as_mut() => {}
        _ = ending.changed() => {
            talking.as_mut().graceful_shutdown();
            let _ = talking.await;
        }
    }
}

#[derive(Debug)]
enum Stream {
    Plain(TcpStream),
    Tls(Box<TlsStream<TcpStream>>),
}

/// A connection that gives its slot back when it ends.
#[derive(Debug)]
pub(crate) struct Connection {
    stream: Stream,
    _slot: OwnedSemaphorePermit,
}

impl Connection {
    /// Who does not finish the handshake is not served, and the slot is given back.
    async fn begin(stream: TcpStream, tls: Option<TlsAcceptor>, slot: OwnedSemaphorePermit) -> Option<Self> {
        // Small messages go out at once; where the system does not allow that they go out later.
        let _ = stream.set_nodelay(true);
        let stream = match tls {
            None => Stream::Plain(stream),
            Some(tls) => Stream::Tls(Box::new(timeout(HANDSHAKE, tls.accept(stream)).await.ok()?.ok()?)),
        };
        Some(Self { stream, _slot: slot })
    }
}

impl AsyncRead for Connection {
    fn poll_read(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buf: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        match &mut self.stream {
            Stream::Plain(s) => Pin::new(s).poll_read(cx, buf),
            Stream::Tls(s) => Pin::new(s).poll_read(cx, buf),
        }
    }
}

impl AsyncWrite for Connection {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buf: &[u8]) -> Poll<io::Result<usize>> {
        match &mut self.stream {
            Stream::Plain(s) => Pin::new(s).poll_write(cx, buf),
            Stream::Tls(s) => Pin::new(s).poll_write(cx, buf),
        }
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        match &mut self.stream {
            Stream::Plain(s) => Pin::new(s).poll_flush(cx),
            Stream::Tls(s) => Pin::new(s).poll_flush(cx),
        }
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        match &mut self.stream {
            Stream::Plain(s) => Pin::new(s).poll_shutdown(cx),
            Stream::Tls(s) => Pin::new(s).poll_shutdown(cx),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::routing::get;
    use tokio::io::{AsyncReadExt, AsyncWriteExt};

    async fn served(headers: Duration) -> SocketAddr {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("bind");
        let address = listener.local_addr().expect("address");
        let router = Router::new().route("/", get(async || "here"));
        tokio::spawn(serve_within(headers, listener, None, router, std::future::pending()));
        address
    }

    async fn begun(address: SocketAddr) -> TcpStream {
        let mut stream = TcpStream::connect(address).await.expect("connect");
        stream.write_all(b"GET / HTTP/1.1\r\nHost: x\r\nX-Slow: ").await.expect("send");
        stream
    }

    async fn answer(address: SocketAddr) -> String {
        let mut stream = TcpStream::connect(address).await.expect("connect");
        stream.write_all(b"GET / HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n").await.expect("send");
        let mut text = String::new();
        stream.read_to_string(&mut text).await.expect("an answer");
        text
    }

    /// As many as there are connections begin a request and never end it: the next client used to wait for ever.
    #[tokio::test]
    async fn clients_that_never_finish_their_headers_hold_no_connection() {
        let address = served(Duration::from_millis(200)).await;
        let mut slow = Vec::new();
        for _ in 0..MOST_CONNECTIONS {
            slow.push(begun(address).await);
        }
        assert!(answer(address).await.ends_with("here"));
        // They are told, or cut off, but not kept.
        for mut stream in slow {
            let mut rest = Vec::new();
            let _ = stream.read_to_end(&mut rest).await;
        }
    }

    #[tokio::test]
    async fn a_client_that_trickles_its_headers_is_cut_off() {
        let address = served(Duration::from_millis(200)).await;
        let mut stream = begun(address).await;
        while stream.write_all(b"a").await.is_ok() {
            sleep(Duration::from_millis(20)).await;
        }
    }

    #[tokio::test]
    async fn more_clients_than_connections_wait_for_a_place() {
        let address = served(HEADERS).await;
        let mut slow = Vec::new();
        for _ in 0..MOST_CONNECTIONS {
            slow.push(begun(address).await);
        }
        let waiting = tokio::spawn(answer(address));
        assert!(
            timeout(Duration::from_millis(200), async {
                while !waiting.is_finished() {
                    sleep(PAUSE).await;
                }
            })
            .await
            .is_err()
        );
        slow.pop();
        assert!(waiting.await.expect("served").ends_with("here"));
    }
}
