//! The editor of labels for browsers: one desk, one page, a WebSocket of small JSON messages, slices as bytes.
//!
//! The rules are those of `monro_anatomy::desk`; here are the socket, the file that every edit is appended to before its
//! answer goes out, and the thread that rebuilds the case. Who may come in is decided as for the live session.

mod export;
mod rebuild;
mod request;
mod routes;
mod store;
mod work;

pub use export::{ExportError, export};
pub use rebuild::{Rebuild, Rebuilt};
pub use store::{Known, StoreError, Subject};

use crate::ServeError;
use crate::door::Keys;
use crate::server::{Ready, ready_at};
use monro_anatomy::desk::Desk;
use monro_geometry::Volume;
use rebuild::Progress;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex};
use store::Store;
use tokio::net::TcpListener;
use tokio::sync::watch;
use work::Work;

/// What makes the labels at the start, when there is no earlier work to go on with.
pub type StartLabels = Box<dyn FnOnce() -> Result<Start, String> + Send>;

/// Labels to begin with.
#[derive(Debug)]
pub struct Start {
    /// A structure's number per voxel of the scan.
    pub labels: Volume<u8>,
    /// What is known of them; nothing for labels made elsewhere.
    pub known: Known,
}

/// What to edit, and where.
pub struct EditOptions {
    /// The scan.
    pub ct: Volume<i16>,
    /// Which scan and labels the work belongs to.
    pub subject: Subject,
    /// Folder of the work, beside the case.
    pub folder: PathBuf,
    /// Labels at the start.
    pub start: StartLabels,
    /// What the page says about the scan.
    pub findings: Vec<String>,
    /// Makes the case again from corrected labels.
    pub rebuild: Rebuild,
    /// A loopback address; port 0 takes any free port.
    pub listen: SocketAddr,
}

impl core::fmt::Debug for EditOptions {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("EditOptions")
            .field("subject", &self.subject)
            .field("folder", &self.folder)
            .finish_non_exhaustive()
    }
}

/// What all requests share.
struct Shared {
    work: Mutex<Work>,
    keys: Arc<Keys>,
    subject: Subject,
    findings: Vec<String>,
    /// What became of earlier work.
    notes: Vec<String>,
    rebuild: Rebuild,
    progress: Mutex<Progress>,
    /// Pages that were opened, and how many changes of labels and wire there were of all of them.
    pages: AtomicU64,
    edited: watch::Sender<u64>,
}

/// Serves the editor until the process ends. `ready` is called once, when the port is open.
///
/// # Errors
/// Earlier work that does not fit, an address that cannot be had or is not loopback, a socket that fails.
pub fn serve_edit(options: EditOptions, ready: impl FnOnce(&Ready)) -> Result<(), ServeError> {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
    let address = options.listen;
    if !address.ip().is_loopback() {
        return Err(ServeError::NotLoopback(address));
    }
    runtime.block_on(async {
        let listener = TcpListener::bind(address).await.map_err(|error| ServeError::Listen { address, error })?;
        let address = listener.local_addr()?;
        let shared = tokio::task::spawn_blocking(move || open(options)).await.map_err(std::io::Error::other)??;
        ready(&Ready { notes: shared.notes.clone(), ..ready_at(address, &shared.keys) });
        routes::run(Arc::new(shared), listener).await;
        Ok(())
    })
}

fn open(options: EditOptions) -> Result<Shared, ServeError> {
    let EditOptions { ct, mut subject, folder, start, mut findings, rebuild, .. } = options;
    let (store, editor, notes) = Store::open(&folder, ct.grid(), &mut subject, start)?;
    findings.extend(subject.known.findings.iter().cloned());
    findings.extend(notes.iter().cloned());
    let desk = Desk::new(ct, editor)?;
    Ok(Shared {
        work: Mutex::new(Work::new(desk, store)),
        keys: Arc::new(Keys::new().map_err(ServeError::Random)?),
        subject,
        findings,
        notes: notes.into_iter().collect(),
        rebuild,
        progress: Mutex::default(),
        pages: AtomicU64::new(1),
        edited: watch::Sender::new(0),
    })
}

#[cfg(test)]
mod tests;
