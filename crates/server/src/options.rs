//! What to serve, and where.

use crate::Tracker;
use monro_session::ModelSettings;
use std::net::SocketAddr;
use std::path::PathBuf;

/// What to serve, and where.
#[derive(Debug)]
pub struct ServeOptions {
    /// The folder of the case.
    pub case_dir: PathBuf,
    /// A loopback address; port 0 takes any free port.
    pub listen: SocketAddr,
    /// Where poses come from.
    pub tracker: Tracker,
    /// The soft body.
    pub model: ModelSettings,
}
