//! `monro phantom`: a digital phantom as a DICOM series, with its truth beside it.

use crate::NOTICE;
use crate::args::{PhantomArgs, PhantomKind};
use crate::console::Console;
use crate::interrupt::Guard;
use anyhow::{Context, Result};
use monro_anatomy::phantom::{self, DrawerOptions, HeadOptions, Phantom};
use monro_case::markups::{self, Kind, NamedPoint};
use monro_case::{OutputKind, Staging, nothing_known};
use monro_scan::dicom::{self, SeriesMeta};
use monro_scan::nifti;
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

/// What the command writes.
pub(crate) const PHANTOM: OutputKind = OutputKind {
    name: "a phantom",
    marks: &["phantom.json"],
    files: &["phantom.json", "labels.nii.gz", "landmarks.mrk.json", "dicom/*.dcm"],
    parts: &[],
    changed: nothing_known,
};

/// Runs the command.
pub(crate) fn run(args: &PhantomArgs, console: &Console) -> Result<()> {
    let staging = Staging::begin(&args.out, args.force, &PHANTOM, &[])?;
    let guard = Guard::new(&staging);
    let made = console.stage("make phantom", || make(args.kind, args.seed))?;
    console.stage("write DICOM", || write(&made, staging.path(), args.seed))?;
    let out = guard.finish(staging)?;
    // A box with a drawer is no head to the segmentation.
    let labels = match args.kind {
        PhantomKind::Head => String::new(),
        PhantomKind::Drawer => format!(" --labels {}", out.join("labels.nii.gz").display()),
    };
    let text = format!(
        "Phantom {} in {}: DICOM in dicom/, true labels in labels.nii.gz, landmarks in landmarks.mrk.json.\nNext: monro prepare {}{labels} --out CASE",
        made.name,
        out.display(),
        out.join("dicom").display()
    );
    console.result(&describe(&made, args.seed, &out), &text);
    Ok(())
}

/// Makes a phantom.
pub(crate) fn make(kind: PhantomKind, seed: u64) -> Result<Phantom> {
    match kind {
        PhantomKind::Head => phantom::head(&HeadOptions { seed, ..HeadOptions::default() }),
        PhantomKind::Drawer => phantom::drawer(&DrawerOptions { seed, ..DrawerOptions::default() }),
    }
    .context("the phantom cannot be made")
}

/// Writes a phantom into an existing folder.
pub(crate) fn write(made: &Phantom, dir: &Path, seed: u64) -> Result<()> {
    let images = dir.join("dicom");
    fs::create_dir_all(&images).with_context(|| format!("cannot make {}", images.display()))?;
    let meta = SeriesMeta { seed, description: made.name.clone(), ..SeriesMeta::default() };
    dicom::write_series(&made.ct, &images, &meta)?;
    let put = |name: &str, bytes: &[u8]| {
        let path = dir.join(name);
        fs::write(&path, bytes).with_context(|| format!("cannot write {}", path.display()))
    };
    put("labels.nii.gz", &nifti::encode_u8(&made.labels))?;
    put("landmarks.mrk.json", markups::encode(Kind::Fiducial, &landmarks(made)).as_bytes())?;
    // Names within its own folder, which may be moved.
    put("phantom.json", format!("{:#}\n", describe(made, seed, Path::new(""))).as_bytes())
}

fn landmarks(made: &Phantom) -> Vec<NamedPoint> {
    let m = &made.landmarks;
    monro_prepare::named_landmarks([
        m.nasion,
        m.midline_110mm,
        m.kocher_left,
        m.kocher_right,
        m.monro_left,
        m.monro_right,
    ])
}

fn describe(made: &Phantom, seed: u64, out: &Path) -> Value {
    let grid = made.ct.grid();
    json!({
        "notice": NOTICE,
        "name": made.name,
        "seed": seed,
        "dims": grid.dims(),
        "spacing_mm": grid.spacing(),
        "outputs": { "dicom": out.join("dicom").display().to_string(), "labels": out.join("labels.nii.gz").display().to_string(), "landmarks": out.join("landmarks.mrk.json").display().to_string() },
    })
}
