//! Planes of air beyond a head that is cut off: padding, no scan.
//!
//! Some programs pad a volume to a size. What lies there was never seen; taken for air, the flat end of the head would be
//! its skin.

use monro_geometry::{Affine, Grid, Volume};

/// A plane with less tissue holds none, mm2.
const NOTHING_MM2: f64 = 100.0;
/// A whole head shows at most so much tissue in its first plane, mm2, and so much more for each mm between planes: its
/// flattest places are balls of 140 mm radius, and a plane `t` inside shows a disc of `2 pi R t`. The sides of a skull without
/// its skin are flatter: 4200 mm2 in the first 2 mm of a template.
const END_MM2: f64 = 3000.0;
const GROWTH_MM: f64 = 900.0;
/// It is a head if it is as large for so long, mm: the sides of a head rest are thin.
const DEEP_MM: f64 = 12.0;
/// Planes in which resampling may have mixed the head with the padding, and the first one that it has not.
const BLURRED: usize = 2;

/// Leaves out planes without tissue on whose other side the head begins at once in its full size; says so. `profiles` are
/// the volume's, of [`crate::check::profiles`].
pub(crate) fn cut_off(volume: Volume<i16>, profiles: &[Vec<u64>; 3]) -> (Volume<i16>, Vec<String>) {
    let grid = *volume.grid();
    let (dims, spacing) = (grid.dims(), grid.spacing());
    let (mut low, mut high, mut said) = ([0; 3], dims, Vec::new());
    for axis in 0..3 {
        let pixel = grid.voxel_volume() / spacing[axis];
        let areas: Vec<f64> = profiles[axis].iter().map(|&n| n as f64 * pixel).collect();
        let before = padding(areas.iter().copied(), spacing[axis]);
        let after = padding(areas.iter().rev().copied(), spacing[axis]);
        (low[axis], high[axis]) = (before, dims[axis] - after);
        for (planes, sign) in [(before, -1.0), (after, 1.0)] {
            if planes > 0 {
                said.push(sentence(planes, spacing[axis], grid.end(axis, sign > 0.0)));
            }
        }
    }
    if said.is_empty() { (volume, said) } else { (crop(&volume, low, high), said) }
}

/// Number of planes without tissue that end at a cut through the head, from the areas (mm2) of tissue in planes `spacing`
/// mm apart.
fn padding(areas: impl Iterator<Item = f64> + Clone, spacing: f64) -> usize {
    let planes = areas.clone().take_while(|&area| area < NOTHING_MM2).count();
    let least = |n: usize| END_MM2 + GROWTH_MM * spacing * n as f64;
    let mut first = areas.clone().skip(planes).take(BLURRED).zip(1..);
    let abrupt = first.any(|(area, n)| area > least(n));
    let thick = ((DEEP_MM / spacing).ceil() as usize).max(BLURRED);
    let lasting = areas.skip(planes + 1).take(thick).all(|area| area > least(1));
    if abrupt && lasting { planes } else { 0 }
}

fn sentence(planes: usize, spacing: f64, end: &str) -> String {
    format!(
        "{planes} plane(s) ({:.1} mm) at the {end} end of the scan hold only air, though the head does not end there but is \
         cut: they were left out as padding",
        planes as f64 * spacing
    )
}

