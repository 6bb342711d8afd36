//! How late a stream has become, by the stamps of a clock of which nothing else is known.

/// A delay that comes on within so long (up to twice that) is seen, s. Clocks drift by less than 1e-3 meanwhile: 30 ms.
const LONG: f64 = 15.0;
/// A delay counts once nothing has come without it for so long (up to twice that), s: stamps may be coarse, or count in jumps.
const SHORT: f64 = 1.0;
/// Stamps that go back by more are those of a clock that was set anew, s.
const BACK: f64 = 0.25;

/// Compares when things came with when they are said to be of: `arrival - stamp` is the way's length and the offset between the
/// clocks, and where the least of it grows, what comes is held up. A delay that was there from the beginning is not seen.
#[derive(Debug, Clone)]
pub struct Lag {
    newest: f64,
    quickest: Least,
    quick: Least,
    lag: f64,
    set_back: Option<(f64, f64)>,
}

impl Default for Lag {
    fn default() -> Self {
        Self {
            newest: f64::NEG_INFINITY,
            quickest: Least::new(LONG, true),
            quick: Least::new(SHORT, false),
            lag: 0.0,
            set_back: None,
        }
    }
}

impl Lag {
    /// Takes what is stamped with `stamp` (s, of any clock) and came at `arrival` (s, of ours). How much later it came than the
    /// quickest lately, s; 0 where that cannot be said.
    pub fn take(&mut self, stamp: f64, arrival: f64) -> f64 {
        let way = arrival - stamp;
        if way.is_finite() && stamp < self.newest - BACK {
            let set_back = Some((self.newest - stamp, arrival));
            *self = Self { set_back, ..Self::default() };
        }
        // What comes with the stamp of the one before says nothing of the way: it is of a clock that is coarse.
        if way.is_finite() && stamp != self.newest {
            self.newest = self.newest.max(stamp);
            self.lag = self.quick.take(way, arrival) - self.quickest.take(way, arrival);
        }
        self.lag
    }

    /// By how much stamps went back last, s, and when that was by our clock. The clock was set anew then, or what came from there
    /// on is as much older than it seems: that cannot be told.
    pub fn set_back(&self) -> Option<(f64, f64)> {
        self.set_back
    }
}

/// The least value of a window of time, and at most of twice that.
#[derive(Debug, Clone)]
struct Least {
    window: f64,
    /// Whether a silence is no reason to forget: what comes after it may have been waiting all the while.
    outlasts: bool,
    before: f64,
    now: f64,
    begun: f64,
}

impl Least {
    const fn new(window: f64, outlasts: bool) -> Self {
        Self { window, outlasts, before: f64::INFINITY, now: f64::INFINITY, begun: f64::NEG_INFINITY }
    }

    fn take(&mut self, value: f64, at: f64) -> f64 {
        let since = at - self.begun;
        if since > self.window {
            self.before = match since > 2.0 * self.window {
                true if self.outlasts => self.before.min(self.now),
                true => f64::INFINITY,
                false => self.now,
            };
            (self.now, self.begun) = (f64::INFINITY, at);
        }
        self.now = self.now.min(value);
        self.now.min(self.before)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Random;

    /// What is found at the end of a stream at 60 Hz for `seconds`; `delay` and `stamp` of the time at which it was measured.
    fn after(seconds: f64, delay: impl Fn(f64) -> f64, stamp: impl Fn(f64) -> f64) -> (f64, f64) {
        let (mut lag, mut last, mut most) = (Lag::default(), 0.0, 0f64);
        let mut arrival = f64::NEG_INFINITY;
        for i in 0..(60.0 * seconds) as u32 {
            let measured = f64::from(i) / 60.0;
            // Nothing overtakes.
            arrival = (measured + delay(measured)).max(arrival);
            last = lag.take(stamp(measured), arrival);
            most = most.max(last);
        }
        (last, most)
    }

    #[test]
    fn a_delay_that_comes_on_is_found_to_its_size() {
        let other = |t: f64| t * (1.0 - 2e-4) + 1.7e9;
        for full in [0.2, 0.8, 3.0] {
            let (found, _) = after(20.0, |t| 0.004 + full * ((t - 8.0) / 6.0).clamp(0.0, 1.0), other);
            assert!((found - full).abs() < 0.01, "{found} of {full}");
        }
        // A queue that is worked off: none is left.
        let (found, most) = after(40.0, |t| if t < 20.0 { 0.02 * t } else { 0.01 }, other);
        assert!(found < 0.01 && most > 0.25, "{found}, {most}");
    }

    /// What waited while the cable was out comes at once when it is in again.
    #[test]
    fn what_comes_after_a_silence_is_as_late_as_it_waited() {
        for silence in [5.0, 20.0, 100.0] {
            let mut lag = Lag::default();
            assert!((0..600).all(|i| lag.take(f64::from(i) / 60.0, f64::from(i) / 60.0 + 0.01) < 1e-9));
            let found = lag.take(10.0, 10.0 + silence);
            assert!((found - silence + 0.01).abs() < 1e-6, "{found} of {silence}");
        }
    }

    #[test]
    fn coarse_stamps_jitter_drift_and_a_clock_set_anew_are_no_delay() {
        let (still, whole) = (|_: f64| 0.01, |t: f64| t);
        assert!(after(60.0, still, f64::floor).1 < 0.05, "whole seconds");
        // Nanoseconds where 2^-32 s belong.
        assert!(after(60.0, still, |t| t.floor() + t.fract() * 1e9 / 4_294_967_296.0).1 < 0.05);
        assert!(after(60.0, still, |_| 5.0).1 < 1e-9, "a clock that stands");
        assert!(after(300.0, still, |t| t * (1.0 - 1e-3)).1 < 0.032, "drift");
        assert!(after(60.0, still, |t| if t < 30.0 { t + 500.0 } else { t }).1 < 1e-9, "set back");
        assert!(after(60.0, still, |t| if t < 30.0 { t } else { t + 500.0 }).1 < 1e-9, "set on");
        let mut random = Random::new(3);
        let jitter: Vec<f64> = (0..3600).map(|_| 0.2 * random.uniform().powi(2)).collect();
        let found = after(60.0, |t| jitter[(t * 60.0).round() as usize % 3600], whole).1;
        assert!(found < 0.05, "{found}");
        assert_eq!(Lag::default().take(f64::NAN, 1.0), 0.0);
    }

    /// A delay of 0.2 s that stepped on was found, one of 0.4 s was a clock set anew without a word.
    #[test]
    fn stamps_that_went_back_were_forgotten_without_a_word() {
        let mut lag = Lag::default();
        for i in 0..240 {
            let arrival = f64::from(i) / 60.0;
            lag.take(if i < 120 { arrival } else { arrival - 0.4 }, arrival);
        }
        let (by, when) = lag.set_back().expect("noticed");
        assert!((by - (0.4 - 1.0 / 60.0)).abs() < 1e-9 && (when - 2.0).abs() < 1e-9, "{by} at {when}");
    }
}
