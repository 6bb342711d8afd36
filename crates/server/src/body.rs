//! The bodies of requests.

use crate::door::refuse;
use axum::Json;
use axum::extract::rejection::JsonRejection;
use axum::extract::{FromRequest, Request};
use axum::response::Response;

/// What the JSON of a request says. One that is no JSON, or does not say what was asked for, is refused in words.
#[derive(Debug)]
pub(crate) struct Body<T>(pub(crate) T);

impl<S: Send + Sync, T> FromRequest<S> for Body<T>
where
    Json<T>: FromRequest<S, Rejection = JsonRejection>,
{
    type Rejection = Response;

    async fn from_request(request: Request, state: &S) -> Result<Self, Response> {
        let read = Json::from_request(request, state).await;
        read.map(|Json(said)| Self(said)).map_err(|e| refuse(e.status(), &e.body_text()))
    }
}
