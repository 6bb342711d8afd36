//! DICOM segmentations (Segmentation Storage, PS3.3 A.51): binary, one bit per voxel, one frame per segment and slice.

mod read;
mod write;

pub(crate) use read::read;
pub use write::{SegError, encode};
