//! Scans that are one file (or a header with its data file beside it).

use crate::error::{Problem, ScanError, unsupported};
use crate::labels::CaseLabels;
use crate::raster::Raster;
use crate::resample::{self, Stack};
use crate::types::{Format, Inspection, Scan, SeriesSummary, Source};
use crate::{hash, metaimage, nifti, nrrd};
use monro_geometry::Volume;
use std::path::Path;

/// Larger files are no head CT; this keeps a wrong path from filling the memory.
const LARGEST_FILE: u64 = 4 << 30;

pub(crate) fn read(path: &Path) -> Result<Scan, ScanError> {
    with_raster(path, |format, raster| {
        let mut warnings = raster.warnings.clone();
        let (volume, notes) = raster.into_hu()?;
        warnings.extend(notes.warnings());
        let source = Source::of_grid(format, volume.grid());
        let stack = Stack::of_grid(volume.grid());
        let (volume, resampled) = straightened(&stack, volume)?;
        warnings.extend(doubts(&volume));
        Ok(Scan { pseudonym: hash::pseudonym(&volume), volume, source, warnings, resampled })
    })
}

/// A volume that is rectangular already keeps its own placement to the last bit.
fn straightened(stack: &Stack, volume: Volume<i16>) -> Result<(Volume<i16>, Option<String>), Problem> {
    stack.check_right_angle()?;
    if stack.even_step().is_some() || stack.origins.len() < 2 {
        return Ok((volume, None));
    }
    resample::onto_even_grid(stack, volume.into_data())
}

/// Values that do not look like HU of a head.
pub(crate) fn doubts(volume: &Volume<i16>) -> Vec<String> {
    let (low, high) = volume.data().iter().fold((i16::MAX, i16::MIN), |(a, b), &v| (a.min(v), b.max(v)));
    let mut out = Vec::new();
    if high < 300 {
        out.push(format!("the highest value is {high} HU: there is no bone, so these may not be HU"));
    }
    if low > -500 {
        out.push(format!("the lowest value is {low} HU: there is no air around the head, so these may not be HU"));
    }
    out
}

pub(crate) fn inspect(path: &Path) -> Result<Inspection, ScanError> {
    with_raster(path, |format, raster| {
        let source = Source::of_grid(format, &raster.layout.grid);
        let stack = Stack::of_grid(&raster.layout.grid);
        let refusal = resample::foresee(&stack).err().map(|problem| problem.to_string());
        let step = source.native_spacing_mm[2] * source.tilt_deg.to_radians().cos();
        let images = source.native_dims[2];
        Ok(Inspection {
            chosen: refusal.is_none().then_some(0),
            reason: refusal.clone().unwrap_or_else(|| format!("the one volume of a {} file", format.name())),
            series: vec![SeriesSummary { source, images, step_mm: [step, step], refusal }],
            warnings: raster.warnings,
        })
    })
}

/// Labels with what is to be said of the file's header.
pub(crate) fn read_labels(path: &Path) -> Result<CaseLabels, ScanError> {
    let labels = |mut raster: Raster<'_>| {
        let warnings = core::mem::take(&mut raster.warnings);
        Ok(CaseLabels { volume: raster.into_labels()?, warnings, drawn_on: None })
    };
    with_raster(path, |_, raster| labels(raster)).map_err(|e| match e {
        // Worded for a CT, which nobody said it was.
        ScanError::File { file, problem: Problem::Unrecognised(what) } => {
            ScanError::File { file, problem: Problem::NoLabels(what) }
        }
        other => other,
    })
}

/// Opens a file, finds its format by its content, and hands over the parsed header with the voxels' stream.
fn with_raster<T>(path: &Path, then: impl FnOnce(Format, Raster<'_>) -> Result<T, Problem>) -> Result<T, ScanError> {
    let at = |problem| ScanError::file(path, problem);
    let bytes = bytes(path)?;
    match format_of(path, &bytes).map_err(at)? {
        Format::Nrrd => {
            let header = nrrd::decode_header(&bytes).map_err(at)?;
            let data = detached(path, header.data_file.as_deref())?;
            let raster = header.with_data(data.as_deref().unwrap_or(&bytes));
            raster.and_then(|r| then(Format::Nrrd, r)).map_err(at)
        }
        Format::MetaImage => {
            let header = metaimage::decode_header(&bytes).map_err(at)?;
            let data = detached(path, header.data_file.as_deref())?;
            let raster = header.with_data(data.as_deref().unwrap_or(&bytes));
            raster.and_then(|r| then(Format::MetaImage, r)).map_err(at)
        }
        format => nifti::decode(&bytes).and_then(|r| then(format, r)).map_err(at),
    }
}

/// The format, by content; the name only helps to word a refusal.
fn format_of(path: &Path, bytes: &[u8]) -> Result<Format, Problem> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    if nrrd::looks_like(bytes) {
        Ok(Format::Nrrd)
    } else if bytes.starts_with(&[0x1f, 0x8b]) || nifti::looks_like(bytes) {
        Ok(Format::Nifti)
    } else if metaimage::looks_like(bytes) {
        Ok(Format::MetaImage)
    } else if bytes.is_empty() {
        Err(Problem::Unrecognised("it is empty".into()))
    } else if name.ends_with(".img") || name.ends_with(".img.gz") {
        let convert = "convert it to a single NIfTI-1 .nii or .nii.gz file";
        Err(unsupported("an image whose header is a second file (.hdr/.img)", convert))
    } else if name.ends_with(".nii") || name.ends_with(".hdr") {
        nifti::decode(bytes).map(|_| Format::Nifti)
    } else {
        let shown: Vec<String> = bytes.iter().take(8).map(|b| format!("{b:02x}")).collect();
        Err(Problem::Unrecognised(format!("{} bytes that begin with {}", bytes.len(), shown.join(" "))))
    }
}

/// The data file beside a header.
fn detached(header: &Path, name: Option<&str>) -> Result<Option<Vec<u8>>, ScanError> {
    name.map(|name| bytes(&header.with_file_name(name))).transpose()
}

/// The content of a file of reasonable size.
fn bytes(path: &Path) -> Result<Vec<u8>, ScanError> {
    let unreadable = |e: std::io::Error| ScanError::file(path, Problem::Unreadable(e.to_string()));
    let meta = std::fs::metadata(path).map_err(unreadable)?;
    if !meta.is_file() {
        return Err(ScanError::file(path, Problem::Unreadable("it is not a plain file".into())));
    }
    if meta.len() > LARGEST_FILE {
        let what = format!("a file of {} bytes (the limit is {LARGEST_FILE})", meta.len());
        return Err(ScanError::file(path, unsupported(what, "crop or downsample the scan")));
    }
    std::fs::read(path).map_err(unreadable)
}
