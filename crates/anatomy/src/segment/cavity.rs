//! The space inside the skull.
//!
//! A ball of 18 mm rolls inside the braincase but fits through no opening of a skull, not even the foramen magnum; what
//! it sweeps is brain for sure. Smaller balls then enter the corners, each only a bounded way beyond what is already
//! known, so that a leak through an orbit, a craniotomy or the foramen magnum stays short. Half-spaces around the first
//! sweep bridge defects of the vault, and the neck is cut where the cross-section has narrowed to a foramen magnum.

use super::error::SegmentError;
use super::working::any_in_block;
use crate::image::{Mask, Raster, dilate, distance_to, distance_to_false, fill_holes, label, largest};
use monro_geometry::d3::dot;

/// Voxels of the coarse raster, mm.
const COARSE: f32 = 2.0;
/// First ball, then radius, reach beyond what is known (mm), and whether the neck is cut afterwards.
const FIRST_BALL: f32 = 18.0;
const BALLS: [(f32, f32, bool); 3] = [(12.0, 14.0, false), (8.0, 10.0, true), (5.0, 6.0, false)];
/// A foramen magnum has 600 to 1100 mm2; the posterior fossa above it soon has twice that.
const NECK_AREA: f64 = 1000.0;
/// Room around the first sweep, mm: small over the vault, more below (tonsils, middle fossa).
const MARGIN: f64 = 5.0;
const MARGIN_BELOW: f64 = 12.0;
/// Last, unswept step to the bone on the fine raster, mm.
const LAST_REACH: f32 = 3.5;
/// A braincase has at least this, mL.
const LEAST_ML: f64 = 300.0;

/// The space inside the skull, and how it was closed.
#[derive(Debug)]
pub(crate) struct Cavity {
    pub(crate) mask: Mask,
    /// Whether the neck had to be cut (otherwise the scan or the bone ends it).
    pub(crate) neck_cut: bool,
}

/// Finds it from the walls (bone, air, end of the data) on a raster of 1 mm voxels; `bone` tells the bone's own surface,
/// which lies a little deeper than the wall's.
///
/// # Errors
/// [`SegmentError::NoCavity`].
pub(crate) fn cavity(wall: &Mask, nodata: &Mask, bone: impl Fn(usize) -> bool) -> Result<Cavity, SegmentError> {
    let mut walls = any_in_block(wall, 2);
    let mut room = distance_to_false(&walls.not());
    let core = largest(&room.map(|d| d * COARSE > FIRST_BALL));
    let mut known = dilate(&core, FIRST_BALL / COARSE).minus(&walls);
    let found_ml = known.count() as f64 * f64::from(COARSE).powi(3) / 1000.0;
    if found_ml < LEAST_ML {
        return Err(SegmentError::NoCavity { found_ml, needed_ml: LEAST_ML });
    }
    bridge_defects(&known, &mut walls, &mut room);
    let mut neck_cut = false;
    for (ball, reach, cuts_neck) in BALLS {
        let near = distance_to(&known);
        let centres = room.zip(&near, |d, n| d * COARSE > ball && n * COARSE <= reach);
        let centres = label(&centres.or(&known)).touching(&core).and(&centres);
        known = known.or(&dilate(&centres, ball / COARSE).minus(&walls));
        if cuts_neck && let Some(level) = neck_level(&known) {
            neck_cut = true;
            cut_below(level, &mut known, &mut walls, &mut room);
        }
    }
    let mask = to_surface(&to_fine(&known, &walls, wall), wall, nodata, bone);
    Ok(Cavity { mask, neck_cut })
}

/// Makes walls beyond half-spaces that touch the known space with a margin.
fn bridge_defects(known: &Mask, walls: &mut Mask, room: &mut Raster<f32>) {
    let directions = sphere_directions(400);
    let rim: Vec<[f64; 3]> = (0..known.data.len())
        .filter(|&n| known.data[n] && known.neighbours(n).any(|m| !known.data[m]))
        .map(|n| known.voxel(n).map(|c| c as f64))
        .collect();
    let support: Vec<f64> = directions
        .iter()
        .map(|d| {
            let margin = if d[2] < -0.6 { MARGIN_BELOW } else { MARGIN };
            rim.iter().map(|p| dot(*p, *d)).fold(f64::NEG_INFINITY, f64::max) + margin / f64::from(COARSE)
        })
        .collect();
    for n in 0..walls.data.len() {
        if walls.data[n] || known.data[n] {
            continue;
        }
        let p = known.voxel(n).map(|c| c as f64);
        if directions.iter().zip(&support).any(|(d, s)| dot(p, *d) > *s) {
            walls.data[n] = true;
            room.data[n] = 0.0;
        }
    }
}

