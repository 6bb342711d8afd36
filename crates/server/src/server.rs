//! Puts everything together: case, session, threads, routes.

use crate::door::{self, Door, Keys, Role};
use crate::live::Live;
use crate::options::{Certificate, Recording, ServeOptions};
use crate::record::{Log, identity, way_to_case};
use crate::slicer;
use crate::tissue::Tissue;
use crate::tls::{self, Tls};
use crate::tracker::Tracker;
use crate::{ServeError, api, case_data, deformer, headers, listener, register, socket, web};
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, State};
use axum::http::StatusCode;
use axum::http::header::{CONTENT_SECURITY_POLICY, CONTENT_TYPE};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Router, middleware};
use monro_case::Case;
use monro_guidance::Plan;
use monro_session::Loads;
use monro_session::live::log::Opened;
use monro_session::live::{Deformation, Expiry, Session, SessionEvent, ToolNames};
use serde_json::{Value, json};
use std::io;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;

/// Bodies that are taken: events of the procedure.
const MOST_BODY_BYTES: usize = 16 << 10;

/// How another device comes in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Invitation {
    /// The address with the code behind the `#`, for a QR code.
    pub url: String,
    /// A code that is good once, for a viewer.
    pub code: String,
    /// SHA-256 of the certificate, to be compared.
    pub fingerprint: String,
    /// The certificate, DER.
    pub certificate: Vec<u8>,
}

/// Where the server can be reached.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ready {
    /// `http://ADDRESS:PORT` or `https://ADDRESS:PORT`.
    pub url: String,
    /// For other devices, where there is encryption.
    pub invitation: Option<Invitation>,
    /// For `Authorization: Bearer`.
    pub token: String,
    /// Whether the web app is in this binary.
    pub has_web_app: bool,
    /// Where OpenIGTLink is served.
    pub igtl: Option<SocketAddr>,
    /// Where the session is recorded.
    pub recording: Option<PathBuf>,
    /// What the user should know from the start, as what became of earlier work.
    pub notes: Vec<String>,
}

impl Ready {
    /// What to open in a browser; the token stays behind the `#`, which browsers do not send.
    pub fn browser_url(&self) -> String {
        format!("{}/#token={}", self.url, self.token)
    }
}

/// Where a server with these keys can be reached, by this machine only.
pub(crate) fn ready_at(address: SocketAddr, keys: &Keys) -> Ready {
    let (url, token) = (format!("http://{address}"), keys.token(Role::Operator).to_owned());
    Ready { url, token, invitation: None, has_web_app: web::IS_BUILT, igtl: None, recording: None, notes: Vec::new() }
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
    pub(crate) tissue: Tissue,
    pub(crate) igtl: Option<SocketAddr>,
    /// The report of the case as it was when it was opened, where there is one: the case may be made again meanwhile.
    report: Option<Vec<u8>>,
}

