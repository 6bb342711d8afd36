//! Ctrl-C leaves no half-written folder or file behind.

use crate::console::tell;
use anyhow::Result;
use monro_case::Staging;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// Folders and files under construction at this moment, each with the folders that were made around it, which go if empty.
static UNDER_CONSTRUCTION: Mutex<Vec<Vec<PathBuf>>> = Mutex::new(Vec::new());

/// Whether Ctrl-C is how the command is ended.
static ENDS_THE_COMMAND: AtomicBool = AtomicBool::new(false);

/// From now on the command runs until it is interrupted: that is no failure then.
pub(crate) fn ends_the_command() {
    ENDS_THE_COMMAND.store(true, Ordering::Relaxed);
}

/// Removes what is under construction on Ctrl-C (and on a termination signal) and ends with status 130; with 0 where nothing is
/// and the command is ended so.
pub(crate) fn install() {
    let result = ctrlc::set_handler(|| {
        let mut told = None;
        if let Ok(all) = UNDER_CONSTRUCTION.lock() {
            for (path, around) in all.iter().filter_map(|made| made.split_first()) {
                // The process ends here; what cannot be removed keeps its ".partial" name.
                let _ = if path.is_dir() { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) };
                around.iter().for_each(|empty| _ = std::fs::remove_dir(empty));
                told = Some("interrupted; nothing was written");
            }
        }
        if told.is_none() && ENDS_THE_COMMAND.load(Ordering::Relaxed) {
            tell("monro: ended");
            std::process::exit(0);
        }
        tell(&format!("monro: {}", told.unwrap_or("interrupted")));
        std::process::exit(130);
    });
    if let Err(error) = result {
        tell(&format!("warning: Ctrl-C may leave a \".partial\" folder behind: {error}"));
    }
}

/// Registers a folder or a file under construction for as long as the guard lives.
#[derive(Debug)]
pub(crate) struct Guard(Vec<PathBuf>);

impl Guard {
    /// Registers the folder of `staging`.
    pub(crate) fn new(staging: &Staging) -> Self {
        Self::of(staging.made())
    }

    /// Registers what was made: a path, and folders around it.
    pub(crate) fn of<'a>(made: impl IntoIterator<Item = &'a Path>) -> Self {
        let made: Vec<PathBuf> = made.into_iter().map(Path::to_owned).collect();
        if let Ok(mut all) = UNDER_CONSTRUCTION.lock() {
            all.push(made.clone());
        }
        Self(made)
    }

    /// Brings the folder of `staging` into its place. From here on it is complete, and nothing of it is removed: not under its
    /// new name, nor is it said that nothing was written.
    pub(crate) fn finish(self, staging: Staging) -> Result<PathBuf> {
        drop(self);
        Ok(staging.finish()?)
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        if let Ok(mut all) = UNDER_CONSTRUCTION.lock() {
            all.retain(|made| *made != self.0);
        }
    }
}
