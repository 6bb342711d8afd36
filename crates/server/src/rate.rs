//! How often something happens and how long it takes.

/// Weight of the newest duration in the mean.
const WEIGHT: f64 = 0.05;
/// What happens is counted over so long, s: tools in messages of their own come in bursts, of which no interval tells.
const WINDOW: f64 = 1.0;

/// A count over the last second and a running mean of durations, s.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Rate {
    last: Option<f64>,
    begun: f64,
    count: u32,
    hz: Option<f64>,
    duration: Option<f64>,
}

impl Rate {
    /// It happened at `now` (s) and took `duration` (s).
    pub(crate) fn tick(&mut self, now: f64, duration: f64) {
        if self.last.is_none_or(|last| now - last >= WINDOW) {
            (self.begun, self.count, self.hz) = (now, 0, None);
        } else if now - self.begun >= WINDOW {
            self.hz = Some(f64::from(self.count) / (now - self.begun));
            (self.begun, self.count) = (now, 0);
        }
        self.count += 1;
        self.last = Some(now);
        self.duration = Some(self.duration.map_or(duration, |m| m + WEIGHT * (duration - m)));
    }

    /// Times per second at `now`: 0 when it has stopped (nothing for a second).
    pub(crate) fn hz(&self, now: f64) -> f64 {
        let running = self.last.is_some_and(|t| now - t < WINDOW);
        // Before a second is over: by the intervals so far.
        let since = self.last.map_or(0.0, |last| last - self.begun);
        let first = (since > 0.0).then(|| f64::from(self.count - 1) / since);
        self.hz.or(first).filter(|_| running).unwrap_or(0.0)
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
        (0..20).for_each(|i| r.tick(f64::from(i) * 0.02, 0.005));
        assert!((r.hz(0.38) - 50.0).abs() < 1e-6 && (r.ms() - 5.0).abs() < 1e-9);
        (20..200).for_each(|i| r.tick(f64::from(i) * 0.02, 0.005));
        assert!((r.hz(3.98) - 50.0).abs() < 1.0, "{}", r.hz(3.98));
        assert!(r.hz(5.1) <= 0.0);
    }

    /// 60 tools in messages of their own, 240 times a second: 70,000 to 86,000 were shown.
    #[test]
    fn bursts_were_counted_by_the_intervals_within_them() {
        let mut r = Rate::default();
        let burst = |i: u32, tool: u32| f64::from(i) / 240.0 + f64::from(tool) * 1e-5;
        (0..720).flat_map(|i| (0..60).map(move |tool| burst(i, tool))).for_each(|at| r.tick(at, 0.0));
        assert!((r.hz(3.0) / 14_400.0 - 1.0).abs() < 0.01, "{}", r.hz(3.0));
    }
}
