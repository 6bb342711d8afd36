//! Why there are no poses, in words for the person at the machine.

use super::{Client, DATA_PORT, NatNetError, Version};
use core::fmt;

impl Client {
    /// What is wrong, if anything, for the tools that are `wanted`; the first cause that explains the rest.
    pub fn diagnosis(&self, now: f64, wanted: &[&str]) -> Diagnosis {
        let age = |t: Option<f64>| t.map_or(f64::INFINITY, |t| now - t);
        // A version that was forced is no word of the server.
        let heard = self.server.is_some() || self.times.frame.is_some() || self.counters.malformed > 0;
        let Some(version) = self.version().filter(|_| heard) else {
            return Diagnosis::NoServer { waited: now - self.times.start.unwrap_or(now) };
        };
        let unreadable = || Some(Diagnosis::Unreadable { version, error: self.counters.last_error.clone()? });
        if self.times.frame.is_none() {
            if let Some(unreadable) = unreadable() {
                return unreadable;
            }
            let clock = self.server.as_ref().and_then(|s| s.clock);
            return Diagnosis::NoData {
                version,
                waited: age(self.times.server.or(self.times.start)),
                multicast: clock.map(|c| c.multicast),
                port: clock.map_or(DATA_PORT, |c| c.data_port),
            };
        }
        if age(self.times.frame) > 0.5 {
            let stopped = Diagnosis::Stopped { since: age(self.times.frame) };
            return unreadable().filter(|_| age(self.times.malformed) <= 0.5).unwrap_or(stopped);
        }
        if age(self.times.fresh) > 0.5 {
            return Diagnosis::Repeats { since: age(self.times.fresh) };
        }
        let id_of = |name: &str| self.names.iter().find(|(_, n)| n.as_str() == name).map(|(id, _)| *id);
        let missing = wanted.iter().find(|w| id_of(w).is_none_or(|id| !self.seen.contains_key(&id)));
        if let Some(&name) = missing {
            let streamed = self.names.iter().filter(|(id, _)| self.seen.contains_key(id)).map(|(_, n)| n.clone());
            return Diagnosis::NotStreamed { name: name.to_owned(), streamed: streamed.collect() };
        }
        let lost = wanted.iter().find(|w| id_of(w).and_then(|id| self.seen.get(&id)) == Some(&false));
        match lost {
            Some(&name) => Diagnosis::NotTracked { name: name.to_owned() },
            None if version.is_newer_than_tested() => Diagnosis::NewerThanTested(version),
            None => Diagnosis::Streaming(version),
        }
    }
}

/// Why there are no poses, or that there are; for people.
#[derive(Debug, Clone, PartialEq)]
pub enum Diagnosis {
    /// CONNECT was never answered.
    NoServer {
        /// Seconds since the first CONNECT.
        waited: f64,
    },
    /// The server answers but sends no frames.
    NoData {
        /// Its version.
        version: Version,
        /// Seconds since it answered.
        waited: f64,
        /// Whether it sends by multicast; before 3.0 it does not say.
        multicast: Option<bool>,
        /// The data port that it announced, or the usual one.
        port: u16,
    },
    /// Frames come, but none can be read.
    Unreadable {
        /// The version they were read with.
        version: Version,
        /// Why.
        error: NatNetError,
    },
    /// Frames have stopped coming.
    Stopped {
        /// Seconds since the last.
        since: f64,
    },
    /// One and the same frame comes again and again.
    Repeats {
        /// Seconds since it came first.
        since: f64,
    },
    /// A wanted tool is not in the stream.
    NotStreamed {
        /// The tool.
        name: String,
        /// What is streamed.
        streamed: Vec<String>,
    },
    /// A wanted tool is streamed but not seen by the cameras.
    NotTracked {
        /// The tool.
        name: String,
    },
    /// All is well, but the version is newer than tested.
    NewerThanTested(Version),
    /// All is well.
    Streaming(Version),
}

impl Diagnosis {
    /// Whether poses of all wanted tools come.
    pub const fn is_well(&self) -> bool {
        matches!(self, Self::Streaming(_) | Self::NewerThanTested(_))
    }
}

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoServer { waited } => write!(
                f,
                "no answer from the server for {waited:.1} s: is its address right, Motive running, streaming switched on, and its command port (UDP) open?"
            ),
            Self::NoData { version, waited, multicast: Some(true), .. } => write!(
                f,
                "connected (NatNet {version}), but no data for {waited:.1} s: the server sends by multicast; choose the network interface that faces it, or switch both sides to unicast"
            ),
            Self::NoData { version, waited, multicast: None, port } => write!(
                f,
                "connected (NatNet {version}), but no data for {waited:.1} s: a server before 3.0 does not say how it sends; tell the client what is set in Motive: data_port= (now {port}), multicast= and interface=, or unicast=1"
            ),
            Self::NoData { version, waited, multicast: Some(false), port } => write!(
                f,
                "connected (NatNet {version}), but no data for {waited:.1} s: the server sends by unicast; is UDP port {port} open, and Motive live or playing?"
            ),
            Self::Unreadable { version, error } => {
                write!(f, "data come (NatNet {version}), but cannot be read: {error}")
            }
            Self::Stopped { since } => write!(f, "data stopped {since:.1} s ago: is Motive paused, or the cable out?"),
            Self::Repeats { since } => write!(
                f,
                "one and the same frame has been sent for {since:.1} s, to the last bit: is Motive paused, or does the server hang?"
            ),
            Self::NotStreamed { name, streamed } => write!(
                f,
                "'{name}' is not streamed: create or enable that asset in Motive (streamed: {})",
                if streamed.is_empty() { "nothing".to_owned() } else { streamed.join(", ") }
            ),
            Self::NotTracked { name } => write!(f, "'{name}' is streamed but not seen by the cameras"),
            Self::NewerThanTested(v) => write!(
                f,
                "streaming NatNet {v}, newer than tested (up to {}): check the poses, or ask the server for an older bitstream",
                Version::NEWEST
            ),
            Self::Streaming(v) => write!(f, "streaming NatNet {v}"),
        }
    }
}
