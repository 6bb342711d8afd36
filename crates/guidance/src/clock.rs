//! Time: the offset between two clocks, the age of a pose, and when it expires.

/// One question to another clock and its answer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exchange {
    /// When the question left, s on our clock.
    pub sent: f64,
    /// When it was answered, s on the other clock.
    pub other: f64,
    /// When the answer came, s on our clock.
    pub received: f64,
}

impl Exchange {
    fn round_trip(&self) -> f64 {
        self.received - self.sent
    }

    fn middle(&self) -> f64 {
        0.5 * (self.received + self.sent)
    }

    /// Whether one and the same clock can have given both answers: each bounds its offset by the two ways of the question.
    fn agrees(&self, later: &Self) -> bool {
        let drift = SLACK + DRIFT * (later.received - self.sent).abs();
        let low = (self.other - self.received).max(later.other - later.received);
        let high = (self.other - self.sent).min(later.other - later.sent);
        low <= high + drift
    }
}

/// Two clocks of computers drift apart by less than this, s a second.
const DRIFT: f64 = 1e-3;
/// What a coarse clock adds to the bounds of an exchange, s.
const SLACK: f64 = 1e-3;

/// An estimate of `other - ours`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Offset {
    /// At `reference`, s.
    pub offset: f64,
    /// Change of the offset per second of ours.
    pub skew: f64,
    /// The time on our clock at which `offset` holds, s.
    pub reference: f64,
    /// The offset is wrong by no more than this, s: half the shortest round trip.
    pub bound: f64,
}

impl Offset {
    /// A time of the other clock on ours, s.
    pub fn to_ours(&self, other: f64) -> f64 {
        // other = t + offset + skew (t - reference), solved for t.
        (other - self.offset + self.skew * self.reference) / (1.0 + self.skew)
    }
}

/// Estimates the offset of another clock from exchanges (Cristian 1989): only those whose round trip is near the
/// shortest count, for the others were held up on one of their two ways; a line is fitted to them.
#[derive(Debug, Clone)]
pub struct ClockEstimate {
    exchanges: Vec<Exchange>,
    window: f64,
}

impl ClockEstimate {
    /// An estimate over the last `window` seconds.
    pub const fn new(window: f64) -> Self {
        Self { exchanges: Vec::new(), window }
    }

    /// Takes an exchange; one whose answer came before its question is ignored. One that contradicts the last says that the
    /// other clock was set anew, as when its computer was restarted: what was known before is forgotten.
    pub fn push(&mut self, e: Exchange) {
        let valid = e.round_trip() >= 0.0 && e.other.is_finite() && e.sent.is_finite() && e.received.is_finite();
        if valid {
            if self.exchanges.last().is_some_and(|last| !last.agrees(&e)) {
                self.forget();
            }
            self.exchanges.push(e);
            self.exchanges.retain(|x| x.received >= e.received - self.window);
        }
    }

    /// Forgets all exchanges: the other clock is known to have been set anew.
    pub fn forget(&mut self) {
        self.exchanges.clear();
    }

    /// The offset; `None` before the first exchange.
    pub fn offset(&self) -> Option<Offset> {
        let shortest = self.exchanges.iter().map(Exchange::round_trip).fold(f64::INFINITY, f64::min);
        // Half as long again, and 50 us for a coarse clock.
        let good: Vec<&Exchange> = self.exchanges.iter().filter(|e| e.round_trip() <= 1.5 * shortest + 50e-6).collect();
        let n = good.len() as f64;
        let last = good.last()?;
        let reference = good.iter().map(|e| e.middle()).sum::<f64>() / n;
        let offset = good.iter().map(|e| e.other - e.middle()).sum::<f64>() / n;
        let (mut sxx, mut sxy) = (0.0, 0.0);
        for e in &good {
            let x = e.middle() - reference;
            sxx += x * x;
            sxy += x * (e.other - e.middle() - offset);
        }
        // A skew is only worth having over some seconds; before, noise would be taken for it.
        let span = last.middle() - good[0].middle();
        let skew = if good.len() >= 4 && span >= 5.0 { sxy / sxx } else { 0.0 };
        Some(Offset { offset, skew, reference, bound: 0.5 * shortest })
    }
}

/// Whether a pose may still be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Freshness {
    /// Younger than the stale limit.
    Live,
    /// Older; shown, but marked.
    Stale,
    /// Older than the lost limit, or never seen: numbers vanish.
    Lost,
}

impl Freshness {
    /// `live`, `stale` or `lost`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Live => "live",
            Self::Stale => "stale",
            Self::Lost => "lost",
        }
    }
}

/// Ages at which a pose expires, s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expiry {
    /// From this age on it is stale.
    pub stale: f64,
    /// From this age on it is lost.
    pub lost: f64,
}

impl Default for Expiry {
    fn default() -> Self {
        Self { stale: 0.1, lost: 0.5 }
    }
}

impl Expiry {
    /// The state of a pose of a given age (s); `None` for a tool never seen. An age that is no number is lost. A pose from
    /// the future (clocks not yet in step) is live where it is ahead by no more than the stale limit, further ahead it is
    /// lost: nobody knows how old it is.
    pub fn state(&self, age: Option<f64>) -> Freshness {
        match age {
            Some(a) if a < -self.stale => Freshness::Lost,
            Some(a) if a < self.stale => Freshness::Live,
            Some(a) if a < self.lost => Freshness::Stale,
            _ => Freshness::Lost,
        }
    }
}

/// An offset known worse than this says less about a pose's age than its arrival does, s: a fifth of what makes it stale.
const WORST_BOUND: f64 = 0.02;

