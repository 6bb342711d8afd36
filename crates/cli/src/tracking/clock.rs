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

impl Clock {
    /// Starts the clock.
    pub fn new() -> Self {
        Self { start: Instant::now(), unix: SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default() }
    }

    /// Now, s.
    pub fn now(&self) -> f64 {
        (self.unix + self.start.elapsed()).as_secs_f64()
    }

    /// The start, nanoseconds since 1970.
    pub fn start_nanos(&self) -> u64 {
        self.unix.as_nanos().try_into().unwrap_or(u64::MAX)
    }
}
