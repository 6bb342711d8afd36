//! How the three slice directions are shown: as radiologists expect them, whatever the order of the voxels.

use crate::livewire::Axis;
use monro_geometry::Grid;

/// A direction of slices on the screen. The image has the columns and rows of [`Axis::in_plane`]; `transpose` exchanges
/// them first, then the flips mirror left-right and top-bottom. The patient's right is then on the left of axial and
/// coronal views, the nose on the left of sagittal ones, and up is the head or the nose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// "axial", "coronal" or "sagittal".
    pub name: &'static str,
    /// The index that is constant on a slice.
    pub axis: Axis,
    /// Number of slices.
    pub slices: usize,
    /// Columns and rows of a slice, before the transposition.
    pub size: [usize; 2],
    /// Distance between columns and between rows, mm.
    pub spacing: [f64; 2],
    /// Columns run down the screen, rows across.
    pub transpose: bool,
    /// Mirrored left-right and top-bottom, after the transposition.
    pub flip: [bool; 2],
    /// Whether the slice's number grows towards the patient's left, back or head.
    pub ascending: bool,
}

/// Patient axes (x left, y back, z up) across and down the screen, and whether they then run towards + on the screen.
const SCREEN: [(&str, [usize; 2], [bool; 2]); 3] =
    [("sagittal", [1, 2], [true, false]), ("coronal", [0, 2], [true, false]), ("axial", [0, 1], [true, true])];

/// Axial, coronal and sagittal view of a grid: each the slice direction nearest to it.
pub fn views(grid: &Grid) -> [View; 3] {
    let index_of = nearest_indices(grid);
    let linear = grid.patient_from_voxel().linear;
    let grows = |patient: usize| linear.rows[patient][index_of[patient]] > 0.0;
    let view = |constant: usize| {
        let (name, [across, down], [right, below]) = SCREEN[constant];
        let axis = Axis::ALL[index_of[constant]];
        let [c, r] = axis.in_plane();
        View {
            name,
            axis,
            slices: grid.dims()[index_of[constant]],
            size: [grid.dims()[c], grid.dims()[r]],
            spacing: [grid.spacing()[c], grid.spacing()[r]],
            transpose: c != index_of[across],
            flip: [grows(across) != right, grows(down) != below],
            ascending: grows(constant),
        }
    };
    [view(2), view(1), view(0)]
}

/// For each patient axis the index axis that runs along it most, each index once.
fn nearest_indices(grid: &Grid) -> [usize; 3] {
    const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let linear = grid.patient_from_voxel().linear;
    let along = |o: &[usize; 3]| (0..3).map(|p| linear.rows[p][o[p]].abs() / grid.spacing()[o[p]]).sum::<f64>();
    ORDERS.into_iter().max_by(|a, b| along(a).total_cmp(&along(b))).unwrap_or([0, 1, 2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::{Affine, Grid, Matrix3};

    #[test]
    fn a_standard_head_ct_is_shown_as_stored_but_upright() {
        let grid = Grid::axis_aligned([512, 500, 91], [0.4, 0.5, 2.0], [0.0; 3]).expect("grid");
        let [axial, coronal, sagittal] = views(&grid);
        assert_eq!((axial.axis, axial.slices, axial.transpose, axial.flip), (Axis::K, 91, false, [false, false]));
        assert_eq!((coronal.axis, coronal.size, coronal.flip), (Axis::J, [512, 91], [false, true]));
        assert_eq!((sagittal.axis, sagittal.size, sagittal.flip), (Axis::I, [500, 91], [false, true]));
        assert_eq!(sagittal.spacing, [0.5, 2.0]);
    }

    #[test]
    fn any_order_of_axes_shows_the_right_on_the_left_and_the_nose_up() {
        // First index up, second towards the right, third to the front.
        let linear = Matrix3 { rows: [[0.0, -0.5, 0.0], [0.0, 0.0, -0.7], [2.0, 0.0, 0.0]] };
        let grid = Grid::new([30, 40, 50], Affine::new(linear, [1.0, 2.0, 3.0])).expect("grid");
        let [axial, coronal, sagittal] = views(&grid);
        // Axial: columns are j (towards the right: mirrored), rows k (to the front: mirrored).
        assert_eq!((axial.axis, axial.transpose, axial.flip, axial.ascending), (Axis::I, false, [true, true], true));
        // Coronal: columns are i (up), rows j: exchanged, then j mirrored across, i mirrored so that up is up.
        assert_eq!(
            (coronal.axis, coronal.transpose, coronal.flip, coronal.ascending),
            (Axis::K, true, [true, true], false)
        );
        assert_eq!((sagittal.axis, sagittal.transpose, sagittal.flip), (Axis::J, true, [true, true]));
    }
}
