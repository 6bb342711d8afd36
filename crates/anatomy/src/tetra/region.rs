//! Whether a box holds some of the region, by sums over all cells below and before each one of a lattice.

use monro_geometry::d3::D3;
use monro_geometry::{Grid, Point};

/// How many points of the region lie below and before each corner of a lattice's cells.
#[derive(Debug, Clone)]
pub(super) struct Region {
    /// Lowest corner and cell edge, mm.
    low: D3,
    step: f64,
    /// Along each axis one more than the lattice has.
    dims: [usize; 3],
    sums: Vec<u32>,
}

impl Region {
    /// Points in an even grid along the patient's axes; those outside of it are left out.
    pub(super) fn new(grid: &Grid, points: impl Iterator<Item = D3>) -> Self {
        let dims = grid.dims().map(|d| d + 1);
        let mut sums = vec![0u32; dims.iter().product()];
        let at = |[i, j, k]: [usize; 3]| i + dims[0] * (j + dims[1] * k);
        for cell in points.filter_map(|p| grid.containing(Point::from_array(p))) {
            sums[at(cell.map(|c| c + 1))] += 1;
        }
        for (axis, stride) in [1, dims[0], dims[0] * dims[1]].into_iter().enumerate() {
            for lines in sums.chunks_mut(stride * dims[axis]) {
                (stride..lines.len()).for_each(|i| lines[i] += lines[i - stride]);
            }
        }
        let step = grid.spacing()[0];
        let low = grid.centre(0, 0, 0).to_array().map(|x| x - 0.5 * step);
        Self { low, step, dims, sums }
    }

    /// Whether there is a point in a cell that the box from `low` to `high` touches.
    pub(super) fn meets(&self, low: D3, high: D3) -> bool {
        let bound = |x: f64, a: usize| (x.max(0.0) as usize).min(self.dims[a] - 1);
        let from: [usize; 3] = std::array::from_fn(|a| bound((low[a] - self.low[a]) / self.step, a));
        let to: [usize; 3] = std::array::from_fn(|a| bound((high[a] - self.low[a]) / self.step + 1.0, a));
        let sum = |pick: usize| {
            let [i, j, k] = std::array::from_fn(|a| if pick >> a & 1 == 1 { to[a] } else { from[a] });
            i64::from(self.sums[i + self.dims[0] * (j + self.dims[1] * k)])
        };
        let inside: i64 = (0..8usize).map(|c| if c.count_ones() % 2 == 1 { sum(c) } else { -sum(c) }).sum();
        inside > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_box_meets_the_region_where_a_touched_cell_holds_a_point(
            points in proptest::collection::vec(proptest::array::uniform3(0.0..10.0f64), 1..6),
            corner in proptest::array::uniform3(-2.0..12.0f64),
            size in proptest::array::uniform3(0.0..5.0f64),
        ) {
            let grid = Grid::axis_aligned([10; 3], [1.0; 3], [0.5; 3]).expect("grid");
            let region = Region::new(&grid, points.iter().copied());
            let high: D3 = std::array::from_fn(|a| corner[a] + size[a]);
            let touched = |p: &D3| (0..3).all(|a| p[a].floor() >= corner[a].floor() && p[a].floor() <= high[a].floor());
            prop_assert_eq!(region.meets(corner, high), points.iter().any(touched));
        }
    }
}
