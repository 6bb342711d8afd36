//! `monro replay`: a recorded session again, compared with what was shown.

use crate::args::ReplayArgs;
use crate::console::Console;
use crate::{output_file, recorded};
use anyhow::{Context, Result, bail};
use monro_server::Replayed;
use serde_json::{Value, json};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::iter;
use std::path::{Path, PathBuf};

/// An empty file of our own would only be in the way of the next try.
fn remove_empty(args: &ReplayArgs) {
    let is_empty = |out: &&PathBuf| out.symlink_metadata().is_ok_and(|file| file.is_file() && file.len() == 0);
    let _ = args.out.as_ref().filter(|_| !args.force).filter(is_empty).map(std::fs::remove_file);
}

/// The file for the numbers, if one is wanted.
fn open_out(args: &ReplayArgs) -> Result<Option<BufWriter<File>>> {
    let Some(path) = &args.out else { return Ok(None) };
    let file = if args.force { File::create(path) } else { File::create_new(path) };
    Ok(Some(BufWriter::new(file.with_context(|| format!("cannot make {}", path.display()))?)))
}

/// Runs the command. A snapshot that comes out differently is a failure.
pub(crate) fn run(args: &ReplayArgs, console: &Console) -> Result<()> {
    let inputs: Vec<&Path> = iter::once(&args.recording).chain(&args.case).map(PathBuf::as_path).collect();
    args.out.as_deref().map_or(Ok(()), |out| output_file::check(out, args.force, &inputs))?;
    let mut out = open_out(args)?;
    let mut written = Ok(());
    let each = |guidance: &Value| {
        if let Some(out) = &mut out
            && written.is_ok()
        {
            written = writeln!(out, "{guidance}");
        }
    };
    let mut told = 0;
    let progress = |share: f64| {
        let percent = (100.0 * share) as u32;
        if percent > told {
            told = percent;
            console.progress(format!("replay: {percent} %"));
        }
    };
    let play = || monro_server::replay(&args.recording, args.case.as_deref(), recorded::known, each, progress);
    let played = console.stage("replay", play);
    if played.is_err() {
        drop(out.take());
        remove_empty(args);
    }
    let done = played?;
    written.context("cannot write the numbers (disk full?)")?;
    out.map_or(Ok(()), |mut out| out.flush()).context("cannot write the numbers (disk full?)")?;
    say(&done, console);
    verdict(&done)
}

/// What was played.
fn say(done: &Replayed, console: &Console) {
    let result = json!({
        "recorded_by": done.generator, "seconds": done.seconds, "frames": done.frames, "steps": done.steps,
        "events": done.events, "snapshots": done.snapshots, "identical": done.identical,
        "differs_at_s": done.differs_at_s, "cut_off_bytes": done.cut_off, "damage": done.damage,
    });
    let text = format!(
        "{:.1} s: {} tracker frames, {} steps of the soft body; {} of {} snapshots are the same bit for bit.",
        done.seconds, done.frames, done.steps, done.identical, done.snapshots
    );
    console.result(&result, &text);
    if done.damage.is_none() && done.cut_off > 0 {
        console.warn(&format!("the last {} bytes of the recording are no whole entry: it was cut off, or the length of an entry is damaged", done.cut_off));
    }
}

/// Whether it came out as it was shown.
fn verdict(done: &Replayed) -> Result<()> {
    match (done.differs_at_s, &done.damage) {
        (Some(at), _) if !at.is_finite() => bail!("a snapshot has no time that could be: the recording is damaged"),
        (Some(at), _) => bail!(
            "the snapshot of {at:.3} s comes out differently; it was recorded by {}, this is monro {}",
            done.generator,
            env!("CARGO_PKG_VERSION")
        ),
        (None, Some(damage)) => bail!("{damage}; it and all that follows, {} bytes, were left out", done.cut_off),
        (None, None) => Ok(()),
    }
}
