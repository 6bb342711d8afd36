//! Where poses come from. Each source runs by itself and only ever hands observations to the session.

mod feed;
mod igtl;
mod sim;

pub use feed::Feed;

use crate::live::Live;
use core::fmt;
use core::str::FromStr;
use monro_guidance::Plan;
use monro_wire::openigtlink::DEFAULT_PORT;
use std::borrow::Cow;
use std::io;
use std::sync::Arc;
use std::thread;
use thiserror::Error;

/// Where poses come from.
pub enum Tracker {
    /// A scripted insertion along the plan, calibrated and registered exactly.
    Sim,
    /// An OpenIGTLink server such as PLUS, as `host:port`. Calibration and registration come over the API, as for all
    /// that follow.
    OpenIgtLink(String),
    /// Anything else.
    Other {
        /// Its name, for people.
        name: String,
        /// Runs on a thread of its own, until the source ends or [`Feed::is_stopping`].
        run: Box<dyn FnOnce(Feed) + Send>,
    },
}

impl Tracker {
    /// Its name, for people.
    pub(crate) fn name(&self) -> Cow<'_, str> {
        match self {
            Self::Sim => "sim:".into(),
            Self::OpenIgtLink(host) => format!("igtl://{host}").into(),
            Self::Other { name, .. } => name.into(),
        }
    }

    /// Starts it.
    pub(crate) fn start(self, live: &Arc<Live>, plan: Plan) -> io::Result<()> {
        let live = Arc::clone(live);
        match self {
            Self::Sim => sim::spawn(live, plan),
            Self::OpenIgtLink(host) => {
                tokio::spawn(igtl::run(live, host));
                Ok(())
            }
            Self::Other { run, .. } => {
                thread::Builder::new().name("tracker".into()).spawn(move || run(Feed::new(live)))?;
                Ok(())
            }
        }
    }
}

impl fmt::Debug for Tracker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Tracker").field(&self.name()).finish()
    }
}

/// Why a tracker's URL was refused.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("\"{0}\" is no tracker that can be served; use \"sim:\" or \"igtl://HOST[:PORT]\"")]
pub struct TrackerUrlError(String);

impl FromStr for Tracker {
    type Err = TrackerUrlError;

    /// `sim:` or `igtl://HOST[:PORT]`.
    fn from_str(url: &str) -> Result<Self, TrackerUrlError> {
        if url == "sim:" {
            return Ok(Self::Sim);
        }
        let host = url.strip_prefix("igtl://").filter(|h| !h.is_empty() && !h.contains(['/', '?', '#', '@']));
        let host = host.ok_or_else(|| TrackerUrlError(url.to_owned()))?;
        let has_port = host.rsplit_once(':').is_some_and(|(h, p)| p.parse::<u16>().is_ok() && !h.is_empty());
        Ok(Self::OpenIgtLink(if has_port { host.to_owned() } else { format!("{host}:{DEFAULT_PORT}") }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn urls_are_read_and_others_refused() {
        let name = |url: &str| url.parse::<Tracker>().map(|t| t.name().into_owned());
        for (url, read) in [
            ("sim:", "sim:"),
            ("igtl://localhost:1234", "igtl://localhost:1234"),
            ("igtl://10.0.0.7", "igtl://10.0.0.7:18944"),
        ] {
            assert_eq!(name(url).as_deref(), Ok(read));
        }
        for bad in ["", "sim", "igtl://", "http://x", "igtl://a/b", "igtl://user@host"] {
            assert_eq!(name(bad), Err(TrackerUrlError(bad.to_owned())));
        }
    }
}
