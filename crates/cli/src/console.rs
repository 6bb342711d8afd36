//! Progress on stderr, results on stdout.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use monro_prepare::{Observer, Stage};
use serde_json::{Map, Value};
use std::cell::{Cell, RefCell};
use std::io::Write;
use std::time::{Duration, Instant};

/// A line on stderr. Whoever has closed it wants none, and nothing may end, or fail to end, because of that: `eprintln!`
/// panics there.
pub(crate) fn tell(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Where the program talks.
#[derive(Debug)]
pub(crate) struct Console {
    json: bool,
    bar: ProgressBar,
    stages: RefCell<Vec<(String, f64)>>,
    begun: Cell<Option<Instant>>,
}

impl Console {
    /// A console; with `json`, [`Console::result`] prints JSON instead of text.
    pub(crate) fn new(json: bool) -> Self {
        // Hidden by itself where stderr is not a terminal; stages are then announced line by line.
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        if let Ok(style) = ProgressStyle::with_template("{spinner} {msg} ({elapsed})") {
            bar.set_style(style);
        }
        Self { json, bar, stages: RefCell::new(Vec::new()), begun: Cell::new(None) }
    }

    /// Runs one stage of long work under a name and remembers its seconds.
    pub(crate) fn stage<T>(&self, name: &str, work: impl FnOnce() -> T) -> T {
        self.begin_named(name);
        let out = work();
        self.end_named(name);
        out
    }

    fn begin_named(&self, name: &str) {
        self.bar.set_message(name.to_owned());
        self.bar.enable_steady_tick(Duration::from_millis(120));
        self.begun.set(Some(Instant::now()));
    }

    fn end_named(&self, name: &str) {
        let seconds = self.begun.take().map_or(0.0, |t| t.elapsed().as_secs_f64());
        self.stages.borrow_mut().push((name.to_owned(), seconds));
        self.note(&format!("{name}: {seconds:.2} s"));
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
            tell(text);
        } else {
            self.bar.println(text);
        }
    }

    /// A remark that the user should not miss, on stderr.
    pub(crate) fn warn(&self, text: &str) {
        self.note(&format!("warning: {text}"));
    }

    /// The result: `json` as one object, or the text. Whoever closes our output has seen enough.
    pub(crate) fn result(&self, json: &Value, text: &str) {
        self.finish();
        let mut out = std::io::stdout();
        let _ = if self.json { writeln!(out, "{json}") } else { writeln!(out, "{text}") };
    }

    /// Takes the progress line away.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Observer for Console {
    fn begin(&self, stage: Stage) {
        self.begin_named(stage.name());
    }

    fn end(&self, stage: Stage) {
        self.end_named(stage.name());
    }

    fn remark(&self, text: &str) {
        self.warn(text);
    }
}

/// Stage seconds as a JSON object; those of a stage that was gone through several times are added up.
pub(crate) fn seconds_json(stages: &[(String, f64)]) -> Value {
    let mut sums = Map::new();
    for (name, _) in stages {
        let sum: f64 = stages.iter().filter(|s| s.0 == *name).map(|s| s.1).sum();
        sums.insert(name.clone(), Value::from((sum * 1000.0).round() / 1000.0));
    }
    Value::Object(sums)
}
