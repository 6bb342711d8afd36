//! `sim:`: the scripted hand, calibrated and registered exactly.

use crate::live::Live;
use monro_guidance::Plan;
use monro_session::live::{PlainEvent, Refusal, Script, ScriptTruth, SessionEvent};
use std::io;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::Duration;

/// Frames a second, as optical trackers give.
const RATE_HZ: f64 = 120.0;

/// Starts the thread; it ends when the session stops.
pub(crate) fn spawn(live: Arc<Live>, plan: Plan) -> io::Result<()> {
    let script = Script::new(plan);
    prepare(&live, &script).map_err(io::Error::other)?;
    thread::Builder::new().name("tracker".into()).spawn(move || run(&live, &script))?;
    Ok(())
}

fn prepare(live: &Live, script: &Script) -> Result<(), Refusal> {
    let ScriptTruth { calibration, registration } = script.truth();
    live.apply(SessionEvent::Calibrated(calibration))?;
    live.apply(SessionEvent::Registered(registration))?;
    live.apply(SessionEvent::Plain(PlainEvent::CheckPassed))?;
    live.apply(SessionEvent::Plain(PlainEvent::Started))?;
    Ok(())
}

fn run(live: &Live, script: &Script) {
    let mut played = 0.0;
    let mut last = live.clock.now();
    while !live.is_stopping() {
        let now = live.clock.now();
        if !live.paused.load(Ordering::Relaxed) {
            played += now - last;
            let mut seen = script.observations(played);
            seen.iter_mut().for_each(|o| o.time_s = now);
            live.observe(&seen);
        }
        last = now;
        thread::sleep(Duration::from_secs_f64(1.0 / RATE_HZ));
    }
}