/// Directions spread evenly over the sphere (Fibonacci lattice).
pub(crate) fn sphere_directions(count: usize) -> Vec<[f64; 3]> {
    let golden = core::f64::consts::PI * (1.0 + 5f64.sqrt());
    (0..count)
        .map(|i| {
            let z = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
            let (s, c) = (golden * (i as f64 + 0.5)).sin_cos();
            let r = (1.0 - z * z).sqrt();
            [r * c, r * s, z]
        })
        .collect()
}

/// The highest level below the widest cross-section where the known space is no wider than a foramen magnum.
fn neck_level(known: &Mask) -> Option<usize> {
    let sheet = known.dims[0] * known.dims[1];
    let areas: Vec<f64> = known
        .data
        .chunks(sheet)
        .map(|s| s.iter().filter(|&&v| v).count() as f64 * f64::from(COARSE * COARSE))
        .collect();
    let widest = (0..areas.len()).fold(0, |best, k| if areas[k] > areas[best] { k } else { best });
    let level = (0..widest).rev().find(|&k| areas[k] < NECK_AREA)?;
    // Where the space simply ends in bone or data there is nothing to cut.
    (areas[level] > 0.0).then_some(level)
}

fn cut_below(level: usize, known: &mut Mask, walls: &mut Mask, room: &mut Raster<f32>) {
    let end = (level + 1) * known.dims[0] * known.dims[1];
    known.data[..end].fill(false);
    walls.data[..end].fill(true);
    room.data[..end].fill(0.0);
}

/// From the coarse space to the bone on the fine raster.
fn to_fine(known: &Mask, walls: &Mask, wall: &Mask) -> Mask {
    let reach = distance_to(known).map(|d| d * COARSE);
    // Walls that only the coarse raster has (half-spaces, the neck's cut) hold on the fine one too.
    let bone = any_in_block(wall, 2);
    let mut mask = Mask::filled(wall.dims, false);
    for n in 0..mask.data.len() {
        if wall.data[n] {
            continue;
        }
        let v = wall.voxel(n);
        let c = reach.index(v[0] / 2, v[1] / 2, v[2] / 2);
        let artificial = walls.data[c] && !bone.data[c];
        mask.data[n] = !artificial && reach.linear(v.map(|c| (c as f64 - 0.5) / 2.0)) <= LAST_REACH;
    }
    fill_holes(&largest(&mask))
}

/// One voxel more where the wall is not yet bone.
fn to_surface(mask: &Mask, wall: &Mask, nodata: &Mask, bone: impl Fn(usize) -> bool) -> Mask {
    let mut out = mask.clone();
    for n in 0..out.data.len() {
        out.data[n] |= wall.data[n] && !nodata.data[n] && !bone(n) && mask.neighbours(n).any(|m| mask.data[m]);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A shell of bone with a foramen below, on a neck of soft tissue.
    fn head(defect: bool) -> (Mask, Mask) {
        let mut wall = Mask::filled([170, 180, 190], false);
        for n in 0..wall.data.len() {
            let [i, j, k] = wall.voxel(n).map(|c| c as f64);
            let r = ((i - 85.0) / 70.0).hypot((j - 90.0) / 80.0).hypot((k - 115.0) / 60.0);
            let across = (i - 85.0).hypot(j - 90.0);
            let foramen = k < 80.0 && across < 15.0;
            let hole = defect && j > 90.0 && (i - 85.0).hypot(k - 115.0) < 20.0;
            let air = r > 1.25 && !(k < 80.0 && across < 60.0);
            wall.data[n] = (1.0..1.1).contains(&r) && !foramen && !hole || air;
        }
        let nodata = Mask::filled(wall.dims, false);
        (wall, nodata)
    }

    #[test]
    fn the_space_is_filled_and_neither_neck_nor_defect_leak() {
        let volume = 4.0 / 3.0 * core::f64::consts::PI * 70.0 * 80.0 * 60.0;
        for defect in [false, true] {
            let (wall, nodata) = head(defect);
            let found = cavity(&wall, &nodata, |_| true).expect("cavity");
            let ratio = found.mask.count() as f64 / volume;
            assert!(found.neck_cut);
            assert!((0.97..1.03).contains(&ratio), "{defect}: {ratio}");
        }
    }

    #[test]
    fn soft_tissue_without_skull_is_no_cavity() {
        let wall = Mask::filled([30, 30, 30], true);
        let nodata = Mask::filled(wall.dims, false);
        assert!(matches!(cavity(&wall, &nodata, |_| true), Err(SegmentError::NoCavity { .. })));
    }
}
