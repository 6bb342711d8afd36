//! Filling of enclosed holes.

use super::{Selection, islands};
use crate::livewire::Axis;

/// The selection with its holes filled: voxels that no way over faces leads from to the border of the volume.
pub fn fill_holes(selection: &Selection) -> Selection {
    let grid = *selection.grid();
    let dims = grid.dims();
    let on_border = |n: usize| {
        let v = grid.voxel(n);
        (0..3).any(|a| v[a] == 0 || v[a] + 1 == dims[a])
    };
    let outside: Vec<usize> = islands(&selection.complement())
        .iter()
        .filter(|part| part.runs().iter().any(|r| on_border(r.start) || on_border(r.end - 1)))
        .flat_map(Selection::voxels)
        .collect();
    Selection::from_voxels(grid, outside).complement()
}

/// The same on each slice by itself (perpendicular to `axis`): fills cups that are open above or below too.
pub fn fill_holes_in_slices(selection: &Selection, axis: Axis) -> Selection {
    let Some([low, high]) = selection.bounds() else { return selection.clone() };
    let grid = *selection.grid();
    let [c, r] = axis.in_plane();
    // One pixel of surroundings on each side is outside for certain; it need not exist in the volume.
    let (w, h) = (high[c] - low[c] + 3, high[r] - low[r] + 3);
    let mut voxels: Vec<usize> = Vec::new();
    for index in low[axis.number()]..=high[axis.number()] {
        let voxel = |n: usize| {
            let (x, y) = (n % w, n / w);
            let inside = (1..w - 1).contains(&x) && (1..h - 1).contains(&y);
            inside.then(|| {
                let [i, j, k] = axis.voxel(index, low[c] + x - 1, low[r] + y - 1);
                grid.index(i, j, k)
            })
        };
        let set: Vec<bool> = (0..w * h).map(|n| voxel(n).is_some_and(|v| selection.contains(v))).collect();
        let outside = flood(&set, w);
        voxels.extend((0..w * h).filter(|&n| !outside[n]).filter_map(voxel));
    }
    Selection::from_voxels(grid, voxels)
}

/// The pixels that are not set and reached over sides from pixel 0.
fn flood(set: &[bool], width: usize) -> Vec<bool> {
    let mut reached = vec![false; set.len()];
    let mut waiting = vec![0];
    reached[0] = true;
    while let Some(n) = waiting.pop() {
        let x = n % width;
        let left = (x > 0).then(|| n - 1);
        let right = (x + 1 < width).then_some(n + 1);
        let around = [left, right, n.checked_sub(width), Some(n + width)];
        for q in around.into_iter().flatten().filter(|&q| q < set.len()) {
            if !set[q] && !reached[q] {
                reached[q] = true;
                waiting.push(q);
            }
        }
    }
    reached
}
