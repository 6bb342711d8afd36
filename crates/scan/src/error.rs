//! Named refusals. Each says the file, the rule and the numbers, and where there is one, the way out.

use monro_geometry::GridError;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why the bytes of one file were refused.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Problem {
    /// The operating system would not give the bytes.
    #[error("cannot be read: {0}")]
    Unreadable(String),
    /// The content is none of the known formats.
    #[error("is not a CT in a known format ({0}); known are DICOM, NIfTI-1 (.nii, .nii.gz), NRRD and MetaImage")]
    Unrecognised(String),
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
    #[error("is truncated: the header promises {expected} bytes of voxels, {found} are there")]
    Truncated {
        /// Bytes promised.
        expected: u64,
        /// Bytes found.
        found: u64,
    },
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
    #[error("does not say how its voxels lie in the patient ({0}), so left and right cannot be told apart")]
    NoOrientation(String),
    /// The index axes within a slice are not perpendicular.
    #[error(
        "its columns and rows meet at {degrees:.3} degrees instead of 90; resample it onto a rectangular grid first"
    )]
    Sheared {
        /// The angle between them.
        degrees: f64,
    },
    /// Dimensions or placement that make no grid.
    #[error("{0}")]
    Grid(#[from] GridError),
    /// A detached data file outside the folder of its header.
    #[error("its data file {0:?} is not a plain name in the same folder")]
    OutsideFolder(String),
    /// A label that is not a whole number of 0 to 65535.
    #[error("voxel {voxel:?} has the value {value}: labels are whole numbers from 0 to 65535")]
    NotALabel {
        /// The value found.
        value: f64,
        /// Column, row, slice.
        voxel: [usize; 3],
    },
    /// No voxel has a finite value.
    #[error("none of its {0} voxels has a finite value")]
    NothingFinite(usize),
}

/// Why a scan was refused.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ScanError {
    /// One file is at fault.
    #[error("{}: {problem}", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// What is wrong with it.
        problem: Problem,
    },
    /// The volume is too small for a head.
    #[error(
        "not a head: {what} measures {:.0} x {:.0} x {:.0} mm, a head needs at least {:.0} x {:.0} x {:.0} mm",
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
        "not a head: its largest cross-section has {area_cm2:.0} cm2 of tissue, a head has at least {needed_cm2:.0} cm2"
    )]
    ThinSection {
        /// Tissue in the fullest plane across the foot-to-head axis, cm2.
        area_cm2: f64,
        /// The least of a head, cm2.
        needed_cm2: f64,
    },
}

impl ScanError {
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
