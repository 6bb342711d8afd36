//! Where a place lies among the cells of a grid.

use monro_geometry::Grid;
use monro_geometry::d3::D3;

/// The cells between the centres of a grid's voxels, found from patient mm.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cells {
    /// Columns of the map from patient mm to voxels, the offset last; the fourth row is there for registers of four.
    columns: [[f64; 4]; 4],
    /// Coordinate of the last centre along each axis.
    last: [f64; 3],
    /// Steps in the data from a voxel to the next along y and z.
    steps: [usize; 2],
}

impl Cells {
    pub(super) fn new(grid: &Grid) -> Self {
        let map = grid.voxel_from_patient();
        let column = |c: usize| map.linear.rows.map(|row| row[c]);
        let [nx, ny, _] = grid.dims();
        Self {
            columns: [column(0), column(1), column(2), map.offset].map(|[x, y, z]| [x, y, z, 0.0]),
            last: grid.dims().map(|n| (n - 1) as f64),
            steps: [nx, nx * ny],
        }
    }

    /// Steps in the data from a voxel to the next along y and z.
    pub(super) const fn steps(&self) -> [usize; 2] {
        self.steps
    }

    /// Voxel coordinates of a place, the fourth number without meaning. Column by column: a place that was just made is read
    /// number by number, as it was written, for a read of two at once would wait until both are in memory.
    #[inline]
    pub(super) fn coordinates(&self, p: D3) -> [f64; 4] {
        let [x, y, z, offset] = &self.columns;
        std::array::from_fn(|a| x[a] * p[0] + y[a] * p[1] + z[a] * p[2] + offset[a])
    }

    /// First index of the cell around a place and the fractions inside; `None` outside of the box.
    #[inline]
    pub(super) fn find(&self, p: D3) -> Option<(usize, D3)> {
        let [x, y, z, _] = self.coordinates(p);
        let v = [x, y, z];
        if !(0..3).all(|a| v[a] >= 0.0 && v[a] < self.last[a]) {
            return None;
        }
        // Conversions to 32 bits take one instruction each.
        let base = v.map(|x| x as i32);
        let [i, j, k] = base.map(|b| b as usize);
        Some((k * self.steps[1] + j * self.steps[0] + i, std::array::from_fn(|a| v[a] - f64::from(base[a]))))
    }

    /// Change per mm of what changes by `slope` from a voxel to the next.
    #[inline]
    pub(super) fn per_mm(&self, slope: D3) -> D3 {
        std::array::from_fn(|a| {
            let column = self.columns[a];
            column[0] * slope[0] + column[1] * slope[1] + column[2] * slope[2]
        })
    }
}
