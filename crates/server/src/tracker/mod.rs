//! Where poses come from. Each source runs on a thread of its own and only ever hands observations to the session.

mod sim;

use crate::live::Live;
use core::fmt;
use core::str::FromStr;
use monro_guidance::Plan;
use monro_guidance::clock::age;
use monro_session::live::{Observation, Refusal};
use monro_tracking::{
    Batch, Clock, Rivals, Source, Stillness, TrackerUrl, TrackerUrlError, TrackingError, Unusable, open, tool_name,
};
use sim::ScriptSource;
use std::io;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

/// How long the thread waits for a frame before it looks whether the session stops.
const WAIT: Duration = Duration::from_millis(50);
/// Pause before a source that failed is opened again.
const RETRY: Duration = Duration::from_secs(1);
/// How often the source is asked how it is, s.
const DIAGNOSE_S: f64 = 1.0;

/// Where poses come from. All but the script are calibrated and registered over the API.
pub enum Tracker {
    /// `sim:`: a scripted insertion along the plan, calibrated and registered exactly.
    Sim,
    /// A tracker or a recording.
    Url {
        /// As it was given, for people.
        text: String,
        /// As it was read.
        url: TrackerUrl,
    },
    /// A source that somebody else has opened.
    Source {
        /// Its name, for people.
        name: String,
        /// The source.
        source: Box<dyn Source>,
    },
}

impl Tracker {
    /// Its name, for people.
    pub(crate) fn name(&self) -> &str {
        match self {
            Self::Sim => "sim:",
            Self::Url { text, .. } => text,
            Self::Source { name, .. } => name,
        }
    }

    /// The same once more, unless somebody else has opened it.
    pub(crate) fn try_clone(&self) -> Option<Self> {
        match self {
            Self::Sim => Some(Self::Sim),
            Self::Url { text, url } => Some(Self::Url { text: text.clone(), url: url.clone() }),
            Self::Source { .. } => None,
        }
    }

    /// Starts it.
    ///
    /// # Errors
    /// When the source cannot be opened or the thread not be started.
    pub(crate) fn start(self, live: &Arc<Live>, plan: Plan) -> Result<(), StartError> {
        let (source, url) = match self {
            Self::Sim => (ScriptSource::begin(Arc::clone(live), plan)?, None),
            Self::Url { url, .. } => (open(&url, Clock::new(), None)?, Some(url)),
            Self::Source { source, .. } => (source, None),
        };
        let live = Arc::clone(live);
        let run = move || {
            let mut source = Some(source);
            while let Some(open) = source.take() {
                pump(open, &live, url.is_some());
                source = url.as_ref().and_then(|u| reopen(u, &live));
            }
        };
        thread::Builder::new().name("tracker".into()).spawn(run)?;
        Ok(())
    }
}

/// Why a tracker cannot be started.
#[derive(Debug, thiserror::Error)]
pub(crate) enum StartError {
    #[error(transparent)]
    Tracking(#[from] TrackingError),
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error(transparent)]
    Refusal(#[from] Refusal),
}

/// Hands on what a source gives until it ends or fails, or the session stops. While nothing comes, poses grow old by
/// themselves. Poses that are `measured` are watched for whether they ever change.
fn pump(mut source: Box<dyn Source>, live: &Live, measured: bool) {
    let (mut asked, mut rivals, mut stillness) = (f64::NEG_INFINITY, Rivals::default(), Stillness::default());
    let mut unusable = Unusable::default();
    while !live.is_stopping() {
        match source.next(WAIT) {
            Ok(Some(mut batch)) => {
                live.take_bodies(&batch);
                stillness.take(&batch);
                rivals.settle(&mut batch);
                unusable.take(&batch);
                live.observe(observations(&batch, source.now(), live.clock.now()));
            }
            Ok(None) => {
                live.note_tracker(source.diagnosis(&[]).words, None);
                return;
            }
            Err(error) => {
                live.note_tracker(error.to_string(), None);
                return;
            }
        }
        if live.clock.now() - asked > DIAGNOSE_S {
            asked = live.clock.now();
            let wanted = live.wanted_tools();
            let wanted = wanted.each_ref().map(String::as_str);
            let still = stillness.words(&wanted).filter(|_| measured);
            let more = rivals.words(&wanted).or_else(|| unusable.words(&wanted)).or_else(|| still.clone());
            let more = more.map_or_else(String::new, |words| format!("; {words}"));
            live.note_tracker(source.diagnosis(&wanted).words + &more, still);
        }
    }
}

/// A source that failed is opened again, until it succeeds or the session stops; a recording that has ended is not.
fn reopen(url: &TrackerUrl, live: &Live) -> Option<Box<dyn Source>> {
    if matches!(url, TrackerUrl::Replay(_)) {
        return None;
    }
    while !live.is_stopping() {
        thread::sleep(RETRY);
        match open(url, Clock::new(), None) {
            Ok(source) => return Some(source),
            Err(error) => live.note_tracker(error.to_string(), None),
        }
    }
    None
}

/// The poses of a frame on the session's clock: `now` is the present on the source's, `here` on ours. A pose is as old as
/// the camera's exposure where the source tells it and the clocks are known, else as old as its arrival.
fn observations(batch: &Batch, now: f64, here: f64) -> Vec<Observation> {
    let one = |p: &monro_wire::TimedPose| Observation {
        name: tool_name(&p.name).to_owned(),
        time_s: here - age(now, (p.arrival_time, p.lag), p.source_time, batch.clock.as_ref()),
        tracker_from_tool: p.tracker_from_tool,
    };
    batch.poses.iter().map(one).collect()
}

impl fmt::Debug for Tracker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Tracker").field(&self.name()).finish()
    }
}

impl FromStr for Tracker {
    type Err = TrackerUrlError;

    /// Any [`TrackerUrl`]; `sim:` follows the plan of the case.
    fn from_str(text: &str) -> Result<Self, TrackerUrlError> {
        Ok(match text.parse()? {
            TrackerUrl::Sim => Self::Sim,
            url => Self::Url { text: text.to_owned(), url },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_wire::TimedPose;

    #[test]
    fn every_kind_of_tracker_is_read_and_others_are_refused() {
        for url in ["sim:", "igtl://10.0.0.7", "natnet://host?unicast=1", "replay:a.mnr?fast=1"] {
            assert_eq!(url.parse::<Tracker>().expect(url).name(), url);
        }
        for bad in ["", "sim", "igtl://", "http://x"] {
            assert!(bad.parse::<Tracker>().is_err(), "{bad}");
        }
    }

    #[test]
    fn a_pose_is_as_old_on_our_clock_as_on_the_sources_and_loses_the_name_of_its_frame() {
        let pose = TimedPose::new("CatheterToTracker", None, 1e9, Err(monro_wire::Missing::NotTracked));
        let seen = observations(&Batch { poses: vec![pose], ..Batch::default() }, 1e9 + 0.25, 10.0);
        assert_eq!(seen[0].name, "Catheter");
        assert!((seen[0].time_s - 9.75).abs() < 1e-6);
    }
}
