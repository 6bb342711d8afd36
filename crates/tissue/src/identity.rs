//! Numbers that tell constants apart which memory of a simulation was made for.

use core::sync::atomic::{AtomicU64, Ordering};

/// A number that no call in this process has given before.
pub(crate) fn unique() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    NEXT.fetch_add(1, Ordering::Relaxed)
}
