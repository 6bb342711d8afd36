//! HTTP and WebSocket of the editor.

use super::rebuild;
use super::request;
use super::work::Work;
use super::{Shared, export};
use crate::door::{self, Door, refuse};
use crate::listener;
use crate::lock::lock;
use crate::{headers, web};
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{DefaultBodyLimit, Query, State};
use axum::http::StatusCode;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router, middleware};
use monro_anatomy::desk::{View, views};
use monro_case::Confidence;
use monro_geometry::Structure;
use serde::Deserialize;
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use tokio::net::TcpListener;

/// A brush stroke of some thousand points fits.
const MOST_MESSAGE_BYTES: usize = 256 << 10;

pub(super) async fn run(shared: Arc<Shared>, listener: TcpListener) {
    listener::serve(listener, None, router(shared), std::future::pending()).await;
}

fn router(shared: Arc<Shared>) -> Router {
    let door = Arc::new(Door::on_loopback(Arc::clone(&shared.keys)));
    Router::new()
        .route("/", get(async || web::page("edit.html")))
        .route("/api/desk", get(describe))
        .route("/api/slice", get(slice))
        .route("/api/ticket", post(ticket))
        .route("/api/export", get(download))
        .route("/api/rebuild", get(progress).post(rebuilding))
        .route("/desk", get(upgrade))
        .fallback(get(web::file))
        .layer(DefaultBodyLimit::max(16 << 10))
        .layer(middleware::from_fn_with_state(door, door::guard))
        .layer(middleware::from_fn(headers::add))
        .with_state(shared)
}

async fn ticket(State(shared): State<Arc<Shared>>) -> Response {
    door::ticket(&shared.keys)
}

async fn describe(State(shared): State<Arc<Shared>>) -> Response {
    let of = Arc::clone(&shared);
    answered(at_work(&shared, move |work| Json(describe_work(&of, work))).await)
}

/// What was found at the desk.
fn answered(found: Option<impl IntoResponse>) -> Response {
    let failed =
        || refuse(StatusCode::INTERNAL_SERVER_ERROR, "the editor has failed; what was edited is in its folder");
    found.map_or_else(failed, IntoResponse::into_response)
}

fn describe_work(shared: &Shared, work: &Work) -> Value {
    let grid = work.desk.ct().grid();
    json!({
        "scan": shared.subject.scan,
        "notice": monro_prepare::NOTICE,
        "dims": grid.dims(),
        "spacing_mm": grid.spacing(),
        "views": views(grid).map(|v| view_json(&v)),
        "labels": Structure::ALL.map(label),
        "findings": shared.findings,
        "confidence": expected(&shared.subject.known.confidence),
        "state": request::state(&work.desk),
        "wire": request::wire(&work.desk),
    })
}

/// A label as the page needs it, which decides nothing itself.
fn label(s: Structure) -> Value {
    json!({
        "label": s.label(), "name": s.name(), "colour": s.colour(),
        "ventricle": s.is_ventricle(), "intracranial": s.is_intracranial(),
    })
}

/// Expected Dice by label, null where nothing is known.
fn expected(known: &[Confidence]) -> [Option<f64>; Structure::ALL.len()] {
    Structure::ALL.map(|s| known.iter().find(|c| c.structure == s.name()).map(|c| c.expected_dice))
}

fn view_json(v: &View) -> Value {
    json!({
        "name": v.name, "axis": v.axis.number(), "slices": v.slices, "size": v.size, "spacing_mm": v.spacing,
        "transpose": v.transpose, "flip": v.flip, "ascending": v.ascending,
    })
}

/// Which slice, and of what.
#[derive(Debug, Deserialize)]
struct SliceQuery {
    axis: usize,
    index: usize,
    #[serde(default)]
    labels: bool,
}

/// 16-bit HU, little-endian, or one byte per label.
async fn slice(State(shared): State<Arc<Shared>>, Query(q): Query<SliceQuery>) -> Response {
    let axis = match request::axis(q.axis) {
        Ok(axis) => axis,
        Err(e) => return refuse(StatusCode::UNPROCESSABLE_ENTITY, &e),
    };
    let bytes = move |work: &mut Work| match q.labels {
        true => work.desk.slice_labels(axis, q.index),
        false => work.desk.slice_hu(axis, q.index).map(|hu| hu.into_iter().flat_map(i16::to_le_bytes).collect()),
    };
    let found = at_work(&shared, bytes).await;
    answered(found.map(|bytes| match bytes {
        Ok(bytes) => ([(CONTENT_TYPE, "application/octet-stream")], bytes).into_response(),
        Err(e) => refuse(StatusCode::NOT_FOUND, &e.to_string()),
    }))
}

