//! A log played again: the same entries through the same session and the same soft body give the same snapshots.

use super::log::Entry;
use super::{Deformation, Deformed, Expiry, Refusal, Session, SessionEvent, Snapshot, ToolNames};
use crate::{Loads, ModelSettings, SessionError};
use monro_case::Case;
use monro_tissue::FrameSettings;
use std::collections::VecDeque;
use std::sync::Arc;
use thiserror::Error;

/// Deformations that are remembered: a display may still show one that is not the newest any more.
const REMEMBERED: usize = 16;

/// Why a log cannot be followed.
#[derive(Debug, Error)]
pub enum PlaybackError {
    /// The soft body cannot be made.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// An event that was taken then is refused now.
    #[error("the recording does not follow from its case: {0}")]
    Refusal(#[from] Refusal),
    /// A snapshot shows a deformation that has not been computed.
    #[error("the recording shows step {0} of the soft body, which it did not take")]
    NoSuchStep(u64),
}

/// A session that is played again.
#[derive(Debug)]
pub struct Playback {
    session: Session,
    deformation: Deformation,
    recent: VecDeque<Arc<Deformed>>,
}

impl Playback {
    /// The session at its start, with the case open.
    ///
    /// # Errors
    /// When the soft body cannot be made.
    pub fn new(case: &Case, settings: &ModelSettings, frame: FrameSettings) -> Result<Self, PlaybackError> {
        let deformation = Deformation::new(case, settings, frame)?;
        let mut session = Session::new(ToolNames::default(), Expiry::default());
        session.apply(SessionEvent::CaseOpened(case.plan))?;
        session.load(Loads::of(&frame));
        let recent = VecDeque::from([Arc::clone(deformation.now())]);
        Ok(Self { session, deformation, recent })
    }

    /// Takes the next entry; gives the snapshot where one was taken.
    ///
    /// # Errors
    /// When the entry does not follow from those before it.
    pub fn take(&mut self, entry: &Entry) -> Result<Option<Snapshot>, PlaybackError> {
        match entry {
            Entry::Opened(_) | Entry::Shown { .. } => {}
            Entry::Event(event) => {
                self.session.apply(event.clone())?;
            }
            Entry::Worn(display_from_glasses) => self.session.wear(*display_from_glasses),
            Entry::Loaded(loads) => self.session.load(*loads),
            Entry::Seen(seen) => {
                for observation in seen {
                    self.session.observe(observation);
                }
            }
            Entry::Step { now_s, dt_s } => {
                if let Some(deformed) = self.deformation.follow(&self.session.cue(*now_s), *dt_s) {
                    self.recent.push_back(deformed);
                    if self.recent.len() > REMEMBERED {
                        self.recent.pop_front();
                    }
                }
            }
            Entry::Taken { time_s, step, .. } => {
                let shown = self.recent.iter().rev().find(|d| d.step == *step);
                let shown = shown.ok_or(PlaybackError::NoSuchStep(*step))?;
                return Ok(Some(self.session.snapshot(*time_s, shown)));
            }
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Mode;
    use crate::live::deformation::tests::case;
    use crate::live::{PlainEvent, Script};
    use monro_tissue::PaperOptions;

    fn settings() -> ModelSettings {
        ModelSettings::of(Mode::Paper(PaperOptions::default()))
    }

    fn entries() -> Vec<Entry> {
        let script = Script::new(case().plan);
        let truth = script.truth();
        let mut all = vec![
            Entry::Event(SessionEvent::Calibrated(truth.calibration)),
            Entry::Event(SessionEvent::Registered(truth.registration)),
            Entry::Event(SessionEvent::Plain(PlainEvent::CheckPassed)),
            Entry::Event(SessionEvent::Plain(PlainEvent::Started)),
        ];
        for i in 0..60u32 {
            let t = 3.0 + f64::from(i) / 30.0;
            all.push(Entry::Seen(script.observations(t).to_vec()));
            all.push(Entry::Step { now_s: t + 0.001, dt_s: 1.0 / 30.0 });
            // A display that still shows the step before.
            let step = u64::from(i);
            all.push(Entry::Taken { id: step, time_s: t + 0.002, step, sequence: i });
        }
        all
    }

    #[test]
    fn the_same_log_gives_the_same_snapshots() {
        let play = || -> Vec<Snapshot> {
            let mut playback = Playback::new(&case(), &settings(), FrameSettings::default()).expect("playback");
            entries().iter().filter_map(|e| playback.take(e).expect("follows")).collect()
        };
        let (a, b) = (play(), play());
        assert_eq!(a.len(), 60);
        assert!(a[59].deformed.largest_mm > 0.0 && a[59].numbers.is_some());
        for (x, y) in a.iter().zip(&b) {
            assert_eq!((x.numbers, x.needle, &x.deformed, x.age_s), (y.numbers, y.needle, &y.deformed, y.age_s));
        }
    }

    #[test]
    fn a_log_that_does_not_follow_from_its_case_is_refused() {
        let mut playback = Playback::new(&case(), &settings(), FrameSettings::default()).expect("playback");
        let started = Entry::Event(SessionEvent::Plain(PlainEvent::Started));
        assert!(matches!(playback.take(&started), Err(PlaybackError::Refusal(_))));
        let shown = Entry::Taken { id: 0, time_s: 0.0, step: 7, sequence: 0 };
        assert!(matches!(playback.take(&shown), Err(PlaybackError::NoSuchStep(7))));
    }
}
