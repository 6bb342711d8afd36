//! The thread of the soft body: as fast as it can, whatever tracker and displays do.

use crate::live::Live;
use monro_session::live::Deformation;
use std::io;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

/// As fast as displays refresh, s: what is left of it is given back to the machine, for which tracker and displays wait.
const PERIOD_S: f64 = 1.0 / 90.0;

/// Starts the thread; it ends when the session stops.
pub(crate) fn spawn(live: Arc<Live>, deformation: Deformation) -> io::Result<()> {
    thread::Builder::new().name("deformation".into()).spawn(move || run(&live, deformation))?;
    Ok(())
}

fn run(live: &Live, mut deformation: Deformation) {
    let mut last = live.clock.now();
    while !live.is_stopping() {
        let start = live.clock.now();
        // A lost catheter leaves the tissue as it is, but for loads that come on.
        let dt = start - last;
        let cue = live.cue(start, dt, |cue| deformation.is_settled(cue));
        if let Some(deformed) = cue.and_then(|cue| deformation.follow(&cue, dt)) {
            live.publish(deformed, live.clock.now() - start);
        }
        last = start;
        let rest = PERIOD_S - (live.clock.now() - start);
        if rest > 0.0 {
            thread::sleep(Duration::from_secs_f64(rest));
        }
    }
}
