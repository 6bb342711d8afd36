//! Serves a made-up head without preparing anything: for the browser tests and for work on the web app.
//!
//! Prints one JSON line {url, token, open, case} when it is ready. `serve_ellipsoid CASE` serves that case instead.

#[path = "../tests/common/mod.rs"]
mod common;

fn main() {
    let dir = tempfile::tempdir().expect("temp");
    let case =
        std::env::args_os().nth(1).map_or_else(|| common::write_case(dir.path(), true), std::path::PathBuf::from);
    let shown = case.clone();
    let done = monro_server::serve(common::options(case), |ready| {
        let open = ready.browser_url();
        let line = serde_json::json!({ "url": ready.url, "token": ready.token, "open": open, "case": shown });
        println!("{line}");
    });
    if let Err(error) = done {
        eprintln!("{error}");
        std::process::exit(1);
    }
}
