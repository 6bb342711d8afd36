//! A session that begins without a case: a scan is chosen, prepared while one watches, looked at, its path moved; then the
//! case is written and opened, and the live session goes on at the same address.
//!
//! The rules of preparing are those of `monro_prepare`; here are the thread, the progress and the routes.

mod job;
mod routes;

use crate::door::Keys;
use crate::options::ServeOptions;
use crate::server::{Ready, ready_at, start_on};
use crate::{Running, ServeError};
use job::Job;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use tokio::net::TcpListener;
use tokio::sync::{Mutex, mpsc, oneshot};

/// What all requests share.
struct Shared {
    keys: Arc<Keys>,
    /// Where scans lie: each entry is one.
    scans: PathBuf,
    job: Job,
    /// Asks for the live session of the written case; answered when it runs.
    open: Mutex<mpsc::Sender<oneshot::Sender<Result<(), String>>>>,
}

/// Lets a scan of the folder `scans` be prepared, writes the case to `options.case_dir`, and serves it until the process
/// ends. `ready` is called once, when the port is open.
///
/// # Errors
/// An address that cannot be had or is not loopback, a socket that fails, and all that [`crate::serve`] refuses.
pub fn serve_scans(scans: PathBuf, options: ServeOptions, ready: impl FnOnce(&Ready)) -> Result<(), ServeError> {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
    runtime.block_on(async {
        let address = options.listen;
        if !address.ip().is_loopback() {
            return Err(ServeError::NotLoopback(address));
        }
        let listener = TcpListener::bind(address).await.map_err(|error| ServeError::Listen { address, error })?;
        let keys = Arc::new(Keys::new().map_err(ServeError::Random)?);
        ready(&ready_at(listener.local_addr()?, &keys));
        prepare_then_serve(scans, options, listener, keys).await?.wait().await
    })
}

/// Both halves on one socket: the second listens before the first stops, so that no request is turned away.
async fn prepare_then_serve(
    scans: PathBuf,
    mut options: ServeOptions,
    listener: TcpListener,
    keys: Arc<Keys>,
) -> Result<Running, ServeError> {
    let listener = listener.into_std()?;
    let second = listener.try_clone()?;
    let (ask, mut asked) = mpsc::channel(1);
    let job = Job::new(options.case_dir.clone());
    let shared = Arc::new(Shared { keys: Arc::clone(&keys), scans, job, open: Mutex::new(ask) });
    let (stop, stopped) = oneshot::channel::<()>();
    let first = tokio::spawn(routes::run(shared, TcpListener::from_std(listener)?, stopped));
    let Some(answer) = asked.recv().await else {
        first.await.map_err(io::Error::other)?;
        return Err(io::Error::other("the page that prepares has ended").into());
    };
    options.listen = second.local_addr()?;
    let running = start_on(TcpListener::from_std(second)?, options, keys).await;
    // Stopped before it is answered: what the page asks next is asked of the live session.
    let _ = stop.send(());
    let _ = answer.send(running.as_ref().map(|_| ()).map_err(ToString::to_string));
    running
}
