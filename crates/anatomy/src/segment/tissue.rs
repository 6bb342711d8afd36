//! Thresholds from the scan's own values.

use super::error::SegmentError;
use super::working::Working;
use crate::image::{Mask, Raster};

/// Everything above is bone, whatever the scan (only used to find the scan's own bone).
const SURELY_BONE: f32 = 300.0;
/// A skull has at least this, mL (an infant's has about 150).
const LEAST_BONE_ML: f64 = 60.0;
/// Parts of the step from soft tissue to bone. A wall is already what reaches a fifth of it, so that thin plates, dimmed
/// by partial volume, still close; the surface of bone lies near half way, a little lower since bone is thin.
const WALL_EDGE: f32 = 0.2;
const BONE_EDGE: f32 = 0.4;

/// Thresholds between air, soft tissue and bone, HU.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tissue {
    /// Soft tissue above, air below.
    pub(crate) air: f32,
    /// Bone above, for closing the skull.
    pub(crate) wall: f32,
    /// Bone above, for its surface.
    pub(crate) bone: f32,
}

impl Tissue {
    /// Measures a scan.
    ///
    /// # Errors
    /// [`SegmentError::NoSkull`].
    pub(crate) fn of(working: &Working) -> Result<Self, SegmentError> {
        let seen = |low: f32, high: f32| -> Vec<f32> {
            let values = working.hu.data.iter().zip(&working.nodata.data);
            values.filter(|(v, n)| **v > low && **v < high && !**n).map(|(v, _)| *v).collect()
        };
        let mut bone = seen(SURELY_BONE, f32::INFINITY);
        let bone_ml = bone.len() as f64 / 1000.0;
        let mut soft = seen(-20.0, 90.0);
        if bone_ml < LEAST_BONE_ML || soft.is_empty() {
            return Err(SegmentError::NoSkull { bone_ml, threshold: SURELY_BONE.into(), needed_ml: LEAST_BONE_ML });
        }
        let (soft, bone) = (median(&mut soft), median(&mut bone));
        let mut air = seen(-2000.0, -700.0);
        let air = if air.is_empty() { -1000.0 } else { median(&mut air) };
        let level = |part: f32| soft + part * (bone - soft);
        Ok(Self { air: (air + soft) / 2.0, wall: level(WALL_EDGE), bone: level(BONE_EDGE) })
    }
}

/// The median; reorders the values. Must not be empty.
pub(crate) fn median(values: &mut [f32]) -> f32 {
    quantile(values, 0.5)
}

/// The `q`-quantile, `0..=1`; reorders the values. Zero when empty.
pub(crate) fn quantile(values: &mut [f32], q: f64) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let at = ((values.len() - 1) as f64 * q).round() as usize;
    *values.select_nth_unstable_by(at, f32::total_cmp).1
}

/// The commonest value between -20 and 80 HU of the voxels in a set: the brain's mode.
pub(crate) fn brain_mode(hu: &Raster<f32>, inside: impl Fn(usize) -> bool) -> f32 {
    const BINS: usize = 200;
    let mut histogram = [0f32; BINS];
    for (_, &v) in hu.data.iter().enumerate().filter(|(n, _)| inside(*n)) {
        let bin = (v + 20.0) * 2.0;
        if bin >= 0.0 && bin < BINS as f32 {
            histogram[bin as usize] += 1.0;
        }
    }
    // A window of 2.5 HU: wide enough for a peak that noise does not move, narrow against the 25 HU to fluid.
    let window = |b: usize| histogram[b.saturating_sub(2)..(b + 3).min(BINS)].iter().sum::<f32>();
    let best = (0..BINS).fold(0, |best, b| if window(b) > window(best) { b } else { best });
    (best as f32 + 0.5) / 2.0 - 20.0
}

/// Bone, and all that bounds soft tissue: bone, air, and the end of the data.
pub(crate) fn wall(working: &Working, smooth: &Raster<f32>, tissue: Tissue) -> Mask {
    let mut mask = working.nodata.clone();
    for (n, wall) in mask.data.iter_mut().enumerate() {
        *wall |= working.hu.data[n] > tissue.wall || smooth.data[n] < -150.0;
    }
    mask
}
