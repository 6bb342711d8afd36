//! HTTP while there is no case.

use super::Shared;
use super::job::Task;
use crate::api;
use crate::body::Body;
use crate::door::{self, Door, refuse};
use crate::guidance::Guidance;
use crate::listener;
use crate::{headers, web};
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, State};
use axum::http::StatusCode;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Json, Router, middleware};
use monro_geometry::Point;
use monro_guidance::Side;
use serde::Deserialize;
use serde_json::json;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use tokio::net::TcpListener;
use tokio::sync::oneshot;

pub(super) async fn run(shared: Arc<Shared>, listener: TcpListener, stopped: oneshot::Receiver<()>) {
    listener::serve(listener, None, router(shared), async { drop(stopped.await) }).await;
}

fn router(shared: Arc<Shared>) -> Router {
    let door = Arc::new(Door::on_loopback(Arc::clone(&shared.keys)));
    Router::new()
        .route("/", get(async || web::page("prepare.html")))
        .route("/api/openapi.json", get(api::openapi))
        .route("/api/guidance", get(async || Json(Guidance::without_case())))
        .route("/api/prepare", get(describe).post(act))
        .route("/api/scene", get(async |State(s): State<Arc<Shared>>| binary(s.job.scene())))
        .route("/api/ct", get(async |State(s): State<Arc<Shared>>| binary(s.job.ct())))
        .fallback(get(web::file))
        .layer(DefaultBodyLimit::max(16 << 10))
        .layer(middleware::from_fn_with_state(door, door::guard))
        .layer(middleware::from_fn(headers::add))
        .with_state(shared)
}

fn binary(bytes: Option<Bytes>) -> Response {
    match bytes {
        Some(bytes) => ([(CONTENT_TYPE, "application/octet-stream")], bytes).into_response(),
        None => refuse(StatusCode::NOT_FOUND, "nothing is prepared yet"),
    }
}

/// What can be prepared in the folder of scans, which may lie far away and be large.
async fn scans(shared: &Shared) -> io::Result<Vec<String>> {
    let folder = shared.scans.clone();
    let looked = tokio::task::spawn_blocking(move || monro_scan::scans_in(&folder)).await;
    looked.map_err(io::Error::other)?
}

async fn describe(State(shared): State<Arc<Shared>>) -> Response {
    match scans(&shared).await {
        Ok(names) => {
            let mut out = shared.job.describe();
            out["scans"] = json!(names);
            Json(out).into_response()
        }
        Err(e) => refuse(StatusCode::INTERNAL_SERVER_ERROR, &format!("{}: {e}", shared.scans.display())),
    }
}

/// What to do.
#[derive(Debug, Deserialize)]
#[serde(tag = "action", rename_all = "snake_case", deny_unknown_fields)]
enum Action {
    /// Prepare a scan of the list, for an entry on the `left` or `right`.
    Start { scan: String, side: Option<String> },
    /// Prepare it again along another path.
    Path { entry_lps_mm: [f64; 3], target_lps_mm: [f64; 3] },
    /// Write the case and go on with it.
    Open,
}

async fn act(State(shared): State<Arc<Shared>>, Body(request): Body<Action>) -> Response {
    let started = match request {
        Action::Start { scan, side } => start(&shared, &scan, side.as_deref()).await,
        Action::Path { entry_lps_mm, target_lps_mm } => {
            Ok(Task::Path([entry_lps_mm, target_lps_mm].map(Point::from_array)))
        }
        Action::Open => return open(&shared).await,
    };
    match started.map(|task| shared.job.start(task)) {
        Ok(true) => Json(shared.job.describe()).into_response(),
        Ok(false) => refuse(StatusCode::CONFLICT, "wait until what runs is done; a path needs a prepared scan"),
        Err(e) => refuse(StatusCode::UNPROCESSABLE_ENTITY, &e),
    }
}

async fn start(shared: &Shared, scan: &str, side: Option<&str>) -> Result<Task, String> {
    // Only what was listed: a name cannot lead out of the folder.
    let known = scans(shared).await.map_err(|e| e.to_string())?.into_iter().find(|n| n == scan);
    let path: PathBuf = shared.scans.join(known.ok_or("no such scan in the list")?);
    let side = match side {
        None => None,
        Some("left") => Some(Side::Left),
        Some("right") => Some(Side::Right),
        Some(other) => return Err(format!("side \"{other}\" is neither left nor right")),
    };
    Ok(Task::Scan { path, side })
}

/// Answers when the live session runs.
async fn open(shared: &Arc<Shared>) -> Response {
    let job = shared.job.clone();
    let written = tokio::task::spawn_blocking(move || job.write()).await;
    if let Err(why) = written.map_err(|e| e.to_string()).and_then(|w| w) {
        return refuse(StatusCode::CONFLICT, &why);
    }
    let (answer, answered) = oneshot::channel();
    let asked = shared.open.lock().await.send(answer).await.is_ok();
    match answered.await {
        Ok(Ok(())) if asked => Json(json!({ "opened": true })).into_response(),
        Ok(Err(why)) => refuse(StatusCode::CONFLICT, &why),
        _ => refuse(StatusCode::CONFLICT, "the case is being opened already"),
    }
}
