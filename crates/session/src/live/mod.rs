//! The live session: what the operating room tells, what the solver says, and what a display may show of it.
//!
//! Three loops that never wait for each other (paper, section II.5), each as plain logic with time as an argument:
//!
//! | loop | in | out | rate |
//! |---|---|---|---|
//! | tracking | [`Observation`]s | the latest pose of each tool ([`Tracking`]) | as data arrive |
//! | deformation | a needle pose and a time step | [`Deformed`] ([`Deformation`]) | as fast as it can |
//! | display | the newest of both | [`Snapshot`] ([`Session::snapshot`]) | each client's own |
//!
//! What may be shown follows from two independent things: the [`Phase`] of the procedure and the [`Freshness`] of the
//! tracker. Guidance numbers exist only while navigating, and not when the signal is lost.

mod cue;
pub(crate) mod deformation;
mod deformed;
#[cfg(test)]
mod follow_tests;
pub mod log;
mod phase;
mod playback;
mod registering;
mod room;
mod script;
mod session;
mod snapshot;
mod tracking;

pub use cue::Cue;
pub use deformation::Deformation;
pub use deformed::{Deformed, Doubt, MOST_SHIFT_MM};
pub use monro_guidance::clock::{Expiry, Freshness};
pub use phase::{Event, Phase, Refusal, ToFirst};
pub use playback::{Playback, PlaybackError};
pub use registering::{Registering, Touch, TouchError, TouchMark};
pub use script::{Script, ScriptTruth};
pub use session::{Calibration, PlainEvent, Registration, Session, SessionEvent, ToolNames};
pub use snapshot::{Numbers, Snapshot, SoftNumbers};
pub use tracking::{Observation, Tracking};
