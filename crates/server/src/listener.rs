//! Serves on a bounded number of connections, with or without TLS; the next one waits in the system's queue, and one address
//! cannot hold them all. Handshakes go on beside each other. Who does not finish a handshake or a request's headers in time,
//! or does not take what it has asked for, gives the connection back.

use crate::connection::Connection;
use crate::places::{Place, Places};
use axum::extract::ConnectInfo;
use axum::{Extension, Router};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::future::Future;
use std::net::SocketAddr;
use std::pin::pin;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;
use tokio::task::JoinSet;
use tokio::time::sleep;
use tokio_rustls::TlsAcceptor;

/// What a client is waited for.
#[derive(Debug, Clone, Copy)]
struct Patience {
    /// The headers of a request, counted from the connection's beginning or the answer before.
    headers: Duration,
    /// Taking a part of what it has asked for.
    taking: Duration,
}

const PATIENCE: Patience = Patience { headers: Duration::from_secs(15), taking: Duration::from_secs(20) };
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
    serve_within(PATIENCE, listener, tls, router, stop).await;
}

async fn serve_within(
    patience: Patience,
    listener: TcpListener,
    tls: Option<TlsAcceptor>,
    router: Router,
    stop: impl Future<Output = ()>,
) {
    let places = Places::default();
    let (end, ending) = watch::channel(());
    let (mut open, mut stop) = (JoinSet::new(), pin!(stop));
    loop {
        let (stream, peer, place) = tokio::select! {
            accepted = accept(&listener, &places) => accepted,
            _ = open.join_next(), if !open.is_empty() => continue,
            () = &mut stop => break,
        };
        let (tls, router, ending) = (tls.clone(), router.clone(), ending.clone());
        open.spawn(async move {
            if let Some(connection) = Connection::begin(stream, tls, patience.taking, place).await {
                talk(connection, patience.headers, router.layer(Extension(ConnectInfo(Peer(peer)))), ending).await;
            }
        });
    }
    end.send_replace(());
    while open.join_next().await.is_some() {}
}

