//! Our clock: seconds since 1970, never going back.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Seconds since 1970 as the system said at the start, carried on by a clock that nobody sets.
#[derive(Debug, Clone, Copy)]
pub struct Clock {
    start: Instant,
    unix: Duration,
}

impl Default for Clock {
    fn default() -> Self {
        Self::new()
    }
}

/// The time `since` nanoseconds after `start` nanoseconds since 1970, in seconds: arrival times are made here only, live and
/// in a replay, so that both are the same bits.
pub(crate) fn seconds(start: u64, since: u64) -> f64 {
    start as f64 / 1e9 + since as f64 / 1e9
}

impl Clock {
    /// Starts the clock.
    pub fn new() -> Self {
        Self { start: Instant::now(), unix: SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default() }
    }

    /// Now, s.
    pub fn now(&self) -> f64 {
        self.at(self.nanos())
    }

    /// Nanoseconds since the start.
    pub(crate) fn nanos(&self) -> u64 {
        self.start.elapsed().as_nanos().try_into().unwrap_or(u64::MAX)
    }

    /// The time `since` nanoseconds after the start, s.
    pub(crate) fn at(&self, since: u64) -> f64 {
        seconds(self.start_nanos(), since)
    }

    /// The start, nanoseconds since 1970.
    pub fn start_nanos(&self) -> u64 {
        self.unix.as_nanos().try_into().unwrap_or(u64::MAX)
    }
}
