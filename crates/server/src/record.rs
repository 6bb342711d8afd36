//! Writes the log of a session as it goes. Every entry is handed to the system at once, by a thread of its own: a crash of
//! this program loses what was waiting for that thread, which is less than the tenth of a second that is promised.

use crate::ServeError;
use crate::lock::lock;
use monro_case::Case;
use monro_session::live::log::{Entry, MAGIC, Opened, framed};
use std::fs::{File, create_dir_all};
use std::io::{self, Write};
use std::path::{Component, Path, PathBuf, absolute};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread;

/// Why a log has ended, where it has.
type Trouble = Arc<Mutex<Option<String>>>;

/// What tells a case from others: its files with the beginnings of their hashes.
pub(crate) fn identity(case: &Case) -> String {
    let one = |f: &monro_case::FileEntry| format!("{}={:.16}", f.name, f.sha256);
    case.manifest.files.iter().map(one).collect::<Vec<_>>().join(" ")
}

/// The way from the folder of a recording to that of its case, so that both can be moved together.
pub(crate) fn way_to_case(recording: &Path, case_dir: &Path) -> io::Result<PathBuf> {
    let (recording, case) = (absolute(recording)?, absolute(case_dir)?);
    let folder: Vec<_> = recording.parent().into_iter().flat_map(Path::components).collect();
    let common = folder.iter().zip(case.components()).take_while(|(a, b)| **a == *b).count();
    let up = folder[common..].iter().map(|_| Component::ParentDir);
    Ok(up.chain(case.components().skip(common)).collect())
}

/// The case of a recording, by the way that it tells.
pub(crate) fn case_of(recording: &Path, way: &str) -> PathBuf {
    recording.parent().unwrap_or(Path::new("")).join(way)
}

/// An open log.
#[derive(Debug)]
pub(crate) struct Log {
    path: PathBuf,
    sender: Sender<Vec<u8>>,
    trouble: Trouble,
}

impl Log {
    /// Makes a new file, with its folder; an existing one is refused.
    ///
    /// # Errors
    /// When it cannot be made.
    pub(crate) fn create(path: &Path, opened: Opened) -> Result<Self, ServeError> {
        let refused = |error| ServeError::Recording { path: path.to_owned(), error };
        if let Some(folder) = path.parent() {
            create_dir_all(folder).map_err(refused)?;
        }
        let mut file = monro_tracking::new_file(path).map_err(refused)?;
        file.write_all(&[MAGIC.to_vec(), framed(&Entry::Opened(opened).encode())].concat()).map_err(refused)?;
        let (sender, receiver) = channel();
        let trouble = Trouble::default();
        let (told, at) = (Arc::clone(&trouble), path.to_owned());
        thread::Builder::new().name("recording".into()).spawn(move || write((file, &at), &receiver, &told))?;
        Ok(Self { path: path.to_owned(), sender, trouble })
    }

    /// Takes the bytes of an entry.
    pub(crate) fn write(&self, entry: &[u8]) {
        // A thread that has ended has said why.
        let _ = self.sender.send(framed(entry));
    }

    /// Where it is.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Why nothing is recorded any more, where that is so.
    pub(crate) fn trouble(&self) -> Option<String> {
        lock(&self.trouble).clone()
    }
}

fn write((mut file, path): (File, &Path), entries: &Receiver<Vec<u8>>, trouble: &Trouble) {
    while let Ok(mut bytes) = entries.recv() {
        // Whatever waits goes in one piece.
        entries.try_iter().for_each(|more| bytes.extend(more));
        // A file without a name takes all that is written and is gone with the process.
        let written = file.write_all(&bytes).and_then(|()| path.metadata().map(drop));
        if let Err(error) = written {
            let why = format!("the session is not recorded any more: {}: {error}", path.display());
            *lock(trouble) = Some(why);
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_from_a_recording_leads_to_its_case() {
        for (recording, case, way) in [
            ("/a/case-sessions/x.mnrs", "/a/case", "../case"),
            ("/a/x.mnrs", "/a/b/case", "b/case"),
            ("/r/x.mnrs", "/a/case", "../a/case"),
            ("case-sessions/x.mnrs", "case", "../case"),
        ] {
            assert_eq!(way_to_case(Path::new(recording), Path::new(case)).expect("a way"), Path::new(way));
        }
        assert_eq!(case_of(Path::new("/b/case-sessions/x.mnrs"), "../case"), Path::new("/b/case-sessions/../case"));
        // Recordings of earlier versions tell the folder itself.
        assert_eq!(case_of(Path::new("/b/x.mnrs"), "/a/case"), Path::new("/a/case"));
    }
}
