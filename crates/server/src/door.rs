//! Who may come in: `Host` and `Origin` are ours, the API wants a bearer token, the WebSocket a one-time ticket (browsers
//! cannot set headers there). A viewer's token may look at everything and change nothing; an operator's may do both.

use crate::limit::Limits;
use crate::listener::Peer;
use crate::lock::lock;
use crate::pairing::Pairing;
use axum::extract::{ConnectInfo, Request, State};
use axum::http::header::{AUTHORIZATION, HOST, ORIGIN};
use axum::http::{HeaderMap, Method, StatusCode, Uri};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};
use tokio::time::timeout;

/// Time for a request without a token.
const STRANGER: Duration = Duration::from_secs(10);
/// A ticket is for the next moment.
const TICKET_LIFE: Duration = Duration::from_secs(30);
/// Tickets that can wait at a time; the oldest goes first.
const MOST_TICKETS: usize = 64;
/// Random bytes of a token: 128 bits.
const TOKEN_BYTES: usize = 16;

/// What a token allows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Role {
    /// To look.
    Viewer,
    /// To look and to change.
    Operator,
}

/// The keys of one run of the server.
#[derive(Debug)]
pub(crate) struct Keys {
    operator: String,
    viewer: String,
    tickets: Mutex<Vec<(String, Instant)>>,
    pairing: Mutex<Pairing>,
}

/// 32 random hexadecimal digits.
fn random() -> Result<String, getrandom::Error> {
    let mut bytes = [0; TOKEN_BYTES];
    getrandom::fill(&mut bytes)?;
    Ok(bytes.iter().map(|b| format!("{b:02x}")).collect())
}

/// Compares in a time that does not tell how much is right.
pub(crate) fn equal(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |d, (x, y)| d | (x ^ y)) == 0
}

impl Keys {
    /// New keys.
    pub(crate) fn new() -> Result<Self, getrandom::Error> {
        let (tickets, pairing) = (Mutex::default(), Mutex::default());
        Ok(Self { operator: random()?, viewer: random()?, tickets, pairing })
    }

    /// The bearer token of a role.
    pub(crate) fn token(&self, role: Role) -> &str {
        match role {
            Role::Viewer => &self.viewer,
            Role::Operator => &self.operator,
        }
    }

    /// The codes for pairing.
    pub(crate) fn pairing(&self) -> MutexGuard<'_, Pairing> {
        lock(&self.pairing)
    }

    /// A ticket for one WebSocket.
    pub(crate) fn ticket(&self) -> Result<String, getrandom::Error> {
        let ticket = random()?;
        let mut tickets = lock(&self.tickets);
        tickets.retain(|(_, made)| made.elapsed() < TICKET_LIFE);
        if tickets.len() >= MOST_TICKETS {
            tickets.remove(0);
        }
        tickets.push((ticket.clone(), Instant::now()));
        Ok(ticket)
    }

    /// Takes a ticket back; it is good once.
    fn redeem(&self, ticket: &str) -> bool {
        let mut tickets = lock(&self.tickets);
        tickets.retain(|(_, made)| made.elapsed() < TICKET_LIFE);
        let found = tickets.iter().position(|(t, _)| equal(t, ticket));
        found.map(|i| tickets.remove(i)).is_some()
    }

    /// What the token of a request allows.
    pub(crate) fn role(&self, headers: &HeaderMap) -> Option<Role> {
        let token = headers.get(AUTHORIZATION)?.to_str().ok()?.strip_prefix("Bearer ")?;
        [Role::Operator, Role::Viewer].into_iter().find(|r| equal(token, self.token(*r)))
    }

    fn has_ticket(&self, uri: &Uri) -> bool {
        let query = uri.query().unwrap_or("");
        query.split('&').find_map(|p| p.strip_prefix("ticket=")).is_some_and(|t| self.redeem(t))
    }
}

/// A refusal as JSON.
pub(crate) fn refuse(status: StatusCode, message: &str) -> Response {
    (status, axum::Json(json!({ "error": message }))).into_response()
}

/// The answer to `POST /api/ticket`.
pub(crate) fn ticket(keys: &Keys) -> Response {
    match keys.ticket() {
        Ok(ticket) => axum::Json(json!({ "ticket": ticket })).into_response(),
        Err(e) => refuse(StatusCode::INTERNAL_SERVER_ERROR, &format!("no random numbers: {e}")),
    }
}

