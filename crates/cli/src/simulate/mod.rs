//! `monro simulate`: the catheter goes in, and everything is written down.

mod figures;
mod output;
mod run;

use crate::args::{ModeArg, SimulateArgs};
use crate::console::Console;
use crate::interrupt::Guard;
use anyhow::Result;
use monro_case::{Case, Staging};
use monro_session::{InsertionSettings, Mode, ModelSettings};
use monro_tissue::{CollisionResponse, FrameSettings, PaperOptions, PhysicalOptions};
use std::path::Path;

pub(crate) use output::{summary_json, summary_text};
pub(crate) use run::{Run, insert};

/// Outer diameter of the catheter, mm: 9 Fr, as in the paper.
const DIAMETER_MM: f64 = 3.0;
/// Rest at the target before the end, s: long enough for the tissue to settle.
const HOLD_S: f64 = 1.0;

/// Runs the command.
pub(crate) fn run(args: &SimulateArgs, console: &Console) -> Result<()> {
    let staging = Staging::begin(&args.out, args.force)?;
    let guard = Guard::new(&staging);
    let case = console.stage("open case", || Case::open(&args.case))?;
    let done = insert(&case, &settings(args.mode, args.speed), console)?;
    write(&args.case, &case, &done, &staging, console)?;
    let out = staging.finish()?;
    drop(guard);
    console.result(&summary_json(&done, &out), &summary_text(&done, &out));
    Ok(())
}

/// Settings of an insertion in one of the two modes.
pub(crate) fn settings(mode: ModeArg, speed_mm_s: f64) -> InsertionSettings {
    let mode = match mode {
        ModeArg::Paper => Mode::Paper(PaperOptions::default()),
        ModeArg::Physical => Mode::Physical(PhysicalOptions::default()),
    };
    InsertionSettings {
        model: ModelSettings { mode, collision: CollisionResponse::Insertion },
        speed_mm_s,
        diameter_mm: DIAMETER_MM,
        hold_s: HOLD_S,
        frame: FrameSettings::default(),
    }
}

/// Writes series, meshes, summary and report into a folder under construction.
pub(crate) fn write(case_dir: &Path, case: &Case, done: &Run, staging: &Staging, console: &Console) -> Result<()> {
    console.stage("write", || output::write(done, staging))?;
    let html = console.stage("report", || figures::report(case_dir, case, done))?;
    staging.write("report.html", html.as_bytes())?;
    Ok(())
}
