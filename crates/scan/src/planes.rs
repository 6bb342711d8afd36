//! Planes of a volume that do not belong between those beside them (lost and filled with one value, scaled differently, of
//! another place), and places where a volume is torn.

use monro_geometry::Volume;
use std::ops::Range;

/// Values count within these, HU: metal in a single slice is no fault.
const WITHIN: [i16; 2] = [-1000, 1000];
/// A plane is odd that differs from both planes beside it by more than so many times as much as these from each other, and by so
/// many HU more. In three heads and a phantom it is 0.8 times as much at most, noise or not.
const TIMES: f64 = 1.5;
const MORE_HU: f64 = 5.0;
/// A volume is torn between two planes that differ, where both show tissue, by more than so many times as much as each two of the
/// next three on either side, and [`MORE_HU`]. In three heads, thick slices of them, a dozen changed ones and a phantom it is 1.26 times
/// at most; with 5 mm cut out of a head 2.6, with a part moved by 7 mm 8.6.
const TORN_TIMES: f64 = 2.0;
/// Values of tissue, HU: an edge of air against something foreign (a frame, a dressing) may lie along a plane.
const TISSUE: i16 = -300;
/// Beside a lost plane more than this share of what another shows is off the lost one's value, by more HU than this: between two
/// bodies in air there is a plane of air, too.
const SHOWN: f64 = 0.03;
const OFF_HU: u16 = 100;
/// Only every so many voxels of a plane are looked at, in both directions.
const EVERY: usize = 2;
/// So many planes are named.
const NAMED: usize = 3;

/// Sentences about planes of one value within the volume, and about others that are unlike both beside them.
pub(crate) fn told(volume: &Volume<i16>) -> Vec<String> {
    (0..3).flat_map(|axis| along(volume, axis)).collect()
}

fn along(volume: &Volume<i16>, axis: usize) -> Vec<String> {
    let count = volume.grid().dims()[axis];
    if count < 5 {
        return Vec::new();
    }
    let all: Vec<Plane> = (0..count).map(|k| Plane::of(volume, axis, k)).collect();
    let name = |k: usize| match axis {
        2 => format!("slice {} of {count}", k + 1),
        _ => format!("plane {} of {count} along the {} axis", k + 1, ["first", "second"][axis]),
    };
    let empty = emptied(&all);
    let mut out: Vec<String> = empty
        .iter()
        .take(NAMED)
        .map(|run| {
            let to = if run.len() > 1 { format!(" to {}", run.end) } else { String::new() };
            format!(
                "{}{to} holds nothing but {} HU, between slices that show something: it was lost; fill it, or leave it out",
                name(run.start),
                all[run.start].values[0]
            )
        })
        .collect();
    let odd = (1..count - 1).filter(|&k| !empty.iter().any(|run| run.contains(&k)));
    let odd: Vec<(usize, [f64; 2])> =
        odd.filter_map(|k| Some((k, is_odd([&all[k - 1], &all[k], &all[k + 1]])?))).collect();
    out.extend(odd.iter().take(NAMED).map(|&(k, [own, beside])| {
        format!(
            "{} is unlike both beside it ({own:.0} HU off them on average, they {beside:.0} off each other): it may be damaged, \
             scaled differently or of another place; look at it",
            name(k)
        )
    }));
    let torn = torn(&all);
    out.extend(torn.iter().take(NAMED).map(|&(k, [own, beside])| {
        format!(
            "between {} and the next the scan is torn ({own:.0} HU apart where both show tissue, those beside {beside:.0} at most): slices \
             are missing there, in another order, or a part of the scan was moved, and nothing beyond lies where it seems to; convert \
             the scan again from its images",
            name(k)
        )
    }));
    let more: usize = [empty.len(), odd.len(), torn.len()].iter().map(|n| n.saturating_sub(NAMED)).sum();
    out.extend((more > 0).then(|| format!("{more} more such planes along that axis")));
    out
}

/// Some values of a plane.
struct Plane {
    values: Vec<i16>,
    is_flat: bool,
}

