//! Named refusals. Each says the file, the rule and the numbers, and where there is one, the way out.

use monro_geometry::GridError;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why the bytes of one file were refused.
#[derive(Debug, Error)]
pub enum Problem {
    /// The operating system would not give the bytes.
    #[error("cannot be read: {0}")]
    Unreadable(String),
    /// The content is none of the known formats.
    #[error("is not a CT in a known format ({0}); known are DICOM, NIfTI-1 (.nii, .nii.gz), NRRD and MetaImage")]
    Unrecognised(String),
    /// The content is none of the formats that labels come in.
    #[error("is not a label volume in a known format ({0}); known are NIfTI-1 (.nii, .nii.gz), NRRD and MetaImage")]
    NoLabels(String),
    /// A known format, but a variety of it that is not read.
    #[error("{what} is not supported; {way_out}")]
    Unsupported {
        /// The variety.
        what: String,
        /// What the user can do.
        way_out: &'static str,
    },
    /// A header field is missing, malformed or out of its range.
    #[error("header field {field}: {problem}")]
    Header {
        /// Name of the field in its own format.
        field: &'static str,
        /// What is wrong with it, with its value.
        problem: String,
    },
    /// Fewer bytes of voxels than the header promises.
    #[error("is cut short: the header promises {expected} bytes of voxels, {found} are there; copy it again")]
    Truncated {
        /// Bytes promised.
        expected: u64,
        /// Bytes found.
        found: u64,
    },
    /// A compressed file too short for what it is to hold, however well it is packed.
    #[error(
        "is cut short: the header promises {expected} bytes of voxels, which no {stored} compressed bytes can hold; copy it again"
    )]
    TooShort {
        /// Bytes promised.
        expected: u64,
        /// Bytes of the file.
        stored: u64,
    },
    /// A compressed stream without its end.
    #[error("is cut short: its compressed pixel data end early; copy it again")]
    EndsEarly,
    /// The compressed stream is damaged.
    #[error("its compressed data are damaged: {0}")]
    Corrupt(String),
    /// More voxels than any head CT has.
    #[error("{dims:?} voxels are more than the limit of {limit}; crop or downsample the scan")]
    TooLarge {
        /// Columns, rows, slices as the header says.
        dims: [u64; 3],
        /// The limit, in voxels.
        limit: u64,
    },
    /// The file does not say where left and right are.
    #[error(
        "does not say how its voxels lie in the patient ({0}), so left and right cannot be told apart; write it into the header (NIfTI: a sform or qform with a code of 1 or more; NRRD: space and space directions; MetaImage: TransformMatrix)"
    )]
    NoOrientation(String),
    /// The index axes within a slice are not perpendicular.
    #[error(
        "its columns and rows meet at {degrees:.3} degrees instead of 90; resample it onto a rectangular grid first"
    )]
    Sheared {
        /// The angle between them.
        degrees: f64,
    },
    /// Slices so tilted or so unevenly spaced that an even grid would be mostly made up.
    #[error(
        "its slices lie so unevenly that an even grid needs {dims:?} voxels, more than {limit}; use another series"
    )]
    TooUneven {
        /// Columns, rows, slices of that grid.
        dims: [u64; 3],
        /// The limit, in voxels.
        limit: u64,
    },
    /// Dimensions or placement that make no grid.
    #[error("{0}")]
    Grid(#[from] GridError),
    /// A detached data file outside the folder of its header.
    #[error("its data file {0:?} is not a plain name in the same folder")]
    OutsideFolder(String),
    /// A label that is not a whole number of 0 to 65535.
    #[error(
        "voxel {voxel:?} has the value {value}: labels are whole numbers from 0 to 65535: renumber them, and set what is no label to 0"
    )]
    NotALabel {
        /// The value found.
        value: f64,
        /// Column, row, slice.
        voxel: [usize; 3],
    },
    /// Segments that are all unknown.
    #[error("names no structure of a case; its segments are {found}; known are {known}")]
    NoSegment {
        /// Names in the file.
        found: String,
        /// Names that are known.
        known: String,
    },
    /// No voxel has a finite value.
    #[error("none of its {0} voxels has a finite value")]
    NothingFinite(usize),
}

