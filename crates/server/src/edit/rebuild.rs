//! Rebuilding the case on a thread of its own, one at a time.

use super::{Known, Shared, Subject};
use crate::lock::lock;
use monro_geometry::Volume;
use monro_prepare::{Observer, Stage};
use serde_json::{Value, json};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// What is said of a panic, whose own words are on the terminal.
const FAULT: &str = "a fault of the program (its words are on the terminal); the edits are kept: change the labels and try again, or export them";

/// Makes the case again from labels, and what is known of those that they began with; writes it, and tells the observer.
/// Errors are sentences for the user.
pub type Rebuild = Box<dyn Fn(Volume<u8>, &Known, &dyn Observer) -> Result<Rebuilt, String> + Send + Sync>;

/// A case that was made again.
#[derive(Debug, Clone)]
pub struct Rebuilt {
    /// Its folder.
    pub case: PathBuf,
    /// What should not be missed about it.
    pub findings: Vec<String>,
    /// The new [`Subject::origin`].
    pub origin: String,
}

/// How far it is.
#[derive(Debug, Default)]
pub(super) enum Progress {
    #[default]
    Never,
    Running {
        stage: &'static str,
        since: Instant,
    },
    Done {
        result: Result<Rebuilt, String>,
        seconds: f64,
        /// Bytes of the edits that are in it.
        edits: u64,
    },
}

impl Progress {
    /// For the page, given the bytes of all edits so far.
    pub(super) fn describe(&self, edits_now: u64) -> Value {
        match self {
            Self::Never => json!({ "state": "never" }),
            Self::Running { stage, since } => {
                json!({ "state": "running", "stage": stage, "seconds": since.elapsed().as_secs_f64() })
            }
            Self::Done { result: Ok(r), seconds, edits } => {
                let edited_since = *edits != edits_now;
                json!({
                    "state": "done", "seconds": seconds, "case": r.case, "findings": r.findings,
                    "edited_since": edited_since,
                })
            }
            Self::Done { result: Err(e), seconds, .. } => json!({ "state": "failed", "seconds": seconds, "error": e }),
        }
    }
}

/// Writes the stage down.
struct Teller<'a> {
    progress: &'a Mutex<Progress>,
    begun: Instant,
}

impl Observer for Teller<'_> {
    fn begin(&self, stage: Stage) {
        *lock(self.progress) = Progress::Running { stage: stage.name(), since: self.begun };
    }
}

/// Starts rebuilding; false when it is running already.
pub(super) fn start(shared: &Arc<Shared>) -> bool {
    let begun = Instant::now();
    {
        let mut progress = lock(&shared.progress);
        if matches!(*progress, Progress::Running { .. }) {
            return false;
        }
        *progress = Progress::Running { stage: "begin", since: begun };
    }
    let shared = Arc::clone(shared);
    // The thread ends by itself; its result is in `progress`, also after a panic: "running" would never end.
    std::thread::spawn(move || {
        let made = catch_unwind(AssertUnwindSafe(|| made_again(&shared, begun)));
        let (result, edits) = made.unwrap_or_else(|_| (Err(FAULT.into()), 0));
        *lock(&shared.progress) = Progress::Done { result, seconds: begun.elapsed().as_secs_f64(), edits };
    });
    true
}

/// The case made again, or why not, and the bytes of the edits that are in it.
fn made_again(shared: &Shared, begun: Instant) -> (Result<Rebuilt, String>, u64) {
    let (labels, edits) = {
        let work = lock(&shared.work);
        (work.desk.labels().clone(), work.store.length())
    };
    let mut result = (shared.rebuild)(labels, &shared.subject.known, &Teller { progress: &shared.progress, begun });
    if let Ok(made) = &mut result {
        let subject = Subject { origin: made.origin.clone(), ..shared.subject.clone() };
        if let Err(error) = lock(&shared.work).store.describe(&subject) {
            made.findings.push(format!("the next session will begin with the rebuilt labels: {error}"));
        }
    }
    (result, edits)
}
