//! `/api/calibration`: the catheter's tip by pivoting about it and its axis by turning about that, with the same code as
//! `monro calibrate`; then both are taken into the session.

use crate::body::Body;
use crate::door::refuse;
use crate::lock::lock;
use crate::server::Shared;
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use monro_geometry::{Point, Rigid, Tool, Tracker};
use monro_guidance::calibration::{
    AxisCalibration, AxisError, PivotCalibration, PivotError, PivotOptions, calibrate_axis, calibrate_pivot, distinct,
};
use monro_session::live::{Calibration, Refusal, SessionEvent};
use serde::Deserialize;
use serde_json::{Value, json};
use std::sync::{Arc, MutexGuard};
use std::time::Duration;
use tokio::time::sleep;

/// How often the catheter is looked at: more often than trackers give poses; one that was seen already is not taken twice.
const LOOK: Duration = Duration::from_millis(3);
/// Seconds that a motion is watched if nothing is said, and how short or long that may be.
const WATCHED_S: f64 = 10.0;
const LEAST_S: f64 = 1.0;
const MOST_S: f64 = 60.0;

/// What was found so far.
#[derive(Debug, Clone, Default)]
pub(crate) struct Calibrating {
    tip: Option<PivotCalibration>,
    axis: Option<AxisCalibration>,
    /// How often all was forgotten, or another tip found: what was watched in an earlier round is void.
    round: u64,
}

impl Calibrating {
    /// Forgets what was found of a catheter that is not there any more.
    pub(crate) fn forget(&mut self) {
        *self = Self { round: self.round + 1, ..Self::default() };
    }

    /// Takes another tip: an axis that was found, or is being watched, belongs to the old one.
    fn take_tip(&mut self, tip: PivotCalibration) {
        *self = Self { tip: Some(tip), axis: None, round: self.round + 1 };
    }
}

/// What to do.
#[derive(Debug, Deserialize)]
#[serde(tag = "action", rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum Action {
    /// Watch the catheter being swung about its resting tip.
    Pivot { seconds: Option<f64> },
    /// Watch it being turned about its own axis in a fixed guide.
    Turn {
        seconds: Option<f64>,
        /// A point of the shaft at the hub, mm in the tool's frame, where that has its origin at the tip.
        hub_mm: Option<[f64; 3]>,
    },
    /// Take what was found into the session.
    Accept,
}

/// Why it was not done.
#[derive(Debug, thiserror::Error)]
enum Why {
    #[error("{0}")]
    Pivot(#[from] PivotError),
    #[error("{0}")]
    Axis(#[from] AxisError),
    #[error("{0}")]
    Phase(#[from] Refusal),
    #[error("pivot the catheter about its tip first")]
    NoTip,
    #[error("turn the catheter about its axis first")]
    NoAxis,
    #[error(
        "the catheter was exchanged, its body defined anew, or another tip found, while it was watched: do it again"
    )]
    Voided,
    #[error("seconds must be from {LEAST_S} to {MOST_S}")]
    Seconds,
}

fn held(shared: &Shared) -> MutexGuard<'_, Calibrating> {
    lock(&shared.live.calibrating)
}

/// `GET /api/calibration`.
pub(crate) async fn get(State(shared): State<Arc<Shared>>) -> Json<Value> {
    Json(describe(&shared))
}

/// `POST /api/calibration`.
pub(crate) async fn post(State(shared): State<Arc<Shared>>, Body(action): Body<Action>) -> Response {
    match act(&shared, action).await {
        Ok(()) => Json(describe(&shared)).into_response(),
        Err(why @ Why::Phase(_)) => refuse(StatusCode::CONFLICT, &why.to_string()),
        Err(why) => refuse(StatusCode::UNPROCESSABLE_ENTITY, &why.to_string()),
    }
}

async fn act(shared: &Shared, action: Action) -> Result<(), Why> {
    match action {
        Action::Pivot { seconds } => {
            let (poses, round) = watch(shared, seconds).await?;
            let found = calibrate_pivot(&poses, &PivotOptions::default())?;
            still(shared, round)?.take_tip(found);
        }
        Action::Turn { seconds, hub_mm } => {
            let tip = || held(shared).tip.as_ref().map(|t| t.tip).ok_or(Why::NoTip);
            tip()?;
            let (poses, round) = watch(shared, seconds).await?;
            let hub = hub_mm.map_or(Point::ORIGIN, Point::from_array);
            let found = calibrate_axis(&poses, (hub, tip()?))?;
            still(shared, round)?.axis = Some(found);
        }
        Action::Accept => {
            // Held meanwhile: what voids it comes before or after.
            let found = held(shared);
            let tip = found.tip.as_ref().ok_or(Why::NoTip)?.tip;
            let axis = found.axis.as_ref().ok_or(Why::NoAxis)?.axis;
            shared.live.apply(SessionEvent::Calibrated(Calibration { tip, axis }))?;
        }
    }
    Ok(())
}

/// What was found so far, if what was watched in this round still counts.
fn still(shared: &Shared, round: u64) -> Result<MutexGuard<'_, Calibrating>, Why> {
    let calibrating = held(shared);
    if calibrating.round == round { Ok(calibrating) } else { Err(Why::Voided) }
}

/// The catheter's poses during a motion, as long as it is seen, and the round they belong to.
async fn watch(shared: &Shared, seconds: Option<f64>) -> Result<(Vec<Rigid<Tracker, Tool>>, u64), Why> {
    let seconds = seconds.unwrap_or(WATCHED_S);
    if !(LEAST_S..=MOST_S).contains(&seconds) {
        return Err(Why::Seconds);
    }
    let (live, round) = (&shared.live, held(shared).round);
    let begun = live.clock.now();
    let (mut poses, mut last) = (Vec::new(), begun);
    while live.clock.now() < begun + seconds {
        // What was seen before the motion began does not belong to it.
        if let Some((time, pose)) = live.catheter().filter(|(time, _)| *time > last) {
            last = time;
            poses.push(pose);
        }
        sleep(LOOK).await;
    }
    drop(still(shared, round)?);
    Ok((distinct(poses), round))
}

fn describe(shared: &Shared) -> Value {
    let Calibrating { tip, axis, .. } = held(shared).clone();
    json!({
        "phase": shared.live.phase().name(),
        "tip": tip.map(|t| json!({
            "tip_mm": t.tip.to_array(), "tip_sigma_mm": t.covariance.rms(), "residual_mm": t.residual,
            "tilt_deg": t.tilt.to_degrees(), "poses": t.used.len(), "used": t.used.iter().filter(|u| **u).count(),
            "remark": t.remark(),
        })),
        "axis": axis.map(|a| json!({
            "axis": a.axis.to_array(), "wobble_deg": a.wobble.to_degrees(), "axis_sigma_deg": a.sigma.to_degrees(),
        })),
    })
}
