//! The one place that picks instructions at run time, and the only one that needs `unsafe`.
//!
//! The loops over lanes are written once, in plain Rust, and compiled twice: for any x86-64 (or other) processor, and for
//! those with AVX2. No operation is fused or reordered, so both give the same bits.

#![expect(unsafe_code, reason = "a function compiled for AVX2 may only be called after asking the processor")]

/// Runs `work` compiled for the widest vectors that the processor has.
#[inline]
pub(crate) fn widest<R>(work: impl FnOnce() -> R) -> R {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has just said that it has AVX2.
        return unsafe { with_avx2(work) };
    }
    work()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn with_avx2<R>(work: impl FnOnce() -> R) -> R {
    work()
}
