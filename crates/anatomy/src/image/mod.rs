//! Image processing on plain rasters: filters, distances, morphology, components, watershed.
//!
//! All lengths are in voxels of the raster; callers convert from mm. Every routine gives the same bits on any number
//! of threads: parallel parts write disjoint slices and reduce nothing.

mod components;
mod distance;
mod eikonal;
mod gaussian;
mod morphology;
mod raster;
mod watershed;

pub(crate) use components::{fill_holes, label, largest};
pub(crate) use distance::{distance_to, distance_to_false};
pub(crate) use eikonal::signed_distance;
pub(crate) use gaussian::{gaussian, gaussian_along};
pub(crate) use morphology::{close, dilate, erode, open};
pub(crate) use raster::{Mask, Raster};
pub(crate) use watershed::watershed;
