//! The JSON API.

use crate::body::Body;
use crate::calibrate;
use crate::door::{self, Role, refuse};
use crate::listener::Peer;
use crate::live::Live;
use crate::pairing;
use crate::record::Log;
use crate::register;
use crate::server::Shared;
use crate::tissue;
use axum::body::Bytes;
use axum::extract::{ConnectInfo, State};
use axum::http::header::CONTENT_TYPE;
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use monro_geometry::{Patient, Point, Rigid, Tool, Vector};
use monro_session::live::{Calibration, Phase, PlainEvent, Registration, SessionEvent};
use serde::Deserialize;
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// The description that `/api/openapi.json` gives; a test compares it with the routes.
pub(crate) const OPENAPI: &str = include_str!("openapi.json");

/// All routes below `/api`.
pub(crate) fn routes() -> Router<Arc<Shared>> {
    Router::new()
        .route("/api/openapi.json", get(openapi))
        .route("/api/case", get(async |State(s): State<Arc<Shared>>| Json(s.case.clone())))
        .route("/api/guidance", get(async |State(s): State<Arc<Shared>>| Json(s.live.snapshot().1)))
        .route("/api/status", get(status))
        .route("/api/scene", get(async |State(s): State<Arc<Shared>>| binary(s.scene.clone())))
        .route("/api/ct", get(ct))
        .route("/api/ticket", post(ticket))
        .route("/api/session", post(event))
        .route("/api/glasses", post(glasses))
        .route("/api/calibration", get(calibrate::get).post(calibrate::post))
        .route("/api/registration", get(register::get).post(register::post))
        .route("/api/tissue", get(tissue::get).post(tissue::post))
        .route("/api/tracker", post(tracker))
        .route("/api/pair", post(pair))
        .route("/api/pairing", post(offer))
        .route("/api/{*rest}", get(unknown).post(unknown))
}

/// What there is to ask.
pub(crate) async fn openapi() -> Response {
    ([(CONTENT_TYPE, "application/json")], OPENAPI).into_response()
}

async fn unknown() -> Response {
    refuse(StatusCode::NOT_FOUND, "no such path; /api/openapi.json lists them all")
}

fn binary(bytes: Bytes) -> Response {
    ([(CONTENT_TYPE, "application/octet-stream")], bytes).into_response()
}

async fn ct(State(shared): State<Arc<Shared>>) -> Response {
    match &shared.ct {
        Some(bytes) => binary(bytes.clone()),
        None => refuse(StatusCode::NOT_FOUND, "this case was shared without its images"),
    }
}

async fn ticket(State(shared): State<Arc<Shared>>) -> Response {
    door::ticket(&shared.keys)
}

async fn status(State(shared): State<Arc<Shared>>, headers: HeaderMap) -> Json<Value> {
    let live = &shared.live;
    let (rates, now) = (live.rates(), live.clock.now());
    Json(json!({
        "role": shared.keys.role(&headers),
        "tracker": shared.tracker,
        "tracker_diagnosis": live.tracker_diagnosis(),
        "tracker_trouble": live.tracker_trouble(),
        "simulated": shared.simulated,
        "paused": live.paused.load(Ordering::Relaxed),
        "tools": live.tools(),
        "tracking_hz": rates.tracking.hz(now),
        "deformation_hz": rates.deformation.hz(now),
        "deformation_ms": rates.deformation.ms(),
        "tracking_ms": rates.tracking.ms(),
        "snapshot_hz": rates.snapshot.hz(now),
        "snapshot_ms": rates.snapshot.ms(),
        "recording": live.recording().and_then(|log| log.path().file_name()).map(|name| name.to_string_lossy().into_owned()),
        "recording_trouble": live.recording().and_then(Log::trouble),
        "igtl": shared.igtl.map(|a| a.to_string()),
        "displays": live.displays.load(Ordering::Relaxed),
        "uptime_s": now,
    }))
}

