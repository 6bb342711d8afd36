//! The offline half in one call: a head CT, or labels that somebody corrected, becomes a case.
//!
//! [`build`] runs scan → labels → surfaces → plan → tetrahedra → case, and tells an [`Observer`] where it is; the observer
//! keeps the time (there is no clock here) and may stop the work between two stages. With [`Request::labels`] the same
//! stages run on labels from elsewhere; [`rebuild`] does so for a case that exists. Nothing is written but by [`write()`].

mod build;
mod error;
mod landmarks;
mod observer;
mod plan;
mod request;
mod write;

pub use build::{Prepared, build, confidence, rebuild, simulated_labels, spots, volumes_ml};
pub use error::PrepareError;
pub use landmarks::named as named_landmarks;
pub use observer::{Observer, Silent, Stage};
pub use request::{DEFAULT_ELEMENTS, Labels, Request};
pub use write::write;

/// Said wherever a result leaves the program.
pub const NOTICE: &str = "Research software. Not for clinical use.";
