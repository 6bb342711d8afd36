//! Labels on the grid of a scan.

use super::error::SegmentError;
use core::fmt;
use monro_geometry::{Affine, Grid, Point, Vector, Volume, Voxel};

/// Voxel centres nearer than this to those of the other grid are on them, voxels.
const ON_VOXEL: f64 = 0.05;
/// Labels whose volume covers less of the scan are elsewhere, unless most of what is labelled lies in it, percent.
const LEAST_COVERED: f64 = 20.0;
const MOST_LABELLED: f64 = 50.0;
/// Less than this of what is labelled beyond the scan is not worth a word, percent.
const FEW: f64 = 0.5;

/// Where the voxels of a volume are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Geometry {
    /// Voxels along each index.
    pub dims: [usize; 3],
    /// Distance of neighbours, mm.
    pub spacing_mm: [f64; 3],
    /// Centre of the first voxel, LPS mm.
    pub first_mm: [f64; 3],
    /// Unit directions of i, j and k, LPS.
    pub axes: [[f64; 3]; 3],
}

impl From<&Grid> for Geometry {
    fn from(grid: &Grid) -> Self {
        let spacing_mm = grid.spacing();
        let unit = |a: usize| (step(grid.patient_from_voxel(), a) * (1.0 / spacing_mm[a])).to_array();
        let axes = core::array::from_fn(unit);
        Self { dims: grid.dims(), spacing_mm, first_mm: grid.centre(0, 0, 0).to_array(), axes }
    }
}

impl fmt::Display for Geometry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let row = |v: &[f64; 3], digits: usize| {
            // No "-0.00" for what rounds to nothing.
            let round = |v: f64| {
                format!("{:.digits$}", (v * 10f64.powi(digits as i32)).round() / 10f64.powi(digits as i32) + 0.0)
            };
            v.map(round).join(" ")
        };
        let [i, j, k] = self.axes.each_ref().map(|a| row(a, 3));
        write!(
            f,
            "{:?} voxels of {} mm, first at ({}), axes ({i}) ({j}) ({k})",
            self.dims,
            row(&self.spacing_mm, 3),
            row(&self.first_mm, 2)
        )
    }
}

/// Where one step along an axis leads.
fn step<To, From>(map: &Affine<To, From>, axis: usize) -> Vector<To> {
    map.vector(Vector::from_array(core::array::from_fn(|a| f64::from(a == axis))))
}

fn same(a: &Grid, b: &Grid) -> bool {
    let spacing = a.spacing().iter().copied().fold(f64::INFINITY, f64::min);
    a.dims() == b.dims() && a.corners().iter().zip(b.corners()).all(|(p, q)| p.distance(q) < ON_VOXEL * spacing)
}

/// Whether every voxel of one grid lies on a voxel of the other, however both are stored or cropped.
fn on_voxels(to: &Grid, from: &Grid) -> bool {
    let map: Affine<Voxel, Voxel> = to.voxel_from_patient().after(from.patient_from_voxel());
    let whole = |v: [f64; 3]| v.iter().all(|c| (c - c.round()).abs() < ON_VOXEL);
    let unit = |a: usize| (step(&map, a).norm() - 1.0).abs() < ON_VOXEL;
    let end = |corner: usize| core::array::from_fn(|a| (corner >> a & 1) as f64 * (from.dims()[a] - 1) as f64);
    (0..3).all(unit) && (0..8).all(|c| whole(map.point(Point::from_array(end(c))).to_array()))
}

/// Labels on another grid: resampled with nearest neighbour, with a remark that says so, unless their voxels are the
/// scan's. What lies beyond the scan is told, too.
///
/// # Errors
/// [`SegmentError::LabelsElsewhere`], with both geometries.
pub fn onto_grid(to: &Grid, labels: Volume<u8>) -> Result<(Volume<u8>, Option<String>), SegmentError> {
    let (to, from) = (*to, *labels.grid());
    if same(&to, &from) {
        return Ok((Volume::new(to, labels.into_data())?, None));
    }
    let (scan, given) = (Geometry::from(&to), Geometry::from(&from));
    let (data, covered) = nearest(&to, &labels);
    let labelled = labelled_within(&to, &labels);
    if covered < LEAST_COVERED && labelled < MOST_LABELLED {
        return Err(SegmentError::LabelsElsewhere { covered, labelled, scan: Box::new(scan), labels: Box::new(given) });
    }
    let mut said = Vec::new();
    if !on_voxels(&to, &from) {
        said.push(format!("labels on another grid ({given}; scan: {scan}) were resampled with nearest neighbour"));
    }
    if labelled < 100.0 - FEW {
        said.push(format!("{:.0} % of what is labelled lie beyond the scan and were left out", 100.0 - labelled));
    }
    Ok((Volume::new(to, data)?, (!said.is_empty()).then(|| said.join("; "))))
}

/// Nearest labels at the voxels of a grid, and how much of it they cover, percent.
fn nearest(to: &Grid, labels: &Volume<u8>) -> (Vec<u8>, f64) {
    let mut covered = 0usize;
    let value = |n: usize| {
        let [i, j, k] = to.voxel(n);
        let value = labels.nearest(to.centre(i, j, k));
        covered += usize::from(value.is_some());
        value.unwrap_or(0)
    };
    let data = (0..to.len()).map(value).collect();
    (data, 100.0 * covered as f64 / to.len() as f64)
}

/// How much of what is labelled lies within a grid, percent; all of nothing.
fn labelled_within(to: &Grid, labels: &Volume<u8>) -> f64 {
    let (mut all, mut within) = (0usize, 0usize);
    for n in (0..labels.data().len()).filter(|&n| labels.data()[n] != 0) {
        let [i, j, k] = labels.grid().voxel(n);
        all += 1;
        within += usize::from(to.containing(labels.grid().centre(i, j, k)).is_some());
    }
    if all == 0 { 100.0 } else { 100.0 * within as f64 / all as f64 }
}
