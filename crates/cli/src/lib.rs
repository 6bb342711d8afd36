//! What the `monro` command shows: pictures and reports, drawn without a network, a window or a graphics card; and the
//! trackers that it listens to, or plays.

pub mod picture;
pub mod report;
pub mod tracking;
