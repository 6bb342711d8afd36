//! Scans read and written, seen from outside.

mod choosing;
mod common;
mod dicom_round_trip;
mod formats;
mod real_scans;
mod refusals;
mod robustness;
mod segmentation_on_images;
