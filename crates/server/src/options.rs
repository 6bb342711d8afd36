//! What to serve, and where.

use crate::Tracker;
use monro_session::{FrameSettings, ModelSettings};
use std::net::SocketAddr;
use std::path::PathBuf;

/// What to serve, and where.
#[derive(Debug)]
pub struct ServeOptions {
    /// The folder of the case.
    pub case_dir: PathBuf,
    /// Port 0 takes any free port. What others can reach is encrypted.
    pub listen: SocketAddr,
    /// Encrypts loopback too; for other addresses one is made when there is none.
    pub certificate: Option<Certificate>,
    /// Names of this machine under which it may be reached, beside its addresses.
    pub names: Vec<String>,
    /// Where poses come from.
    pub tracker: Tracker,
    /// The soft body.
    pub model: ModelSettings,
    /// How its steps go, but for their time.
    pub frame: FrameSettings,
    /// Where the session is recorded, if it is.
    pub recording: Option<Recording>,
    /// Where OpenIGTLink is served, if it is; a loopback address.
    pub igtl: Option<SocketAddr>,
}

impl ServeOptions {
    /// The same once more, for another try; `None` where somebody else has opened the tracker.
    pub(crate) fn try_clone(&self) -> Option<Self> {
        Some(Self {
            case_dir: self.case_dir.clone(),
            listen: self.listen,
            certificate: self.certificate.clone(),
            names: self.names.clone(),
            tracker: self.tracker.try_clone()?,
            model: self.model,
            frame: self.frame,
            recording: self.recording.clone(),
            igtl: self.igtl,
        })
    }
}

/// Where the certificate comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Certificate {
    /// Made at start; browsers warn, and its fingerprint can be compared.
    SelfSigned,
    /// Two PEM files.
    Files {
        /// The certificate, with those between it and the root.
        cert: PathBuf,
        /// Its private key.
        key: PathBuf,
    },
}

/// A recording to be made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Recording {
    /// The new file; its folder is made.
    pub path: PathBuf,
    /// A name for the soft body's settings, by which a replay knows them again.
    pub settings: String,
}
