//! The WebSocket of snapshots. A display asks (with any message) for one snapshot and gets the newest as soon as there is
//! something that it has not seen: latest wins, nothing is queued, and each display waits only for itself. The word
//! `vertices` asks for the surfaces' vertices instead of the mesh's nodes.

use crate::live::Live;
use crate::server::Shared;
use crate::snapshot::Moved;
use axum::extract::State;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::http::StatusCode;
use axum::response::Response;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;
use tokio::time::timeout;

/// A snapshot comes at least this often, so that ages grow on the screen when nothing else happens.
const HEARTBEAT: Duration = Duration::from_millis(100);
/// A display that has not asked or not taken for this long is gone.
const PATIENCE: Duration = Duration::from_secs(30);
/// Requests are empty or a word.
const MOST_REQUEST_BYTES: usize = 1024;
/// Displays at a time.
const MOST_DISPLAYS: u32 = 16;

/// `GET /live`.
pub(crate) async fn upgrade(State(shared): State<Arc<Shared>>, ws: WebSocketUpgrade) -> Response {
    let Some(seat) = Seat::take(&shared.live) else {
        return crate::door::refuse(StatusCode::SERVICE_UNAVAILABLE, "too many displays; close one");
    };
    ws.max_message_size(MOST_REQUEST_BYTES).max_frame_size(MOST_REQUEST_BYTES).on_upgrade(move |socket| async move {
        // However it ends, the display can come back.
        let _ = show(socket, &seat.0).await;
        drop(seat);
    })
}

/// One display's place, given back when it goes.
struct Seat(Arc<Live>);

impl Seat {
    fn take(live: &Arc<Live>) -> Option<Self> {
        let taken =
            live.displays.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |n| (n < MOST_DISPLAYS).then_some(n + 1));
        taken.ok().map(|_| Self(Arc::clone(live)))
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.0.displays.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Why a display went.
#[derive(Debug)]
struct Gone;

async fn show(mut socket: WebSocket, live: &Live) -> Result<(), Gone> {
    let mut news = live.news();
    news.mark_changed();
    while !live.is_stopping() {
        let wanted = wait_for_request(&mut socket).await?;
        // Whichever comes first: something new, or the heartbeat.
        let _ = timeout(HEARTBEAT, news.changed()).await;
        news.borrow_and_update();
        let bytes = live.snapshot_for_display(wanted);
        timeout(PATIENCE, socket.send(Message::Binary(bytes.into()))).await.map_err(|_| Gone)?.map_err(|_| Gone)?;
    }
    Ok(())
}

async fn wait_for_request(socket: &mut WebSocket) -> Result<Moved, Gone> {
    loop {
        match timeout(PATIENCE, socket.recv()).await {
            Ok(Some(Ok(Message::Text(t)))) if t == "vertices" => return Ok(Moved::Vertices),
            Ok(Some(Ok(Message::Text(_) | Message::Binary(_)))) => return Ok(Moved::Nodes),
            Ok(Some(Ok(Message::Ping(_) | Message::Pong(_)))) => {}
            Ok(Some(Ok(Message::Close(_)) | Err(_)) | None) | Err(_) => return Err(Gone),
        }
    }
}
