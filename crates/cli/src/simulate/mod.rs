//! `monro simulate`: the catheter goes in, and everything is written down.

mod asked;
mod beside;
mod beyond;
mod coarse;
mod crossed;
mod crushed;
mod cutting;
mod figures;
mod misplaced;
mod output;
mod restless;
mod run;
mod verdict;
mod walls;
mod withdrawal;

use crate::args::{ModeArg, SimulateArgs};
use crate::console::Console;
use crate::interrupt::Guard;
use crate::soft_body;
use anyhow::{Result, ensure};
use monro_case::{Case, Staging};
use monro_session::{CATHETER_MM, InsertionSettings};
use monro_tissue::{FrameSettings, TipShape};
use std::path::Path;

pub(crate) use figures::PROJECTED;
pub(crate) use output::{SIMULATION, summary_json, summary_text};
pub(crate) use run::{Run, insert};

/// Rest at the target before the end, s: long enough for the tissue to settle.
const HOLD_S: f64 = 1.0;

/// Runs the command.
pub(crate) fn run(args: &SimulateArgs, console: &Console) -> Result<()> {
    ensure!(
        args.side.is_none(),
        "the side is that of the plan in the case: choose it with \"monro prepare SCAN --side left\""
    );
    let inputs: Vec<&Path> =
        [Some(&args.case), args.materials.as_ref()].into_iter().flatten().map(|p| p.as_path()).collect();
    let staging = Staging::begin(&args.out, args.force, &SIMULATION, &inputs)?;
    let guard = Guard::new(&staging);
    let case = console.stage("open case", || Case::open(&args.case))?;
    let mut done = insert(&case, &beside::paths(args, &case)?, &asked(args)?, console)?;
    done.materials_file = args.materials.as_ref().map(|file| file.display().to_string());
    write(&args.case, &case, &done, &staging, console)?;
    let out = guard.finish(staging)?;
    console.result(&summary_json(&done, &out), &summary_text(&done, &out));
    Ok(())
}

/// Settings with what is done to the fluid and with gravity.
fn asked(args: &SimulateArgs) -> Result<InsertionSettings> {
    let mut out = settings(args.mode, args.speed);
    (out.diameter_mm, out.tip, out.withdraw) = (args.diameter, args.tip, args.withdraw);
    out.frame = args.shift.loads(args.mode)?.on(args.solver.frame());
    out.model = soft_body::model(args.mode, args.materials.as_deref())?;
    out.model.skull = args.shift.skull()?;
    Ok(out)
}

/// Settings of an insertion in one of the two modes.
pub(crate) fn settings(mode: ModeArg, speed_mm_s: f64) -> InsertionSettings {
    InsertionSettings {
        model: soft_body::of(mode),
        speed_mm_s,
        diameter_mm: CATHETER_MM,
        tip: TipShape::Round,
        hold_s: HOLD_S,
        withdraw: false,
        frame: FrameSettings::default(),
    }
}

/// Writes series, meshes, summary and report into a folder under construction.
pub(crate) fn write(case_dir: &Path, case: &Case, done: &Run, staging: &Staging, console: &Console) -> Result<()> {
    done.findings().iter().for_each(|f| console.warn(&f.text));
    console.stage("write", || output::write(done, staging))?;
    let html = console.stage("report", || figures::report(case_dir, case, done))?;
    staging.write("report.html", html.as_bytes())?;
    Ok(())
}
