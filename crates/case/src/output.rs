//! What `--force` may replace: an earlier output of the same kind, and nothing that anybody else put there.

use std::fs::{self, Metadata};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Component, Path, PathBuf};
use thiserror::Error;

/// Files that a refusal names at most.
const NAMED: usize = 3;

/// What a command writes into a folder.
#[derive(Debug, Clone, Copy)]
pub struct OutputKind {
    /// With its article, as "a case".
    pub name: &'static str,
    /// Files without which a folder is none.
    pub marks: &'static [&'static str],
    /// All files that it may hold, from the folder on; one `*` stands for anything within a name.
    pub files: &'static [&'static str],
    /// Folders in it that are outputs of a kind of their own.
    pub parts: &'static [(&'static str, &'static Self)],
    /// Names the files that are not as they were written, as far as the folder itself tells.
    pub changed: fn(&Path) -> Vec<String>,
}

/// For outputs that keep no hashes.
pub fn nothing_known(_: &Path) -> Vec<String> {
    Vec::new()
}

/// Why an output folder must not be written.
#[derive(Debug, Error)]
pub enum OutputError {
    /// It is, holds or lies in what the command reads.
    #[error("{out} {how} {input}, which this command reads; write elsewhere")]
    Input {
        /// The output folder.
        out: PathBuf,
        /// "is", "holds" or "lies in".
        how: &'static str,
        /// The input.
        input: PathBuf,
    },
    /// The folder exists and overwriting was not asked for.
    #[error("{0} exists already; give --force to overwrite it, or another --out")]
    Exists(PathBuf),
    /// Something else is there.
    #[error(
        "{out} exists already and is no earlier output of this kind ({why}); --force will not delete it: write elsewhere"
    )]
    Foreign {
        /// The output folder.
        out: PathBuf,
        /// What is missing.
        why: String,
    },
    /// It holds what Monro did not write.
    #[error(
        "{out} holds what Monro did not write, or what was changed since: {names}; --force will not delete that: move it away, or write elsewhere"
    )]
    Strangers {
        /// The output folder.
        out: PathBuf,
        /// Some of the files.
        names: String,
    },
    /// The file system refused.
    #[error("{path}: {error}")]
    Io {
        /// The path.
        path: PathBuf,
        /// The reason.
        error: io::Error,
    },
}

/// Whether a command that reads `inputs` may make `out`, or replace what is there. Paths are compared as files are: through
/// links, relative paths and mounts.
///
/// # Errors
/// `out` is, holds or lies in an input; something is there and `force` was not given, or it is no earlier output of the
/// same kind, or other files are in it.
pub fn check_output(out: &Path, force: bool, kind: &OutputKind, inputs: &[&Path]) -> Result<(), OutputError> {
    inputs.iter().try_for_each(|input| apart(out, input))?;
    replaceable(out, force, kind)
}

/// Refuses a file `out` that is one of the inputs, or that is there already inside a folder among them.
///
/// # Errors
/// [`OutputError::Input`].
pub fn check_output_file(out: &Path, inputs: &[&Path]) -> Result<(), OutputError> {
    if !out.exists() {
        return Ok(());
    }
    inputs.iter().try_for_each(|input| apart(out, input))
}

/// Where a path leads: links followed as far as there is something, `.` and `..` taken out.
pub(crate) fn real(path: &Path) -> io::Result<PathBuf> {
    let mut out = PathBuf::new();
    for part in std::path::absolute(path)?.components() {
        match part {
            Component::ParentDir => drop(out.pop()),
            other => out.push(other),
        }
        out = out.canonicalize().unwrap_or(out);
    }
    Ok(out)
}

fn same(a: &Metadata, b: &Metadata) -> bool {
    (a.dev(), a.ino()) == (b.dev(), b.ino())
}

/// Whether `inner` is `outer` or below it. The place of a link counts as well as what it leads to.
fn within(inner: &Path, outer: &Path) -> bool {
    let Ok(outer) = fs::metadata(outer) else { return false };
    let leads_to = real(inner);
    let place = inner.parent().filter(|p| !p.as_os_str().is_empty()).map_or_else(|| real(Path::new(".")), real);
    let above = |path: &Path| path.ancestors().any(|p| fs::metadata(p).is_ok_and(|m| same(&m, &outer)));
    [leads_to, place].into_iter().flatten().any(|path| above(&path))
}

fn apart(out: &Path, input: &Path) -> Result<(), OutputError> {
    let how = match (within(input, out), within(out, input)) {
        (false, false) => return Ok(()),
        (true, true) => "is",
        (true, false) => "holds",
        (false, true) => "lies in",
    };
    Err(OutputError::Input { out: out.to_owned(), how, input: input.to_owned() })
}

/// Whether what is at `out`, if anything, may go.
pub(crate) fn replaceable(out: &Path, force: bool, kind: &OutputKind) -> Result<(), OutputError> {
    let io = |error| OutputError::Io { path: out.to_owned(), error };
    let foreign = |why: &str| Err(OutputError::Foreign { out: out.to_owned(), why: why.to_owned() });
    if fs::symlink_metadata(out).is_err() {
        return Ok(());
    }
    if !out.is_dir() {
        return foreign("it is no folder");
    }
    if fs::read_dir(out).map_err(io)?.next().is_none() {
        return Ok(());
    }
    if let Some(mark) = kind.marks.iter().find(|mark| !out.join(mark).is_file()) {
        return foreign(&format!("{} has {mark}", kind.name));
    }
    let mut names = Vec::new();
    strangers(out, kind, "", &mut names).map_err(io)?;
    if !names.is_empty() {
        let more = if names.len() > NAMED { " and more" } else { "" };
        let names = names[..names.len().min(NAMED)].join(", ") + more;
        return Err(OutputError::Strangers { out: out.to_owned(), names });
    }
    if force { Ok(()) } else { Err(OutputError::Exists(out.to_owned())) }
}

/// Files below `dir` that an output of this kind does not have, or not as they are; a few of them.
pub(crate) fn strangers(dir: &Path, kind: &OutputKind, prefix: &str, names: &mut Vec<String>) -> io::Result<()> {
    names.extend((kind.changed)(dir).into_iter().map(|name| format!("{prefix}{name}")));
    below(dir, kind, (prefix, ""), names)
}

fn below(dir: &Path, kind: &OutputKind, (prefix, inside): (&str, &str), names: &mut Vec<String>) -> io::Result<()> {
    for entry in fs::read_dir(dir)? {
        if names.len() > NAMED {
            return Ok(());
        }
        let entry = entry?;
        let (is, path) = (entry.file_type()?, entry.path());
        let name = format!("{inside}{}", entry.file_name().to_string_lossy());
        let part = kind.parts.iter().find(|(own, _)| *own == name);
        match part {
            Some((_, part)) if is.is_dir() => strangers(&path, part, &format!("{prefix}{name}/"), names)?,
            _ if is.is_dir() => below(&path, kind, (prefix, &format!("{name}/")), names)?,
            // A link is nobody's output.
            _ if is.is_file() && kind.files.iter().any(|pattern| fits(pattern, &name)) => {}
            _ => names.push(format!("{prefix}{name}")),
        }
    }
    Ok(())
}

fn fits(pattern: &str, name: &str) -> bool {
    let Some((before, after)) = pattern.split_once('*') else { return pattern == name };
    let middle = name.strip_prefix(before).and_then(|rest| rest.strip_suffix(after));
    middle.is_some_and(|middle| !middle.is_empty() && !middle.contains('/'))
}
