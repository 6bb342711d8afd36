//! The command as a user meets it: refusals, the whole chain on the phantom, the real scans.

mod bench_frame;
mod common;
mod force;
mod mesh_files;
mod real_scans;
mod refusals;
mod self_crossing;
#[cfg(unix)]
mod signals;
mod solve;
mod solve_told;
mod whole_chain;