/// Why a DICOM series cannot be taken.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SeriesProblem {
    /// Another modality.
    #[error("modality {0:?} is not CT")]
    NotCt(String),
    /// A scout view.
    #[error("it is a localizer")]
    Localizer,
    /// Maximum intensity projections, volume renderings and the like.
    #[error("it is a projection or rendering (its ImageType says so), not slices")]
    Projection,
    /// Too few slices for a volume.
    #[error("{images} slices make no volume, at least {needed} are needed")]
    TooFew {
        /// Slices found.
        images: usize,
        /// Slices needed.
        needed: usize,
    },
    /// Not grey values that can be HU.
    #[error("{0} is not supported; export it as MONOCHROME2 grey values")]
    NotGrey(String),
    /// Grey values of another quantity than HU.
    #[error(
        "its values are of RescaleType {0:?}, not HU: a map of a material or of the electron density, as spectral CTs make them; \
         export the conventional images of the scan"
    )]
    NotHu(String),
    /// An encoding that is not read.
    #[error("{0} is not supported; export it uncompressed or as JPEG Lossless")]
    Encoding(String),
    /// An attribute is missing or malformed.
    #[error("{file}: {field} {problem}")]
    Attribute {
        /// Name of the file.
        file: String,
        /// DICOM keyword.
        field: &'static str,
        /// What is wrong.
        problem: String,
    },
    /// Too much of the head is missing.
    #[error(
        "slices {} and {} are {found_mm:.1} mm apart along their normal, expected {expected_mm:.3}; \
         a gap of more than {limit_mm:.1} mm is not filled in{stray}", after + 1, after + 2
    )]
    Gap {
        /// Index of the slice below the gap, from 0.
        after: usize,
        /// Width of the gap, mm.
        found_mm: f64,
        /// Median step, mm.
        expected_mm: f64,
        /// Widest gap that is filled in, mm.
        limit_mm: f64,
        /// What to do where few slices lie beyond it.
        stray: String,
    },
    /// Two different images at one place.
    #[error("{}", conflict(files))]
    Conflict {
        /// Names of the files.
        files: [String; 2],
    },
}

/// What to give instead of a folder with volumes.
fn choice(volumes: &[String]) -> String {
    match volumes {
        [] => String::new(),
        all => format!("; give one of the volumes in it: {}", all.join(", ")),
    }
}

fn counts(images: &[usize]) -> String {
    let one = |(n, count): (usize, &usize)| format!("patient {}: {count}", n + 1);
    images.iter().enumerate().map(one).collect::<Vec<_>>().join(", ")
}

