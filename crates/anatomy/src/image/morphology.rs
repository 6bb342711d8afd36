//! Morphology with balls, by distance transforms.

use super::{Mask, distance_to, distance_to_false};

/// Voxels within `radius` of the set.
pub(crate) fn dilate(mask: &Mask, radius: f32) -> Mask {
    distance_to(mask).map(|d| d <= radius)
}

/// Voxels farther than `radius` from the complement (the outside of the box does not count as complement).
pub(crate) fn erode(mask: &Mask, radius: f32) -> Mask {
    distance_to_false(mask).map(|d| d > radius)
}

/// Erosion, then dilation: what a ball inside the set can reach.
pub(crate) fn open(mask: &Mask, radius: f32) -> Mask {
    dilate(&erode(mask, radius), radius)
}

/// Dilation, then erosion: gaps that a ball cannot enter are filled.
pub(crate) fn close(mask: &Mask, radius: f32) -> Mask {
    erode(&dilate(mask, radius), radius)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn opening_shrinks_and_closing_grows(bits in proptest::collection::vec(any::<bool>(), 9 * 8 * 7), r in 1.0f32..2.5) {
            let mask = Mask { dims: [9, 8, 7], data: bits };
            let (opened, closed) = (open(&mask, r), close(&mask, r));
            prop_assert_eq!(opened.minus(&mask).count(), 0);
            prop_assert_eq!(mask.minus(&closed).count(), 0);
        }
    }

    #[test]
    fn opening_removes_a_thin_bridge() {
        let mut mask = Mask::filled([30, 11, 11], false);
        for n in 0..mask.data.len() {
            let [i, j, k] = mask.voxel(n);
            let r2 = (j as i32 - 5).pow(2) + (k as i32 - 5).pow(2);
            mask.data[n] = r2 <= 16 && !(12..18).contains(&i) || r2 <= 1;
        }
        let opened = open(&mask, 2.0);
        assert!(!opened.data[opened.index(15, 5, 5)] && opened.data[opened.index(5, 5, 5)]);
    }
}
