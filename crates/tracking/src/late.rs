//! Streams that fall behind, told by the times that their servers stamp what they send with.

use monro_guidance::Lag;
use monro_guidance::clock::Expiry;

/// What to ask where poses are old by the server's own clock.
pub(crate) const DELAYED: &str = "does the server play a recording or work with a delay?";

/// What the times are good for that a source stamps its poses with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Stamps {
    /// Poses that come later by them than they did are as much older.
    #[default]
    Heeded,
    /// Nothing: its clock does not keep time.
    Ignored,
}

/// How late poses come.
#[derive(Debug, Clone)]
pub(crate) struct Late {
    lag: Lag,
    stamps: Stamps,
    now: f64,
    /// When the last came, s.
    last: f64,
}

/// That stamps went back is told for so long, s.
const TOLD: f64 = 30.0;

impl Late {
    pub(crate) fn new(stamps: Stamps) -> Self {
        Self { lag: Lag::default(), stamps, now: 0.0, last: f64::NEG_INFINITY }
    }

    /// How late (s) what is stamped so and came then is; 0 where nothing says it.
    pub(crate) fn take(&mut self, stamp: Option<f64>, arrival: f64) -> f64 {
        let stamp = stamp.filter(|_| self.stamps == Stamps::Heeded);
        self.last = arrival;
        self.now = stamp.map_or(0.0, |stamp| self.lag.take(stamp, arrival));
        self.now
    }

    /// What comes from now on may be another server's.
    pub(crate) fn forget(&mut self) {
        *self = Self::new(self.stamps);
    }

    /// That poses of `what` come late, where that makes them stale, or may, for all that their stamps tell.
    pub(crate) fn words(&self, what: &str) -> Option<String> {
        if self.now < Expiry::default().stale {
            let (by, when) = self.lag.set_back().filter(|(_, when)| self.last - when < TOLD)?;
            return Some(format!(
                "the times that {what} is stamped with went back by {by:.2} s, {:.0} s ago: that clock was set anew (then all is \
                 well, and ?stamps=ignore says so), or what comes is as much older than it is counted",
                self.last - when
            ));
        }
        Some(format!(
            "{what} comes {:.2} s later than it did, by the times that the server stamps it with: it is held up there or on \
                 the way, and counted as so much older. If that clock does not keep time: ?stamps=ignore",
            self.now
        ))
    }
}