impl Plane {
    fn of(volume: &Volume<i16>, axis: usize, k: usize) -> Self {
        let dims = volume.grid().dims();
        let [a, b] = [[1, 2], [0, 2], [0, 1]][axis];
        let mut values = Vec::with_capacity((dims[a] / EVERY + 1) * (dims[b] / EVERY + 1));
        let mut at = [k; 3];
        for v in (0..dims[b]).step_by(EVERY) {
            for u in (0..dims[a]).step_by(EVERY) {
                (at[a], at[b]) = (u, v);
                let value = volume.data()[at[0] + dims[0] * (at[1] + dims[1] * at[2])];
                values.push(value.clamp(WITHIN[0], WITHIN[1]));
            }
        }
        let is_flat = values.iter().all(|&v| v == values[0]);
        Self { values, is_flat }
    }

    /// Share of the values that are far off another.
    fn shown_off(&self, value: i16) -> f64 {
        let off = self.values.iter().filter(|v| v.abs_diff(value) > OFF_HU).count();
        off as f64 / self.values.len().max(1) as f64
    }

    /// Mean difference of the values where both show tissue, HU; `None` where they hardly do.
    fn apart(&self, other: &Self) -> Option<f64> {
        let pairs = self.values.iter().zip(&other.values);
        let tissue = pairs.filter(|(a, b)| **a > TISSUE && **b > TISSUE);
        let (count, sum) = tissue.fold((0usize, 0u64), |(n, sum), (a, b)| (n + 1, sum + u64::from(a.abs_diff(*b))));
        (count as f64 > SHOWN * self.values.len() as f64).then(|| sum as f64 / count as f64)
    }

    /// Mean difference of the values, HU.
    fn off(&self, other: &Self) -> f64 {
        let sum: u64 = self.values.iter().zip(&other.values).map(|(&a, &b)| u64::from(a.abs_diff(b))).sum();
        sum as f64 / self.values.len().max(1) as f64
    }
}

/// Runs of planes of one value between two that show more than the rim of something.
fn emptied(all: &[Plane]) -> Vec<Range<usize>> {
    let mut out: Vec<Range<usize>> = Vec::new();
    let varied = |k: &usize| !all[*k].is_flat;
    let (Some(first), Some(last)) = ((0..all.len()).find(varied), (0..all.len()).rfind(varied)) else { return out };
    for k in (first..last).filter(|&k| all[k].is_flat) {
        match out.last_mut().filter(|run| run.end == k) {
            Some(run) => run.end = k + 1,
            None => out.push(k..k + 1),
        }
    }
    out.retain(|run| {
        let value = all[run.start].values[0];
        all[run.start - 1].shown_off(value).min(all[run.end].shown_off(value)) > SHOWN
    });
    out
}

/// The planes between which and the next a volume is torn, and by how much they are apart and those beside at most, HU.
fn torn(all: &[Plane]) -> Vec<(usize, [f64; 2])> {
    let steps: Vec<Option<f64>> = all.windows(2).map(|w| w[0].apart(&w[1])).collect();
    let at = |(k, w): (usize, &[Option<f64>])| {
        let beside = [w[0]?, w[1]?, w[3]?, w[4]?].into_iter().fold(0.0, f64::max);
        let own = w[2]?;
        (own > TORN_TIMES * beside + MORE_HU).then_some((k + 2, [own, beside]))
    };
    steps.windows(5).enumerate().filter_map(at).collect()
}

