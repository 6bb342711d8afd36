//! What lies beyond the head and holds one value throughout: filled in, or cut off at that value, by another program.
//!
//! Programs that turn a volume, or bring it from a round field into a box, put zeros where nothing was scanned. In HU that is
//! water: taken for tissue, it is the skin of a head as large as the box.

use crate::check::TISSUE_HU;
use crate::hu::AIR;
use monro_geometry::Volume;

/// So many of the eight corners hold the value,
const CORNERS: usize = 4;
/// and this part of the voxels at least does so from there on inwards: noise gives no two neighbours the same for long.
const LEAST: f64 = 0.005;

/// Sets to air what holds one value above that of air from the corners inwards, without a gap; says so.
pub(crate) fn emptied(volume: &mut Volume<i16>) -> Option<String> {
    let grid = *volume.grid();
    let end = |axis: usize, is_far: bool| if is_far { grid.dims()[axis] - 1 } else { 0 };
    let corner = |c: usize| grid.index(end(0, c & 1 != 0), end(1, c & 2 != 0), end(2, c & 4 != 0));
    let corners: Vec<usize> = (0..8).map(corner).collect();
    let data = volume.data_mut();
    let held = |value: i16| corners.iter().filter(|&&c| data[c] == value).count();
    let fill = corners.iter().map(|&c| data[c]).find(|&value| value > TISSUE_HU && held(value) >= CORNERS)?;
    let found = flood(data, grid.dims(), corners, fill);
    if (found.len() as f64) < LEAST * data.len() as f64 {
        found.into_iter().for_each(|at| data[at] = fill);
        return None;
    }
    Some(format!(
        "{:.1} % of the scan hold {fill} HU throughout, from its corners inwards: filled in beyond what was scanned, or cut \
         off at that value, by another program; taken for air",
        100.0 * found.len() as f64 / data.len() as f64
    ))
}

/// Sets to air all that hangs together with some places by faces and holds a value; returns where that is.
fn flood(data: &mut [i16], [nx, ny, nz]: [usize; 3], mut found: Vec<usize>, value: i16) -> Vec<usize> {
    found.sort_unstable();
    found.dedup();
    found.retain(|&at| data[at] == value);
    found.iter().for_each(|&at| data[at] = AIR);
    let mut next = 0;
    while let Some(&at) = found.get(next) {
        next += 1;
        let place = [(at % nx, nx, 1), (at / nx % ny, ny, nx), (at / nx / ny, nz, nx * ny)];
        for (x, n, step) in place {
            let near = [(x > 0).then(|| at - step), (x + 1 < n).then(|| at + step)];
            for other in near.into_iter().flatten() {
                if data[other] == value {
                    data[other] = AIR;
                    found.push(other);
                }
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Grid;

    /// A ball of tissue with a cavity of 0 HU in air, in a round field of 90 mm; outside of that `fill`.
    fn scan(fill: i16) -> Volume<i16> {
        let grid = Grid::axis_aligned([80, 76, 30], [2.5, 2.5, 5.0], [-98.0, -93.0, -72.0]).expect("a grid");
        let hu = |n: usize| {
            let [i, j, k] = grid.voxel(n);
            let [x, y, z] = grid.centre(i, j, k).to_array();
            match (x * x + y * y + z * z).sqrt() {
                r if r < 10.0 => 0,
                r if r < 60.0 => 30 + (n % 7) as i16,
                _ if x.hypot(y) < 90.0 => -1000 + (n % 5) as i16,
                _ => fill,
            }
        };
        Volume::new(grid, (0..grid.len()).map(hu).collect()).expect("as many values")
    }

    #[test]
    fn zeros_outside_of_a_round_field_were_the_skin_of_a_head() {
        for fill in [0, 40, 3071] {
            let mut volume = scan(fill);
            let said = emptied(&mut volume).expect("told");
            assert!(said.contains(&format!("hold {fill} HU throughout")), "{said}");
            // The cavity stays, and so does all else.
            assert_eq!(volume, scan(AIR));
        }
    }

    #[test]
    fn air_and_tissue_in_the_corners_stay_as_they_are() {
        for fill in [AIR, -1000] {
            let mut volume = scan(fill);
            assert_eq!(emptied(&mut volume), None);
            assert_eq!(volume, scan(fill));
        }
        // Noise in a scan cut close to the brain: corners may agree, their neighbours do not.
        let grid = *scan(AIR).grid();
        let noise = (0..grid.len()).map(|n| 20 + (n % 11) as i16).collect();
        let mut volume = Volume::new(grid, noise).expect("as many values");
        let [nx, ny, nz] = grid.dims();
        for at in [0, nx - 1, nx * (ny - 1), nx * ny * nz - 1] {
            volume.data_mut()[at] = 30;
        }
        let same = volume.clone();
        assert_eq!(emptied(&mut volume), None);
        assert_eq!(volume, same);
    }
}
