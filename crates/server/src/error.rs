//! Why a case cannot be served.

use crate::tracker::StartError;
use monro_case::CaseError;
use monro_geometry::EmbeddingError;
use monro_scan::ScanError;
use monro_session::SessionError;
use monro_session::live::PlaybackError;
use monro_session::live::log::LogError;
use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;
use thiserror::Error;

/// Why a case cannot be served.
#[derive(Debug, Error)]
pub enum ServeError {
    /// The case is faulty.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// The images of the case are faulty.
    #[error("the images of the case cannot be read: {0}")]
    Images(#[from] ScanError),
    /// The soft body cannot be made.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// A surface cannot be bound to the tetrahedra.
    #[error("a surface of the case cannot be bound to its tetrahedra: {0}")]
    Embedding(#[from] EmbeddingError),
    /// Earlier edits do not fit, or edits cannot be kept.
    #[error(transparent)]
    Edit(#[from] crate::edit::StoreError),
    /// Scan and labels do not fit.
    #[error(transparent)]
    Desk(#[from] monro_anatomy::desk::DeskError),
    /// The address is not on this machine alone.
    #[error(
        "{0} can be reached by others, and editing and preparing are for this machine only; listen on 127.0.0.1 (or [::1])"
    )]
    NotLoopback(SocketAddr),
    /// No certificate, no encryption.
    #[error("the certificate cannot be used: {0}")]
    Certificate(String),
    /// The address cannot be had.
    #[error("cannot listen on {address}: {error}; choose another with --listen, or 127.0.0.1:0 for any free port")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// The reason.
        error: io::Error,
    },
    /// The tracker cannot be started.
    #[error("the tracker cannot be started: {0}")]
    Tracker(String),
    /// The recording cannot be made or read.
    #[error("the recording {path}: {error}", path = path.display())]
    Recording {
        /// Its path.
        path: PathBuf,
        /// The reason.
        error: io::Error,
    },
    /// A folder of recordings.
    #[error("{0} is a folder; give one of the recordings in it, a file that ends in .mnrs")]
    ManyRecordings(PathBuf),
    /// The recording is damaged.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The recording is of a tracker, not of a session.
    #[error("{0} is the recording of a tracker, not of a session: \"monro track replay:FILE\" plays it")]
    OfATracker(PathBuf),
    /// The recording does not say of what it is.
    #[error("the recording does not begin with the case that was opened")]
    NoOpening,
    /// The recording was made with a soft body that is not known.
    #[error("the recording was made with the soft body \"{0}\", which this version does not know")]
    Settings(String),
    /// The case is not where the recording says.
    #[error("the case of this recording cannot be opened: {0}; if it lies elsewhere now, give its folder with --case")]
    CaseGone(CaseError),
    /// The case has changed.
    #[error("{0} is not the case of this recording, or has changed since; give the folder with --case")]
    OtherCase(PathBuf),
    /// The recording does not follow from its case.
    #[error(transparent)]
    Playback(#[from] PlaybackError),
    /// OpenIGTLink for others.
    #[error(
        "{0} can be reached by others, and OpenIGTLink has neither encryption nor passwords; listen on 127.0.0.1 and let others in by a tunnel (ssh -L)"
    )]
    OpenIgtLink(SocketAddr),
    /// No randomness for the token.
    #[error("the system gives no random numbers for the access token: {0}")]
    Random(getrandom::Error),
    /// Threads or sockets failed.
    #[error("the server stopped: {0}")]
    Io(#[from] io::Error),
}

impl From<StartError> for ServeError {
    fn from(error: StartError) -> Self {
        Self::Tracker(error.to_string())
    }
}
