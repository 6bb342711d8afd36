//! `monro prepare`: a head CT becomes a case.

mod figures;
mod result;

use crate::args::{PrepareArgs, SideArg};
use crate::console::Console;
use crate::inspect::not_a_case;
use crate::interrupt::Guard;
use anyhow::{Context, Result};
use monro_case::{CASE, Staging, markups};
use monro_geometry::{Patient, Point};
use monro_guidance::Side;
use monro_prepare::{Labels, PrepareError, Prepared, Request};
use monro_scan::ReadOptions;
use std::iter;
use std::path::{Path, PathBuf};

pub(crate) use figures::report;
pub(crate) use result::{summary_json, summary_text};

impl From<SideArg> for Side {
    fn from(side: SideArg) -> Self {
        match side {
            SideArg::Left => Self::Left,
            SideArg::Right => Self::Right,
        }
    }
}

/// Runs the command.
pub(crate) fn run(args: &PrepareArgs, console: &Console) -> Result<()> {
    // Begun first, so that an occupied folder is refused before any work is done.
    let files = [&args.labels, &args.plan].into_iter().flatten().map(PathBuf::as_path);
    let inputs: Vec<&Path> = iter::once(args.scan.as_path()).chain(files).collect();
    let staging = Staging::begin(&args.out, args.force, &CASE, &inputs)?;
    let guard = Guard::new(&staging);
    not_a_case(&args.scan)?;
    let options = ReadOptions { series_uid: args.series.clone(), ..ReadOptions::default() };
    let mut scan = console.stage("read", || monro_scan::read(&args.scan, &options))?;
    let path = args.plan.as_deref().map(read_plan).transpose()?;
    let labels = args.labels.as_deref().map(monro_scan::labels::read).transpose()?;
    scan.warnings.extend(labels.iter().flat_map(|l| l.warnings.iter().cloned()));
    scan.warnings.extend(labels.iter().filter_map(|l| l.drawn_on.as_ref()?.unlike(&scan.source)));
    let labels = labels.map_or(Labels::Automatic, |l| Labels::Given(l.volume));
    let request = Request { elements: args.elements, side: args.side.map(Side::from), labels, path };
    let prepared = monro_prepare::build(scan, &request, console);
    let prepared = prepared.map_err(|e| named(e, args.labels.as_deref()))?;
    write(&prepared, &staging, console)?;
    let out = guard.finish(staging)?;
    let stages = console.stages();
    console.result(&summary_json(&prepared, &out, &stages), &summary_text(&prepared, &out, &stages));
    Ok(())
}

fn read_plan(path: &Path) -> Result<[Point<Patient>; 2]> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read the plan {}", path.display()))?;
    markups::decode_plan(&text).with_context(|| format!("the plan {} is not usable", path.display()))
}

/// Faults of given labels name their file.
fn named(error: PrepareError, labels: Option<&Path>) -> anyhow::Error {
    match (&error, labels) {
        (PrepareError::Labels(_) | PrepareError::UnknownLabel(_), Some(file)) => {
            anyhow::Error::new(error).context(file.display().to_string())
        }
        _ => error.into(),
    }
}

/// Writes the case and its report into a folder under construction.
pub(crate) fn write(prepared: &Prepared, staging: &Staging, console: &Console) -> Result<()> {
    monro_prepare::write(prepared, staging, console)?;
    let html = console.stage("report", || report(prepared, &console.stages()));
    staging.write("report.html", html?.as_bytes())?;
    Ok(())
}
