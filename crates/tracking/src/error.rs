//! Why there is no source of poses, or no more.

use monro_wire::natnet::NatNetError;
use monro_wire::openigtlink::IgtlError;
use monro_wire::recording::RecordingError;
use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use thiserror::Error;

/// Why an address of a tracker was refused.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum TrackerUrlError {
    /// No scheme that we know.
    #[error("'{0}' is no tracker; use natnet://HOST, igtl://HOST, replay:FILE or sim:")]
    Scheme(String),
    /// A setting without a value.
    #[error("'{0}' in the tracker's address has no '='")]
    NoValue(String),
    /// A setting that this kind of tracker does not have.
    #[error("'{name}' is no setting of this tracker; known are: {}", if known.is_empty() { "none" } else { known })]
    Setting {
        /// As given.
        name: String,
        /// All that there are.
        known: String,
    },
    /// A setting given more than once.
    #[error("{0} is given twice in the tracker's address")]
    Twice(String),
    /// Two settings of which only one can be.
    #[error("{0} and {1} in the tracker's address exclude each other")]
    Both(&'static str, &'static str),
    /// What stands for the host is none.
    #[error("'{0}' is no host with a port; write HOST:PORT, an IPv6 address in brackets")]
    Host(String),
    /// A value that cannot be read.
    #[error("{name}={value} cannot be read; {wanted}")]
    Value {
        /// Of the setting.
        name: String,
        /// As given.
        value: String,
        /// What it should be.
        wanted: &'static str,
    },
    /// The port is no number from 1 to 65535.
    #[error("'{0}' is no port; give a number from 1 to 65535")]
    Port(String),
    /// The host is missing.
    #[error("the tracker's address names no host")]
    NoHost,
}

/// Why there is no source of poses, or no more.
#[derive(Debug, Error)]
pub enum TrackingError {
    /// A name that nobody knows.
    #[error("cannot find the host '{host}': {error}")]
    Host {
        /// As given.
        host: String,
        /// The reason.
        error: io::Error,
    },
    /// NatNet speaks IPv4 only.
    #[error("'{0}' has no IPv4 address, which NatNet needs")]
    NoIpv4(String),
    /// No way to the server.
    #[error("no network interface leads to {server}: {error}")]
    NoWay {
        /// The server.
        server: SocketAddr,
        /// The reason.
        error: io::Error,
    },
    /// The multicast group cannot be joined.
    #[error("cannot join {group}:{port} on interface {interface}: {error}; name another interface with ?interface=")]
    Join {
        /// The group.
        group: Ipv4Addr,
        /// The data port.
        port: u16,
        /// Our interface.
        interface: Ipv4Addr,
        /// The reason.
        error: io::Error,
    },
    /// An address on this machine cannot be had.
    #[error("cannot listen on {address}: {error}; another program may have it: choose another address or port")]
    Listen {
        /// The address.
        address: String,
        /// The reason.
        error: io::Error,
    },
    /// A stream that cannot be followed any more.
    #[error("igtl://{place}: {error}")]
    Stream {
        /// Host and port.
        place: String,
        /// The reason.
        error: IgtlError,
    },
    /// A message that cannot be made.
    #[error(transparent)]
    Message(#[from] IgtlError),
    /// A datagram of our own that our own server does not understand.
    #[error(transparent)]
    Datagram(#[from] NatNetError),
    /// A recording that cannot be opened, made or written.
    #[error("the recording {path}: {error}")]
    File {
        /// Its path.
        path: PathBuf,
        /// The reason.
        error: io::Error,
    },
    /// A file that is no recording.
    #[error("the recording {path}: {error}")]
    Recording {
        /// Its path.
        path: PathBuf,
        /// The reason.
        error: RecordingError,
    },
    /// A recorded stream that cannot be followed any more.
    #[error(
        "the recording {path} is damaged {since_s:.2} s after its start ({error}); {left} records behind it are lost"
    )]
    Damaged {
        /// Its path.
        path: PathBuf,
        /// Where, s.
        since_s: f64,
        /// Records that were not played.
        left: usize,
        /// The reason.
        error: Box<IgtlError>,
    },
    /// A thread or a socket failed.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// A thread of ours panicked.
    #[error("the thread that {0} failed")]
    Thread(&'static str),
}
