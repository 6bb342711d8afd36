//! Smoothing that keeps the volume.

use super::distance::{Cut, margin};
use super::{EditError, Selection, check_positive_mm};

/// The selection smoothed by a Gaussian of `sigma_mm` and cut at the level that leaves exactly as many voxels as there
/// were; thin spikes go, the volume stays.
///
/// # Errors
/// The selection is empty; the width is not positive.
pub fn smoothed(selection: &Selection, sigma_mm: f64) -> Result<Selection, EditError> {
    check_positive_mm("sigma", sigma_mm)?;
    let grid = selection.grid();
    let cut = Cut::new(selection, margin(grid, 3.0 * sigma_mm))
        .ok_or(EditError::Empty { what: "the selection", verb: "smooth" })?;
    let mut field: Vec<f32> = cut.flags.iter().map(|&f| f32::from(u8::from(f))).collect();
    for axis in 0..3 {
        blur(&mut field, cut.dims, axis, sigma_mm / grid.spacing()[axis]);
    }
    // Highest values first; among equals former members, then lower offsets.
    let key = |&n: &usize| (field[n], cut.flags[n], core::cmp::Reverse(n));
    let order = |a: &usize, b: &usize| {
        let (a, b) = (key(a), key(b));
        b.0.total_cmp(&a.0).then(b.1.cmp(&a.1)).then(b.2.cmp(&a.2))
    };
    let mut ranked: Vec<usize> = (0..field.len()).collect();
    let count = selection.count();
    if count < ranked.len() {
        ranked.select_nth_unstable_by(count, order);
    }
    let voxels = ranked[..count].iter().map(|&n| cut.global(grid, n)).collect();
    Ok(Selection::from_voxels(*grid, voxels))
}

/// A Gaussian along one axis of a box, in place; the ends are continued by their last value.
fn blur(field: &mut [f32], dims: [usize; 3], axis: usize, sigma: f64) {
    let radius = (3.0 * sigma).ceil() as usize;
    let weights: Vec<f32> = (0..=radius).map(|d| (-0.5 * (d as f64 / sigma).powi(2)).exp() as f32).collect();
    let total = weights[0] + 2.0 * weights[1..].iter().sum::<f32>();
    let inner: usize = dims[..axis].iter().product();
    let n = dims[axis];
    let mut line = vec![0.0; n];
    for block in field.chunks_exact_mut(inner * n) {
        for start in 0..inner {
            for (i, v) in line.iter_mut().enumerate() {
                *v = block[start + i * inner];
            }
            if line.iter().all(|v| v.to_bits() == line[0].to_bits()) {
                continue;
            }
            for i in 0..n {
                let pairs = weights.iter().enumerate().skip(1);
                let sides = pairs.map(|(d, w)| w * (line[i.saturating_sub(d)] + line[(i + d).min(n - 1)]));
                block[start + i * inner] = (weights[0] * line[i] + sides.sum::<f32>()) / total;
            }
        }
    }
}
