//! Strokes of a ball or a disc in millimetres, on grids of any spacing and orientation.

use super::{EditError, Selection, check_positive_mm};
use crate::livewire::Axis;
use monro_geometry::{Grid, Patient, Point};

/// A stroke: the voxels within `radius_mm` of the line through the positions, without gaps however fast the mouse was.
/// With `flat` it stays on the slice nearest to the first position, and the positions are projected onto it. Empty beside
/// the volume.
///
/// # Errors
/// No position, one that is not finite, or a radius that is not positive.
pub fn stroke(
    grid: &Grid,
    positions: &[Point<Patient>],
    radius_mm: f64,
    flat: Option<Axis>,
) -> Result<Selection, EditError> {
    check_positive_mm("radius", radius_mm)?;
    let first = positions.first().ok_or(EditError::Empty { what: "the stroke", verb: "paint" })?;
    for p in positions.iter().flat_map(|p| p.to_array()) {
        super::check("a brush position", p, p.is_finite(), "finite")?;
    }
    let slice = flat.map(|axis| (axis, grid.voxel_from_patient().point(*first).to_array()[axis.number()].round()));
    let onto_slice = |p: &Point<Patient>| {
        let Some((axis, index)) = slice else { return *p };
        let mut voxel = grid.voxel_from_patient().point(*p).to_array();
        voxel[axis.number()] = index;
        grid.patient_from_voxel().point(Point::from_array(voxel))
    };
    let line: Vec<_> = positions.iter().map(onto_slice).collect();
    let mut out = piece(grid, line[0], line[0], radius_mm, slice);
    for ends in line.windows(2) {
        out = out.union(&piece(grid, ends[0], ends[1], radius_mm, slice))?;
    }
    Ok(out)
}

/// Voxels near one straight piece, by testing the box around it.
fn piece(grid: &Grid, from: Point<Patient>, to: Point<Patient>, radius: f64, slice: Option<(Axis, f64)>) -> Selection {
    let mut out = Selection::empty(*grid);
    let Some([low, high]) = box_around(grid, [from, to], radius, slice) else { return out };
    let along = to - from;
    let square = along.dot(along);
    for k in low[2]..=high[2] {
        for j in low[1]..=high[1] {
            for i in low[0]..=high[0] {
                let offset = grid.centre(i, j, k) - from;
                let t = if square > 0.0 { (offset.dot(along) / square).clamp(0.0, 1.0) } else { 0.0 };
                if (offset - along * t).norm() <= radius {
                    let n = grid.index(i, j, k);
                    out.push(n, n + 1);
                }
            }
        }
    }
    out
}

/// First and last voxel that can be within `radius` of two points; `None` if that is beside the grid.
fn box_around(
    grid: &Grid,
    ends: [Point<Patient>; 2],
    radius: f64,
    slice: Option<(Axis, f64)>,
) -> Option<[[usize; 3]; 2]> {
    let ends = ends.map(|p| grid.voxel_from_patient().point(p).to_array());
    let rows = grid.voxel_from_patient().linear.rows;
    let (mut first, mut last) = ([0; 3], [0; 3]);
    for a in 0..3 {
        // A step of one mm changes index `a` by at most the length of that row of the inverse placement.
        let margin = radius * rows[a].iter().map(|v| v * v).sum::<f64>().sqrt();
        let mut low = (ends[0][a].min(ends[1][a]) - margin).ceil();
        let mut high = (ends[0][a].max(ends[1][a]) + margin).floor();
        if let Some((_, index)) = slice.filter(|s| s.0.number() == a) {
            (low, high) = (index, index);
        }
        let end = grid.dims()[a] as f64 - 1.0;
        if !(low <= end && high >= 0.0 && low <= high) {
            return None;
        }
        (first[a], last[a]) = (low.max(0.0) as usize, high.min(end) as usize);
    }
    Some([first, last])
}
