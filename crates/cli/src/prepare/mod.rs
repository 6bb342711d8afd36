//! `monro prepare`: a head CT becomes a case.

mod figures;
mod model;
mod plan;
mod result;

use crate::args::{PrepareArgs, SideArg};
use crate::console::Console;
use crate::interrupt::Guard;
use anyhow::{Context, Result};
use monro_case::{CaseFiles, Staging, markups};
use monro_geometry::{Patient, Point};
use monro_guidance::Side;
use monro_scan::{ReadOptions, Scan, nifti};
use std::path::{Path, PathBuf};

pub(crate) use model::{Prepared, build, simulated_labels};
pub(crate) use result::{summary_json, summary_text};

/// What to make of a scan.
#[derive(Debug, Clone)]
pub(crate) struct Request {
    /// Wanted number of tetrahedra.
    pub(crate) elements: usize,
    /// Side of the entry; `None`: that of the plan, or right.
    pub(crate) side: Option<Side>,
    /// Label file instead of the automatic segmentation.
    pub(crate) labels: Option<PathBuf>,
    /// Entry and target instead of the automatic plan.
    pub(crate) path: Option<[Point<Patient>; 2]>,
}

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
    let staging = Staging::begin(&args.out, args.force)?;
    let guard = Guard::new(&staging);
    let options = ReadOptions { series_uid: args.series.clone(), ..ReadOptions::default() };
    let scan = console.stage("read", || monro_scan::read(&args.scan, &options))?;
    let path = args.plan.as_deref().map(read_plan).transpose()?;
    let request =
        Request { elements: args.elements, side: args.side.map(Side::from), labels: args.labels.clone(), path };
    let prepared = build(scan, &request, console)?;
    write(&prepared, &staging, console)?;
    let out = staging.finish()?;
    drop(guard);
    let stages = console.stages();
    console.result(&summary_json(&prepared, &out, &stages), &summary_text(&prepared, &out, &stages));
    Ok(())
}

fn read_plan(path: &Path) -> Result<[Point<Patient>; 2]> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read the plan {}", path.display()))?;
    markups::decode_plan(&text).with_context(|| format!("the plan {} is not usable", path.display()))
}

/// Writes the case and its report into a folder under construction.
pub(crate) fn write(prepared: &Prepared, staging: &Staging, console: &Console) -> Result<()> {
    console.stage("write", || -> Result<()> {
        let (ct, labels) = rayon::join(
            || nifti::encode_i16(&prepared.scan.volume),
            || nifti::encode_u8(&prepared.segmentation.labels),
        );
        prepared.case.write(staging, CaseFiles { ct: Some(ct), labels: Some(labels) })?;
        Ok(())
    })?;
    let html = console.stage("report", || figures::report(prepared, &console.stages()));
    staging.write("report.html", html?.as_bytes())?;
    Ok(())
}

/// Reads a scan and says what is worth saying about it.
pub(crate) fn announce(scan: &Scan, console: &Console) {
    for warning in scan.warnings.iter().chain(&scan.resampled) {
        console.warn(warning);
    }
}
