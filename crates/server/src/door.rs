//! Who may come in: `Host` and `Origin` are ours, the API wants the bearer token, the WebSocket a one-time ticket
//! (browsers cannot set headers there).

use axum::extract::{Request, State};
use axum::http::header::{AUTHORIZATION, HOST, ORIGIN};
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use serde_json::json;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A ticket is for the next moment.
const TICKET_LIFE: Duration = Duration::from_secs(30);
/// Tickets that can wait at a time; the oldest goes first.
const MOST_TICKETS: usize = 64;
/// Random bytes of a token: 128 bits.
const TOKEN_BYTES: usize = 16;

/// The keys of one run of the server.
#[derive(Debug)]
pub(crate) struct Keys {
    token: String,
    tickets: Mutex<Vec<(String, Instant)>>,
}

/// 32 random hexadecimal digits.
fn random() -> Result<String, getrandom::Error> {
    let mut bytes = [0; TOKEN_BYTES];
    getrandom::fill(&mut bytes)?;
    Ok(bytes.iter().map(|b| format!("{b:02x}")).collect())
}

/// Compares in a time that does not tell how much is right.
fn equal(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |d, (x, y)| d | (x ^ y)) == 0
}

impl Keys {
    /// New keys.
    pub(crate) fn new() -> Result<Self, getrandom::Error> {
        Ok(Self { token: random()?, tickets: Mutex::default() })
    }

    /// The bearer token.
    pub(crate) fn token(&self) -> &str {
        &self.token
    }

    /// A ticket for one WebSocket.
    pub(crate) fn ticket(&self) -> Result<String, getrandom::Error> {
        let ticket = random()?;
        let mut tickets = self.tickets.lock().unwrap_or_else(PoisonError::into_inner);
        tickets.retain(|(_, made)| made.elapsed() < TICKET_LIFE);
        if tickets.len() >= MOST_TICKETS {
            tickets.remove(0);
        }
        tickets.push((ticket.clone(), Instant::now()));
        Ok(ticket)
    }

    /// Takes a ticket back; it is good once.
    fn redeem(&self, ticket: &str) -> bool {
        let mut tickets = self.tickets.lock().unwrap_or_else(PoisonError::into_inner);
        tickets.retain(|(_, made)| made.elapsed() < TICKET_LIFE);
        let found = tickets.iter().position(|(t, _)| equal(t, ticket));
        found.map(|i| tickets.remove(i)).is_some()
    }

    fn has_token(&self, headers: &HeaderMap) -> bool {
        let value = headers.get(AUTHORIZATION).and_then(|v| v.to_str().ok()).unwrap_or("");
        value.strip_prefix("Bearer ").is_some_and(|t| equal(t, &self.token))
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

/// Only addresses and `localhost` are ours: a name that resolves to this machine is a DNS rebinding.
fn is_own_host(host: &str) -> bool {
    let name = match host.strip_prefix('[').and_then(|h| h.split_once(']')) {
        Some((v6, _)) => v6,
        None => host.rsplit_once(':').map_or(host, |(name, _)| name),
    };
    name.eq_ignore_ascii_case("localhost") || name.parse::<IpAddr>().is_ok()
}

/// The middleware at the door.
pub(crate) async fn guard(State(keys): State<Arc<Keys>>, request: Request, next: Next) -> Response {
    let headers = request.headers();
    let text = |name| headers.get(name).and_then(|v: &axum::http::HeaderValue| v.to_str().ok());
    let Some(host) = text(HOST).filter(|h| is_own_host(h)) else {
        return refuse(
            StatusCode::MISDIRECTED_REQUEST,
            "this Host is not served here; use the address that was printed",
        );
    };
    if headers.contains_key(ORIGIN) && text(ORIGIN) != Some(&format!("http://{host}")) {
        return refuse(StatusCode::FORBIDDEN, "requests from pages of another origin are refused");
    }
    let path = request.uri().path();
    let allowed = match path {
        "/live" | "/desk" => keys.has_token(headers) || keys.has_ticket(request.uri()),
        p if p == "/api" || p.starts_with("/api/") => keys.has_token(headers),
        _ => true,
    };
    if !allowed {
        return refuse(
            StatusCode::UNAUTHORIZED,
            "the access token is missing or wrong; use the one that was printed at start",
        );
    }
    next.run(request).await
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ticket_is_good_once_and_no_other_is() {
        let keys = Keys::new().expect("random");
        let ticket = keys.ticket().expect("random");
        assert!(!keys.redeem("") && !keys.redeem(keys.token()));
        assert!(keys.redeem(&ticket) && !keys.redeem(&ticket));
        (0..MOST_TICKETS).for_each(|_| assert!(keys.ticket().is_ok()));
        let last = keys.ticket().expect("random");
        assert!(keys.redeem(&last));
    }

    #[test]
    fn only_addresses_and_localhost_are_our_host() {
        for good in ["127.0.0.1:80", "127.0.0.1", "localhost:8080", "LOCALHOST", "[::1]:80", "192.168.1.5:1"] {
            assert!(is_own_host(good), "{good}");
        }
        for bad in ["evil.example", "evil.example:80", "localhost.evil.example:80", "", ":80", "[evil]:80"] {
            assert!(!is_own_host(bad), "{bad}");
        }
    }
}
