//! Watershed by flooding from markers (Meyer 1994).

use super::{Mask, Raster};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Floods `inside` from the non-zero `markers` in the order of `height`; each voxel takes the label that reaches it
/// first, equal heights first come, first served. Voxels that no marker reaches stay 0.
pub(crate) fn watershed(height: &Raster<f32>, markers: &Raster<u8>, inside: &Mask) -> Raster<u8> {
    let mut labels = markers.zip(inside, |m, i| if i { m } else { 0 });
    let mut queue: BinaryHeap<Reverse<(u32, u32, u32)>> = BinaryHeap::new();
    let mut order = 0u32;
    for (n, _) in markers.data.iter().zip(&inside.data).enumerate().filter(|(_, (m, i))| **m > 0 && **i) {
        queue.push(Reverse((key(height.data[n]), order, n as u32)));
        order += 1;
    }
    while let Some(Reverse((level, _, n))) = queue.pop() {
        let n = n as usize;
        for m in labels.neighbours(n) {
            if labels.data[m] == 0 && inside.data[m] {
                labels.data[m] = labels.data[n];
                // A flood never sinks below the level at which it came.
                queue.push(Reverse((key(height.data[m]).max(level), order, m as u32)));
                order = order.wrapping_add(1);
            }
        }
    }
    labels
}

/// An integer in the order of the float.
fn key(v: f32) -> u32 {
    let bits = v.to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_basins_meet_on_the_ridge_and_islands_stay_dry() {
        let heights = [0.0, -1.0, 0.0, 3.0, 0.5, -2.0, 0.0, 9.0, 1.0];
        let height = Raster { dims: [9, 1, 1], data: heights.to_vec() };
        let markers = Raster { dims: [9, 1, 1], data: vec![0, 1, 0, 0, 0, 2, 0, 0, 0] };
        let inside = Mask { dims: [9, 1, 1], data: vec![true, true, true, true, true, true, true, false, true] };
        assert_eq!(watershed(&height, &markers, &inside).data, [1, 1, 1, 1, 2, 2, 2, 0, 0]);
    }

    #[test]
    fn keys_order_as_floats_do() {
        let values = [-5.0f32, -0.5, 0.0, 1e-3, 2.0, 1e9];
        assert!(values.windows(2).all(|w| key(w[0]) < key(w[1])));
    }
}
