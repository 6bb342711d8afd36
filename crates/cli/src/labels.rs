//! `monro labels`: labels from and for other programs.

use crate::args::LabelsCommand;
use crate::console::Console;
use crate::output_file;
use anyhow::{Context, Result, bail, ensure};
use monro_anatomy::segment;
use monro_geometry::{Structure, Volume};
use monro_scan::ReadOptions;
use monro_scan::dicom::seg;
use monro_scan::labels::DrawnOn;
use serde_json::{Value, json};
use std::path::Path;

/// Runs one of the commands.
pub(crate) fn run(command: &LabelsCommand, console: &Console) -> Result<()> {
    let LabelsCommand::Convert { from, out, like, images, series, force } = command;
    let inputs: Vec<&Path> =
        [Some(from), like.as_ref(), images.as_ref()].into_iter().flatten().map(|p| p.as_path()).collect();
    output_file::check(out, *force, &inputs)?;
    let format = format_of(out)?;
    if images.is_some() && format != "dicom" {
        bail!("{}: only a DICOM segmentation (.dcm) refers to images; leave --images away", out.display());
    }
    let (labels, drawn_on) = console.stage("read", || read(from, like.as_deref(), console))?;
    let bytes = console.stage("encode", || match images {
        Some(images) => on_images(&labels, drawn_on.as_ref(), (images, series.clone()), console),
        None => Ok(monro_server::edit::export(&labels, format)?),
    })?;
    output_file::write(out, &bytes)?;
    let volumes = volumes(&labels);
    let text = format!("{}: {} structures", out.display(), volumes.as_object().map_or(0, serde_json::Map::len));
    console.result(&json!({ "out": out.display().to_string(), "format": format, "volumes_ml": volumes }), &text);
    Ok(())
}

/// A DICOM segmentation that refers to the images of a folder.
fn on_images(
    labels: &Volume<u8>,
    drawn_on: Option<&DrawnOn>,
    (folder, series_uid): (&Path, Option<String>),
    console: &Console,
) -> Result<Vec<u8>> {
    ensure!(folder.is_dir(), "--images {}: wanted the folder of the DICOM images", folder.display());
    let images = seg::Images::of(folder, &ReadOptions { series_uid, any_size: true })?;
    ensure!(
        !drawn_on.is_some_and(|d| images.is_another_patient(d)),
        "the labels were drawn on images of another patient than those of {} (another PatientID), whose name they would get. If they \
         are the same person's, convert them to .nii.gz first, which names nobody",
        folder.display()
    );
    let (bytes, remark) = seg::encode_on(labels, &images)?;
    remark.iter().for_each(|r| console.warn(r));
    Ok(bytes)
}

/// The format that a name asks for.
fn format_of(out: &Path) -> Result<&'static str> {
    let name = out.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let known = [(".nii.gz", "nifti"), (".seg.nrrd", "seg.nrrd"), (".dcm", "dicom")];
    let found = known.iter().find(|(end, _)| name.ends_with(end)).map(|(_, format)| *format);
    found.with_context(|| format!("{}: give it a name that ends in .nii.gz, .seg.nrrd or .dcm", out.display()))
}

/// Labels of any file and what they were drawn on; with a scan, on its grid.
fn read(from: &Path, like: Option<&Path>, console: &Console) -> Result<(Volume<u8>, Option<DrawnOn>)> {
    let found = monro_scan::labels::read(from)?;
    found.warnings.iter().for_each(|w| console.warn(w));
    if let Some(bad) = found.volume.data().iter().find(|l| **l > 7) {
        bail!("{}: label {bad} is unknown; known are 0 (outside) to 7 (third ventricle)", from.display());
    }
    let labels = found.volume.map(|l| u8::try_from(l).unwrap_or(0));
    let Some(like) = like else { return Ok((labels, found.drawn_on)) };
    let scan = monro_scan::read(like, &ReadOptions { any_size: true, ..ReadOptions::default() })?;
    let (labels, remark) = segment::onto_grid(scan.volume.grid(), labels)?;
    let other = found.drawn_on.as_ref().and_then(|d| d.unlike(&scan.source));
    let fit = remark.into_iter().chain(segment::outside_head(&scan.volume, &labels));
    fit.chain(other).for_each(|r| console.warn(&r));
    Ok((labels, found.drawn_on))
}

fn volumes(labels: &Volume<u8>) -> Value {
    let ml = labels.grid().voxel_volume() / 1000.0;
    let of = |s: Structure| {
        let count = labels.data().iter().filter(|l| **l == s.label()).count();
        (count > 0).then(|| (s.name().to_owned(), json!(count as f64 * ml)))
    };
    Value::Object(Structure::ALL.into_iter().skip(1).filter_map(of).collect())
}
