//! Connected components (face neighbours) by union-find.

use super::{Mask, Raster};
use monro_geometry::DisjointSets;

/// A labelling: 0 outside the set, components numbered from 1 in order of their first voxel.
#[derive(Debug, Clone)]
pub(crate) struct Components {
    pub(crate) labels: Raster<u32>,
    /// Voxels per label; entry 0 is the complement.
    pub(crate) sizes: Vec<usize>,
}

impl Components {
    /// The voxels of all components whose number passes the test.
    pub(crate) fn keep(&self, test: impl Fn(u32) -> bool) -> Mask {
        let pass: Vec<bool> = (0..self.sizes.len() as u32).map(|l| l > 0 && test(l)).collect();
        self.labels.map(|l| pass[l as usize])
    }

    /// For each component, whether it contains a voxel of `seeds`.
    pub(crate) fn touched(&self, seeds: &Mask) -> Vec<bool> {
        let mut hit = vec![false; self.sizes.len()];
        for (&l, &s) in self.labels.data.iter().zip(&seeds.data) {
            hit[l as usize] |= s && l > 0;
        }
        hit
    }

    /// The components that contain a voxel of `seeds`.
    pub(crate) fn touching(&self, seeds: &Mask) -> Mask {
        let hit = self.touched(seeds);
        self.keep(|l| hit[l as usize])
    }
}

/// Labels the components of a set.
pub(crate) fn label(mask: &Mask) -> Components {
    let [nx, ny, _] = mask.dims;
    // Number 0 is the background; the root of a set is its first voxel's.
    let mut parts = DisjointSets::new(1);
    let mut labels = Raster::filled(mask.dims, 0u32);
    for index in 0..mask.data.len() {
        if !mask.data[index] {
            continue;
        }
        let [i, j, k] = mask.voxel(index);
        let west = if i > 0 { labels.data[index - 1] } else { 0 };
        let north = if j > 0 { labels.data[index - nx] } else { 0 };
        let below = if k > 0 { labels.data[index - nx * ny] } else { 0 };
        let before = [west, north, below].into_iter().filter(|&l| l > 0);
        let joined = before.reduce(|a, b| {
            parts.join(a, b);
            a
        });
        labels.data[index] = joined.unwrap_or_else(|| parts.add());
    }
    renumber(labels, &mut parts)
}

fn renumber(mut labels: Raster<u32>, parts: &mut DisjointSets) -> Components {
    let mut number = vec![0u32; parts.len()];
    let mut count = 0;
    for l in 1..number.len() as u32 {
        let r = parts.root(l) as usize;
        if number[r] == 0 {
            count += 1;
            number[r] = count;
        }
        number[l as usize] = number[r];
    }
    let mut sizes = vec![0; count as usize + 1];
    for l in &mut labels.data {
        *l = number[*l as usize];
        sizes[*l as usize] += 1;
    }
    Components { labels, sizes }
}

/// The largest component (the first of equals); empty for an empty set.
pub(crate) fn largest(mask: &Mask) -> Mask {
    let parts = label(mask);
    let best = (1..parts.sizes.len()).max_by_key(|&l| (parts.sizes[l], usize::MAX - l)).unwrap_or(usize::MAX);
    parts.keep(|l| l as usize == best)
}

/// The set and every hole that does not reach the faces of the box.
pub(crate) fn fill_holes(mask: &Mask) -> Mask {
    let parts = label(&mask.not());
    let mut outer = vec![false; parts.sizes.len()];
    let [nx, ny, nz] = mask.dims;
    for (index, &l) in parts.labels.data.iter().enumerate() {
        let [i, j, k] = mask.voxel(index);
        if i == 0 || j == 0 || k == 0 || i + 1 == nx || j + 1 == ny || k + 1 == nz {
            outer[l as usize] = true;
        }
    }
    parts.labels.map(|l| l == 0 || !outer[l as usize])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn neighbours_share_a_label_and_sizes_add_up(bits in proptest::collection::vec(any::<bool>(), 6 * 5 * 4)) {
            let mask = Mask { dims: [6, 5, 4], data: bits };
            let parts = label(&mask);
            prop_assert_eq!(parts.sizes.iter().sum::<usize>(), mask.data.len());
            for n in 0..mask.data.len() {
                prop_assert_eq!(parts.labels.data[n] > 0, mask.data[n]);
                for m in mask.neighbours(n) {
                    prop_assert!(!(mask.data[n] && mask.data[m]) || parts.labels.data[n] == parts.labels.data[m]);
                }
            }
        }
    }

    #[test]
    fn a_shell_is_filled_and_the_largest_part_found() {
        let mut mask = Mask::filled([9, 9, 9], false);
        for n in 0..mask.data.len() {
            let far = mask.voxel(n).iter().map(|&c| c.abs_diff(4)).max();
            mask.data[n] = far == Some(3);
        }
        mask.data[0] = true;
        assert_eq!(fill_holes(&largest(&mask)).count(), 7 * 7 * 7);
        assert_eq!(largest(&Mask::filled([2, 2, 2], false)).count(), 0);
    }
}
