//! Labels in the formats of other programs.

use monro_geometry::Volume;
use monro_scan::dicom::seg;
use monro_scan::{labels as formats, nifti};
use thiserror::Error;

/// Why labels were not encoded.
#[derive(Debug, Error)]
pub enum ExportError {
    /// A format that is not written.
    #[error("the format {0:?} is not written; known are nifti, seg.nrrd and dicom")]
    Unknown(String),
    /// The labels are no DICOM segmentation.
    #[error(transparent)]
    Dicom(#[from] seg::SegError),
}

/// A label file's bytes: `nifti` (`.nii.gz`), `seg.nrrd` (3D Slicer), `dicom` (DICOM-SEG).
///
/// # Errors
/// A format that is not written; labels that DICOM cannot hold.
pub fn export(labels: &Volume<u8>, format: &str) -> Result<Vec<u8>, ExportError> {
    match format {
        "nifti" => Ok(nifti::encode_u8(labels)),
        "seg.nrrd" => Ok(formats::encode_seg_nrrd(labels)),
        "dicom" => Ok(seg::encode(labels, "anonymous")?),
        other => Err(ExportError::Unknown(other.to_owned())),
    }
}
