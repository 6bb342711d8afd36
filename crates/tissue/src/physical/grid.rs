//! Functions that are linear between the points of a coarse grid.

use monro_geometry::d3::D3;

/// A grid over a box.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    /// Lowest corner, mm, and cells to the millimetre along each axis.
    low: D3,
    scale: D3,
    /// Points along each axis.
    points: [usize; 3],
    /// Longest side, mm.
    pub(super) longest: f64,
}

/// A place in a grid: the lowest corner of its cell, and how far it is from there, in cells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    corner: u32,
    beyond: [f32; 3],
}

impl Grid {
    /// Around some points, with so many cells along the longest side, and as many along the others as make them about as long.
    pub(super) fn around(points: &[D3], cells: f64) -> Self {
        let end = |a: usize, end: fn(f64, f64) -> f64| points.iter().map(|p| p[a]).reduce(end).unwrap_or(0.0);
        let low: D3 = core::array::from_fn(|a| end(a, f64::min));
        let sides: D3 = core::array::from_fn(|a| end(a, f64::max) - low[a]);
        let longest = sides.into_iter().fold(0.0, f64::max);
        let counts = sides.map(|s| (cells * s / longest.max(f64::MIN_POSITIVE)).ceil().clamp(1.0, cells));
        let scale = core::array::from_fn(|a| if sides[a] > 0.0 { counts[a] / sides[a] } else { 0.0 });
        Self { low, scale, points: counts.map(|c| c as usize + 1), longest }
    }

    /// Number of points.
    pub(super) fn len(&self) -> usize {
        self.points.iter().product()
    }

    /// Where a point within the box is.
    pub(super) fn place(&self, at: D3) -> Place {
        let place: D3 = core::array::from_fn(|a| (self.scale[a] * (at[a] - self.low[a])).max(0.0));
        let cell: [usize; 3] = core::array::from_fn(|a| (place[a] as usize).min(self.points[a] - 2));
        let corner = cell[0] + self.points[0] * (cell[1] + self.points[1] * cell[2]);
        Place { corner: corner as u32, beyond: core::array::from_fn(|a| (place[a] - cell[a] as f64) as f32) }
    }

    /// The points around a place, with the functions of which each is one there.
    #[inline]
    pub(super) fn weights(&self, place: Place) -> [(usize, f64); 8] {
        let [x, y, z] = place.beyond.map(|b| [1.0 - f64::from(b), f64::from(b)]);
        let [row, layer] = [self.points[0], self.points[0] * self.points[1]];
        core::array::from_fn(|i| {
            let [i, j, k] = [i & 1, i >> 1 & 1, i >> 2];
            (place.corner as usize + i + j * row + k * layer, x[i] * y[j] * z[k])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_linear_comes_out_anywhere_and_flat_boxes_have_a_cell() {
        for high in [[60.0, 20.0, 31.0], [10.0, 0.0, 1e-3], [0.0; 3]] {
            let low = [-7.0, 3.0, 1.0];
            let at = |s: D3| -> D3 { core::array::from_fn(|a| low[a] + s[a] * high[a]) };
            let grid = Grid::around(&[at([0.0; 3]), at([1.0; 3])], 6.0);
            assert_eq!(grid.longest, high[0]);
            let corners: Vec<D3> = (0..grid.len())
                .map(|i| {
                    let [nx, ny, nz] = grid.points;
                    let index = [i % nx, i / nx % ny, i / nx / ny];
                    at(core::array::from_fn(|a| index[a] as f64 / ([nx, ny, nz][a] - 1) as f64))
                })
                .collect();
            for s in [[0.0; 3], [1.0; 3], [0.3, 0.99, 0.5], [1.0, 0.0, 0.2]] {
                let weights = grid.weights(grid.place(at(s)));
                assert!((weights.iter().map(|w| w.1).sum::<f64>() - 1.0).abs() < 1e-12);
                for a in 0..3 {
                    let mean: f64 = weights.iter().map(|&(i, w)| w * corners[i][a]).sum();
                    // Places within a cell are in single precision.
                    assert!((mean - at(s)[a]).abs() < 1e-6 * (1.0 + high[a]), "{s:?}: {mean} for {:?}", at(s));
                }
            }
        }
    }
}
