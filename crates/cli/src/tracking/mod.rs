//! Trackers over the network: sources of poses, recordings, and fake trackers to play with. Sockets and threads live
//! here; what the bytes mean is `monro-wire`'s business.

mod clock;
mod doctor;
mod fake_igtl;
mod fake_natnet;
mod igtl;
mod latency;
mod natnet;
mod record;
mod replay;
mod scene;
mod sim;
mod source;
mod track;
mod url;

pub use clock::Clock;
pub use doctor::doctor;
pub use fake_igtl::{IgtlFake, run_fake_igtl};
pub use fake_natnet::{NatNetFake, run_fake_natnet};
pub use latency::latencies;
pub use record::Recorder;
pub use scene::{CATHETER_TIP, Motion, STYLUS_TIP, Scene, SceneOptions, TOOLS};
pub use source::{Batch, Source, open};
pub use track::{TrackOptions, track};
pub use url::{NatNetAddress, TrackerUrl};