/// Only addresses, `localhost` and the names that the user has given are ours: any other name that resolves to this machine
/// is a DNS rebinding.
fn is_own_host(host: &str, names: &[String]) -> bool {
    let name = match host.strip_prefix('[').and_then(|h| h.split_once(']')) {
        Some((v6, _)) => v6,
        None => host.rsplit_once(':').map_or(host, |(name, _)| name),
    };
    let own = |known: &str| name.eq_ignore_ascii_case(known);
    own("localhost") || names.iter().any(|n| own(n)) || name.parse::<IpAddr>().is_ok()
}

/// What the door knows.
#[derive(Debug)]
pub(crate) struct Door {
    pub(crate) keys: Arc<Keys>,
    /// `http` or `https`.
    pub(crate) scheme: &'static str,
    /// Names of this machine that the user has given.
    pub(crate) names: Vec<String>,
    pub(crate) limits: Limits,
}

/// The middleware at the door.
pub(crate) async fn guard(
    State(door): State<Arc<Door>>,
    ConnectInfo(Peer(peer)): ConnectInfo<Peer>,
    request: Request,
    next: Next,
) -> Response {
    if !door.limits.allows(peer.ip(), Instant::now()) {
        return refuse(StatusCode::TOO_MANY_REQUESTS, "too many requests from this address; wait a second");
    }
    // Whoever has no token yet may not take long to say the code.
    let is_stranger = request.uri().path() == "/api/pair";
    match door.admits(&request) {
        Ok(()) if is_stranger => timeout(STRANGER, next.run(request))
            .await
            .unwrap_or_else(|_| refuse(StatusCode::REQUEST_TIMEOUT, "the pairing code did not come in time")),
        Ok(()) => next.run(request).await,
        Err((status, why)) => refuse(status, why),
    }
}

impl Door {
    /// The door of a server for this machine only.
    pub(crate) fn on_loopback(keys: Arc<Keys>) -> Self {
        Self { keys, scheme: "http", names: Vec::new(), limits: Limits::default() }
    }

    fn admits(&self, request: &Request) -> Result<(), (StatusCode, &'static str)> {
        let headers = request.headers();
        let text = |name| headers.get(name).and_then(|v: &axum::http::HeaderValue| v.to_str().ok());
        let Some(host) = text(HOST).filter(|h| is_own_host(h, &self.names)) else {
            let why = "this Host is not served here; use the address that was printed, or give the name with --host";
            return Err((StatusCode::MISDIRECTED_REQUEST, why));
        };
        if headers.contains_key(ORIGIN) && text(ORIGIN) != Some(&format!("{}://{host}", self.scheme)) {
            return Err((StatusCode::FORBIDDEN, "requests from pages of another origin are refused"));
        }
        let (path, role) = (request.uri().path(), self.keys.role(headers));
        let looks = [Method::GET, Method::HEAD].contains(request.method());
        let is_known = match path {
            "/live" | "/desk" | "/report" => role.is_some() || self.keys.has_ticket(request.uri()),
            "/api/pair" => true,
            p if p == "/api" || p.starts_with("/api/") => role.is_some(),
            _ => true,
        };
        if !is_known {
            let why = "the access token is missing or wrong; use the one that was printed at start";
            return Err((StatusCode::UNAUTHORIZED, why));
        }
        let harmless = looks || matches!(path, "/api/ticket" | "/api/pair");
        if !harmless && role != Some(Role::Operator) {
            return Err((StatusCode::FORBIDDEN, "a viewer may look, not change; pair this device as operator"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ticket_is_good_once_and_no_other_is() {
        let keys = Keys::new().expect("random");
        let ticket = keys.ticket().expect("random");
        assert!(!keys.redeem("") && !keys.redeem(keys.token(Role::Operator)));
        assert!(keys.redeem(&ticket) && !keys.redeem(&ticket));
        (0..MOST_TICKETS).for_each(|_| assert!(keys.ticket().is_ok()));
        let last = keys.ticket().expect("random");
        assert!(keys.redeem(&last));
    }

    #[test]
    fn only_addresses_and_localhost_are_our_host() {
        for good in ["127.0.0.1:80", "127.0.0.1", "localhost:8080", "LOCALHOST", "[::1]:80", "192.168.1.5:1"] {
            assert!(is_own_host(good, &[]), "{good}");
        }
        for bad in ["evil.example", "evil.example:80", "localhost.evil.example:80", "", ":80", "[evil]:80"] {
            assert!(!is_own_host(bad, &["theatre.local".into()]), "{bad}");
        }
        assert!(is_own_host("Theatre.local:443", &["theatre.local".into()]));
    }
}
