//! Places for connections: a bounded number, of which one address gets a share, so that no client shuts the others out.

use crate::lock::lock;
use std::collections::BTreeMap;
use std::net::IpAddr;
use std::sync::{Arc, Mutex};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// Connections at a time: browsers open up to six each.
pub(crate) const MOST_CONNECTIONS: usize = 96;
/// Of one address: five browsers on one machine, or behind one router.
pub(crate) const MOST_OF_ONE: usize = 32;

type Held = Arc<Mutex<BTreeMap<IpAddr, usize>>>;

/// All places of a listener.
#[derive(Debug)]
pub(crate) struct Places {
    free: Arc<Semaphore>,
    held: Held,
}

impl Default for Places {
    fn default() -> Self {
        Self { free: Arc::new(Semaphore::new(MOST_CONNECTIONS)), held: Held::default() }
    }
}

impl Places {
    /// Waits for a place for whoever comes next.
    pub(crate) async fn free(&self) -> Option<OwnedSemaphorePermit> {
        Arc::clone(&self.free).acquire_owned().await.ok()
    }

    /// Gives a place to an address, unless it has its share.
    pub(crate) fn take(&self, place: OwnedSemaphorePermit, address: IpAddr) -> Option<Place> {
        let mut held = lock(&self.held);
        let count = held.entry(address).or_default();
        if *count >= MOST_OF_ONE {
            return None;
        }
        *count += 1;
        Some(Place { _place: place, held: Arc::clone(&self.held), address })
    }
}

/// A place, given back when it is dropped.
#[derive(Debug)]
pub(crate) struct Place {
    _place: OwnedSemaphorePermit,
    held: Held,
    address: IpAddr,
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut held = lock(&self.held);
        if let Some(count) = held.get_mut(&self.address) {
            *count -= 1;
            if *count == 0 {
                held.remove(&self.address);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Ipv4Addr;

    #[tokio::test]
    async fn an_address_gets_its_share_and_another_one_the_rest() {
        let places = Places::default();
        let [a, b]: [IpAddr; 2] = [Ipv4Addr::new(10, 0, 0, 1).into(), Ipv4Addr::new(10, 0, 0, 2).into()];
        let mut taken = Vec::new();
        while let Some(place) = places.take(places.free().await.expect("a place"), a) {
            taken.push(place);
        }
        assert_eq!(taken.len(), MOST_OF_ONE);
        assert!(places.take(places.free().await.expect("a place"), b).is_some());
        taken.pop();
        assert!(places.take(places.free().await.expect("a place"), a).is_some());
        drop(taken);
        assert!(lock(&places.held).is_empty() && places.free.available_permits() == MOST_CONNECTIONS);
    }
}