/// By how much a plane is off those beside it, and they off each other, HU, where that is odd.
fn is_odd([before, plane, after]: [&Plane; 3]) -> Option<[f64; 2]> {
    let own = plane.off(before).min(plane.off(after));
    if own < MORE_HU {
        return None;
    }
    let beside = before.off(after);
    (own > TIMES * beside + MORE_HU).then_some([own, beside])
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Grid;

    /// A ball of bone with brain in it, in noise, whose slices along `axis` a fault may change.
    fn head(axis: usize, fault: impl Fn(usize, [usize; 3], i16) -> i16) -> Volume<i16> {
        let grid = Grid::axis_aligned([40, 44, 36], [4.0, 4.0, 5.0], [0.0; 3]).expect("a grid");
        let mut seed = 1u32;
        let mut noise = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 16) as i16 % 40 - 20
        };
        let value = |n: usize| {
            let at = grid.voxel(n);
            let p = grid.centre(at[0], at[1], at[2]).to_array();
            let r = (0..3).map(|a| (p[a] - 80.0).powi(2)).sum::<f64>().sqrt();
            let hu = if r < 65.0 {
                35
            } else if r < 72.0 {
                1200
            } else {
                -1000
            };
            fault(at[axis], at, hu + noise())
        };
        let data = (0..grid.len()).map(value).collect();
        Volume::new(grid, data).expect("as many values")
    }

    /// As [`head`], with a core that turns and shrinks upwards, so that each slice is like the next and no other.
    fn wound(slice: impl Fn(usize) -> usize) -> Volume<i16> {
        let grid = Grid::axis_aligned([40, 44, 36], [4.0, 4.0, 5.0], [0.0; 3]).expect("a grid");
        let value = |n: usize| {
            let [i, j, k] = grid.voxel(n);
            let k = slice(k) as f64;
            let (x, y) = (i as f64 * 4.0 - 81.3, j as f64 * 4.0 - 86.1);
            let (r, turn) = (x.hypot(y), y.atan2(x) - 0.12 * k);
            if r > 72.0 { -1000 } else { (30.0 + 25.0 * (turn * 2.0).cos() + 20.0 * (0.1 * r + 0.15 * k).sin()) as i16 }
        };
        Volume::new(grid, (0..grid.len()).map(value).collect()).expect("as many values")
    }

    #[test]
    fn a_scan_without_some_slices_or_with_a_block_turned_about_had_targets_elsewhere_without_a_word() {
        assert_eq!(told(&wound(|k| k)), Vec::<String>::new());
        let cut = told(&wound(|k| if k < 17 { k } else { k + 5 }));
        assert!(cut.len() == 1 && cut[0].contains("slice 17 of 36 and the next the scan is torn"), "{cut:?}");
        let turned = told(&wound(|k| if (12..22).contains(&k) { 33 - k } else { k }));
        assert!(
            turned.len() == 2 && turned[0].contains("slice 12 of") && turned[1].contains("slice 22 of"),
            "{turned:?}"
        );
    }

    #[test]
    fn air_between_the_head_and_a_ball_beside_it_was_told_as_a_lost_plane() {
        let [r, ball] = [72.0, 12.0];
        let grid = Grid::axis_aligned([60, 44, 36], [4.0, 4.0, 5.0], [0.0; 3]).expect("a grid");
        let value = |n: usize| {
            let [i, j, k] = grid.voxel(n);
            let p = grid.centre(i, j, k);
            let within = |x: f64, r: f64| p.distance(monro_geometry::Point::new(x, 80.0, 80.0)) < r;
            if within(80.0, r) || within(180.0, ball) { 35 } else { -1000 }
        };
        let volume = Volume::new(grid, (0..grid.len()).map(value).collect()).expect("as many values");
        assert!((0..60).any(|i| i > 20 && Plane::of(&volume, 0, i).is_flat && i < 45), "air between them");
        assert_eq!(told(&volume), Vec::<String>::new());
    }

    #[test]
    fn a_slice_lost_scaled_or_of_another_place_was_tissue_without_a_word() {
        for axis in 0..3 {
            assert_eq!(told(&head(axis, |_, _, hu| hu)), Vec::<String>::new());
            let lost = told(&head(axis, |k, _, hu| if k == 17 { 0 } else { hu }));
            assert!(lost.len() == 1 && lost[0].contains("18 of") && lost[0].contains("nothing but 0 HU"), "{lost:?}");
            let two = told(&head(axis, |k, _, hu| if k == 17 || k == 18 { -1000 } else { hu }));
            assert!(two.len() == 1 && two[0].contains("18 of") && two[0].contains(" to 19"), "{two:?}");
            let half = told(&head(axis, |k, at, hu| if k == 17 && at[(axis + 1) % 3] < 18 { 0 } else { hu }));
            assert!(half.len() == 1 && half[0].contains("18 of") && half[0].contains("unlike both"), "{half:?}");
            let scaled = told(&head(axis, |k, _, hu| if k == 17 { hu + 1024 } else { hu }));
            assert!(scaled.len() == 1 && scaled[0].contains("unlike both"), "{scaled:?}");
        }
    }

    #[test]
    fn air_before_and_behind_is_no_lost_slice_and_many_are_counted() {
        let air = head(2, |k, _, hu| if !(6..=30).contains(&k) { -1024 } else { hu });
        assert_eq!(told(&air), Vec::<String>::new());
        let many = told(&head(2, |k, _, hu| if k % 5 == 2 { -1024 } else { hu }));
        assert_eq!(many.len(), NAMED + 1, "{many:?}");
        assert!(many[NAMED].contains("more such planes"), "{many:?}");
    }
}
