//! Where poses come from, as one word on the command line.

use crate::{Stamps, TrackerUrlError};
use monro_wire::natnet::{COMMAND_PORT, UpAxis, Version};
use monro_wire::openigtlink::DEFAULT_PORT;
use std::net::Ipv4Addr;
use std::path::PathBuf;
use std::str::FromStr;

/// A NatNet server and how to talk to it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NatNetAddress {
    /// Name or address.
    pub host: String,
    /// Its command port.
    pub port: u16,
    /// Data port, when it is not the one that the server announces.
    pub data_port: Option<u16>,
    /// Our interface that faces the server, for multicast.
    pub interface: Option<Ipv4Addr>,
    /// Multicast group, when it is not the one that the server announces.
    pub multicast: Option<Ipv4Addr>,
    /// No multicast at all.
    pub unicast: bool,
    /// Motive's up-axis setting.
    pub up: UpAxis,
    /// Version to read with, whatever the server says.
    pub version: Option<Version>,
    /// Older bitstream to ask the server for.
    pub bitstream: Option<Version>,
    /// Whether its stamps are heeded.
    pub stamps: Stamps,
}

/// An OpenIGTLink server.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct IgtlAddress {
    /// Name or address.
    pub host: String,
    /// TCP port.
    pub port: u16,
    /// What to ask for by `STT_`, of a server that waits to be asked: `TDATA` or `QTDATA`.
    pub start: Option<String>,
    /// Whether its stamps are heeded.
    pub stamps: Stamps,
}

/// A recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReplayAddress {
    /// The file.
    pub path: PathBuf,
    /// As fast as possible instead of as it was.
    pub fast: bool,
    /// Motive's up-axis setting of then.
    pub up: UpAxis,
    /// Version to read with, whatever the server said.
    pub version: Option<Version>,
    /// Whether the server's stamps are heeded.
    pub stamps: Stamps,
}

/// A source of poses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TrackerUrl {
    /// `natnet://host[:port]?interface=&multicast=&unicast=1&data_port=&up=z&version=&bitstream=&stamps=ignore`.
    NatNet(NatNetAddress),
    /// `igtl://host[:port]?start=TDATA&stamps=ignore`.
    OpenIgtLink(IgtlAddress),
    /// `replay:FILE?fast=1&up=z&version=&stamps=ignore`.
    Replay(ReplayAddress),
    /// `sim:`, the built-in scene without a network.
    Sim,
}

impl FromStr for TrackerUrl {
    type Err = TrackerUrlError;

    fn from_str(text: &str) -> Result<Self, TrackerUrlError> {
        let (place, query) = text.split_once('?').unwrap_or((text, ""));
        let query = pairs(query)?;
        once(&query)?;
        if let Some(rest) = place.strip_prefix("natnet://") {
            return Ok(Self::NatNet(natnet(rest, &query)?));
        }
        if let Some(rest) = place.strip_prefix("igtl://") {
            let (host, port) = host_port(rest, DEFAULT_PORT)?;
            known(&query, &["start", "stamps"])?;
            let kind = |v: &str| matches!(v, "TDATA" | "QTDATA").then(|| v.to_owned());
            let start = setting(&query, "start", "it is TDATA or QTDATA", kind)?;
            return Ok(Self::OpenIgtLink(IgtlAddress { host, port, start, stamps: stamps(&query)? }));
        }
        if let Some(path) = place.strip_prefix("replay:") {
            known(&query, &["fast", "up", "version", "stamps"])?;
            return Ok(Self::Replay(ReplayAddress {
                path: path.into(),
                fast: flag(&query, "fast")?,
                up: up_axis(&query)?,
                version: version(&query, "version")?,
                stamps: stamps(&query)?,
            }));
        }
        if place == "sim:" {
            known(&query, &[])?;
            return Ok(Self::Sim);
        }
        Err(TrackerUrlError::Scheme(text.to_owned()))
    }
}

type Query<'a> = Vec<(&'a str, &'a str)>;

