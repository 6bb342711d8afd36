//! What to serve, and where.

use core::fmt;
use core::str::FromStr;
use monro_session::ModelSettings;
use std::net::SocketAddr;
use std::path::PathBuf;
use thiserror::Error;

/// What to serve, and where.
#[derive(Debug, Clone)]
pub struct ServeOptions {
    /// The folder of the case.
    pub case_dir: PathBuf,
    /// A loopback address; port 0 takes any free port.
    pub listen: SocketAddr,
    /// Where poses come from.
    pub tracker: TrackerUrl,
    /// The soft body.
    pub model: ModelSettings,
}

/// Where poses come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TrackerUrl {
    /// `sim:`, a scripted insertion along the plan.
    Sim,
    /// `igtl://host:port`, an OpenIGTLink server such as PLUS.
    OpenIgtLink(String),
}

/// Why a tracker's URL was refused.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("\"{0}\" is no tracker that can be served; use \"sim:\" or \"igtl://HOST[:PORT]\"")]
pub struct TrackerUrlError(String);

impl FromStr for TrackerUrl {
    type Err = TrackerUrlError;

    fn from_str(url: &str) -> Result<Self, TrackerUrlError> {
        if url == "sim:" {
            return Ok(Self::Sim);
        }
        let host = url.strip_prefix("igtl://").filter(|h| !h.is_empty() && !h.contains(['/', '?', '#', '@']));
        let host = host.ok_or_else(|| TrackerUrlError(url.to_owned()))?;
        let has_port = host.rsplit_once(':').is_some_and(|(h, p)| p.parse::<u16>().is_ok() && !h.is_empty());
        let port = monro_wire::openigtlink::DEFAULT_PORT;
        Ok(Self::OpenIgtLink(if has_port { host.to_owned() } else { format!("{host}:{port}") }))
    }
}

impl fmt::Display for TrackerUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Sim => f.write_str("sim:"),
            Self::OpenIgtLink(host) => write!(f, "igtl://{host}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn urls_are_read_and_others_refused() {
        let igtl = |h: &str| Ok(TrackerUrl::OpenIgtLink(h.to_owned()));
        assert_eq!("sim:".parse(), Ok(TrackerUrl::Sim));
        assert_eq!("igtl://localhost:1234".parse(), igtl("localhost:1234"));
        assert_eq!("igtl://10.0.0.7".parse(), igtl("10.0.0.7:18944"));
        for bad in ["", "sim", "igtl://", "http://x", "igtl://a/b", "igtl://user@host"] {
            assert!(bad.parse::<TrackerUrl>().is_err(), "{bad}");
        }
    }
}
