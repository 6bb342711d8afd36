//! Where a raster's voxels lie in the patient.

use monro_geometry::{Patient, Point};

/// An LPS-aligned isotropic lattice: voxel `(i, j, k)` is centred at `origin + step * (i, j, k)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lattice {
    pub(crate) origin: [f64; 3],
    /// Voxel size, mm.
    pub(crate) step: f64,
}

impl Lattice {
    /// Continuous index of a patient position.
    pub(crate) fn index(&self, p: Point<Patient>) -> [f64; 3] {
        let p = p.to_array();
        core::array::from_fn(|a| (p[a] - self.origin[a]) / self.step)
    }

    /// Patient position of a continuous index.
    pub(crate) fn point(&self, v: [f64; 3]) -> Point<Patient> {
        Point::from_array(core::array::from_fn(|a| self.origin[a] + self.step * v[a]))
    }

    /// The lattice of blocks of `factor` voxels.
    pub(crate) fn coarser(&self, factor: usize) -> Self {
        let shift = (factor as f64 - 1.0) / 2.0 * self.step;
        Self { origin: self.origin.map(|o| o + shift), step: self.step * factor as f64 }
    }

    /// The lattice whose first voxel is `low` of this one.
    pub(crate) fn cropped(&self, low: [usize; 3]) -> Self {
        Self { origin: self.point(low.map(|l| l as f64)).to_array(), step: self.step }
    }
}
