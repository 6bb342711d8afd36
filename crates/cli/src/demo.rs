//! `monro demo`: the whole chain on the built-in phantom, and at its end the live view.

use crate::args::{DemoArgs, ModeArg, PhantomKind};
use crate::console::{Console, seconds_json};
use crate::interrupt::Guard;
use crate::phantom::PHANTOM;
use crate::prepare;
use crate::simulate::SIMULATION;
use crate::{NOTICE, phantom, serve, simulate};
use anyhow::Result;
use monro_case::{CASE, Case, OutputKind, Staging, nothing_known};
use monro_prepare::{Prepared, Request};
use monro_scan::{ReadOptions, Scan};
use serde_json::json;
use std::fs;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// Speed of the demo's catheter, mm/s.
const SPEED_MM_S: f64 = 10.0;

/// What the command writes.
const DEMO: OutputKind = OutputKind {
    name: "a demo",
    marks: &["demo.json"],
    files: &["demo.json", "sessions/*.mnrs"],
    parts: &[("phantom", &PHANTOM), ("case", &CASE), ("insertion", &SIMULATION)],
    changed: nothing_known,
};

/// Runs the command: phantom as DICOM, prepared, inserted, reported.
pub(crate) fn run(args: &DemoArgs, console: &Console) -> Result<()> {
    let staging = Staging::begin(&args.out, args.force, &DEMO, &[])?;
    let guard = Guard::new(&staging);
    let scan = phantom_as_scan(&staging.path().join("phantom"), 0, console)?;
    let prepared = monro_prepare::build(scan, &Request::default(), console)?;
    let case_dir = sub_folder((&staging, "case", &CASE), |s| prepare::write(&prepared, s, console))?;
    let preparing = console.stages();
    let case = console.stage("open case", || Case::open(&case_dir))?;
    let done = simulate::insert(&case, &[], &simulate::settings(ModeArg::Physical, SPEED_MM_S), console)?;
    sub_folder((&staging, "insertion", &SIMULATION), |s| simulate::write(&case_dir, &case, &done, s, console))?;
    let stages = console.stages();
    let times = json!({ "notice": NOTICE, "seconds": seconds_json(&stages) });
    staging.write("demo.json", format!("{times:#}\n").as_bytes())?;
    let out = guard.finish(staging)?;
    report(&prepared, &preparing, &done, &out, console);
    if !wants_live_view(args) {
        return Ok(());
    }
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs();
    let recording = out.join("sessions").join(format!("{}.mnrs", serve::date(now)));
    serve::demo(&out.join("case"), recording, console)
}

/// The live view runs until somebody ends it, so there must be somebody, or it must be asked for.
fn wants_live_view(args: &DemoArgs) -> bool {
    let somebody = std::io::stdin().is_terminal() && std::io::stderr().is_terminal();
    args.live || (somebody && !args.headless)
}

/// Makes a folder inside another one that is itself still under construction.
fn sub_folder(
    (staging, name, kind): (&Staging, &str, &OutputKind),
    fill: impl FnOnce(&Staging) -> Result<()>,
) -> Result<PathBuf> {
    let inner = Staging::begin(&staging.path().join(name), false, kind, &[])?;
    fill(&inner)?;
    Ok(inner.finish()?)
}

/// Makes the head phantom, writes it as a DICOM series into `dir`, and reads that back through the door of every scan.
pub(crate) fn phantom_as_scan(dir: &Path, seed: u64, console: &Console) -> Result<Scan> {
    let made = console.stage("make phantom", || phantom::make(PhantomKind::Head, seed))?;
    fs::create_dir_all(dir)?;
    console.stage("write DICOM", || phantom::write(&made, dir, seed))?;
    Ok(console.stage("read", || monro_scan::read(&dir.join("dicom"), &ReadOptions::default()))?)
}

fn report(prepared: &Prepared, preparing: &[(String, f64)], done: &simulate::Run, out: &Path, console: &Console) {
    let (case, insertion) = (out.join("case"), out.join("insertion"));
    let json = json!({
        "prepare": prepare::summary_json(prepared, &case, preparing),
        "simulate": simulate::summary_json(done, &insertion),
    });
    let text = format!(
        "{}\n{}\n\nOpen {} in a browser, {} in ParaView, and {} in 3D Slicer; \"monro serve {}\" shows it live.\n{NOTICE}",
        prepare::summary_text(prepared, &case, preparing),
        simulate::summary_text(done, &insertion),
        insertion.join("report.html").display(),
        insertion.join("insertion.pvd").display(),
        case.display(),
        case.display()
    );
    console.result(&json, &text);
}
