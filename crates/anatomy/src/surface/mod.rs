//! Closed surfaces from voxel fields.