/// An event of the procedure, as the operator sends it. Those without content have braces, or serde would take any.
#[derive(Debug, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case", deny_unknown_fields)]
enum EventRequest {
    /// `markers_mm`: where the markers of its body lay when it was calibrated, to be compared with where they are.
    Calibrated {
        tip_mm: [f64; 3],
        axis: [f64; 3],
        markers_mm: Option<Vec<[f64; 3]>>,
    },
    Registered {
        quaternion_wxyz: [f64; 4],
        translation_mm: [f64; 3],
        predicted_tre_mm: Option<f64>,
    },
    ToolChanged {},
    ReferenceMoved {},
    CheckPassed {},
    CheckFailed {},
    Started {},
    Stopped {},
}

/// How far from its body's origin a tip can be, mm: farther is another unit, or garbled.
const LONGEST_TOOL_MM: f64 = 2000.0;
/// How far behind its body's origin, along the axis, a tip can be, mm: markers lie at the hub, or about the shaft.
const FURTHEST_BEHIND_MM: f64 = 20.0;
/// How far from a reference body the origin of a scan can be, mm.
const FURTHEST_REFERENCE_MM: f64 = 10_000.0;
/// What the error of a registration can be, mm.
const MOST_TRE_MM: f64 = 100.0;

impl EventRequest {
    fn event(&self) -> Result<SessionEvent, String> {
        let plain = match *self {
            Self::Calibrated { tip_mm, axis, .. } => return calibrated(tip_mm, axis),
            Self::Registered { quaternion_wxyz, translation_mm, predicted_tre_mm } => {
                return registered(rigid(quaternion_wxyz, translation_mm)?, predicted_tre_mm);
            }
            Self::ToolChanged {} => PlainEvent::ToolChanged,
            Self::ReferenceMoved {} => PlainEvent::ReferenceMoved,
            Self::CheckPassed {} => PlainEvent::CheckPassed,
            Self::CheckFailed {} => PlainEvent::CheckFailed,
            Self::Started {} => PlainEvent::Started,
            Self::Stopped {} => PlainEvent::Stopped,
        };
        Ok(SessionEvent::Plain(plain))
    }

    /// Why an event is refused that would lower the alarm of the reference with nothing to show for it: only here is it known
    /// what was touched after it.
    fn silences(&self, live: &Live) -> Option<String> {
        let confirms = matches!(self, Self::Registered { .. } | Self::CheckPassed {});
        let bump = live.reference_alarm().filter(|_| confirms && live.phase() >= Phase::Registered)?;
        Some(format!(
            "the reference has moved by {:.1} mm and turned by {:.1}\u{b0} since the registration or the last check: touch a \
             landmark to check it (POST /api/registration), or send \"reference_moved\" and register anew",
            bump.shift,
            bump.turn.to_degrees()
        ))
    }
}

fn calibrated(tip: [f64; 3], axis: [f64; 3]) -> Result<SessionEvent, String> {
    let calibration = Calibration { tip: Point::from_array(tip), axis: Vector::from_array(axis) };
    let away = calibration.tip.distance(Point::ORIGIN);
    if !(0.0..=LONGEST_TOOL_MM).contains(&away) {
        return Err(format!("the tip lies {away:.0} mm from its body; up to {LONGEST_TOOL_MM} mm can be"));
    }
    let axis = calibration.axis.normalized().ok_or_else(|| format!("the axis {axis:?} has no direction"))?;
    let along = (calibration.tip - Point::ORIGIN).dot(axis);
    if along < -FURTHEST_BEHIND_MM {
        return Err(format!(
            "the axis points from the tip back to its body, which lies {:.0} mm ahead along it: it must point from the hub to the tip",
            -along
        ));
    }
    Ok(SessionEvent::Calibrated(calibration))
}

fn registered(
    patient_from_reference: Rigid<Patient, Tool>,
    predicted_tre_mm: Option<f64>,
) -> Result<SessionEvent, String> {
    let away = patient_from_reference.translation().norm();
    if away > FURTHEST_REFERENCE_MM {
        return Err(format!("the translation is {away:.0} mm long; up to {FURTHEST_REFERENCE_MM} mm can be"));
    }
    if let Some(tre) = predicted_tre_mm.filter(|t| !(0.0..=MOST_TRE_MM).contains(t)) {
        return Err(format!("predicted_tre_mm is {tre}; it must be a distance of 0 to {MOST_TRE_MM} mm"));
    }
    Ok(SessionEvent::Registered(Registration { patient_from_reference, predicted_tre_mm }))
}

