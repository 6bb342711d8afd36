//! The web app, from the binary. `build.rs` lists what `web/dist` held; without it there is one page that says so.

use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE};
use axum::http::{StatusCode, Uri};
use axum::response::{IntoResponse, Response};

include!(concat!(env!("OUT_DIR"), "/web_files.rs"));

/// Whether the web app is in this binary.
pub(crate) const IS_BUILT: bool = !FILES.is_empty();

const PLACEHOLDER: &str = include_str!("placeholder.html");

/// Everything that is not the API.
pub(crate) async fn file(uri: Uri) -> Response {
    let path = uri.path().trim_start_matches('/');
    page(if path.is_empty() { "index.html" } else { path })
}

/// A file of the app by its name; without the app, pages are the one that says how to build it.
pub(crate) fn page(path: &str) -> Response {
    match FILES.iter().find(|(name, _)| *name == path) {
        Some((name, bytes)) => {
            // Vite puts a hash of the content into the names below assets/.
            let cache = if name.starts_with("assets/") { "max-age=31536000, immutable" } else { "no-cache" };
            ([(CONTENT_TYPE, content_type(name)), (CACHE_CONTROL, cache)], *bytes).into_response()
        }
        None if !IS_BUILT && !path.contains('/') && path.ends_with(".html") => {
            ([(CONTENT_TYPE, "text/html; charset=utf-8")], PLACEHOLDER).into_response()
        }
        None => (StatusCode::NOT_FOUND, "not found").into_response(),
    }
}

fn content_type(name: &str) -> &'static str {
    match name.rsplit_once('.').map_or("", |(_, extension)| extension) {
        "html" => "text/html; charset=utf-8",
        "js" => "text/javascript; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "svg" => "image/svg+xml",
        "json" | "map" => "application/json",
        "wasm" => "application/wasm",
        _ => "application/octet-stream",
    }
}
