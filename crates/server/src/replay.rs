//! A recorded session again, without a clock: the same snapshots, bit for bit, or where they part.

use crate::ServeError;
use crate::guidance::Guidance;
use crate::record::{case_of, identity};
use crate::snapshot::{Moved, Quantised, digest, encode};
use monro_case::Case;
use monro_session::live::Playback;
use monro_session::live::log::{Entry, Log, Opened, read};
use monro_session::{FrameSettings, ModelSettings};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What a replay found.
#[derive(Debug, Clone, PartialEq)]
pub struct Replayed {
    /// Seconds from the first to the last entry, on the session's clock.
    pub seconds: f64,
    /// Frames of the tracker, steps of the soft body, events of the procedure.
    pub frames: u64,
    /// Steps of the soft body.
    pub steps: u64,
    /// Events of the procedure.
    pub events: u64,
    /// Snapshots that went to displays.
    pub snapshots: u64,
    /// How many of them came out the same, bit for bit.
    pub identical: u64,
    /// Time of the first that did not, s.
    pub differs_at_s: Option<f64>,
    /// Bytes at the end that are not played: of an unfinished entry, as a crash leaves them, or from a damaged one on.
    pub cut_off: usize,
    /// Why those cannot be played, where they are damaged.
    pub damage: Option<String>,
    /// Where the case lies.
    pub case_dir: PathBuf,
    /// The program that recorded it.
    pub generator: String,
}

/// Plays a recording. `settings` knows the soft body by the name that was recorded; `case_dir` is used instead of the
/// folder that the recording tells, seen from its own; `each` gets the JSON of each snapshot, `progress` the share done.
///
/// # Errors
/// A file that is no recording, a case that is missing or another one, a log that does not follow from it.
pub fn replay(
    recording: &Path,
    case_dir: Option<&Path>,
    settings: impl Fn(&str) -> Option<(ModelSettings, FrameSettings)>,
    mut each: impl FnMut(&serde_json::Value),
    mut progress: impl FnMut(f64),
) -> Result<Replayed, ServeError> {
    if recording.is_dir() {
        return Err(ServeError::ManyRecordings(recording.to_owned()));
    }
    let named = |error| ServeError::Recording { path: recording.to_owned(), error };
    let file = std::fs::read(recording).map_err(named)?;
    if monro_wire::recording::is_recording(&file) {
        return Err(ServeError::OfATracker(recording.to_owned()));
    }
    let Log { entries, left, damage } = read(&file)?;
    let Some(Entry::Opened(opened)) = entries.first() else { return Err(ServeError::NoOpening) };
    let (case, case_dir) = open_case(opened, recording, case_dir)?;
    let (model, frame) = settings(&opened.settings).ok_or_else(|| ServeError::Settings(opened.settings.clone()))?;
    let mut taken = BTreeMap::new();
    let mut playback = Playback::new(&case, &model, frame)?;
    let mut out = Replayed::begin(opened, case_dir, (left, damage.map(|error| error.to_string())));
    let (mut first, mut last) = (f64::INFINITY, f64::NEG_INFINITY);
    for (i, entry) in entries.iter().enumerate() {
        progress(i as f64 / entries.len() as f64);
        let snapshot = playback.take(entry)?;
        if let Some(time) = out.count(entry) {
            (first, last) = (first.min(time), last.max(time));
        }
        match (snapshot, entry) {
            (Some(snapshot), Entry::Taken { id, sequence, .. }) => {
                let guidance = Guidance::new(&snapshot, case.plan.target());
                let moved = Quantised::new(Moved::Nodes, &snapshot.deformed.displacements);
                taken.insert(*id, (snapshot.time_s, digest(&encode(&snapshot, &moved, &guidance, *sequence))));
                each(&serde_json::to_value(&guidance).unwrap_or_default());
            }
            (_, Entry::Shown { id, digest }) => out.compare(taken.remove(id), *digest),
            _ => {}
        }
    }
    out.seconds = (last - first).max(0.0);
    Ok(out)
}

impl Replayed {
    fn begin(opened: &Opened, case_dir: PathBuf, (cut_off, damage): (usize, Option<String>)) -> Self {
        let generator = opened.generator.clone();
        let (frames, steps, events, snapshots, identical) = (0, 0, 0, 0, 0);
        Self {
            seconds: 0.0,
            frames,
            steps,
            events,
            snapshots,
            identical,
            differs_at_s: None,
            cut_off,
            damage,
            case_dir,
            generator,
        }
    }

    /// Compares a snapshot (its time and digest) with what was sent.
    fn compare(&mut self, taken: Option<(f64, u64)>, sent: u64) {
        match taken {
            Some((_, digest)) if digest == sent => self.identical += 1,
            other => {
                self.differs_at_s.get_or_insert(other.map_or(f64::NAN, |(time, _)| time));
            }
        }
    }

    /// Counts an entry; gives its time where it has one.
    fn count(&mut self, entry: &Entry) -> Option<f64> {
        let (counter, time) = match entry {
            Entry::Opened(_) => return None,
            Entry::Event(_) | Entry::Worn(_) | Entry::Loaded(_) => (&mut self.events, None),
            Entry::Seen(seen) => (&mut self.frames, seen.first().map(|o| o.time_s)),
            Entry::Step { now_s, .. } => (&mut self.steps, Some(*now_s)),
            Entry::Taken { time_s, .. } => return Some(*time_s),
            Entry::Shown { .. } => (&mut self.snapshots, None),
        };
        *counter += 1;
        time
    }
}

/// The case of a recording; another one, or a changed one, is refused.
fn open_case(opened: &Opened, recording: &Path, case_dir: Option<&Path>) -> Result<(Case, PathBuf), ServeError> {
    let (case, dir) = match case_dir {
        Some(dir) => (Case::open(dir)?, dir.to_owned()),
        None => {
            let dir = case_of(recording, &opened.case_dir);
            (Case::open(&dir).map_err(ServeError::CaseGone)?, dir)
        }
    };
    if identity(&case) == opened.identity { Ok((case, dir)) } else { Err(ServeError::OtherCase(dir)) }
}
