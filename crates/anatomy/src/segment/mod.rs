//! Automatic segmentation of a head CT.