/// Why a scan was refused.
#[derive(Debug, Error)]
pub enum ScanError {
    /// One file is at fault.
    #[error("{}: {problem}", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// What is wrong with it.
        problem: Problem,
    },
    /// A folder with no file in it.
    #[error("{}: the folder holds no file", .0.display())]
    EmptyFolder(PathBuf),
    /// A folder with more than anyone exports for one patient.
    #[error("{}: more than {limit} files or folders nested deeper than {depth}; give the folder of the series", folder.display())]
    FolderTooLarge {
        /// The folder.
        folder: PathBuf,
        /// Most files that are looked at.
        limit: usize,
        /// Deepest nesting that is looked into.
        depth: usize,
    },
    /// Files, but no DICOM image among them.
    #[error("{}: no DICOM image among its {files} files ({seen}){}", folder.display(), choice(volumes))]
    NoImages {
        /// The folder or file.
        folder: PathBuf,
        /// Files looked at.
        files: usize,
        /// What they are, by count and example.
        seen: String,
        /// Volumes of other formats right in the folder.
        volumes: Vec<String>,
    },
    /// Images of more than one patient.
    #[error(
        "{}: images of {} patients in one folder ({}); separate them, or choose a series by its id (`monro inspect` lists them)",
        folder.display(), images.len(), counts(images)
    )]
    SeveralPatients {
        /// The folder.
        folder: PathBuf,
        /// Images of each patient, who are not named.
        images: Vec<usize>,
    },
    /// The wanted series is not there.
    #[error("no series {wanted:?}; there are: {}", known.join(", "))]
    UnknownSeries {
        /// What was asked for.
        wanted: String,
        /// Short ids of the series found.
        known: Vec<String>,
    },
    /// One series, the wanted one or the only one, cannot be taken.
    #[error("series {series}: {problem}")]
    Series {
        /// Its short id.
        series: String,
        /// Why not.
        problem: SeriesProblem,
    },
    /// None of several series can be taken.
    #[error("{}: none of its {} series is a head CT: {}", folder.display(), reasons.len(), reasons.join("; "))]
    NoUsableSeries {
        /// The folder.
        folder: PathBuf,
        /// Each series with the reason.
        reasons: Vec<String>,
    },
    /// Several files of a series end before their pixel data do.
    #[error("{files} files of the series are cut short (the first: {first}); copy them again")]
    CutShort {
        /// How many.
        files: usize,
        /// Name of the first.
        first: String,
    },
    /// The tissue is larger than a body.
    #[error(
        "the tissue in it measures {:.0} x {:.0} x {:.0} mm, more than the {:.0} x {:.0} x {:.0} mm of a whole body: is the \
         spacing of {:.3} x {:.3} x {:.3} mm in the header right? Correct it, or convert the scan again",
        extent_mm[0], extent_mm[1], extent_mm[2], most_mm[0], most_mm[1], most_mm[2],
        spacing_mm[0], spacing_mm[1], spacing_mm[2]
    )]
    TooLarge {
        /// Size of the tissue, largest first, mm.
        extent_mm: [f64; 3],
        /// The most that a body measures, largest first, mm.
        most_mm: [f64; 3],
        /// The spacing of the voxels, mm.
        spacing_mm: [f64; 3],
    },
    /// The volume is too small for a head.
    #[error(
        "not a head: {what} measures {:.0} x {:.0} x {:.0} mm, a head needs at least {:.0} x {:.0} x {:.0} mm; if it shows \
         one, the spacing in the header is wrong",
        extent_mm[0], extent_mm[1], extent_mm[2], needed_mm[0], needed_mm[1], needed_mm[2]
    )]
    NotAHead {
        /// What was measured: the field of view, or the tissue in it.
        what: &'static str,
        /// Its size, largest first, mm.
        extent_mm: [f64; 3],
        /// The least size of a head, largest first, mm.
        needed_mm: [f64; 3],
    },
    /// No cross-section is as large as that of a head.
    #[error(
        "not a head: its largest cross-section has {area_cm2:.0} cm2 of tissue, a head has at least {needed_cm2:.0} cm2; \
         where -1024 was added to values that were HU already, add 1024; values that are no HU (attenuation per cm, 0 to 1) have to be \
         converted: 1000 (mu / mu of water - 1)"
    )]
    ThinSection {
        /// Tissue in the fullest plane across the foot-to-head axis, cm2.
        area_cm2: f64,
        /// The least of a head, cm2.
        needed_cm2: f64,
    },
    /// Soft tissue has the values of bone: 1024 was added to all.
    #[error(
        "{lifted_ml:.0} ml of the scan have values from 1000 to 1110, where a head has at most {most_ml:.0} ml of bone: these \
         look like HU + 1024, as they are stored where the rescale intercept is lost; subtract 1024, or convert the scan again"
    )]
    Lifted {
        /// Volume with such values, ml.
        lifted_ml: f64,
        /// The most that a head has, ml.
        most_ml: f64,
    },
}

impl ScanError {
    /// The same sentence with no more of a file's path than its name, for what is listed under a path that was given.
    pub(crate) fn by_name(&self) -> String {
        match self {
            Self::File { file, problem } => {
                format!("{}: {problem}", file.file_name().unwrap_or_default().to_string_lossy())
            }
            other => other.to_string(),
        }
    }

    /// A problem of one file.
    pub(crate) fn file(file: &Path, problem: Problem) -> Self {
        Self::File { file: file.to_path_buf(), problem }
    }
}

/// Shorthand for a header problem.
pub(crate) fn header(field: &'static str, problem: impl Into<String>) -> Problem {
    Problem::Header { field, problem: problem.into() }
}

/// Shorthand for an unsupported variety.
pub(crate) fn unsupported(what: impl Into<String>, way_out: &'static str) -> Problem {
    Problem::Unsupported { what: what.into(), way_out }
}

/// What to do about two images at one place, by the files that they are in.
fn conflict([one, other]: &[String; 2]) -> String {
    if one == other {
        return format!(
            "two frames of {one} lie at the same position: take each acquisition into a file of its own, and leave copies out"
        );
    }
    format!(
        "{one} and {other} are different images at the same position; move one of them away, and all others of its acquisition"
    )
}
