//! Ctrl-C leaves no half-written folder behind.

use crate::console::tell;
use monro_case::Staging;
use std::path::PathBuf;
use std::sync::Mutex;

/// Folders under construction at this moment.
static UNDER_CONSTRUCTION: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Removes the folders under construction on Ctrl-C (and on a termination signal) and ends with status 130.
pub(crate) fn install() {
    let result = ctrlc::set_handler(|| {
        let mut told = "interrupted";
        if let Ok(folders) = UNDER_CONSTRUCTION.lock() {
            for folder in folders.iter() {
                // The process ends here; a folder that cannot be removed keeps its ".partial" name.
                let _ = std::fs::remove_dir_all(folder);
                told = "interrupted; nothing was written";
            }
        }
        tell(&format!("monro: {told}"));
        std::process::exit(130);
    });
    if let Err(error) = result {
        tell(&format!("warning: Ctrl-C may leave a \".partial\" folder behind: {error}"));
    }
}

/// Registers a folder under construction for as long as the guard lives.
#[derive(Debug)]
pub(crate) struct Guard(PathBuf);

impl Guard {
    /// Registers the folder of `staging`.
    pub(crate) fn new(staging: &Staging) -> Self {
        let path = staging.path().to_owned();
        if let Ok(mut folders) = UNDER_CONSTRUCTION.lock() {
            folders.push(path.clone());
        }
        Self(path)
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        if let Ok(mut folders) = UNDER_CONSTRUCTION.lock() {
            folders.retain(|f| *f != self.0);
        }
    }
}
