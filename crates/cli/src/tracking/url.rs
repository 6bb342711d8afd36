//! Where poses come from, as one word on the command line.

use anyhow::{Context, Result, bail};
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
}

/// A source of poses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TrackerUrl {
    /// `natnet://host[:port]?interface=&multicast=&unicast=1&data_port=&up=z&version=&bitstream=`.
    NatNet(NatNetAddress),
    /// `igtl://host[:port]`.
    OpenIgtLink {
        /// Name or address.
        host: String,
        /// TCP port.
        port: u16,
    },
    /// `replay:FILE[?fast=1]`.
    Replay {
        /// The recording.
        path: PathBuf,
        /// As fast as possible instead of as it was.
        fast: bool,
    },
    /// `sim:`, the built-in scene without a network.
    Sim,
}

impl FromStr for TrackerUrl {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> Result<Self> {
        let (place, query) = text.split_once('?').unwrap_or((text, ""));
        let query = pairs(query)?;
        if let Some(rest) = place.strip_prefix("natnet://") {
            return Ok(Self::NatNet(natnet(rest, &query)?));
        }
        if let Some(rest) = place.strip_prefix("igtl://") {
            let (host, port) = host_port(rest, DEFAULT_PORT)?;
            known(&query, &[])?;
            return Ok(Self::OpenIgtLink { host, port });
        }
        if let Some(path) = place.strip_prefix("replay:") {
            known(&query, &["fast"])?;
            return Ok(Self::Replay { path: path.into(), fast: flag(&query, "fast") });
        }
        if place == "sim:" {
            return Ok(Self::Sim);
        }
        bail!("'{text}' is no tracker; use natnet://HOST, igtl://HOST, replay:FILE or sim:")
    }
}

type Query<'a> = Vec<(&'a str, &'a str)>;

fn pairs(query: &str) -> Result<Query<'_>> {
    let split = |p| str::split_once(p, '=').with_context(|| format!("'{p}' in the tracker's address has no '='"));
    query.split('&').filter(|p| !p.is_empty()).map(split).collect()
}

fn known(query: &Query<'_>, names: &[&str]) -> Result<()> {
    match query.iter().find(|(k, _)| !names.contains(k)) {
        Some((k, _)) => bail!("'{k}' is no setting of this tracker; known are: {}", names.join(", ")),
        None => Ok(()),
    }
}

fn flag(query: &Query<'_>, name: &str) -> bool {
    query.iter().any(|(k, v)| *k == name && *v != "0" && *v != "false")
}

fn value<'a>(query: &Query<'a>, name: &str) -> Option<&'a str> {
    query.iter().find(|(k, v)| *k == name && !v.is_empty()).map(|(_, v)| *v)
}

fn parsed<T: FromStr>(query: &Query<'_>, name: &str) -> Result<Option<T>> {
    let read = |v: &str| v.parse().ok().with_context(|| format!("{name}={v} cannot be read"));
    value(query, name).map(read).transpose()
}

fn version(query: &Query<'_>, name: &str) -> Result<Option<Version>> {
    let read = |v: &str| Version::parse(v).with_context(|| format!("{name}={v} is no version such as 4.1"));
    value(query, name).map(read).transpose()
}

fn host_port(text: &str, default: u16) -> Result<(String, u16)> {
    let text = text.trim_end_matches('/');
    let (host, port) = match text.rsplit_once(':') {
        Some((h, p)) => (h, p.parse().with_context(|| format!("'{p}' is no port"))?),
        None => (text, default),
    };
    if host.is_empty() {
        bail!("the tracker's address names no host");
    }
    Ok((host.to_owned(), port))
}

fn natnet(rest: &str, query: &Query<'_>) -> Result<NatNetAddress> {
    known(query, &["interface", "multicast", "unicast", "data_port", "up", "version", "bitstream"])?;
    let (host, port) = host_port(rest, COMMAND_PORT)?;
    let up = value(query, "up").map(|v| UpAxis::parse(v).with_context(|| format!("up={v} is neither y nor z")));
    Ok(NatNetAddress {
        host,
        port,
        data_port: parsed(query, "data_port")?,
        interface: parsed(query, "interface")?,
        multicast: parsed(query, "multicast")?,
        unicast: flag(query, "unicast"),
        up: up.transpose()?.unwrap_or_default(),
        version: version(query, "version")?,
        bitstream: version(query, "bitstream")?,
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
        assert_eq!(read("igtl://plus"), TrackerUrl::OpenIgtLink { host: "plus".to_owned(), port: 18944 });
        assert_eq!(read("replay:a b.mnr?fast=1"), TrackerUrl::Replay { path: "a b.mnr".into(), fast: true });
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
    }
}
