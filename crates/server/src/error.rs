//! Why a case cannot be served.

use crate::tracker::StartError;
use monro_case::CaseError;
use monro_geometry::EmbeddingError;
use monro_scan::ScanError;
use monro_session::SessionError;
use std::io;
use std::net::SocketAddr;
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
    #[error("{0} can be reached by others, and there is no encryption yet; listen on 127.0.0.1 (or [::1])")]
    NotLoopback(SocketAddr),
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
