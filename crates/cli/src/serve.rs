//! `monro serve`: a live insertion in the browser.

use crate::NOTICE;
use crate::args::ServeArgs;
use crate::console::Console;
use crate::simulate;
use anyhow::Result;
use monro_server::{Ready, ServeOptions};
use serde_json::json;

/// Runs the command until it is interrupted.
pub(crate) fn run(args: &ServeArgs, console: &Console) -> Result<()> {
    let options = ServeOptions {
        case_dir: args.case.clone(),
        listen: args.listen,
        tracker: args.tracker.parse()?,
        model: simulate::settings(args.mode, 1.0).model,
    };
    monro_server::serve(options, |ready| announce(ready, console))?;
    Ok(())
}

fn announce(ready: &Ready, console: &Console) {
    let line = json!({ "url": ready.url, "token": ready.token, "open": ready.browser_url() });
    let text = format!("Open {} in a browser on this machine (Ctrl-C ends it).\n{NOTICE}", ready.browser_url());
    console.result(&line, &text);
}
