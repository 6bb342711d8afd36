//! What the `monro` command shows: pictures and reports, drawn without a network, a window or a graphics card.

pub mod picture;
pub mod report;