/// The voxels `low..high`, where they were.
fn crop(volume: &Volume<i16>, low: [usize; 3], high: [usize; 3]) -> Volume<i16> {
    let grid = volume.grid();
    let first = grid.centre(low[0], low[1], low[2]).to_array();
    let placed = Affine::new(grid.patient_from_voxel().linear, first);
    let own = Grid::new([0, 1, 2].map(|a| high[a] - low[a]), placed).expect("some planes of a sound grid");
    let mut data = Vec::with_capacity(own.len());
    for (k, j) in (low[2]..high[2]).flat_map(|k| (low[1]..high[1]).map(move |j| (k, j))) {
        data.extend_from_slice(&volume.data()[grid.index(low[0], j, k)..grid.index(high[0] - 1, j, k) + 1]);
    }
    Volume::new(own, data).expect("as many values as voxels")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::profiles;
    use proptest::prelude::*;

    fn off(volume: Volume<i16>) -> (Volume<i16>, Vec<String>) {
        let profiles = profiles(&volume);
        cut_off(volume, &profiles)
    }

    /// An ellipsoid of tissue with semi-axes of 70, 90 and 75 mm about the origin, in a box.
    fn head(dims: [usize; 3], spacing: [f64; 3], origin: [f64; 3]) -> Volume<i16> {
        let grid = Grid::axis_aligned(dims, spacing, origin).expect("a grid");
        let hu = |n: usize| {
            let [i, j, k] = grid.voxel(n);
            let p = grid.centre(i, j, k).to_array();
            let r: f64 = p.iter().zip([70.0, 90.0, 75.0]).map(|(x, r)| (x / r).powi(2)).sum();
            if r < 1.0 { 30 } else { -1024 }
        };
        Volume::new(grid, (0..grid.len()).map(hu).collect()).expect("as many values")
    }

    /// Replaces the planes from `from` on along an axis by air.
    fn blank(volume: &mut Volume<i16>, axis: usize, from: usize) {
        let grid = *volume.grid();
        volume
            .data_mut()
            .iter_mut()
            .enumerate()
            .filter(|(n, _)| grid.voxel(*n)[axis] >= from)
            .for_each(|(_, v)| *v = -1024);
    }

    proptest! {
        #[test]
        fn a_whole_head_in_air_is_left_as_it_is(step in 0.8..8.0f64, axis in 0..3usize, offset in 0.0..1.0f64) {
            let mut spacing = [3.0; 3];
            spacing[axis] = step;
            let dims = spacing.map(|s| (230.0 / s) as usize);
            let origin = spacing.map(|s| -115.0 + offset * s);
            let volume = head(dims, spacing, origin);
            let (same, said) = off(volume.clone());
            prop_assert_eq!((same.grid().dims(), said), (dims, Vec::<String>::new()));
        }

        #[test]
        fn padding_beyond_a_cut_is_left_out_on_any_axis(step in 0.8..5.0f64, axis in 0..3usize, missing in 22.0..60.0f64) {
            let mut spacing = [3.0; 3];
            spacing[axis] = step;
            let dims = spacing.map(|s| (230.0 / s) as usize);
            let mut volume = head(dims, spacing, [-115.0; 3]);
            let top = [70.0, 90.0, 75.0][axis] - missing;
            let from = ((top + 115.0) / step) as usize;
            blank(&mut volume, axis, from);
            let (cut, said) = off(volume.clone());
            let mut wanted = dims;
            wanted[axis] = from;
            prop_assert_eq!(cut.grid().dims(), wanted);
            prop_assert_eq!(said.len(), 1);
            // What is left lies where it lay.
            let p = volume.grid().centre(5, 6, 7);
            prop_assert_eq!(cut.grid().containing(p), Some([5, 6, 7]));
            prop_assert_eq!(cut.at(dims[0] / 2, 20, 10), volume.at(dims[0] / 2, 20, 10));
        }
    }

    #[test]
    fn a_plate_beside_the_head_is_no_cut() {
        let mut volume = head([153, 77, 77], [1.5, 3.0, 3.0], [-115.0; 3]);
        let grid = *volume.grid();
        let in_plate = |n: usize| (10..15).contains(&grid.voxel(n)[0]) && grid.voxel(n)[1] > 30;
        volume.data_mut().iter_mut().enumerate().filter(|(n, _)| in_plate(*n)).for_each(|(_, v)| *v = -100);
        assert_eq!(off(volume).1, Vec::<String>::new());
    }

    #[test]
    fn the_end_is_named_for_the_patient_and_the_lower_one_counts_too() {
        let mut volume = head([77, 77, 77], [3.0; 3], [-115.0; 3]);
        let grid = *volume.grid();
        volume.data_mut().iter_mut().enumerate().filter(|(n, _)| grid.voxel(*n)[2] < 20).for_each(|(_, v)| *v = -1024);
        let (cut, said) = off(volume);
        assert_eq!(cut.grid().dims(), [77, 77, 57]);
        assert_eq!(cut.grid().centre(0, 0, 0).to_array(), [-115.0, -115.0, -55.0]);
        assert!(said[0].starts_with("20 plane(s) (60.0 mm) at the inferior end"), "{said:?}");
    }

    #[test]
    fn a_volume_without_tissue_is_left_as_it_is() {
        let grid = Grid::axis_aligned([4, 5, 6], [1.0; 3], [0.0; 3]).expect("a grid");
        let (same, said) = off(Volume::filled(grid, -1024));
        assert_eq!((same.grid().dims(), said.len()), ([4, 5, 6], 0));
    }
}
