//! Air under the skull, as after an operation: it bounds soft tissue like the air outside, but lies on the brain, not on bone.

use crate::image::{Mask, Raster, dilate, label};

/// Darker is air, HU; at least what is half air in a smoothed scan.
const AIR: f32 = -400.0;
/// Pockets from here to there are looked at, mL: less may be noise, more is no head.
const SIZES_ML: core::ops::Range<f64> = 1.0..250.0;
/// Brain lies so near to the air, voxels of 1 mm, with what is partly air between; a sinus has a plate of bone there.
const NEAR: usize = 4;
/// What is brighter between them is a plate of bone, HU, however thin.
const SOFT: f32 = 100.0;
/// The part of a pocket's own surface that must face the brain so: a layer does with half of it, a sinus whose wall is too thin to be
/// seen in a place with a few percent.
const FACING: f64 = 0.25;
/// So far around a pocket voxels are partly air, voxels of 1 mm.
const RIM: f32 = 2.0;

/// Counts pockets of air that lie on the space inside the skull to it; returns their volume, mL. Voxels brighter than `bone` HU stay
/// what they are.
pub(super) fn take_in(hu: &Raster<f32>, cavity: &mut Mask, nodata: &Mask, bone: f32) -> f64 {
    let air = hu.zip(nodata, |v, n| v < AIR || n).minus(cavity);
    let parts = label(&air);
    let mut found = vec![[0usize; 2]; parts.sizes.len()];
    let mut open = vec![false; parts.sizes.len()];
    open[0] = true;
    for n in (0..air.data.len()).filter(|&n| air.data[n]) {
        let part = parts.labels.data[n] as usize;
        open[part] |= nodata.data[n] || is_at_end(hu, n);
    }
    let is_asked = |l: usize| !open[l] && SIZES_ML.contains(&(parts.sizes[l] as f64 / 1000.0));
    for n in (0..air.data.len()).filter(|&n| air.data[n] && is_asked(parts.labels.data[n] as usize)) {
        if hu.neighbours(n).any(|m| !air.data[m]) {
            let count = &mut found[parts.labels.data[n] as usize];
            count[0] += 1;
            count[1] += usize::from(faces(hu, cavity, n));
        }
    }
    let is_pocket = |l: u32| is_asked(l as usize) && found[l as usize][1] as f64 > FACING * found[l as usize][0] as f64;
    let pockets = parts.keep(is_pocket);
    let voxels = pockets.count();
    if voxels > 0 {
        let whole = dilate(&pockets, RIM);
        for n in 0..cavity.data.len() {
            cavity.data[n] |= whole.data[n] && hu.data[n] < bone && !nodata.data[n];
        }
    }
    voxels as f64 / 1000.0
}

fn is_at_end(hu: &Raster<f32>, n: usize) -> bool {
    hu.voxel(n).into_iter().zip(hu.dims).any(|(i, d)| i == 0 || i + 1 == d)
}

/// Whether the cavity is near along one of the axes, with nothing brighter than soft tissue before it.
fn faces(hu: &Raster<f32>, cavity: &Mask, n: usize) -> bool {
    let [nx, ny, _] = hu.dims;
    hu.voxel(n).into_iter().zip(hu.dims).zip([1, nx, nx * ny]).any(|((at, size), step)| {
        let down = (1..=NEAR.min(at)).map(|k| n - k * step);
        let up = (1..=NEAR.min(size - 1 - at)).map(|k| n + k * step);
        let meets =
            |way: &mut dyn Iterator<Item = usize>| way.take_while(|&m| hu.data[m] < SOFT).any(|m| cavity.data[m]);
        meets(&mut { down }) || meets(&mut { up })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ball of brain in bone in skin, with a layer of air on the brain to one side, and a sinus in the bone to the other.
    fn head() -> (Raster<f32>, Mask, Mask) {
        let mut hu = Raster::filled([80, 80, 80], -1000f32);
        let mut cavity = Mask::filled(hu.dims, false);
        for n in 0..hu.data.len() {
            let [i, j, k] = hu.voxel(n).map(|c| c as f64 - 39.7);
            let r = i.hypot(j).hypot(k);
            let sinus = i < -5.0 && (27.5..33.0).contains(&r) && j.hypot(k) < 14.0;
            let layer = i > 5.0 && (20.0..25.0).contains(&r);
            hu.data[n] = match r {
                _ if sinus || layer => -980.0,
                r if r < 25.0 => 30.0,
                r if r < 34.0 => 900.0,
                r if r < 37.0 => 40.0,
                _ => -1000.0,
            };
            cavity.data[n] = r < 25.0 && !layer;
        }
        let none = Mask::filled(hu.dims, false);
        (crate::image::gaussian(&hu, 0.7), cavity, none)
    }

    #[test]
    fn air_on_the_brain_was_counted_to_the_scalp() {
        let (hu, mut cavity, none) = head();
        let before = cavity.count() as f64 / 1000.0;
        let taken = take_in(&hu, &mut cavity, &none, 400.0);
        let layer = 4.0 / 3.0 * core::f64::consts::PI * (25f64.powi(3) - 20f64.powi(3)) / 1000.0 * 0.39;
        assert!((taken / layer - 1.0).abs() < 0.2, "{taken} of {layer} mL");
        let grown = cavity.count() as f64 / 1000.0 - before;
        assert!(grown >= taken && grown < 1.3 * layer, "{grown} for {taken} mL");
        // The sinus is in bone, and the air outside is open.
        let at = |i: usize| hu.index(i, 40, 40);
        assert!(cavity.data[at(62)] && !cavity.data[at(10)] && !cavity.data[at(2)]);
    }
}
