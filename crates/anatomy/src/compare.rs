//! How well two labellings of one grid agree.

use crate::surface::distance::squared_distance;
use monro_geometry::Grid;

/// Agreement of a structure with its reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Agreement {
    /// Dice's coefficient, 0 to 1; 1 when both are empty.
    pub dice: f64,
    /// Mean distance from the border voxels of each to the nearest of the other, both ways, mm; infinite when one is
    /// empty.
    pub mean_mm: f64,
    /// 95th percentile of the same distances (Hausdorff's distance without the worst twentieth), mm.
    pub hausdorff95_mm: f64,
    /// Volume found, ml.
    pub found_ml: f64,
    /// Volume of the reference, ml.
    pub reference_ml: f64,
}

/// Compares two sets of voxels (one flag per voxel of `grid`).
///
/// # Panics
/// When a set does not have one flag per voxel.
pub fn agreement(grid: &Grid, found: &[bool], reference: &[bool]) -> Agreement {
    assert!(found.len() == grid.len() && reference.len() == grid.len(), "one flag per voxel");
    let count = |v: &[bool]| v.iter().filter(|b| **b).count();
    let both = found.iter().zip(reference).filter(|(a, b)| **a && **b).count();
    let each = [count(found), count(reference)];
    let dice = if each == [0, 0] { 1.0 } else { 2.0 * both as f64 / (each[0] + each[1]) as f64 };
    let ml = |n: usize| n as f64 * grid.voxel_volume() / 1000.0;
    let mut all = border_distances(grid, found, reference);
    all.sort_by(f64::total_cmp);
    let rank = ((all.len() as f64 - 1.0).max(0.0) * 0.95).round() as usize;
    Agreement {
        dice,
        mean_mm: if all.is_empty() { f64::INFINITY } else { all.iter().sum::<f64>() / all.len() as f64 },
        hausdorff95_mm: all.get(rank).copied().unwrap_or(f64::INFINITY),
        found_ml: ml(each[0]),
        reference_ml: ml(each[1]),
    }
}

/// Distances from each border to the other, both ways; none when one is empty.
fn border_distances(grid: &Grid, a: &[bool], b: &[bool]) -> Vec<f64> {
    let Some((corner, dims)) = bounds(grid, a, b) else { return Vec::new() };
    let cut = |from: &[bool]| -> Vec<bool> {
        let inside = |v: [usize; 3]| from[grid.index(corner[0] + v[0], corner[1] + v[1], corner[2] + v[2])];
        let voxel = |n: usize| [n % dims[0], n / dims[0] % dims[1], n / (dims[0] * dims[1])];
        let on_border = |v: [usize; 3]| {
            (0..3).any(|axis| {
                let (mut low, mut high) = (v, v);
                low[axis] = low[axis].wrapping_sub(1);
                high[axis] += 1;
                v[axis] == 0 || high[axis] == dims[axis] || !inside(low) || !inside(high)
            })
        };
        (0..dims.iter().product()).map(voxel).map(|v| inside(v) && on_border(v)).collect()
    };
    let borders = [cut(a), cut(b)];
    let fields = borders.each_ref().map(|border| squared_distance(border, dims, grid.spacing()));
    let one_way = |from: usize, to: usize| {
        let fields = &fields;
        let on = borders[from].iter().enumerate().filter(|(_, on)| **on);
        on.map(move |(n, _)| f64::from(fields[to][n]).sqrt()).collect::<Vec<_>>()
    };
    if borders.iter().any(|b| !b.contains(&true)) {
        return Vec::new();
    }
    [one_way(0, 1), one_way(1, 0)].concat()
}

/// Corner and size of the box around both sets; `None` when both are empty.
fn bounds(grid: &Grid, a: &[bool], b: &[bool]) -> Option<([usize; 3], [usize; 3])> {
    let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
    for n in (0..grid.len()).filter(|&n| a[n] || b[n]) {
        for (axis, v) in grid.voxel(n).into_iter().enumerate() {
            (low[axis], high[axis]) = (low[axis].min(v), high[axis].max(v));
        }
    }
    (low[0] <= high[0]).then(|| (low, core::array::from_fn(|axis| high[axis] + 1 - low[axis])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_slabs_two_millimetres_apart_are_that_far_apart() {
        let grid = Grid::axis_aligned([10, 12, 8], [0.5, 1.0, 2.0], [0.0; 3]).expect("grid");
        let slab = |k: usize| (0..grid.len()).map(|n| grid.voxel(n)[2] == k).collect::<Vec<_>>();
        let found = agreement(&grid, &slab(3), &slab(4));
        assert_eq!((found.dice, found.mean_mm, found.hausdorff95_mm), (0.0, 2.0, 2.0));
        assert!((found.found_ml - 0.12).abs() < 1e-12 && (found.reference_ml - 0.12).abs() < 1e-12);
        let same = agreement(&grid, &slab(3), &slab(3));
        assert_eq!((same.dice, same.mean_mm, same.hausdorff95_mm), (1.0, 0.0, 0.0));
        let none = vec![false; grid.len()];
        assert_eq!(agreement(&grid, &none, &none).dice, 1.0);
        assert!(agreement(&grid, &slab(1), &none).mean_mm.is_infinite());
    }
}
