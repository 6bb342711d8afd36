//! Progress on stderr, results on stdout.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::Value;
use std::cell::RefCell;
use std::time::{Duration, Instant};

/// Where the program talks.
#[derive(Debug)]
pub(crate) struct Console {
    json: bool,
    bar: ProgressBar,
    stages: RefCell<Vec<(String, f64)>>,
}

impl Console {
    /// A console; with `json`, [`Console::result`] prints JSON instead of text.
    pub(crate) fn new(json: bool) -> Self {
        // Hidden by itself where stderr is not a terminal; stages are then announced line by line.
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        if let Ok(style) = ProgressStyle::with_template("{spinner} {msg} ({elapsed})") {
            bar.set_style(style);
        }
        Self { json, bar, stages: RefCell::new(Vec::new()) }
    }

    /// Runs one stage of long work under a name and remembers its seconds.
    pub(crate) fn stage<T>(&self, name: &str, work: impl FnOnce() -> T) -> T {
        self.bar.set_message(name.to_owned());
        self.bar.enable_steady_tick(Duration::from_millis(120));
        let start = Instant::now();
        let out = work();
        let seconds = start.elapsed().as_secs_f64();
        self.stages.borrow_mut().push((name.to_owned(), seconds));
        self.note(&format!("{name}: {seconds:.2} s"));
        out
    }

    /// Changes the text of the running stage, for progress inside it.
    pub(crate) fn progress(&self, text: String) {
        self.bar.set_message(text);
    }

    /// Seconds of each stage so far, in order.
    pub(crate) fn stages(&self) -> Vec<(String, f64)> {
        self.stages.borrow().clone()
    }

    /// A line for people, on stderr.
    pub(crate) fn note(&self, text: &str) {
        if self.bar.is_hidden() {
            eprintln!("{text}");
        } else {
            self.bar.println(text);
        }
    }

    /// A remark that the user should not miss, on stderr.
    pub(crate) fn warn(&self, text: &str) {
        self.note(&format!("warning: {text}"));
    }

    /// The result: `json` as one object, or the text.
    pub(crate) fn result(&self, json: &Value, text: &str) {
        self.finish();
        if self.json {
            println!("{json}");
        } else {
            println!("{text}");
        }
    }

    /// Takes the progress line away.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// Stage seconds as a JSON object.
pub(crate) fn seconds_json(stages: &[(String, f64)]) -> Value {
    let entry = |(name, s): &(String, f64)| (name.clone(), Value::from((s * 1000.0).round() / 1000.0));
    Value::Object(stages.iter().map(entry).collect())
}
