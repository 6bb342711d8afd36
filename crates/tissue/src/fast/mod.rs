//! What makes a step fast: vectors of the width that the processor has, and threads that are there at once.
//!
//! The only home of `unsafe` in this project, for four reasons that the language has no other word for: a function compiled
//! for certain instructions may only be called after asking the processor, memory that will be read soon is asked for by its
//! address, threads that live longer than a call may only be lent its data while the call waits for them, and a library's product
//! of matrices takes addresses. Everything that leaves this module is safe to call.

#![expect(
    unsafe_code,
    reason = "vector instructions, asking for memory, lending data to waiting threads, matrices; each use says why it is sound"
)]

mod lanes;
mod plan;
mod pool;
mod product;
mod queue;
mod sums;
#[cfg(target_arch = "x86_64")]
mod x86;

pub(crate) use lanes::{
    Kernel, Lanes, Line, Numbers, Place, Places, Row, View, WIDTH, Window, ask_ahead, cross, dot, plain, sum_of_roots,
    widest,
};
pub(crate) use plan::{Plans, span};
pub(crate) use pool::{Pool, Turn};
pub(crate) use product::take_product;
pub(crate) use sums::{Sums, Take, side_by_side};

/// Threads at most, unless more are asked for: beyond that they would wait for memory.
pub(crate) const MOST_THREADS: usize = 8;
