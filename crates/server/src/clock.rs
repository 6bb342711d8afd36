//! The session's clock: seconds since the server started, monotonic.

use std::time::Instant;

/// Seconds since the server started.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Clock(Instant);

impl Clock {
    /// A clock that starts now.
    pub(crate) fn start() -> Self {
        Self(Instant::now())
    }

    /// Seconds since the start.
    pub(crate) fn now(&self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }
}
