//! The head against air and head rest.

use super::tissue::Tissue;
use super::working::Working;
use crate::image::{Mask, Raster, distance_to, erode, label};

/// A head rest or a fold of cloth touches the skin over less than a ball of this radius, mm.
const TOUCH: f32 = 2.5;

/// All voxels of the head: tissue connected to the cavity without bridges thinner than a head rest's touch, and the air
/// spaces that each axial slice encloses. `smooth` is the scan smoothed by less than a voxel.
pub(crate) fn head(working: &Working, smooth: &Raster<f32>, cavity: &Mask, tissue: Tissue) -> Mask {
    let body = smooth.zip(&working.nodata, |v, n| v > tissue.air && !n);
    let core = label(&erode(&body, TOUCH).or(cavity)).touching(cavity);
    let reach = distance_to(&core);
    let near = body.zip(&reach, |b, d| b && d <= TOUCH + 1.5);
    let mut mask = label(&near).touching(cavity);
    fill_slices(&mut mask);
    mask
}

/// Area (mm2) over which bone or brain, not scalp, is the topmost part of the head: the scan is cut there.
pub(crate) fn bare_top(head: &Mask, cavity: &Mask, bone: impl Fn(usize) -> bool) -> f64 {
    let sheet = head.dims[0] * head.dims[1];
    let levels: Vec<usize> =
        (0..head.dims[2]).filter(|k| cavity.data[k * sheet..(k + 1) * sheet].contains(&true)).collect();
    let middle = levels.get(levels.len() / 2).map_or(0, |k| k * sheet);
    let ends = |n: usize| head.data.get(n + sheet).is_none_or(|above| !above);
    (middle..head.data.len()).filter(|&n| head.data[n] && ends(n) && (cavity.data[n] || bone(n))).count() as f64
}

/// Fills, in each axial slice, what does not reach the slice's rim.
pub(super) fn fill_slices(mask: &mut Mask) {
    let [nx, ny, _] = mask.dims;
    for sheet in mask.data.chunks_mut(nx * ny) {
        let mut outer = vec![false; nx * ny];
        let mut stack: Vec<usize> =
            (0..nx * ny).filter(|n| n % nx == 0 || n % nx == nx - 1 || n / nx == 0 || n / nx == ny - 1).collect();
        while let Some(n) = stack.pop() {
            if outer[n] || sheet[n] {
                continue;
            }
            outer[n] = true;
            let (i, j) = (n % nx, n / nx);
            stack.extend([(i > 0, n.wrapping_sub(1)), (i + 1 < nx, n + 1)].iter().filter(|s| s.0).map(|s| s.1));
            stack.extend([(j > 0, n.wrapping_sub(nx)), (j + 1 < ny, n + nx)].iter().filter(|s| s.0).map(|s| s.1));
        }
        for (v, o) in sheet.iter_mut().zip(outer) {
            *v |= !o;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_slice_is_filled_by_itself() {
        let mut mask = Mask::filled([9, 9, 2], false);
        for n in 0..81 {
            let [i, j, _] = mask.voxel(n);
            mask.data[n] = i.abs_diff(4).max(j.abs_diff(4)) == 3;
        }
        // The ring of the second slice has a gap.
        for n in 81..162 {
            let [i, j, _] = mask.voxel(n);
            mask.data[n] = i.abs_diff(4).max(j.abs_diff(4)) == 3 && (i, j) != (1, 4);
        }
        fill_slices(&mut mask);
        assert_eq!(mask.data[..81].iter().filter(|&&v| v).count(), 49);
        assert_eq!(mask.data[81..].iter().filter(|&&v| v).count(), 23);
    }
}
