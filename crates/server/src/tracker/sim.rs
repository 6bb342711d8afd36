//! `sim:`: the scripted hand, calibrated and registered exactly.

use crate::live::Live;
use monro_guidance::Plan;
use monro_session::live::{PlainEvent, Refusal, Script, ScriptTruth, SessionEvent};
use monro_tracking::{Batch, Health, Source, TrackingError};
use monro_wire::{Missing, TimedPose};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::Duration;

/// Frames a second, as optical trackers give.
const RATE_HZ: f64 = 120.0;

/// The scripted hand as a source; on the session's own clock.
pub(crate) struct ScriptSource {
    live: Arc<Live>,
    script: Script,
    /// Seconds of the script played so far, and the present when the last frame was taken.
    played: f64,
    last: f64,
}

impl ScriptSource {
    /// Brings the session to navigation and lays the catheter ready.
    pub(crate) fn begin(live: Arc<Live>, plan: Plan) -> Result<Box<dyn Source>, Refusal> {
        let script = Script::new(plan);
        let ScriptTruth { calibration, registration, display_from_glasses } = script.truth();
        live.wear(Some(display_from_glasses));
        for event in [
            SessionEvent::Calibrated(calibration),
            SessionEvent::Registered(registration),
            SessionEvent::Plain(PlainEvent::CheckPassed),
            SessionEvent::Plain(PlainEvent::Started),
        ] {
            live.apply(event)?;
        }
        let last = live.clock.now();
        Ok(Box::new(Self { live, script, played: 0.0, last }))
    }
}

impl Source for ScriptSource {
    fn next(&mut self, wait: Duration) -> Result<Option<Batch>, TrackingError> {
        thread::sleep(Duration::from_secs_f64(1.0 / RATE_HZ).min(wait));
        let now = self.live.clock.now();
        let since = now - core::mem::replace(&mut self.last, now);
        if self.live.paused.load(Ordering::Relaxed) {
            return Ok(Some(Batch::default()));
        }
        self.played += since;
        let pose = |o: monro_session::live::Observation| {
            TimedPose::new(o.name, None, now, o.tracker_from_tool.map(|p| (p, None)).ok_or(Missing::NotTracked))
        };
        let poses = self.script.observations(self.played).into_iter().map(pose).collect();
        Ok(Some(Batch { poses, ..Batch::default() }))
    }

    fn now(&self) -> f64 {
        self.live.clock.now()
    }

    fn diagnosis(&self, _: &[&str]) -> Health {
        Health::well(if self.live.paused.load(Ordering::Relaxed) { "simulated, paused" } else { "simulated" })
    }

    fn facts(&self) -> Vec<String> {
        vec!["a scripted hand that follows the plan".to_owned()]
    }
}
