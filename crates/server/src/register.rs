//! `/api/registration`: landmarks are touched, solved for, accepted and checked. The rules are those of
//! `monro_session::live::Registering`; here the tip is watched while it rests.

use crate::body::Body;
use crate::door::refuse;
use crate::lock::lock;
use crate::server::Shared;
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use monro_case::Case;
use monro_geometry::{Patient, Point, Tool};
use monro_session::live::{Phase, PlainEvent, Refusal, Registering, SessionEvent, Touch, TouchError, TouchMark};
use serde::Deserialize;
use serde_json::{Value, json};
use std::sync::{Arc, MutexGuard};
use std::time::Duration;
use tokio::time::sleep;

/// How long the tip is watched: longer where a slow tracker has not shown it often enough by then.
const WATCHED: Duration = Duration::from_millis(500);
const LONGEST: Duration = Duration::from_millis(2500);
/// How often it is looked at: more often than trackers give poses; one that was seen already is not taken twice.
const LOOK: Duration = Duration::from_millis(4);
/// Landmarks of a case farther than this from the skin cannot be touched, mm.
const ON_SKIN_MM: f64 = 3.0;

/// The landmarks of a case that can be touched: those on the skin.
pub(crate) fn landmarks(case: &Case) -> Registering {
    let skin = monro_geometry::Bvh::new(&case.skin);
    let on_skin = |p: Point<Patient>| skin.nearest(p).is_some_and(|n| n.distance <= ON_SKIN_MM);
    let touchable = case.landmarks.iter().filter(|l| on_skin(l.position));
    Registering::new(touchable.map(|l| (l.label.clone(), l.position)), case.plan.target())
}

/// What to do.
#[derive(Debug, Deserialize)]
#[serde(tag = "action", rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum Action {
    Touch { name: String },
    Forget { name: String },
    Mark { name: String, position_lps_mm: [f64; 3] },
    Unmark { name: String },
    Accept,
    Check { name: String },
}

/// Why it was not done.
enum Why {
    Touch(TouchError),
    Phase(Refusal),
}

impl From<TouchError> for Why {
    fn from(e: TouchError) -> Self {
        Self::Touch(e)
    }
}

impl From<Refusal> for Why {
    fn from(e: Refusal) -> Self {
        Self::Phase(e)
    }
}

/// `GET /api/registration`.
pub(crate) async fn get(State(shared): State<Arc<Shared>>) -> Json<Value> {
    Json(describe(&shared, None))
}

/// `POST /api/registration`.
pub(crate) async fn post(State(shared): State<Arc<Shared>>, Body(action): Body<Action>) -> Response {
    match act(&shared, action).await {
        Ok(checked) => Json(describe(&shared, checked)).into_response(),
        Err(Why::Phase(e)) => refuse(StatusCode::CONFLICT, &e.to_string()),
        Err(Why::Touch(e)) => refuse(StatusCode::UNPROCESSABLE_ENTITY, &e.to_string()),
    }
}

fn held(shared: &Shared) -> MutexGuard<'_, Registering> {
    lock(&shared.live.registering)
}