fn pairs(query: &str) -> Result<Query<'_>, TrackerUrlError> {
    let split = |p| str::split_once(p, '=').ok_or_else(|| TrackerUrlError::NoValue(p.to_owned()));
    query.split('&').filter(|p| !p.is_empty()).map(split).collect()
}

fn once(query: &Query<'_>) -> Result<(), TrackerUrlError> {
    let again = query.iter().enumerate().find(|(i, (k, _))| query[..*i].iter().any(|(earlier, _)| earlier == k));
    again.map_or(Ok(()), |(_, (k, _))| Err(TrackerUrlError::Twice((*k).to_owned())))
}

fn known(query: &Query<'_>, names: &[&str]) -> Result<(), TrackerUrlError> {
    match query.iter().find(|(k, _)| !names.contains(k)) {
        Some((k, _)) => Err(TrackerUrlError::Setting { name: (*k).to_owned(), known: names.join(", ") }),
        None => Ok(()),
    }
}

fn flag(query: &Query<'_>, name: &str) -> Result<bool, TrackerUrlError> {
    let read = |v: &str| match v {
        "1" | "true" => Some(true),
        "0" | "false" => Some(false),
        _ => None,
    };
    Ok(setting(query, name, "it is 1 or 0", read)?.unwrap_or(false))
}

fn value<'a>(query: &Query<'a>, name: &str) -> Option<&'a str> {
    query.iter().find(|(k, v)| *k == name && !v.is_empty()).map(|(_, v)| *v)
}

/// A setting as `read` understands it; `wanted` says what that would be.
fn setting<T>(
    query: &Query<'_>,
    name: &str,
    wanted: &'static str,
    read: impl Fn(&str) -> Option<T>,
) -> Result<Option<T>, TrackerUrlError> {
    let refused = |v: &str| TrackerUrlError::Value { name: name.to_owned(), value: v.to_owned(), wanted };
    value(query, name).map(|v| read(v).ok_or_else(|| refused(v))).transpose()
}

fn version(query: &Query<'_>, name: &str) -> Result<Option<Version>, TrackerUrlError> {
    let sane = |v: &str| Version::parse(v).filter(|v| (Version::OLDEST..Version::new(5, 0)).contains(v));
    setting(query, name, "give a version such as 4.1, from 2.0 to 4.9", sane)
}

fn up_axis(query: &Query<'_>) -> Result<UpAxis, TrackerUrlError> {
    Ok(setting(query, "up", "it is y or z", UpAxis::parse)?.unwrap_or_default())
}

fn stamps(query: &Query<'_>) -> Result<Stamps, TrackerUrlError> {
    let read = |v: &str| (v == "ignore").then_some(Stamps::Ignored);
    Ok(setting(query, "stamps", "it is ignore, or left out", read)?.unwrap_or_default())
}

fn host_port(text: &str, default: u16) -> Result<(String, u16), TrackerUrlError> {
    let text = text.trim_end_matches('/');
    // Brackets hold an IPv6 address, whose colons are no ports.
    let (host, rest) = match text.strip_prefix('[') {
        Some(inner) => inner.split_once(']').ok_or_else(|| TrackerUrlError::Host(text.to_owned()))?,
        None => text.split_at(text.find(':').unwrap_or(text.len())),
    };
    let port = match rest.strip_prefix(':') {
        Some(p) => p.parse().ok().filter(|p| *p > 0).ok_or_else(|| TrackerUrlError::Port(p.to_owned()))?,
        None if rest.is_empty() => default,
        None => return Err(TrackerUrlError::Host(text.to_owned())),
    };
    if host.is_empty() {
        return Err(TrackerUrlError::NoHost);
    }
    if host.contains(|c: char| c.is_whitespace() || "/?#@[]".contains(c)) {
        return Err(TrackerUrlError::Host(text.to_owned()));
    }
    Ok((host.to_owned(), port))
}

