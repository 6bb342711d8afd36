//! Bytes of a head CT (DICOM, NIfTI, NRRD, MetaImage) to one volume in HU in the patient frame, or a named refusal.
//!
//! This is the one door through which every scan enters, and the only place that knows these formats. Behind it there is
//! a [`Scan`]: 16-bit HU on an even, rectangular grid placed in the patient frame (LPS, mm), a pseudonym that is not
//! made of the patient's name, and sentences about everything that was changed or looks odd. A grid that is even and
//! rectangular already is kept voxel by voxel, whatever its orientation; only uneven or tilted stacks are resampled.
//!
//! What a header says is bounded before anything is allocated. Refusals name the file, the rule and the numbers.
//!
//! Limits: CT only; one volume of at most 2^29 voxels; JPEG-LS and 12-bit lossy JPEG are refused by name.
//! Non-goals: de-identification of files, registration, contrast or motion detection.

mod check;
mod error;
mod file;
mod filled;
mod flat;
mod hash;
mod hu;
mod padding;
mod planes;
mod raster;
mod resample;
mod shelf;
mod text;
mod types;

pub mod dicom;
pub mod labels;
pub mod metaimage;
pub mod nifti;
pub mod nrrd;

pub use check::head_extent_check;
pub use error::{Problem, ScanError, SeriesProblem};
pub use hu::HuNotes;
pub use raster::{Element, Endian, Layout, Raster};
pub use shelf::scans_in;
pub use types::{Format, Inspection, ReadOptions, Scan, SeriesSummary, Source};

use monro_geometry::Volume;
use std::path::{Path, PathBuf};

/// Reads a head CT: a folder of DICOM files, or one DICOM, NIfTI, NRRD or MetaImage file, or a folder with just one of
/// these and no DICOM.
///
/// # Errors
/// Any [`ScanError`]: see there for the rules.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Scan, ScanError> {
    let mut scan = match dicom::is_dicom(path).then(|| dicom::read(path, options)) {
        None => file::read(path)?,
        Some(found) => found.or_else(|why| only_volume(path, why).and_then(|file| file::read(&file)))?,
    };
    if !options.any_size {
        scan.warnings.extend(filled::emptied(&mut scan.volume));
        scan.warnings.extend(planes::told(&scan.volume));
        let profiles = check::profiles(&scan.volume);
        check::extent_check(&scan.volume, &profiles)?;
        check::intercept_check(&scan.volume)?;
        let (volume, said) = padding::cut_off(scan.volume, &profiles);
        scan.volume = volume;
        scan.warnings.extend(said);
        scan.warnings.extend(flat::finding(&scan.volume));
    }
    Ok(scan)
}

/// Says what a scan is, all series of a folder, and which one [`read`] would take and why. That one is read, so that all
/// that reading remarks on or refuses is told beforehand.
///
/// # Errors
/// When nothing can be listed: an unreadable path, an unknown format, a damaged header.
pub fn inspect(path: &Path) -> Result<Inspection, ScanError> {
    let mut found = match dicom::is_dicom(path).then(|| dicom::inspect(path)) {
        None => file::inspect(path),
        Some(found) => found.or_else(|why| only_volume(path, why).and_then(|file| file::inspect(&file))),
    }?;
    let said = foretold(path, &found);
    found.warnings.extend(said);
    Ok(found)
}

/// What [`read`] will say of the series that it will take and the listing does not yet.
fn foretold(path: &Path, found: &Inspection) -> Vec<String> {
    let Some(chosen) = found.chosen.and_then(|n| found.series.get(n)) else { return Vec::new() };
    let id = &chosen.source.series;
    let options = ReadOptions { series_uid: (!id.is_empty()).then(|| id.clone()), any_size: false };
    let mut said = match read(path, &options) {
        Ok(scan) => scan.warnings.into_iter().chain(scan.resampled.map(|s| format!("will be {s}"))).collect(),
        Err(error) => vec![format!("will be refused: {}", error.by_name())],
    };
    said.retain(|sentence| !found.warnings.contains(sentence));
    said
}

/// The one volume of another format in a folder that was refused for want of DICOM images.
fn only_volume(folder: &Path, why: ScanError) -> Result<PathBuf, ScanError> {
    match &why {
        ScanError::NoImages { volumes, .. } if volumes.len() == 1 => Ok(folder.join(&volumes[0])),
        _ => Err(why),
    }
}

/// Reads a label volume (NIfTI, NRRD or MetaImage): whole numbers from 0 to 65535 of any stored type.
///
/// # Errors
/// A value that is no label, with its voxel; any [`ScanError`] of the file.
pub fn read_labels(path: &Path) -> Result<Volume<u16>, ScanError> {
    Ok(file::read_labels(path)?.volume)
}

/// As [`read_labels`], with what is doubtful in the file's header: no unit, two frames that disagree.
///
/// # Errors
/// As [`read_labels`].
pub fn read_labels_with_warnings(path: &Path) -> Result<labels::CaseLabels, ScanError> {
    file::read_labels(path)
}
