//! What the `monro` command shows: pictures and reports, drawn without a network, a window or a graphics card, and poses
//! line by line.

pub mod picture;
pub mod report;
pub mod track;
