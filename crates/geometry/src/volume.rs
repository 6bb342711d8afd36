//! Voxel values on a grid.

use crate::{Grid, GridError, Patient, Point};

/// One value per voxel of a [`Grid`]; `i` varies fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct Volume<T> {
    grid: Grid,
    data: Vec<T>,
}

impl<T: Copy> Volume<T> {
    /// From a grid and its values.
    ///
    /// # Errors
    /// When the number of values is not that of the grid.
    pub fn new(grid: Grid, data: Vec<T>) -> Result<Self, GridError> {
        if data.len() != grid.len() {
            return Err(GridError::Count { expected: grid.len(), found: data.len() });
        }
        Ok(Self { grid, data })
    }

    /// A volume of one value everywhere.
    pub fn filled(grid: Grid, value: T) -> Self {
        Self { data: vec![value; grid.len()], grid }
    }

    /// The grid.
    pub const fn grid(&self) -> &Grid {
        &self.grid
    }

    /// All values, `i` fastest.
    pub fn data(&self) -> &[T] {
        &self.data
    }

    /// All values, to be changed.
    pub fn data_mut(&mut self) -> &mut [T] {
        &mut self.data
    }

    /// The values alone.
    pub fn into_data(self) -> Vec<T> {
        self.data
    }

    /// The value of voxel `(i, j, k)`; panics outside, as an array does.
    pub fn at(&self, i: usize, j: usize, k: usize) -> T {
        self.data[self.grid.index(i, j, k)]
    }

    /// The same grid with each value mapped.
    pub fn map<U: Copy>(&self, f: impl FnMut(T) -> U) -> Volume<U> {
        Volume { grid: self.grid, data: self.data.iter().copied().map(f).collect() }
    }

    /// The value of the voxel that contains a patient position; `None` outside.
    pub fn nearest(&self, p: Point<Patient>) -> Option<T> {
        self.grid.containing(p).map(|[i, j, k]| self.at(i, j, k))
    }
}

impl<T: Copy + Into<f64>> Volume<T> {
    /// Trilinear value at a continuous voxel index, edge values continued outwards by half a voxel; `None` further out.
    pub fn trilinear_at(&self, v: [f64; 3]) -> Option<f64> {
        let dims = self.grid.dims();
        let mut base = [0usize; 3];
        let mut next = [0usize; 3];
        let mut t = [0.0; 3];
        for a in 0..3 {
            let last = dims[a] as f64 - 1.0;
            if !(v[a] >= -0.5 && v[a] <= last + 0.5) {
                return None;
            }
            let c = v[a].clamp(0.0, last);
            base[a] = c as usize;
            next[a] = (base[a] + 1).min(dims[a] - 1);
            t[a] = c - base[a] as f64;
        }
        let get = |i, j, k| -> f64 { self.at(i, j, k).into() };
        let line = |j, k| get(base[0], j, k) * (1.0 - t[0]) + get(next[0], j, k) * t[0];
        let sheet = |k| line(base[1], k) * (1.0 - t[1]) + line(next[1], k) * t[1];
        Some(sheet(base[2]) * (1.0 - t[2]) + sheet(next[2]) * t[2])
    }

    /// Trilinear value at a patient position; `None` outside the grid.
    pub fn trilinear(&self, p: Point<Patient>) -> Option<f64> {
        self.trilinear_at(self.grid.voxel_from_patient().point(p).to_array())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn ramp() -> Volume<f32> {
        let grid = Grid::axis_aligned([5, 4, 3], [1.0, 2.0, 3.0], [-1.0, 0.5, 2.0]).expect("grid");
        let data = (0..grid.len())
            .map(|n| {
                let c = grid.voxel(n);
                let p = grid.centre(c[0], c[1], c[2]);
                (2.0 * p.x - p.y + 0.5 * p.z) as f32
            })
            .collect();
        Volume::new(grid, data).expect("count")
    }

    proptest! {
        #[test]
        fn trilinear_is_exact_for_linear_fields(x in -1.0..3.0f64, y in 0.5..6.5f64, z in 2.0..8.0f64) {
            let value = ramp().trilinear(Point::new(x, y, z)).expect("inside");
            prop_assert!((value - (2.0 * x - y + 0.5 * z)).abs() < 1e-5);
        }
    }

    #[test]
    fn outside_is_none_and_the_rim_is_continued() {
        let v = ramp();
        assert!(v.trilinear(Point::new(-1.6, 0.5, 2.0)).is_none());
        assert_eq!(v.trilinear(Point::new(-1.4, 0.5, 2.0)), v.trilinear(Point::new(-1.0, 0.5, 2.0)));
        assert!(v.trilinear(Point::new(f64::NAN, 0.5, 2.0)).is_none());
        assert!(v.nearest(Point::new(100.0, 0.0, 0.0)).is_none());
    }

    #[test]
    fn a_wrong_count_is_refused() {
        let grid = *ramp().grid();
        assert!(matches!(Volume::new(grid, vec![0u8; 3]), Err(GridError::Count { expected: 60, found: 3 })));
    }
}
