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
use monro_case::Staging;
use monro_prepare::Prepared;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use tokio::net::TcpListener;
use tokio::sync::{Mutex, mpsc, oneshot};

/// What is written into the folder of a case beside the case itself, from what was prepared and the stages with their
/// seconds; or why not.
pub type Beside = Box<dyn Fn(&Prepared, &[(String, f64)], &Staging) -> Result<(), String> + Send + Sync>;

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
/// ends. `beside` adds a report to the case; `ready` is called once, when the port is open.
///
/// # Errors
/// An address that cannot be had or is not loopback, a socket that fails, and all that [`crate::serve`] refuses.
pub fn serve_scans(
    scans: PathBuf,
    options: ServeOptions,
    beside: Beside,
    ready: impl FnOnce(&Ready),
) -> Result<(), ServeError> {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
    runtime.block_on(async {
        let address = options.listen;
        if !address.ip().is_loopback() {
            return Err(ServeError::NotLoopback(address));
        }
        let listener = TcpListener::bind(address).await.map_err(|error| ServeError::Listen { address, error })?;
        let keys = Arc::new(Keys::new().map_err(ServeError::Random)?);
        ready(&ready_at(listener.local_addr()?, &keys));
        prepare_then_serve((scans, beside), options, listener, keys).await?.wait().await
    })
}

/// Both halves on one socket: the second listens before the first stops, so that no request is turned away.
async fn prepare_then_serve(
    (scans, beside): (PathBuf, Beside),
    mut options: ServeOptions,
    listener: TcpListener,
    keys: Arc<Keys>,
) -> Result<Running, ServeError> {
    options.listen = listener.local_addr()?;
    let listener = listener.into_std()?;
    let second = listener.try_clone()?;
    let (ask, mut asked) = mpsc::channel(1);
    let job = Job::new(scans.clone(), options.case_dir.clone(), beside);
    let shared = Arc::new(Shared { keys: Arc::clone(&keys), scans, job, open: Mutex::new(ask) });
    let (stop, stopped) = oneshot::channel::<()>();
    let first = tokio::spawn(routes::run(shared, TcpListener::from_std(listener)?, stopped));
    while let Some(answer) = asked.recv().await {
        let Some(again) = options.try_clone() else {
            return Err(io::Error::other("this tracker cannot be opened a second time").into());
        };
        match start_on(TcpListener::from_std(second.try_clone()?)?, options, Arc::clone(&keys)).await {
            Ok(running) => {
                // Stopped before it is answered: what the page asks next is asked of the live session.
                let _ = stop.send(());
                let _ = answer.send(Ok(()));
                return Ok(running);
            }
            // The page says why; the path, the tracker or the disk may be put right, and it is asked for again.
            Err(why) => {
                forget_recording(&again, &why);
                let _ = answer.send(Err(why.to_string()));
            }
        }
        options = again;
    }
    first.await.map_err(io::Error::other)?;
    Err(io::Error::other("the page that prepares has ended").into())
}

/// A recording that was begun for a session which then could not be opened holds nothing, and would be in the way.
fn forget_recording(options: &ServeOptions, why: &ServeError) {
    if let (Some(recording), false) = (&options.recording, matches!(why, ServeError::Recording { .. })) {
        // It may not have come to that.
        let _ = std::fs::remove_file(&recording.path);
    }
}