/// A running server; it stops when this is dropped.
#[derive(Debug)]
pub struct Running {
    ready: Ready,
    live: Arc<Live>,
    task: JoinHandle<()>,
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
    /// When the thread of the server does.
    pub async fn wait(mut self) -> Result<(), ServeError> {
        (&mut self.task).await.map_err(io::Error::other)?;
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
/// A faulty case, an address or a certificate that cannot be had, a socket that fails.
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
    let listener = TcpListener::bind(address).await.map_err(|error| ServeError::Listen { address, error })?;
    start_on(listener, options, Arc::new(Keys::new().map_err(ServeError::Random)?)).await
}

/// Starts serving a case on a socket that is open already, for those who have the keys.
pub(crate) async fn start_on(
    listener: TcpListener,
    options: ServeOptions,
    keys: Arc<Keys>,
) -> Result<Running, ServeError> {
    let address = listener.local_addr()?;
    let (tls, names) = (encryption(&options)?, options.names.clone());
    let igtl = match options.igtl {
        Some(wanted) => Some(slicer::listen(wanted).await?),
        None => None,
    };
    let igtl_address = igtl.as_ref().map(TcpListener::local_addr).transpose()?;
    let (mut shared, deformation, plan, tracker, peers) =
        tokio::task::spawn_blocking(move || prepare(options, keys)).await.map_err(io::Error::other)??;
    shared.igtl = igtl_address;
    let live = Arc::clone(&shared.live);
    let begun = deformer::spawn(Arc::clone(&live), deformation).map_err(ServeError::from);
    let begun = begun.and_then(|()| Ok(tracker.start(&live, plan)?));
    let running = begun.and_then(|()| run(shared, listener, (address, names), tls));
    if running.is_err() {
        // Nobody would ever stop what has begun.
        live.stop();
    } else if let Some(listener) = igtl {
        tokio::spawn(slicer::serve(listener, live, Arc::new(peers)));
    }
    running
}

/// What others can reach is encrypted, and so is what the user has a certificate for.
fn encryption(options: &ServeOptions) -> Result<Option<Tls>, ServeError> {
    let ip = options.listen.ip();
    let certificate = match &options.certificate {
        None if ip.is_loopback() => return Ok(None),
        certificate => certificate.as_ref().unwrap_or(&Certificate::SelfSigned),
    };
    let own = [tls::outward(ip).to_string(), "127.0.0.1".into(), "localhost".into()];
    let mut names: Vec<String> = options.names.iter().cloned().chain(own).collect();
    names.sort();
    names.dedup();
    Tls::new(certificate, names).map(Some)
}

fn run(
    shared: Shared,
    listener: TcpListener,
    (address, names): (SocketAddr, Vec<String>),
    tls: Option<Tls>,
) -> Result<Running, ServeError> {
    let scheme = if tls.is_some() { "https" } else { "http" };
    let url = format!("{scheme}://{}", SocketAddr::new(tls::outward(address.ip()), address.port()));
    let invitation = tls.as_ref().map(|tls| invite(&url, &shared.keys, tls)).transpose()?;
    let recording = shared.live.recording().map(|log| log.path().to_owned());
    let igtl = shared.igtl;
    let ready = Ready { url, invitation, igtl, recording, ..ready_at(address, &shared.keys) };
    let live = Arc::clone(&shared.live);
    let (stop, stopped) = oneshot::channel();
    let door = Door { scheme, names, ..Door::on_loopback(Arc::clone(&shared.keys)) };
    let router = router(Arc::new(shared), Arc::new(door));
    let task = tokio::spawn(async move {
        // WebSockets would hold a graceful shutdown up for as long as they live, so it is an abrupt one.
        tokio::select! {
            () = listener::serve(listener, tls.map(|t| t.acceptor), router, std::future::pending()) => {}
            _ = stopped => {}
        }
    });
    Ok(Running { ready, live, task, stop: Some(stop) })
}

fn invite(url: &str, keys: &Keys, tls: &Tls) -> Result<Invitation, ServeError> {
    let code = keys.pairing().offer(Role::Viewer, Instant::now()).map_err(ServeError::Random)?;
    let (fingerprint, certificate) = (tls.fingerprint.clone(), tls.certificate.clone());
    Ok(Invitation { url: format!("{url}/#pair={code}"), code, fingerprint, certificate })
}

fn router(shared: Arc<Shared>, door: Arc<Door>) -> Router {
    api::routes()
        .route("/live", get(socket::upgrade))
        .route("/report", get(report))
        .fallback(get(web::file))
        .layer(DefaultBodyLimit::max(MOST_BODY_BYTES))
        .layer(middleware::from_fn_with_state(door, door::guard))
        .layer(middleware::from_fn(headers::add))
        .with_state(shared)
}

/// The report of the case, for a new tab of the browser: its styles are within it, and it may do nothing else.
async fn report(State(shared): State<Arc<Shared>>) -> Response {
    match shared.report.clone() {
        Some(html) => {
            let policy = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; frame-ancestors 'none'";
            ([(CONTENT_TYPE, "text/html; charset=utf-8"), (CONTENT_SECURITY_POLICY, policy)], html).into_response()
        }
        None => door::refuse(StatusCode::NOT_FOUND, "this case has no report.html"),
    }
}

type Prepared = (Shared, Deformation, Plan, Tracker, slicer::Scene);

/// Everything that takes a while: files, meshes, the soft body.
fn prepare(options: ServeOptions, keys: Arc<Keys>) -> Result<Prepared, ServeError> {
    let case = Case::open(&options.case_dir)?;
    let deformation = Deformation::new(&case, &options.model, options.frame)?;
    let (scene, surfaces) = case_data::scene(&case)?;
    let ct = case_data::ct(&options.case_dir)?;
    let mut session = Session::new(ToolNames::default(), Expiry::default());
    // A new session takes any case.
    let opened = session.apply(SessionEvent::CaseOpened(case.plan));
    debug_assert!(opened.is_ok(), "{opened:?}");
    session.load(Loads::of(&options.frame));
    let log = options.recording.as_ref().map(|r| open_log(r, &options.case_dir, &case)).transpose()?;
    let image = ct.as_ref().and_then(|ct| slicer::image(ct, case_data::strides(ct.grid(), slicer::MOST_VOXELS)));
    let peers = slicer::Scene::new(&case, image)?;
    let report = std::fs::read(options.case_dir.join("report.html")).ok();
    let shared = Shared {
        live: Arc::new(Live::new(session, register::landmarks(&case), (deformation.now().clone(), surfaces), log)),
        keys,
        case: describe(&case, ct.is_some(), report.is_some()),
        scene: scene.into(),
        ct: ct.as_ref().map(case_data::ct_for_displays).map(Bytes::from),
        tracker: options.tracker.name().to_owned(),
        simulated: matches!(options.tracker, Tracker::Sim),
        tissue: Tissue::new(&case, &options.model),
        igtl: None,
        report,
    };
    Ok((shared, deformation, case.plan, options.tracker, peers))
}

fn open_log(recording: &Recording, case_dir: &Path, case: &Case) -> Result<Log, ServeError> {
    let opened = Opened {
        generator: format!("monro {}", env!("CARGO_PKG_VERSION")),
        case_dir: way_to_case(&recording.path, case_dir)?.display().to_string(),
        identity: identity(case),
        settings: recording.settings.clone(),
    };
    Log::create(&recording.path, opened)
}

fn describe(case: &Case, has_ct: bool, has_report: bool) -> Value {
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
        "has_report": has_report,
    })
}