fn natnet(rest: &str, query: &Query<'_>) -> Result<NatNetAddress, TrackerUrlError> {
    known(query, &["interface", "multicast", "unicast", "data_port", "up", "version", "bitstream", "stamps"])?;
    let (host, port) = host_port(rest, COMMAND_PORT)?;
    let unicast = flag(query, "unicast")?;
    if unicast && value(query, "multicast").is_some() {
        return Err(TrackerUrlError::Both("unicast", "multicast"));
    }
    let ipv4 = |name| setting(query, name, "give an IPv4 address such as 192.168.1.5", |v| v.parse().ok());
    Ok(NatNetAddress {
        host,
        port,
        data_port: setting(query, "data_port", "give a port from 0 to 65535", |v| v.parse().ok())?,
        interface: ipv4("interface")?,
        multicast: ipv4("multicast")?,
        unicast,
        up: up_axis(query)?,
        version: version(query, "version")?,
        bitstream: version(query, "bitstream")?,
        stamps: stamps(query)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> TrackerUrl {
        text.parse().unwrap_or_else(|e| panic!("{text}: {e}"))
    }

    #[test]
    fn addresses_are_read_with_their_defaults() {
        let TrackerUrl::NatNet(n) = read("natnet://motive.local") else { panic!("natnet") };
        assert_eq!((n.host.as_str(), n.port, n.unicast, n.up), ("motive.local", 1510, false, UpAxis::Y));
        let TrackerUrl::NatNet(n) =
            read("natnet://10.0.0.2:1600?interface=10.0.0.1&unicast=1&up=z&version=3.0&data_port=9")
        else {
            panic!("natnet")
        };
        assert_eq!((n.port, n.interface, n.unicast), (1600, Some(Ipv4Addr::new(10, 0, 0, 1)), true));
        assert_eq!((n.up, n.version, n.data_port), (UpAxis::Z, Some(Version::new(3, 0)), Some(9)));
        let plus = |start| {
            let (host, port, stamps) = ("plus".to_owned(), 18944, Stamps::Heeded);
            TrackerUrl::OpenIgtLink(IgtlAddress { host, port, start, stamps })
        };
        assert_eq!(read("igtl://plus"), plus(None));
        assert_eq!(read("igtl://plus?start=TDATA"), plus(Some("TDATA".to_owned())));
        let TrackerUrl::OpenIgtLink(v6) = read("igtl://[::1]:7/") else { panic!("igtl") };
        assert_eq!((v6.host.as_str(), v6.port), ("::1", 7));
        let TrackerUrl::OpenIgtLink(i) = read("igtl://x?stamps=ignore") else { panic!("igtl") };
        assert_eq!(i.stamps, Stamps::Ignored);
        let TrackerUrl::Replay(r) = read("replay:a b.mnr?fast=1&up=z") else { panic!("replay") };
        assert_eq!((r.path, r.fast, r.up, r.version), ("a b.mnr".into(), true, UpAxis::Z, None));
        assert_eq!(read("sim:"), TrackerUrl::Sim);
    }

    #[test]
    fn wrong_addresses_are_refused_with_a_way_out() {
        let refused = |text: &str| text.parse::<TrackerUrl>().expect_err(text).to_string();
        assert!(refused("http://x").contains("natnet://HOST"));
        assert!(refused("natnet://x?speed=2").contains("known are: interface"));
        assert!(refused("natnet://x?version=new").contains("version"));
        assert!(refused("igtl://x:99999").contains("port"));
        assert!(refused("natnet://:1510").contains("host"));
        for (bad, why) in [
            ("natnet://x?unicast=maybe", "it is 1 or 0"),
            ("replay:f?fast=maybe", "it is 1 or 0"),
            ("natnet://x?version=5.0", "from 2.0 to 4.9"),
            ("natnet://x?unicast=1&multicast=239.1.1.1", "exclude each other"),
            ("natnet://x?up=y&up=z", "up is given twice"),
            ("sim:?x=1", "'x' is no setting"),
            ("igtl://x?stamps=no", "it is ignore"),
            ("igtl://[::1", "no host"),
            ("igtl://::1", "port"),
            ("igtl://a b", "no host"),
            ("igtl://x:0", "port"),
        ] {
            assert!(refused(bad).contains(why), "{bad}: {}", refused(bad));
        }
    }
}
