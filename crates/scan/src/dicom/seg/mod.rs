//! DICOM segmentations (Segmentation Storage, PS3.3 A.51): binary, one bit per voxel, one frame per segment and slice.

mod images;
mod read;
mod references;
mod write;

pub use images::Images;
pub(crate) use read::{Stored, read};
pub use write::{SegError, encode, encode_on};
