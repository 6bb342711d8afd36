//! Puts everything together: case, session, threads, routes.

use crate::door::{self, Keys};
use crate::listener::Limited;
use crate::live::Live;
use crate::options::ServeOptions;
use crate::tracker::Tracker;
use crate::{ServeError, api, case_data, deformer, headers, register, socket, web};
use axum::body::Bytes;
use axum::extract::DefaultBodyLimit;
use axum::routing::get;
use axum::{Router, middleware};
use monro_case::Case;
use monro_guidance::Plan;
use monro_session::live::{Deformation, Expiry, Registering, Session, SessionEvent, ToolNames};
use serde_json::{Value, json};
use std::io;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;

/// Bodies that are taken: events of the procedure.
const MOST_BODY_BYTES: usize = 16 << 10;

/// Where the server can be reached.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ready {
    /// `http://ADDRESS:PORT`.
    pub url: String,
    /// For `Authorization: Bearer`.
    pub token: String,
    /// Whether the web app is in this binary.
    pub has_web_app: bool,
}

impl Ready {
    /// What to open in a browser; the token stays behind the `#`, which browsers do not send.
    pub fn browser_url(&self) -> String {
        format!("{}/#token={}", self.url, self.token)
    }
}

/// Where a server with these keys can be reached.
pub(crate) fn ready_at(address: SocketAddr, keys: &Keys) -> Ready {
    Ready { url: format!("http://{address}"), token: keys.token().to_owned(), has_web_app: web::IS_BUILT }
}

/// What all requests share.
#[derive(Debug)]
pub(crate) struct Shared {
    pub(crate) live: Arc<Live>,
    pub(crate) keys: Arc<Keys>,
    pub(crate) case: Value,
    pub(crate) scene: Bytes,
    pub(crate) ct: Option<Bytes>,
    pub(crate) tracker: String,
    pub(crate) simulated: bool,
    pub(crate) registering: Mutex<Registering>,
}

/// A running server; it stops when this is dropped.
#[derive(Debug)]
pub struct Running {
    ready: Ready,
    live: Arc<Live>,
    task: JoinHandle<io::Result<()>>,
    stop: Option<oneshot::Sender<()>>,
}

impl Running {
    /// Where it can be reached.
    pub const fn ready(&self) -> &Ready {
        &self.ready
    }

    /// Runs until it fails.
    ///
    /// # Errors
    /// When the socket does.
    pub async fn wait(mut self) -> Result<(), ServeError> {
        (&mut self.task).await.map_err(io::Error::other)??;
        Ok(())
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.live.stop();
        if let Some(stop) = self.stop.take() {
            // Nobody listens when the server has ended by itself.
            let _ = stop.send(());
        }
    }
}

/// Serves a case until the process ends. `ready` is called once, when the port is open.
///
/// # Errors
/// A faulty case, an address that cannot be had or is not loopback, a socket that fails.
pub fn serve(options: ServeOptions, ready: impl FnOnce(&Ready)) -> Result<(), ServeError> {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
    runtime.block_on(async {
        let running = start(options).await?;
        ready(running.ready());
        running.wait().await
    })
}

/// Starts serving a case; for callers with a runtime of their own.
///
/// # Errors
/// As [`serve`].
pub async fn start(options: ServeOptions) -> Result<Running, ServeError> {
    let address = options.listen;
    if !address.ip().is_loopback() {
        return Err(ServeError::NotLoopback(address));
    }
    let listener = TcpListener::bind(address).await.map_err(|error| ServeError::Listen { address, error })?;
    let address = listener.local_addr()?;
    let (shared, deformation, plan, tracker) =
        tokio::task::spawn_blocking(move || prepare(options)).await.map_err(io::Error::other)??;
    deformer::spawn(Arc::clone(&shared.live), deformation)?;
    tracker.start(&shared.live, plan)?;
    Ok(run(shared, listener, address))
}

fn run(shared: Shared, listener: TcpListener, address: SocketAddr) -> Running {
    let ready = ready_at(address, &shared.keys);
    let live = Arc::clone(&shared.live);
    let (stop, stopped) = oneshot::channel();
    let router = router(Arc::new(shared));
    let task = tokio::spawn(async move {
        // WebSockets would hold a graceful shutdown up for as long as they live, so it is an abrupt one.
        tokio::select! {
            result = axum::serve(Limited::new(listener), router).into_future() => result,
            _ = stopped => Ok(()),
        }
    });
    Running { ready, live, task, stop: Some(stop) }
}

fn router(shared: Arc<Shared>) -> Router {
    let keys = Arc::clone(&shared.keys);
    api::routes()
        .route("/live", get(socket::upgrade))
        .fallback(get(web::file))
        .layer(DefaultBodyLimit::max(MOST_BODY_BYTES))
        .layer(middleware::from_fn_with_state(keys, door::guard))
        .layer(middleware::from_fn(headers::add))
        .with_state(shared)
}

/// Everything that takes a while: files, meshes, the soft body.
fn prepare(options: ServeOptions) -> Result<(Shared, Deformation, Plan, Tracker), ServeError> {
    let case = Case::open(&options.case_dir)?;
    let deformation = Deformation::new(&case, &options.model)?;
    let scene = case_data::scene(&case)?;
    let ct = case_data::ct(&options.case_dir)?;
    let mut session = Session::new(ToolNames::default(), Expiry::default());
    // A new session takes any case.
    let opened = session.apply(SessionEvent::CaseOpened(case.plan));
    debug_assert!(opened.is_ok(), "{opened:?}");
    let shared = Shared {
        live: Arc::new(Live::new(session, deformation.at_rest())),
        keys: Arc::new(Keys::new().map_err(ServeError::Random)?),
        case: describe(&case, ct.is_some()),
        scene: scene.into(),
        ct: ct.map(Bytes::from),
        tracker: options.tracker.name().to_owned(),
        simulated: matches!(options.tracker, Tracker::Sim),
        registering: Mutex::new(register::landmarks(&case)),
    };
    Ok((shared, deformation, case.plan, options.tracker))
}

fn describe(case: &Case, has_ct: bool) -> Value {
    let m = &case.manifest;
    json!({
        "pseudonym": m.pseudonym,
        "side": m.side,
        "notice": m.notice,
        "generator": m.generator,
        "source": { "format": m.source.format, "series": m.source.series, "dims": m.source.dims,
                    "spacing_mm": m.source.spacing_mm },
        "findings": m.findings,
        "plan": case_data::plan(case),
        "nodes": case.tets.vertices.len(),
        "elements": case.tets.tets.len(),
        "has_ct": has_ct,
    })
}
