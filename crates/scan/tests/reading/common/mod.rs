//! What several tests need.

use dicom_core::value::PrimitiveValue;
use dicom_core::{DataElement, Tag, VR};
use monro_geometry::{Affine, Grid, Matrix3, Volume};
use monro_scan::ReadOptions;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The real scans, or `None` where they are not (then the test says so and passes).
pub(crate) fn data(name: &str) -> Option<PathBuf> {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")).join(name);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: no data ({name})");
    None
}

/// Rotation by `angles` about x, then y, then z.
pub(crate) fn rotation(angles: [f64; 3]) -> Matrix3 {
    let [x, y, z] = angles;
    let about_x = [[1.0, 0.0, 0.0], [0.0, x.cos(), -x.sin()], [0.0, x.sin(), x.cos()]];
    let about_y = [[y.cos(), 0.0, y.sin()], [0.0, 1.0, 0.0], [-y.sin(), 0.0, y.cos()]];
    let about_z = [[z.cos(), -z.sin(), 0.0], [z.sin(), z.cos(), 0.0], [0.0, 0.0, 1.0]];
    let [x, y, z] = [about_x, about_y, about_z].map(|rows| Matrix3 { rows });
    z.times(&y).times(&x)
}

/// A rectangular grid; with `mirrored` it is left-handed.
pub(crate) fn grid(dims: [usize; 3], spacing: [f64; 3], angles: [f64; 3], offset: [f64; 3], mirrored: bool) -> Grid {
    let sign = if mirrored { -1.0 } else { 1.0 };
    let scale = Matrix3 { rows: [[spacing[0], 0.0, 0.0], [0.0, spacing[1], 0.0], [0.0, 0.0, spacing[2] * sign]] };
    Grid::new(dims, Affine::new(rotation(angles).times(&scale), offset)).expect("a regular grid")
}

/// A smooth but nowhere symmetric field of HU, so that any wrong axis, sign or shift shows.
pub(crate) fn field(p: [f64; 3]) -> f64 {
    let [x, y, z] = p;
    40.0 + 3.0 * x - 2.0 * y + 1.5 * z + 200.0 * (x / 23.0).sin() * (y / 31.0).cos() + 100.0 * (z / 19.0).sin()
}

/// The field sampled on a grid.
pub(crate) fn sampled(grid: Grid) -> Volume<i16> {
    let data = (0..grid.len())
        .map(|n| {
            let [i, j, k] = grid.voxel(n);
            field(grid.centre(i, j, k).to_array()).round() as i16
        })
        .collect();
    Volume::new(grid, data).expect("as many values as voxels")
}

/// Largest distance between where two grids of equal dimensions put their corners, mm.
pub(crate) fn corner_distance(a: &Grid, b: &Grid) -> f64 {
    a.corners().iter().zip(b.corners()).map(|(p, q)| p.distance(q)).fold(0.0, f64::max)
}

/// Volumes that are no heads are read, too.
pub(crate) fn any_size() -> ReadOptions {
    ReadOptions { any_size: true, ..ReadOptions::default() }
}

pub(crate) fn folder() -> TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

/// Replaces a text attribute of a file.
pub(crate) fn edit(file: &Path, tag: Tag, vr: VR, value: &str) {
    let mut object = dicom_object::open_file(file).expect("DICOM");
    object.put(DataElement::new(tag, vr, PrimitiveValue::from(value)));
    object.write_to_file(file).expect("written");
}