async fn progress(State(shared): State<Arc<Shared>>) -> Response {
    let edits = at_work(&shared, |work| work.store.length()).await;
    answered(edits.map(|edits| Json(lock(&shared.progress).describe(edits))))
}

async fn rebuilding(State(shared): State<Arc<Shared>>) -> Response {
    if rebuild::start(&shared) {
        Json(json!({ "state": "running" })).into_response()
    } else {
        refuse(StatusCode::CONFLICT, "the case is being rebuilt already")
    }
}

/// Which format.
#[derive(Debug, Deserialize)]
struct ExportQuery {
    format: String,
}

async fn download(State(shared): State<Arc<Shared>>, Query(q): Query<ExportQuery>) -> Response {
    // A copy, so that drawing goes on while it is compressed.
    let of = Arc::clone(&shared);
    let made = tokio::task::spawn_blocking(move || {
        let labels = lock(&of.work).desk.labels().clone();
        export(&labels, &q.format)
    });
    match made.await {
        Ok(Ok(bytes)) => ([(CONTENT_TYPE, "application/octet-stream")], bytes).into_response(),
        Ok(Err(e)) => refuse(StatusCode::UNPROCESSABLE_ENTITY, &e.to_string()),
        Err(e) => refuse(StatusCode::INTERNAL_SERVER_ERROR, &e.to_string()),
    }
}

async fn upgrade(State(shared): State<Arc<Shared>>, ws: WebSocketUpgrade) -> Response {
    ws.max_message_size(MOST_MESSAGE_BYTES)
        .max_frame_size(MOST_MESSAGE_BYTES)
        .on_upgrade(move |socket| talk(socket, shared))
}

/// Answers messages one after the other until the page goes, and tells it what other pages have changed.
async fn talk(mut socket: WebSocket, shared: Arc<Shared>) {
    let page = shared.pages.fetch_add(1, Ordering::Relaxed);
    let mut edited = shared.edited.subscribe();
    // Changes that the page has seen.
    let mut seen = *edited.borrow_and_update();
    loop {
        let said = tokio::select! {
            message = socket.recv() => {
                let Some(Ok(message)) = message else { break };
                let Message::Text(text) = message else { continue };
                let shared = Arc::clone(&shared);
                let Ok((said, edit)) = tokio::task::spawn_blocking(move || answer(&shared, page, &text)).await else { break };
                // Another page's before it is yet to be told, with this one.
                seen = edit.filter(|&edit| edit == seen + 1).unwrap_or(seen);
                said
            }
            changed = edited.changed() => {
                let now = *edited.borrow_and_update();
                if changed.is_err() || now == seen {
                    continue;
                }
                seen = now;
                let Some(said) = at_work(&shared, |work| {
                    json!({ "id": 0, "state": request::state(&work.desk), "wire": request::wire(&work.desk) })
                }).await else { break };
                said
            }
        };
        if socket.send(Message::Text(said.to_string().into())).await.is_err() {
            break;
        }
    }
    let _ = at_work(&shared, move |work| work.leave(page)).await;
}

/// Looks at the desk, which a tool may hold for seconds, off the threads that serve. `None` when that has failed.
async fn at_work<T: Send + 'static>(
    shared: &Arc<Shared>,
    look: impl FnOnce(&mut Work) -> T + Send + 'static,
) -> Option<T> {
    let shared = Arc::clone(shared);
    tokio::task::spawn_blocking(move || look(&mut lock(&shared.work))).await.ok()
}

/// Does what a message of a page asks and saves it before the answer goes out. With the number of the change, if labels or
/// wire are other than before.
pub(super) fn answer(shared: &Shared, page: u64, text: &str) -> (Value, Option<u64>) {
    let request = match request::parse(text) {
        Ok(request) => request,
        Err(answer) => return (answer, None),
    };
    let id = request.id;
    let mut work = lock(&shared.work);
    let (wire, is_dab) = (work.desk.open_wire(), request.paints());
    let said = work.answer(page, request);
    let (edited, kept) = work.save(!is_dab);
    // An open wire is not in the journal; another page would close it as it was.
    let change = (edited || work.desk.open_wire() != wire).then(|| {
        shared.edited.send_modify(|edits| *edits += 1);
        *shared.edited.borrow()
    });
    drop(work);
    let mut out = match said {
        Ok(value) => value,
        Err(error) => json!({ "error": error }),
    };
    if let Err(error) = kept {
        out["error"] =
            format!("not saved yet: {error}; it is tried again at every step: make room, or export the labels now")
                .into();
    }
    out["id"] = id.into();
    (out, change)
}
