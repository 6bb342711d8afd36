//! Points in the order of a Morton curve: near on the curve is mostly near in space.

use crate::bounds;

/// Steps of the curve's lattice along an axis: three times 21 bits fill a number.
const STEPS: f64 = 2_097_151.0;

/// The numbers of points along the curve through their bounding box; those in one cell of it in order of their numbers.
pub(super) fn order(points: impl Iterator<Item = [f64; 3]> + Clone) -> Vec<u32> {
    let [low, high] = bounds(points.clone()).unwrap_or_default();
    let longest = (0..3).map(|a| high[a] - low[a]).fold(f64::MIN_POSITIVE, f64::max);
    // What is not finite ends at 0 or at the last step.
    let step = |p: [f64; 3], a: usize| ((p[a] - low[a]) / longest * STEPS) as u64;
    let code = |p: [f64; 3]| (0..3).fold(0, |code, a| code | spread(step(p, a).min(STEPS as u64)) << a);
    let mut keys: Vec<(u64, u32)> = points.enumerate().map(|(n, p)| (code(p), n as u32)).collect();
    keys.sort_unstable();
    keys.into_iter().map(|(_, n)| n).collect()
}

/// The lowest 21 bits of a number, two zeros between each.
fn spread(x: u64) -> u64 {
    let stages = [(32, 0x001f_0000_0000_ffff), (16, 0x001f_0000_ff00_00ff), (8, 0x100f_00f0_0f00_f00f)];
    let last = [(4, 0x10c3_0c30_c30c_30c3), (2, 0x1249_2492_4924_9249)];
    stages.into_iter().chain(last).fold(x, |x, (by, mask)| (x | x << by) & mask)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_of_three_numbers_do_not_meet_and_none_is_lost() {
        let all = (1 << 21) - 1;
        assert_eq!([0, 1, 2].map(|a| spread(all) << a).iter().fold(0, |sum, x| sum ^ x), (1 << 63) - 1);
        assert_eq!(spread(0b1011), 0b1_000_001_001);
    }

    #[test]
    fn what_is_near_on_the_curve_is_near_in_space() {
        // Corners of a cube of eight points each: all of one corner stand together.
        let at = |n: usize| [0, 1, 2].map(|a| (n >> a & 1) as f64 * 100.0 + (n >> 3 >> a & 1) as f64);
        let order = order((0..64).map(at));
        assert!(order.chunks(8).all(|part| part.iter().all(|n| n % 8 == part[0] % 8)), "{order:?}");
        assert!(super::order([[f64::NAN; 3], [1.0, f64::INFINITY, 0.0], [0.0; 3]].into_iter()).len() == 3);
    }
}
