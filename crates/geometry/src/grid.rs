//! A voxel grid placed in the patient frame.

use crate::{Affine, Matrix3, Patient, Point, Vector, Voxel, bounds};
use thiserror::Error;

/// Why a grid was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum GridError {
    /// A dimension is zero or the number of voxels overflows.
    #[error("a grid of {0:?} voxels is empty or too large")]
    Dims([usize; 3]),
    /// The placement is not finite or maps the grid onto a plane.
    #[error("the voxel-to-patient matrix {0:?} is singular or not finite")]
    Placement([[f64; 3]; 3]),
    /// The number of values does not match the dimensions.
    #[error("{found} values for a grid of {expected} voxels")]
    Count {
        /// Voxels in the grid.
        expected: usize,
        /// Values given.
        found: usize,
    },
}

/// Dimensions and placement of a voxel array. Voxel `(i, j, k)` has its *centre* at `patient_from_voxel * (i, j, k)`;
/// `i` varies fastest in memory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    dims: [usize; 3],
    patient_from_voxel: Affine<Patient, Voxel>,
    voxel_from_patient: Affine<Voxel, Patient>,
}

impl Grid {
    /// A grid from its dimensions (columns, rows, slices) and placement (mm, LPS).
    ///
    /// # Errors
    /// Empty or overflowing dimensions; a singular or non-finite placement.
    pub fn new(dims: [usize; 3], patient_from_voxel: Affine<Patient, Voxel>) -> Result<Self, GridError> {
        let count = dims[0].checked_mul(dims[1]).and_then(|n| n.checked_mul(dims[2]));
        if count.is_none_or(|n| n == 0 || n > isize::MAX as usize / 16) {
            return Err(GridError::Dims(dims));
        }
        let rows = patient_from_voxel.linear.rows;
        let finite = rows.iter().flatten().chain(&patient_from_voxel.offset).all(|v| v.is_finite());
        match patient_from_voxel.inverse() {
            Some(voxel_from_patient) if finite => Ok(Self { dims, patient_from_voxel, voxel_from_patient }),
            _ => Err(GridError::Placement(rows)),
        }
    }

    /// An axis-aligned LPS grid with the given spacing and position of the first voxel's centre, both in mm.
    ///
    /// # Errors
    /// As [`Grid::new`].
    pub fn axis_aligned(dims: [usize; 3], spacing: [f64; 3], origin: [f64; 3]) -> Result<Self, GridError> {
        let linear = Matrix3 { rows: [[spacing[0], 0.0, 0.0], [0.0, spacing[1], 0.0], [0.0, 0.0, spacing[2]]] };
        Self::new(dims, Affine::new(linear, origin))
    }

    /// Columns, rows, slices.
    pub const fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// Number of voxels.
    pub const fn len(&self) -> usize {
        self.dims[0] * self.dims[1] * self.dims[2]
    }

    /// Never true: empty grids cannot be made.
    pub const fn is_empty(&self) -> bool {
        false
    }

    /// The placement: voxel index to patient mm.
    pub const fn patient_from_voxel(&self) -> &Affine<Patient, Voxel> {
        &self.patient_from_voxel
    }

    /// The inverse placement: patient mm to continuous voxel index.
    pub const fn voxel_from_patient(&self) -> &Affine<Voxel, Patient> {
        &self.voxel_from_patient
    }

    /// Distance between neighbouring voxel centres along each index axis, mm.
    pub fn spacing(&self) -> [f64; 3] {
        [0, 1, 2].map(|a| Vector::<Patient>::from_array(self.patient_from_voxel.linear.column(a)).norm())
    }

    /// The end of the patient's body that an index axis points to most, forwards or backwards: "superior", "inferior",
    /// "anterior", "posterior", "left" or "right".
    pub fn end(&self, axis: usize, forwards: bool) -> &'static str {
        let along = self.patient_from_voxel.linear.column(axis);
        let most = (0..3).fold(2, |best, a| if along[a].abs() > along[best].abs() { a } else { best });
        match (most, (along[most] > 0.0) == forwards) {
            (0, true) => "left",
            (0, false) => "right",
            (1, true) => "posterior",
            (1, false) => "anterior",
            (_, true) => "superior",
            (_, false) => "inferior",
        }
    }

    /// Volume of one voxel, mm3.
    pub fn voxel_volume(&self) -> f64 {
        self.patient_from_voxel.linear.determinant().abs()
    }

    /// Offset of voxel `(i, j, k)` in a flat array.
    pub const fn index(&self, i: usize, j: usize, k: usize) -> usize {
        (k * self.dims[1] + j) * self.dims[0] + i
    }

    /// The voxel of a flat offset.
    pub const fn voxel(&self, index: usize) -> [usize; 3] {
        [index % self.dims[0], index / self.dims[0] % self.dims[1], index / (self.dims[0] * self.dims[1])]
    }

    /// Patient position of the centre of voxel `(i, j, k)`.
    pub fn centre(&self, i: usize, j: usize, k: usize) -> Point<Patient> {
        self.patient_from_voxel.point(Point::new(i as f64, j as f64, k as f64))
    }

    /// The voxel that contains a patient position; `None` outside the grid.
    pub fn containing(&self, p: Point<Patient>) -> Option<[usize; 3]> {
        let v = self.voxel_from_patient.point(p).to_array();
        let mut out = [0; 3];
        for a in 0..3 {
            let r = v[a].round();
            if !(r >= 0.0 && r < self.dims[a] as f64) {
                return None;
            }
            out[a] = r as usize;
        }
        Some(out)
    }

    /// The eight corners of the grid's box (outer voxel faces), patient mm.
    pub fn corners(&self) -> [Point<Patient>; 8] {
        core::array::from_fn(|c| {
            let at = |a: usize| if c >> a & 1 == 0 { -0.5 } else { self.dims[a] as f64 - 0.5 };
            self.patient_from_voxel.point(Point::new(at(0), at(1), at(2)))
        })
    }

    /// The lowest and highest coordinates of the grid's box (outer voxel faces), patient mm.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        bounds(self.corners().map(Point::to_array)).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn voxel_and_index_are_inverse_and_containing_rounds() {
        let g = Grid::axis_aligned([4, 5, 6], [0.5, 1.0, 2.0], [10.0, 20.0, 30.0]).expect("grid");
        for index in 0..g.len() {
            let [i, j, k] = g.voxel(index);
            assert_eq!(g.index(i, j, k), index);
            assert_eq!(g.containing(g.centre(i, j, k)), Some([i, j, k]));
        }
        assert_eq!(g.containing(Point::new(9.7, 20.0, 30.0)), None);
        assert_eq!(g.spacing(), [0.5, 1.0, 2.0]);
        assert_eq!(g.voxel_volume(), 1.0);
    }

    #[test]
    fn empty_flat_and_non_finite_grids_are_refused() {
        assert!(matches!(Grid::axis_aligned([0, 5, 6], [1.0; 3], [0.0; 3]), Err(GridError::Dims(_))));
        assert!(matches!(Grid::axis_aligned([usize::MAX, 5, 6], [1.0; 3], [0.0; 3]), Err(GridError::Dims(_))));
        assert!(matches!(Grid::axis_aligned([4, 5, 6], [1.0, 0.0, 1.0], [0.0; 3]), Err(GridError::Placement(_))));
        assert!(matches!(Grid::axis_aligned([4, 5, 6], [1.0; 3], [f64::NAN, 0.0, 0.0]), Err(GridError::Placement(_))));
    }
}
