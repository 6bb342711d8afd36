//! How many requests one address may make: a bucket of tokens that fills up again.

use crate::lock::lock;
use std::collections::BTreeMap;
use std::net::IpAddr;
use std::sync::Mutex;
use std::time::Instant;

/// Requests a second in the long run: a hand that leafs through the slices of three panes asks for some two hundred.
const PER_SECOND: f64 = 500.0;
/// Requests at once.
const BURST: f64 = 1500.0;
/// Addresses that are remembered before full buckets, which tell nothing, are forgotten.
const MOST_ADDRESSES: usize = 1024;

/// A bucket for each address.
#[derive(Debug, Default)]
pub(crate) struct Limits(Mutex<BTreeMap<IpAddr, (f64, Instant)>>);

impl Limits {
    /// Whether this address may make one more request.
    pub(crate) fn allows(&self, address: IpAddr, now: Instant) -> bool {
        let mut buckets = lock(&self.0);
        let filled =
            |(tokens, at): (f64, Instant)| (tokens + PER_SECOND * now.duration_since(at).as_secs_f64()).min(BURST);
        if buckets.len() >= MOST_ADDRESSES {
            buckets.retain(|_, bucket| filled(*bucket) < BURST);
        }
        let tokens = buckets.get(&address).map_or(BURST, |bucket| filled(*bucket));
        let allowed = tokens >= 1.0;
        buckets.insert(address, (if allowed { tokens - 1.0 } else { tokens }, now));
        allowed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Ipv4Addr;
    use std::time::Duration;

    #[test]
    fn a_flood_is_stopped_for_its_own_address_only_and_for_a_while() {
        let (limits, now) = (Limits::default(), Instant::now());
        let (a, b) = (Ipv4Addr::new(10, 0, 0, 1).into(), Ipv4Addr::new(10, 0, 0, 2).into());
        let taken = (0..5000).filter(|_| limits.allows(a, now)).count();
        assert!((taken as f64 - BURST).abs() < 1.5);
        assert!(limits.allows(b, now) && !limits.allows(a, now));
        assert!(limits.allows(a, now + Duration::from_millis(10)));
    }
}
