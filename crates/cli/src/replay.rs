//! `monro replay`: a recorded session again, compared with what was shown.

use crate::args::ReplayArgs;
use crate::console::Console;
use crate::output_file::{self, OutputFile};
use crate::recorded;
use anyhow::{Context, Result, bail};
use monro_case::check_output_file;
use monro_server::Replayed;
use serde_json::{Value, json};
use std::io::Write;
use std::iter;
use std::path::{Path, PathBuf};

/// Runs the command. A snapshot that comes out differently is a failure.
pub(crate) fn run(args: &ReplayArgs, console: &Console) -> Result<()> {
    let inputs: Vec<&Path> = iter::once(&args.recording).chain(&args.case).map(PathBuf::as_path).collect();
    args.out.as_deref().map_or(Ok(()), |out| output_file::check(out, args.force, &inputs))?;
    let mut out = args.out.as_deref().map(OutputFile::create).transpose()?;
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
    let done = console.stage("replay", play)?;
    written.context("cannot write the numbers (disk full?)")?;
    // The case is known by the recording only; the numbers must not take the place of a file of it.
    args.out.as_deref().map_or(Ok(()), |out| check_output_file(out, &[&done.case_dir]))?;
    out.map_or(Ok(()), OutputFile::finish)?;
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
    let compared = match done.snapshots {
        0 => "no display was shown anything, so nothing is compared and there are no numbers".to_owned(),
        all => format!("{} of {all} snapshots are the same bit for bit", done.identical),
    };
    let text = format!(
        "{:.1} s: {} tracker frames, {} steps of the soft body; {compared}.",
        done.seconds, done.frames, done.steps
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
