//! A file that a command writes: what must not be lost for it.

use crate::interrupt::Guard;
use anyhow::{Context, Result, bail};
use monro_case::check_output_file;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Whether a command that reads `inputs` may write the file `out`.
pub(crate) fn check(out: &Path, force: bool, inputs: &[&Path]) -> Result<()> {
    check_output_file(out, inputs)?;
    if out.is_dir() {
        bail!("{} is a folder; give the name of a file in it", out.display());
    }
    if out.exists() && !force {
        bail!("{} exists already; give --force to overwrite it, or another name", out.display());
    }
    let target = target(out);
    match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() && !folder.is_dir() => {
            bail!("{} cannot be written: there is no folder {}; make it first", out.display(), folder.display())
        }
        // Before the work, not after it.
        _ => OutputFile::create(out).map(drop),
    }
}

/// Where the bytes go: through a symbolic link, so that it stays one.
fn target(out: &Path) -> PathBuf {
    let Ok(link) = fs::read_link(out) else { return out.to_owned() };
    // The link may point to what is not there yet.
    fs::canonicalize(out).unwrap_or_else(|_| out.with_file_name(link))
}

/// A file that is written aside and then put into its place, so that an interrupted or failed run leaves no half file and what
/// was there before stays. A terminal, pipe or device is written as it is.
pub(crate) struct OutputFile {
    out: PathBuf,
    file: BufWriter<File>,
    aside: Option<Aside>,
}

/// Where it is written; removed if it is still there when this goes.
struct Aside {
    path: PathBuf,
    target: PathBuf,
    _guard: Guard,
}

impl Drop for Aside {
    fn drop(&mut self) {
        // Nothing is there any more once it is in its place.
        let _ = fs::remove_file(&self.path);
    }
}

impl OutputFile {
    /// Begins the file `out`, which [`check`] has allowed.
    pub(crate) fn create(out: &Path) -> Result<Self> {
        let target = target(out);
        let cannot = || format!("cannot write {}", out.display());
        if fs::metadata(&target).is_ok_and(|m| !m.is_file() && !m.is_dir()) {
            let file = File::options().write(true).open(&target).with_context(cannot)?;
            return Ok(Self { out: out.to_owned(), file: BufWriter::new(file), aside: None });
        }
        let mut name = target.file_name().unwrap_or_default().to_owned();
        name.push(format!(".partial-{}", std::process::id()));
        let path = target.with_file_name(name);
        let file = File::create(&path).with_context(cannot)?;
        let aside = Aside { _guard: Guard::of([path.as_path()]), path, target };
        Ok(Self { out: out.to_owned(), file: BufWriter::new(file), aside: Some(aside) })
    }

    /// Puts it into its place.
    pub(crate) fn finish(mut self) -> Result<()> {
        let written = self.file.flush();
        let placed = written.and_then(|()| self.aside.as_ref().map_or(Ok(()), |a| fs::rename(&a.path, &a.target)));
        placed.with_context(|| format!("cannot write {}", self.out.display()))
    }
}

impl Write for OutputFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Writes a whole file.
pub(crate) fn write(out: &Path, bytes: &[u8]) -> Result<()> {
    let mut file = OutputFile::create(out)?;
    file.write_all(bytes).with_context(|| format!("cannot write {}", out.display()))?;
    file.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_output_that_is_a_folder_or_in_no_folder_is_refused_beforehand() {
        let dir = tempfile::tempdir().expect("temp");
        let other = tempfile::tempdir().expect("temp");
        let input = other.path().join("input.vtu");
        fs::write(&input, "x").expect("write");
        let said = |out: &Path, force| check(out, force, &[&input]).expect_err("refused").to_string();
        assert!(said(dir.path(), true).contains("is a folder"));
        let missing = dir.path().join("none").join("q.vtu");
        assert!(said(&missing, true).contains(&format!("no folder {}", dir.path().join("none").display())));
        let there = dir.path().join("there.vtu");
        fs::write(&there, "x").expect("write");
        assert!(said(&there, false).contains("--force"));
        check(&there, true, &[&input]).expect("forced");
        check(Path::new("plain.vtu"), false, &[&input]).expect("a plain name");
        assert!(said(&input, true).contains("which this command reads"));
    }

    #[test]
    fn what_is_checked_is_not_yet_written() {
        let dir = tempfile::tempdir().expect("temp");
        check(&dir.path().join("new.vtu"), false, &[]).expect("may be written");
        assert_eq!(fs::read_dir(dir.path()).expect("list").count(), 0);
    }

    #[test]
    fn a_failed_write_left_a_partial_file() {
        let dir = tempfile::tempdir().expect("temp");
        let folder = dir.path().join("d.vtu");
        fs::create_dir(&folder).expect("folder");
        let said = write(&folder, b"x").expect_err("refused").to_string();
        assert!(said.contains("d.vtu") && !said.contains("partial"), "{said}");
        assert_eq!(fs::read_dir(dir.path()).expect("list").count(), 1);
    }

    #[test]
    fn a_run_that_failed_had_emptied_the_file_that_it_was_to_replace() {
        let dir = tempfile::tempdir().expect("temp");
        let out = dir.path().join("numbers.jsonl");
        fs::write(&out, "old").expect("write");
        let mut begun = OutputFile::create(&out).expect("begun");
        begun.write_all(b"new, and only half of it").expect("write");
        drop(begun);
        assert_eq!(fs::read(&out).expect("there"), b"old");
        assert_eq!(fs::read_dir(dir.path()).expect("list").count(), 1);
        write(&out, b"new").expect("whole");
        assert_eq!(fs::read(&out).expect("there"), b"new");
        assert_eq!(fs::read_dir(dir.path()).expect("list").count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn a_device_was_replaced_by_a_file() {
        let null = Path::new("/dev/null");
        write(null, b"x").expect("written");
        assert!(!fs::metadata(null).expect("there").is_file());
    }

    #[cfg(unix)]
    #[test]
    fn a_symbolic_link_was_replaced_by_a_file() {
        let dir = tempfile::tempdir().expect("temp");
        let [real, link, late] = ["real.vtu", "link.vtu", "late.vtu"].map(|n| dir.path().join(n));
        fs::write(&real, "old").expect("write");
        std::os::unix::fs::symlink("real.vtu", &link).expect("link");
        write(&link, b"new").expect("through the link");
        assert_eq!((fs::read(&real).expect("real"), link.is_symlink()), (b"new".to_vec(), true));
        std::os::unix::fs::symlink("later.vtu", &late).expect("link");
        write(&late, b"late").expect("through a link to nothing yet");
        assert_eq!(fs::read(dir.path().join("later.vtu")).expect("made"), b"late");
    }
}
