//! `monro serve`: a live insertion in the browser.

use crate::NOTICE;
use crate::args::ServeArgs;
use crate::console::Console;
use crate::simulate;
use anyhow::Result;
use monro_cli::tracking::{self, Clock, Source};
use monro_server::{Feed, Ready, ServeOptions, Tracker};
use serde_json::json;
use std::time::Duration;

/// Runs the command until it is interrupted.
pub(crate) fn run(args: &ServeArgs, console: &Console) -> Result<()> {
    let options = ServeOptions {
        case_dir: args.case.clone(),
        listen: args.listen,
        tracker: tracker(&args.tracker)?,
        model: simulate::settings(args.mode, 1.0).model,
    };
    monro_server::serve(options, |ready| announce(ready, console))?;
    Ok(())
}

/// The server speaks OpenIGTLink itself and plays the script; every other source is opened here and fed to it.
fn tracker(url: &str) -> Result<Tracker> {
    if url == "sim:" || url.starts_with("igtl:") {
        return Ok(url.parse()?);
    }
    let source = tracking::open(&url.parse()?, Clock::new(), None)?;
    Ok(Tracker::Other { name: url.to_owned(), run: Box::new(move |feed| pump(source, &feed)) })
}

/// Hands on what a source gives until it ends or the server stops; a source that fails leaves the tools stale, then lost.
fn pump(mut source: Box<dyn Source>, feed: &Feed) {
    while !feed.is_stopping() {
        match source.next(Duration::from_millis(50)) {
            Ok(Some(batch)) => feed.take(&batch.poses, source.now()),
            Ok(None) => break,
            Err(error) => {
                eprintln!("monro: the tracker failed: {error:#}; {}", source.diagnosis(&[]));
                break;
            }
        }
    }
}

fn announce(ready: &Ready, console: &Console) {
    let line = json!({ "url": ready.url, "token": ready.token, "open": ready.browser_url() });
    let text = format!("Open {} in a browser on this machine (Ctrl-C ends it).\n{NOTICE}", ready.browser_url());
    console.result(&line, &text);
}
