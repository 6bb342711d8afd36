//! How often something happens and how long it takes, as a running mean.

/// Weight of the newest value in the mean.
const WEIGHT: f64 = 0.05;

/// A running mean of intervals and durations, s.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Rate {
    last: Option<f64>,
    interval: Option<f64>,
    duration: Option<f64>,
}

fn mix(mean: Option<f64>, value: f64) -> Option<f64> {
    Some(mean.map_or(value, |m| m + WEIGHT * (value - m)))
}

impl Rate {
    /// It happened at `now` (s) and took `duration` (s).
    pub(crate) fn tick(&mut self, now: f64, duration: f64) {
        if let Some(last) = self.last {
            self.interval = mix(self.interval, now - last);
        }
        self.last = Some(now);
        self.duration = mix(self.duration, duration);
    }

    /// Times per second at `now`: 0 when it has stopped (nothing for a second).
    pub(crate) fn hz(&self, now: f64) -> f64 {
        let running = self.last.is_some_and(|t| now - t < 1.0);
        self.interval.filter(|i| running && *i > 0.0).map_or(0.0, |i| 1.0 / i)
    }

    /// Mean duration, ms.
    pub(crate) fn ms(&self) -> f64 {
        self.duration.unwrap_or(0.0) * 1e3
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steady_beat_is_measured_and_a_stopped_one_is_zero() {
        let mut r = Rate::default();
        (0..100).for_each(|i| r.tick(f64::from(i) * 0.02, 0.005));
        assert!((r.hz(1.98) - 50.0).abs() < 1e-6 && (r.ms() - 5.0).abs() < 1e-9);
        assert!(r.hz(3.1) <= 0.0);
    }
}