/// Age of a pose at `now`, s: since its exposure where the source's clock is known to 20 ms, otherwise since its arrival less
/// what its stream lags ([`Lag`](crate::Lag)). Never less than since its arrival: what has arrived was exposed before, whatever
/// the clocks say.
pub fn age(now: f64, (arrival, lag): (f64, f64), source: Option<f64>, clock: Option<&Offset>) -> f64 {
    let known = clock.filter(|c| c.bound <= WORST_BOUND);
    now - source.zip(known).map_or(arrival - lag, |(s, c)| c.to_ours(s).min(arrival))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Random;

    #[test]
    fn an_offset_and_a_skew_are_found_through_jitter() {
        let (mut estimate, mut random) = (ClockEstimate::new(60.0), Random::new(1));
        let other = |t: f64| 1000.0 + t * (1.0 + 3e-5);
        for i in 0..60 {
            let sent = f64::from(i);
            // Each way takes 0.2 ms at least, and sometimes much longer.
            let way = |r: &mut Random| 2e-4 + 5e-3 * r.uniform().powi(4);
            let (to, fro) = (way(&mut random), way(&mut random));
            estimate.push(Exchange { sent, other: other(sent + to), received: sent + to + fro });
        }
        let o = estimate.offset().expect("exchanges");
        assert!((o.skew - 3e-5).abs() < 2e-5, "{}", o.skew);
        assert!((o.to_ours(other(59.5)) - 59.5).abs() < 2e-4, "{}", o.to_ours(other(59.5)) - 59.5);
        assert!((2e-4..4e-4).contains(&o.bound));
    }

    #[test]
    fn one_exchange_gives_an_offset_within_half_its_round_trip() {
        let mut estimate = ClockEstimate::new(10.0);
        assert_eq!(estimate.offset(), None);
        estimate.push(Exchange { sent: 1.0, other: 501.001, received: 1.004 });
        let o = estimate.offset().expect("one");
        assert!((o.offset - 500.0).abs() <= o.bound + 1e-12 && (o.bound - 0.002).abs() < 1e-12);
        estimate.push(Exchange { sent: 5.0, other: 0.0, received: 4.0 });
        assert_eq!(estimate.offset(), Some(o));
    }

    /// The answers of both clocks used to be mixed for the whole window: ages were wrong for a minute.
    #[test]
    fn a_clock_that_was_set_anew_is_believed_at_once() {
        let mut estimate = ClockEstimate::new(60.0);
        let mut ask = |sent: f64, other: f64, way: f64| {
            estimate.push(Exchange { sent, other: other + way, received: sent + 2.0 * way });
            estimate.offset().expect("exchanges").offset
        };
        for i in (0..30).map(f64::from) {
            assert!((ask(i, 1000.0 + i, 3e-4) - 1000.0).abs() < 1e-3);
        }
        // The new clock's first answer is late: it is believed for what it bounds.
        assert!((ask(31.0, 0.5, 2e-2) + 30.5).abs() < 0.02);
        assert!((ask(32.0, 1.5, 3e-4) + 30.5).abs() < 1e-3);
        // One that drifts, and whose answers are held up now and then, is still the same.
        for i in 33..90 {
            let (t, way) = (f64::from(i), 3e-4 * f64::from(1 + i % 40));
            assert!((ask(t, t * (1.0 + 2e-4) - 30.5064, way) + 30.5).abs() < 0.02);
        }
        assert!(estimate.exchanges.len() > 50);
    }

    #[test]
    fn poses_expire_at_their_limits() {
        let e = Expiry::default();
        let states = [0.0, 0.099, 0.1, 0.499, 0.5, f64::NAN].map(|a| e.state(Some(a)));
        use Freshness::{Live, Lost, Stale};
        assert_eq!(states, [Live, Live, Stale, Stale, Lost, Lost]);
        assert_eq!([None, Some(-0.05), Some(-0.2), Some(f64::INFINITY)].map(|a| e.state(a)), [Lost, Live, Lost, Lost]);
    }

    #[test]
    fn the_age_is_since_exposure_where_the_clocks_are_known() {
        let o = Offset { offset: 100.0, skew: 0.0, reference: 0.0, bound: 0.0 };
        assert!((age(5.0, (4.99, 0.0), Some(104.98), Some(&o)) - 0.02).abs() < 1e-9);
        assert!((age(5.0, (4.99, 0.0), None, Some(&o)) - 0.01).abs() < 1e-9);
        assert!((age(5.0, (4.99, 0.0), Some(104.98), None) - 0.01).abs() < 1e-9);
        assert!((age(5.0, (4.99, 0.3), Some(104.98), None) - 0.31).abs() < 1e-9);
        assert!((age(5.0, (4.99, 0.3), Some(104.98), Some(&o)) - 0.02).abs() < 1e-9);
    }

    /// A first exchange that was held up for a second used to put poses into the future; once the offset was known better,
    /// those that followed were older than these, and left out.
    #[test]
    fn a_pose_is_never_exposed_after_it_arrived() {
        let ahead = Offset { offset: 99.0, skew: 0.0, reference: 0.0, bound: 0.0 };
        assert!((age(5.0, (4.99, 0.0), Some(104.98), Some(&ahead)) - 0.01).abs() < 1e-9);
        // An offset that may be half a second wrong is not asked.
        let vague = Offset { offset: 100.4, bound: 0.5, ..ahead };
        assert!((age(5.0, (4.99, 0.0), Some(104.98), Some(&vague)) - 0.01).abs() < 1e-9);
    }
}
