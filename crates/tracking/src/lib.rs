//! Where poses come from: NatNet and OpenIGTLink over sockets, recordings, a built-in scene; and fake trackers to play with.
//!
//! [`open`] turns a [`TrackerUrl`] into a [`Source`], which gives poses with the time of their arrival. What the bytes mean
//! is `monro_wire`'s business; sockets, threads and the clock are here, and nobody else opens a tracker's socket.

mod bodies;
mod clock;
mod decode;
mod doctor;
mod error;
mod fake_igtl;
mod fake_natnet;
mod igtl;
mod late;
mod latency;
mod natnet;
mod record;
mod replay;
mod rivals;
mod scene;
mod sim;
mod source;
mod still;
mod to_and_fro;
mod told;
mod unusable;
mod url;

pub use bodies::{Bodies, Redefined};
pub use clock::Clock;
pub use doctor::{Findings, doctor, never_seen};
pub use error::{TrackerUrlError, TrackingError};
pub use fake_igtl::{IgtlFake, run_fake_igtl};
pub use fake_natnet::{NatNetFake, run_fake_natnet};
pub use igtl::{is_tool, tool_name};
pub use late::Stamps;
pub use latency::{Latencies, latencies};
pub use record::{Recorder, new_file};
pub use rivals::Rivals;
pub use scene::{CATHETER_TIP, Motion, STYLUS_TIP, Scene, SceneOptions, TOOLS};
pub use source::{Batch, Health, Source, open};
pub use still::Stillness;
pub use unusable::Unusable;
pub use url::{IgtlAddress, NatNetAddress, ReplayAddress, TrackerUrl};
