//! How fresh a pose is.

/// Freshness of what is shown. Independent of the phase.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Signal {
    /// Fresh.
    Live,
    /// Old enough to be marked.
    Stale,
    /// Too old to be used, or never seen.
    Lost,
}

/// When a pose becomes stale and lost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expiry {
    /// Age from which a pose is stale, s.
    pub stale_s: f64,
    /// Age from which it is lost, s.
    pub lost_s: f64,
}

impl Default for Expiry {
    fn default() -> Self {
        Self { stale_s: 0.1, lost_s: 0.5 }
    }
}

impl Expiry {
    /// The signal of a pose of this age (s). An age that is not a number is no pose; a pose from the future (clocks that
    /// disagree by less than the stale limit) is fresh, further ahead it is lost.
    pub fn signal(&self, age_s: f64) -> Signal {
        if age_s.is_nan() || age_s < -self.stale_s || age_s >= self.lost_s {
            Signal::Lost
        } else if age_s >= self.stale_s {
            Signal::Stale
        } else {
            Signal::Live
        }
    }
}

impl Signal {
    /// For JSON and messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Live => "live",
            Self::Stale => "stale",
            Self::Lost => "lost",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limits_themselves_belong_to_the_worse_side() {
        let signal = |ms: f64| Expiry::default().signal(ms / 1e3);
        assert_eq!([0.0, 99.9].map(signal), [Signal::Live; 2]);
        assert_eq!([100.0, 499.9].map(signal), [Signal::Stale; 2]);
        assert_eq!([500.0, 1e9, f64::INFINITY, f64::NAN].map(signal), [Signal::Lost; 4]);
    }

    #[test]
    fn a_pose_from_the_future_is_not_trusted_for_long() {
        let signal = |s: f64| Expiry::default().signal(s);
        assert_eq!((signal(-0.05), signal(-0.2)), (Signal::Live, Signal::Lost));
    }
}