/// Does it; a check tells what it found.
async fn act(shared: &Shared, action: Action) -> Result<Option<Value>, Why> {
    match action {
        Action::Touch { name } => {
            // As many as before it was watched: it may have moved meanwhile.
            let alarms = shared.live.alarms();
            let (touch, round) = watch(shared).await?;
            let mut registering = still(shared, round)?;
            let mut tried = registering.clone();
            tried.touch(&name, touch, alarms)?;
            // From any phase in which the tip is known: refused only where that has just been lost, and then it is void.
            shared.live.apply(SessionEvent::Plain(PlainEvent::Touched)).map_err(|_| TouchError::Voided)?;
            *registering = tried;
        }
        Action::Forget { name } => held(shared).forget(&name)?,
        Action::Mark { name, position_lps_mm } => held(shared).mark(&name, Point::from_array(position_lps_mm))?,
        Action::Unmark { name } => held(shared).unmark(&name)?,
        Action::Accept => {
            // The phase may refuse: only then is the old registration still the one that is checked. Held meanwhile: what voids
            // it comes before or after.
            let mut registering = held(shared);
            let mut tried = registering.clone();
            let registration = tried.accept(shared.live.alarm())?;
            shared.live.apply(SessionEvent::Registered(registration))?;
            *registering = tried;
        }
        Action::Check { name } => {
            let (touch, round) = watch(shared).await?;
            // Held until it is told, as above.
            let mut registering = still(shared, round)?;
            let (used, mut tried) = (shared.live.registration(), registering.clone());
            let found = tried.check(&name, &touch, used.as_ref())?;
            let hidden = shared.live.hidden_motion(touch.at, &found).filter(|_| found.holds());
            let said = json!({
                "name": name, "distance_mm": found.distance, "limit_mm": found.limit,
                "holds": found.holds() && hidden.is_none(), "hidden_motion_mm": hidden,
            });
            // What cannot be told apart changes nothing: the alarm stays.
            if hidden.is_some() {
                return Ok(Some(said));
            }
            let event = if found.holds() { PlainEvent::CheckPassed } else { PlainEvent::CheckFailed };
            shared.live.apply(SessionEvent::Plain(event))?;
            *registering = tried;
            return Ok(Some(said));
        }
    }
    Ok(None)
}

/// The landmarks, if what was watched in this round still counts; nothing voids it while they are held.
fn still(shared: &Shared, round: u64) -> Result<MutexGuard<'_, Registering>, TouchError> {
    let registering = held(shared);
    if registering.round() == round { Ok(registering) } else { Err(TouchError::Voided) }
}

/// Watches the tip while it rests: the touch, and the round it belongs to.
async fn watch(shared: &Shared) -> Result<(Touch, u64), TouchError> {
    let (live, round) = (&shared.live, held(shared).round());
    if live.phase() < Phase::Calibrated {
        return Err(TouchError::NotCalibrated);
    }
    let mut samples: Vec<Point<Tool>> = Vec::new();
    let (mut last, begun) = (f64::NEG_INFINITY, live.clock.now());
    let needed = |samples: usize| if samples < Touch::LEAST_SAMPLES { LONGEST } else { WATCHED };
    while live.clock.now() < begun + needed(samples.len()).as_secs_f64() {
        if let Some((time, tip)) = live.tip().filter(|(time, _)| *time > last) {
            last = time;
            samples.push(tip);
        }
        sleep(LOOK).await;
    }
    drop(still(shared, round)?);
    Ok((Touch::new(&samples)?, round))
}

fn describe(shared: &Shared, checked: Option<Value>) -> Value {
    let registering = held(shared).clone();
    let solved = registering.solve();
    let contradiction = solved.as_ref().ok().and_then(|s| registering.contradiction(s));
    let why_not = solved.as_ref().err().map(ToString::to_string).or_else(|| Some(contradiction.as_ref()?.to_string()));
    // The size of residuals that are a mistake says nothing about the error at the target.
    let usable = solved.as_ref().ok().filter(|_| contradiction.is_none());
    let ambiguities = usable.map_or_else(Vec::new, |s| registering.ambiguities(s));
    let residual = |mark: &TouchMark| {
        let solved = solved.as_ref().ok()?;
        let index = solved.residuals.iter().position(|r| r.name == mark.name)?;
        Some((&solved.residuals[index], solved.outlier == Some(index)))
    };
    let landmark = |mark: &TouchMark| {
        let found = residual(mark);
        json!({
            "name": mark.name, "marked_lps_mm": mark.marked.to_array(), "added": mark.added,
            "touched": mark.touched.is_some(), "spread_mm": mark.touched.map(|t| t.spread_mm),
            "residual_mm": found.map(|(r, _)| r.distance), "left_out_mm": found.and_then(|(r, _)| r.left_out),
            "expected_mm": found.and_then(|(r, _)| r.expected), "outlier": found.is_some_and(|(_, outlier)| outlier),
        })
    };
    json!({
        "landmarks": registering.marks().iter().map(landmark).collect::<Vec<_>>(),
        "predicted_tre_mm": usable.map(|s| registering.predicted_tre_mm(s)),
        "why_not": why_not,
        "remarks": ambiguities.first().iter().map(ToString::to_string).collect::<Vec<_>>(),
        "phase": shared.live.phase().name(),
        "checked": checked,
    })
}