/// The next client, as soon as there is a place for one. Who holds too many already is hung up on.
async fn accept(listener: &TcpListener, places: &Places) -> (TcpStream, SocketAddr, Place) {
    loop {
        let Some(free) = places.free().await else { continue };
        match listener.accept().await {
            Ok((stream, peer)) => {
                if let Some(place) = places.take(free, peer.ip().to_canonical()) {
                    return (stream, peer, place);
                }
            }
            Err(_) => sleep(PAUSE).await,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::places::{MOST_CONNECTIONS, MOST_OF_ONE};
    use axum::routing::get;
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    use tokio::net::TcpSocket;
    use tokio::time::timeout;

    const SHORT: Duration = Duration::from_millis(200);
    const IMPATIENT: Patience = Patience { headers: SHORT, taking: SHORT };
    /// More than the system buffers for a client that does not read.
    const LARGE: usize = 32 << 20;

    async fn served(patience: Patience) -> SocketAddr {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("bind");
        let address = listener.local_addr().expect("address");
        let router = Router::new().route("/", get(async || "here")).route("/large", get(async || vec![0u8; LARGE]));
        tokio::spawn(serve_within(patience, listener, None, router, std::future::pending()));
        address
    }

    /// Connects as the `n`th client, of which each loopback address has its share, and says something.
    async fn said(address: SocketAddr, n: usize, words: &[u8]) -> TcpStream {
        let socket = TcpSocket::new_v4().expect("a socket");
        let own = SocketAddr::from(([127, 0, 0, 1 + u8::try_from(n / MOST_OF_ONE).expect("few")], 0));
        socket.bind(own).expect("an address of the loopback");
        let mut stream = socket.connect(address).await.expect("connect");
        stream.write_all(words).await.expect("send");
        stream
    }

    async fn begun(address: SocketAddr, n: usize) -> TcpStream {
        said(address, n, b"GET / HTTP/1.1\r\nHost: x\r\nX-Slow: ").await
    }

    async fn answer(address: SocketAddr, n: usize) -> String {
        let mut stream = said(address, n, b"GET / HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n").await;
        let mut text = String::new();
        stream.read_to_string(&mut text).await.expect("an answer");
        text
    }

    async fn is_waiting<T>(task: &tokio::task::JoinHandle<T>) -> bool {
        let ends = async {
            while !task.is_finished() {
                sleep(SHORT / 10).await;
            }
        };
        timeout(SHORT, ends).await.is_err()
    }

    /// As many as there are connections begin a request and never end it: the next client used to wait for ever.
    #[tokio::test]
    async fn clients_that_never_finish_their_headers_hold_no_connection() {
        let address = served(IMPATIENT).await;
        let mut slow = Vec::new();
        for n in 0..MOST_CONNECTIONS {
            slow.push(begun(address, n).await);
        }
        assert!(answer(address, MOST_CONNECTIONS).await.ends_with("here"));
        // They are told, or cut off, but not kept.
        for mut stream in slow {
            let mut rest = Vec::new();
            let _ = stream.read_to_end(&mut rest).await;
        }
    }

    /// They ask for much and read nothing: the next client used to wait for ever.
    #[tokio::test]
    async fn clients_that_never_read_hold_no_connection() {
        let address = served(Patience { taking: SHORT, ..PATIENCE }).await;
        let mut deaf = Vec::new();
        for n in 0..MOST_CONNECTIONS {
            deaf.push(said(address, n, b"GET /large HTTP/1.1\r\nHost: x\r\n\r\n").await);
        }
        let text = timeout(PATIENCE.taking, answer(address, MOST_CONNECTIONS)).await.expect("a place in time");
        assert!(text.ends_with("here"));
    }

    #[tokio::test]
    async fn a_client_that_takes_a_while_gets_all_of_it() {
        let address = served(Patience { taking: SHORT, ..PATIENCE }).await;
        let mut slow = said(address, 0, b"GET /large HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n").await;
        let (mut part, mut taken) = (vec![0; LARGE / 8], 0);
        loop {
            match slow.read(&mut part).await.expect("a part") {
                0 => break,
                count => taken += count,
            }
            sleep(SHORT / 20).await;
        }
        assert!(taken > LARGE, "{taken}");
    }

    #[tokio::test]
    async fn a_client_that_trickles_its_headers_is_cut_off() {
        let address = served(IMPATIENT).await;
        let mut stream = begun(address, 0).await;
        let trickle = async {
            while stream.write_all(b"a").await.is_ok() {
                sleep(SHORT / 10).await;
            }
        };
        timeout(100 * SHORT, trickle).await.expect("cut off");
    }

    #[tokio::test]
    async fn more_clients_than_connections_wait_for_a_place() {
        let address = served(PATIENCE).await;
        let mut slow = Vec::new();
        for n in 0..MOST_CONNECTIONS {
            slow.push(begun(address, n).await);
        }
        let waiting = tokio::spawn(answer(address, MOST_CONNECTIONS));
        assert!(is_waiting(&waiting).await);
        slow.pop();
        assert!(waiting.await.expect("served").ends_with("here"));
    }

    #[tokio::test]
    async fn one_address_cannot_shut_the_others_out() {
        let address = served(PATIENCE).await;
        let mut slow = Vec::new();
        for _ in 0..MOST_OF_ONE {
            slow.push(begun(address, 0).await);
        }
        // Its next connection is hung up on, however often it tries; another address is served.
        for _ in 0..MOST_CONNECTIONS {
            let mut refused = begun(address, 0).await;
            assert!(!matches!(refused.read(&mut [0; 64]).await, Ok(1..)));
        }
        assert!(answer(address, MOST_OF_ONE).await.ends_with("here"));
    }
}
