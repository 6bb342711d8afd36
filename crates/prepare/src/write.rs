//! A case on disk.

use crate::{Observer, PrepareError, Prepared, Stage};
use monro_case::{CaseFiles, Staging};
use monro_scan::nifti;

/// Writes the case with its images into a folder under construction.
///
/// # Errors
/// [`PrepareError::Case`].
pub fn write(prepared: &Prepared, staging: &Staging, observer: &dyn Observer) -> Result<(), PrepareError> {
    observer.begin(Stage::Write);
    let (ct, labels) =
        rayon::join(|| nifti::encode_i16(&prepared.scan.volume), || nifti::encode_u8(&prepared.segmentation.labels));
    let done = prepared.case.write(staging, CaseFiles { ct: Some(ct), labels: Some(labels) });
    observer.end(Stage::Write);
    done?;
    Ok(())
}