/// A pose as requests give it.
fn rigid<To, From>(quaternion_wxyz: [f64; 4], translation_mm: [f64; 3]) -> Result<Rigid<To, From>, String> {
    Rigid::from_quaternion(quaternion_wxyz, Vector::from_array(translation_mm)).ok_or_else(|| {
        format!("the quaternion {quaternion_wxyz:?} has no length, or a number of {translation_mm:?} is not finite")
    })
}

async fn event(State(shared): State<Arc<Shared>>, Body(request): Body<EventRequest>) -> Response {
    if let EventRequest::Calibrated { markers_mm: Some(markers), .. } = &request
        && let Some(words) = shared.live.calibrated_with(markers)
    {
        let why =
            format!("the catheter's body is not the one that was calibrated ({words}): calibrate it as it is now");
        return refuse(StatusCode::UNPROCESSABLE_ENTITY, &why);
    }
    if let Some(why) = request.silences(&shared.live) {
        return refuse(StatusCode::CONFLICT, &why);
    }
    match request.event().map(|e| shared.live.apply(e)) {
        Ok(Ok(phase)) => Json(json!({ "phase": phase.name() })).into_response(),
        Ok(Err(refusal)) => refuse(StatusCode::CONFLICT, &refusal.to_string()),
        Err(e) => refuse(StatusCode::UNPROCESSABLE_ENTITY, &e),
    }
}

/// From the tracked body of glasses to the eye.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct GlassesRequest {
    quaternion_wxyz: [f64; 4],
    translation_mm: [f64; 3],
}

async fn glasses(State(shared): State<Arc<Shared>>, Body(request): Body<GlassesRequest>) -> Response {
    match rigid(request.quaternion_wxyz, request.translation_mm) {
        Ok(display_from_glasses) => {
            shared.live.wear(Some(display_from_glasses));
            Json(json!({ "worn": true })).into_response()
        }
        Err(e) => refuse(StatusCode::UNPROCESSABLE_ENTITY, &e),
    }
}

/// Stops and continues the scripted tracker.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct TrackerRequest {
    paused: bool,
}

async fn tracker(State(shared): State<Arc<Shared>>, Body(request): Body<TrackerRequest>) -> Response {
    if !shared.simulated {
        return refuse(StatusCode::CONFLICT, "only the scripted tracker (sim:) can be paused");
    }
    shared.live.paused.store(request.paused, Ordering::Relaxed);
    Json(json!({ "paused": request.paused })).into_response()
}

/// A code that somebody has read from the operator's screen.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PairRequest {
    code: String,
}

async fn pair(
    State(shared): State<Arc<Shared>>,
    ConnectInfo(Peer(peer)): ConnectInfo<Peer>,
    Body(request): Body<PairRequest>,
) -> Response {
    let redeemed = shared.keys.pairing().redeem(&request.code, peer.ip().to_canonical(), Instant::now());
    match redeemed {
        Ok(role) => Json(json!({ "token": shared.keys.token(role), "role": role })).into_response(),
        Err(pairing::Refused::Wrong) => refuse(
            StatusCode::UNAUTHORIZED,
            "this pairing code is wrong, used or too old; ask the operator for a new one",
        ),
        Err(pairing::Refused::Wait) => {
            refuse(StatusCode::TOO_MANY_REQUESTS, "too many wrong pairing codes; wait a minute")
        }
    }
}

/// What a new device shall be allowed.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PairingRequest {
    role: Role,
}

async fn offer(State(shared): State<Arc<Shared>>, Body(PairingRequest { role }): Body<PairingRequest>) -> Response {
    let offered = shared.keys.pairing().offer(role, Instant::now());
    match offered {
        Ok(code) => Json(json!({ "code": code, "role": role, "seconds": pairing::LIFE.as_secs() })).into_response(),
        Err(e) => refuse(StatusCode::INTERNAL_SERVER_ERROR, &format!("no random numbers: {e}")),
    }
}
