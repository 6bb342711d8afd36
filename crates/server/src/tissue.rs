//! The soft body of the session, and what is done to it: `/api/tissue`.

use crate::body::Body;
use crate::door::refuse;
use crate::server::Shared;
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use monro_case::Case;
use monro_session::{Csf, KPA_PER_MMHG, LoadError, Loads, Mode, ModelSettings, StructureVolumes};
use serde::{Deserialize, Deserializer};
use serde_json::{Value, json};
use std::sync::Arc;

/// What stays as it is while the session runs.
#[derive(Debug)]
pub(crate) struct Tissue {
    model: ModelSettings,
    has_septa: bool,
    ventricles_ml: f64,
}

impl Tissue {
    /// Of the soft body of a case.
    pub(crate) fn new(case: &Case, model: &ModelSettings) -> Self {
        let has_septa = model.skull.wants_septa() && case.septa.is_some();
        Self { model: *model, has_septa, ventricles_ml: StructureVolumes::new(&case.tets).ventricles_ml() }
    }

    fn describe(&self, loads: &Loads) -> Value {
        json!({
            "mode": if matches!(self.model.mode, Mode::Physical(_)) { "physical" } else { "paper" },
            "skull": if self.model.skull.slides() { "slides" } else { "held" },
            "septa": self.has_septa,
            "ventricles_ml": self.ventricles_ml,
            "drain_ml": loads.drained_ml(),
            "csf_pressure_mmhg": loads.pressure_mmhg(),
            "gravity_m_s2": loads.gravity_mm_s2.map(|g| g * 1e-3),
        })
    }
}

/// What shall be done from now on; what is not said stays as it is, `null` is nothing, and of fluid one thing can be said.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TissueRequest {
    #[serde(default, deserialize_with = "given")]
    drain_ml: Option<Option<f64>>,
    #[serde(default, deserialize_with = "given")]
    csf_pressure_mmhg: Option<Option<f64>>,
    #[serde(default, deserialize_with = "given")]
    gravity_m_s2: Option<Option<[f64; 3]>>,
}

/// What is given as `null` is not what is left out.
fn given<'de, D: Deserializer<'de>, T: Deserialize<'de>>(value: D) -> Result<Option<T>, D::Error> {
    T::deserialize(value).map(Some)
}

impl TissueRequest {
    fn loads(&self, now: Loads) -> Result<Loads, &'static str> {
        let csf = match (self.drain_ml, self.csf_pressure_mmhg) {
            (Some(Some(_)), Some(Some(_))) => {
                return Err("give drain_ml or csf_pressure_mmhg: one follows from the other");
            }
            (Some(Some(ml)), _) => Csf::Drained { ml },
            (_, Some(Some(mmhg))) => Csf::Pressure { kpa: mmhg * KPA_PER_MMHG },
            (None, None) => now.csf,
            _ => Csf::AtRest,
        };
        let gravity = self.gravity_m_s2.map(|gravity| gravity.unwrap_or_default().map(|g| g * 1e3));
        let gravity_mm_s2 = gravity.unwrap_or(now.gravity_mm_s2);
        Ok(Loads { csf, gravity_mm_s2 })
    }
}

pub(crate) async fn get(State(shared): State<Arc<Shared>>) -> Response {
    Json(shared.tissue.describe(&shared.live.loads())).into_response()
}

pub(crate) async fn post(State(shared): State<Arc<Shared>>, Body(request): Body<TissueRequest>) -> Response {
    let tissue = &shared.tissue;
    let changed = shared.live.change_loads(|now| {
        let loads = request.loads(now).map_err(|why| (StatusCode::UNPROCESSABLE_ENTITY, why.to_owned()))?;
        let status = |why: &LoadError| match why {
            LoadError::Paper => StatusCode::CONFLICT,
            _ => StatusCode::UNPROCESSABLE_ENTITY,
        };
        let checked = loads.check_on(tissue.model.mode, tissue.ventricles_ml);
        checked.map(|()| loads).map_err(|why| (status(&why), why.to_string()))
    });
    match changed {
        Ok(loads) => Json(tissue.describe(&loads)).into_response(),
        Err((status, why)) => refuse(status, &why),
    }
}
