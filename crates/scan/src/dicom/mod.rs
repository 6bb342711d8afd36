//! DICOM: a folder of files (or one multi-frame file) to a volume, and a volume to a series.
//!
//! Read: CT Image Storage and enhanced CT; implicit and explicit VR, deflated, RLE, JPEG (8 bit, lossless), JPEG 2000; files
//! without preamble.
//! Files may come in any order, under any names, with other series, localizers and other files among them. Refused by
//! name: JPEG-LS, 12-bit lossy JPEG, colour, MONOCHROME1, images of two patients, gaps beyond three steps and 10 mm.

mod acquisitions;
mod attributes;
mod bare;
mod choose;
mod codestream;
mod folder;
mod image;
mod outline;
mod pixels;
mod rle;
pub mod seg;
mod series;
mod strays;
mod unit;
mod write;

pub(crate) use folder::{holds_dicom, is_dicom_file};
pub use write::{SeriesMeta, WriteError, write_series};

use crate::error::ScanError;
use crate::types::{Inspection, Scan};
use crate::{ReadOptions, file, hash, resample, shelf};
use folder::Survey;
use series::Series;
use std::path::Path;

/// Whether a path is to be read by this module: a folder, or a DICOM file.
pub(crate) fn is_dicom(path: &Path) -> bool {
    path.is_dir() || is_dicom_file(path)
}

/// Names are not told: they would stand in reports.
const NAMES_DIFFER: &str = "images under one patient's id carry different names: make sure that all are of one patient";

pub(crate) fn read(path: &Path, options: &ReadOptions) -> Result<Scan, ScanError> {
    let (series, mut warnings) = select(path, options)?;
    series.check_whole()?;
    let (data, notes) = pixels::decode(&series.images)?;
    warnings.extend(notes.warnings());
    let first = &series.images[0].file;
    let stack = series.stack.as_ref().ok_or_else(|| ScanError::EmptyFolder(path.to_path_buf()))?;
    let (volume, resampled) =
        resample::onto_even_grid(stack, data).map_err(|problem| ScanError::file(first, problem))?;
    warnings.extend(file::doubts(&volume));
    Ok(Scan { pseudonym: hash::pseudonym(&volume), source: series.source(), volume, warnings, resampled })
}

/// The series to take, and what should be known about it and the files beside it.
fn select(path: &Path, options: &ReadOptions) -> Result<(Series, Vec<String>), ScanError> {
    let mut survey = survey(path)?;
    if let Some((file, problem)) = survey.broken.drain(..).next() {
        return Err(ScanError::File { file, problem });
    }
    let images = survey.images.clone();
    let (series, reason) = choose::choose(path, &survey, series::sort(images), options)?;
    let mut warnings = survey.skipped();
    warnings.extend(survey.names_differ().then(|| NAMES_DIFFER.to_owned()));
    warnings.extend(reason.map(|reason| format!("series {} was taken: {reason}; --series takes another", series.id)));
    warnings.extend(series.warnings.iter().cloned());
    Ok((series, warnings))
}

/// Looks at all files; refuses a folder without images.
fn survey(path: &Path) -> Result<Survey, ScanError> {
    let survey = Survey::of(path)?;
    if survey.images.is_empty() && survey.broken.is_empty() {
        let (folder, files) = (path.to_path_buf(), survey.files);
        let volumes = shelf::volumes(path);
        return Err(ScanError::NoImages { folder, files, seen: survey.skipped().join("; "), volumes });
    }
    Ok(survey)
}

pub(crate) fn inspect(path: &Path) -> Result<Inspection, ScanError> {
    let mut survey = survey(path)?;
    if survey.images.is_empty()
        && let Some((file, problem)) = survey.broken.pop()
    {
        return Err(ScanError::File { file, problem });
    }
    let mut warnings = survey.skipped();
    for (file, problem) in &survey.broken {
        warnings.push(format!("{}: {problem}", folder::name(file)));
    }
    let patients = survey.patients().len();
    let broken = survey.broken.len();
    warnings.extend(survey.names_differ().then(|| NAMES_DIFFER.to_owned()));
    let series = series::sort(survey.images);
    let (mut chosen, mut reason) = choose::best(&series);
    if patients > 1 {
        (chosen, reason) = (None, format!("images of {patients} patients: choose a series, or separate them"));
    }
    if broken > 0 {
        (chosen, reason) = (None, format!("{broken} damaged DICOM files may belong to any series: remove them first"));
    }
    warnings.extend(chosen.iter().flat_map(|n| series[*n].warnings.iter().cloned()));
    Ok(Inspection { series: series.iter().map(Series::summary).collect(), chosen, reason, warnings })
}
