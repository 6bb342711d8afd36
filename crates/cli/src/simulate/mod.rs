//! `monro simulate`: the catheter goes in, and everything is written down.

mod asked;
mod beside;
mod coarse;
mod crossed;
mod crushed;
mod figures;
mod misplaced;
mod output;
mod restless;
mod run;
mod verdict;
mod walls;
mod withdrawal;

use crate::args::{ModeArg, SimulateArgs, SkullArg};
use crate::console::Console;
use crate::interrupt::Guard;
use crate::soft_body;
use anyhow::{Result, ensure};
use monro_case::{Case, Staging};
use monro_session::{InsertionSettings, Skull};
use monro_tissue::{Csf, FrameSettings, TipShape};
use std::path::Path;

pub(crate) use figures::PROJECTED;
pub(crate) use output::{SIMULATION, summary_json, summary_text};
pub(crate) use run::{Run, insert};

/// Outer diameter of the catheter, mm: 9 Fr, as in the paper.
pub(crate) const DIAMETER_MM: f64 = 3.0;
/// Rest at the target before the end, s: long enough for the tissue to settle.
const HOLD_S: f64 = 1.0;

/// The largest gravity taken, m/s2: twice the Earth's.
const MOST_GRAVITY_M_S2: f64 = 20.0;

/// A millimetre of mercury (conventional), kPa.
const KPA_PER_MMHG: f64 = 0.133_322;

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
    let out = staging.finish()?;
    drop(guard);
    console.result(&summary_json(&done, &out), &summary_text(&done, &out));
    Ok(())
}

/// Settings with what is done to the fluid and with gravity.
fn asked(args: &SimulateArgs) -> Result<InsertionSettings> {
    let mut out = settings(args.mode, args.speed);
    (out.diameter_mm, out.tip, out.withdraw) = (args.diameter, args.tip, args.withdraw);
    out.frame = args.solver.frame();
    out.frame.csf = match (args.drain_ml, args.csf_pressure_mmhg) {
        (Some(ml), _) => Csf::Drained { ml },
        (_, Some(mmhg)) => Csf::Pressure { kpa: mmhg * KPA_PER_MMHG },
        (None, None) => Csf::AtRest,
    };
    ensure!(
        args.mode == ModeArg::Physical || out.frame.csf == Csf::AtRest,
        "paper mode has no pressure: --drain-ml and --csf-pressure-mmhg need --mode physical"
    );
    for (name, value) in [("--drain-ml", args.drain_ml), ("--csf-pressure-mmhg", args.csf_pressure_mmhg)] {
        let Some(value) = value else { continue };
        ensure!(value.is_finite() && value.abs() <= 150.0, "{name} {value}: wanted -150 to 150");
    }
    out.model = soft_body::model(args.mode, args.materials.as_deref())?;
    out.model.skull = match args.skull {
        SkullArg::Held => Skull::Held,
        SkullArg::Slides => Skull::Slides { septa: !args.no_septa },
    };
    ensure!(
        out.model.skull.slides() || !args.no_septa,
        "--no-septa belongs to --skull slides: falx and tentorium have no part in a brain that is held at the skull"
    );
    if let Some(gravity) = args.gravity {
        ensure!(
            args.mode == ModeArg::Physical || gravity == [0.0; 3],
            "paper mode has no stiffness to bear weight with, so what comes of it depends on the mesh: --gravity needs --mode physical"
        );
        let size = gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
        ensure!(
            size <= MOST_GRAVITY_M_S2,
            "--gravity of {size} m/s2: wanted at most {MOST_GRAVITY_M_S2} (the Earth's is 9.81; are these mm/s2?)"
        );
        out.frame.gravity_mm_s2 = gravity.map(|g| g * 1e3);
    }
    Ok(out)
}

/// Settings of an insertion in one of the two modes.
pub(crate) fn settings(mode: ModeArg, speed_mm_s: f64) -> InsertionSettings {
    InsertionSettings {
        model: soft_body::of(mode),
        speed_mm_s,
        diameter_mm: DIAMETER_MM,
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
