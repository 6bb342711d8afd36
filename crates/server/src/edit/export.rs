//! Labels in the formats of other programs.

use monro_geometry::Volume;
use monro_scan::nifti;

/// The file's bytes.
///
/// # Errors
/// A format that is not written.
pub(super) fn encode(labels: &Volume<u8>, format: &str) -> Result<Vec<u8>, String> {
    match format {
        "nifti" => Ok(nifti::encode_u8(labels)),
        other => Err(format!("the format {other:?} is not written; known are nifti")),
    }
}
