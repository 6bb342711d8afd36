//! Is this volume large enough to be a head?

use crate::{ScanError, Source};
use monro_geometry::{Patient, Vector, Volume};

/// Least field of view, mm. The smallest that shows a whole adult cranium is about 160 x 200 x 100 mm; a scan cut at the
/// skull base and the vertex keeps 60 mm around the ventricles.
const FIELD_MM: [f64; 3] = [130.0, 130.0, 60.0];
/// Least tissue, mm.
const TISSUE_MM: [f64; 3] = [125.0, 105.0, 60.0];
/// Most tissue, mm: a large adult from head to foot with arms and table.
const BODY_MM: [f64; 3] = [2300.0, 900.0, 700.0];
/// A head is at least as large as a circle of this circumference cut across (a child of three months); a knee is not.
const CIRCUMFERENCE_MM: f64 = 400.0;
/// Skin and everything denser.
pub(crate) const TISSUE_HU: i16 = -300;
/// Values of soft tissue with 1024 added, and the most of a head's bone that has them, ml: 40 ml of a skull of 500 ml
/// have been seen, the brain alone has 1000 ml.
const LIFTED_HU: core::ops::RangeInclusive<i16> = 1000..=1110;
const MOST_LIFTED_ML: f64 = 400.0;
/// Skin and everything denser with 1024 added, and the share of that from which soft tissue has such values: most of a head
/// is soft, of bone it is a tenth. A spacing that is too large makes of that a large volume, too.
const LIFTED_TISSUE_HU: i16 = TISSUE_HU + 1024;
const LIFTED_SHARE: f64 = 0.4;
/// A plane with less tissue shows noise, or the head rest, mm2.
const PLANE_MM2: f64 = 500.0;

/// Refuses a volume whose field of view or tissue is too small for a head, or too large for a body. Says nothing about
/// volumes between: a head with neck and shoulders is a head.
///
/// # Errors
/// [`ScanError::NotAHead`], [`ScanError::ThinSection`], [`ScanError::TooLarge`] with the sizes measured.
pub fn head_extent_check(volume: &Volume<i16>) -> Result<(), ScanError> {
    extent_check(volume, &profiles(volume))
}

/// The same, by the volume's [`profiles`].
pub(crate) fn extent_check(volume: &Volume<i16>, profiles: &[Vec<u64>; 3]) -> Result<(), ScanError> {
    let (dims, spacing) = (volume.grid().dims(), volume.grid().spacing());
    let field = core::array::from_fn(|a| dims[a] as f64 * spacing[a]);
    enough("the field of view", field, FIELD_MM)?;
    let pixel = [spacing[1] * spacing[2], spacing[0] * spacing[2], spacing[0] * spacing[1]];
    let extent = core::array::from_fn(|a| {
        let dense = |&&n: &&u64| n as f64 * pixel[a] >= PLANE_MM2;
        let first = profiles[a].iter().position(|n| dense(&n)).unwrap_or(0);
        let last = profiles[a].iter().rposition(|n| dense(&n)).map_or(0, |l| l + 1);
        last.saturating_sub(first) as f64 * spacing[a]
    });
    enough("the tissue in it", extent, TISSUE_MM)?;
    no_more_than_a_body(extent, spacing)?;
    let axis = towards_head(volume);
    let area = profiles[axis].iter().max().map_or(0.0, |&n| n as f64 * pixel[axis]);
    let needed = CIRCUMFERENCE_MM * CIRCUMFERENCE_MM / (4.0 * core::f64::consts::PI);
    if area < needed {
        return Err(ScanError::ThinSection { area_cm2: area / 100.0, needed_cm2: needed / 100.0 });
    }
    Ok(())
}

/// Refuses a scan whose values are 1024 too high: brain, muscle and skin then have those of dense bone. Nothing else does.
pub(crate) fn intercept_check(volume: &Volume<i16>) -> Result<(), ScanError> {
    let lifted = volume.data().iter().filter(|v| LIFTED_HU.contains(v)).count() as f64;
    let lifted_ml = lifted * volume.grid().voxel_volume() / 1000.0;
    if lifted_ml <= MOST_LIFTED_ML {
        return Ok(());
    }
    let dense = volume.data().iter().filter(|&&v| v > LIFTED_TISSUE_HU).count() as f64;
    let is_soft = lifted > LIFTED_SHARE * dense;
    if is_soft { Err(ScanError::Lifted { lifted_ml, most_ml: MOST_LIFTED_ML }) } else { Ok(()) }
}

/// The refusal that the field of view alone makes certain.
pub(crate) fn foresee(source: &Source) -> Option<ScanError> {
    let extent = |a: usize| source.native_dims[a] as f64 * source.native_spacing_mm[a];
    enough("the field of view", [extent(0), extent(1), extent(2)], FIELD_MM).err()
}

fn no_more_than_a_body(mut extent_mm: [f64; 3], spacing_mm: [f64; 3]) -> Result<(), ScanError> {
    extent_mm.sort_by(|a, b| b.total_cmp(a));
    if extent_mm.iter().zip(&BODY_MM).any(|(e, most)| e > most) {
        return Err(ScanError::TooLarge { extent_mm, most_mm: BODY_MM, spacing_mm });
    }
    Ok(())
}

fn enough(what: &'static str, mut extent_mm: [f64; 3], needed_mm: [f64; 3]) -> Result<(), ScanError> {
    extent_mm.sort_by(|a, b| b.total_cmp(a));
    if extent_mm.iter().zip(&needed_mm).any(|(e, n)| e < n) {
        return Err(ScanError::NotAHead { what, extent_mm, needed_mm });
    }
    Ok(())
}

/// The index axis that runs most nearly from foot to head.
fn towards_head(volume: &Volume<i16>) -> usize {
    let cosine = |a| {
        let c = Vector::<Patient>::from_array(volume.grid().patient_from_voxel().linear.column(a));
        c.z.abs() / c.norm()
    };
    (0..3).fold(2, |best, a| if cosine(a) > cosine(best) { a } else { best })
}

/// Number of tissue voxels in every plane across each index axis.
pub(crate) fn profiles(volume: &Volume<i16>) -> [Vec<u64>; 3] {
    let dims = volume.grid().dims();
    let mut out = dims.map(|d| vec![0u64; d]);
    for (r, row) in volume.data().chunks(dims[0]).enumerate() {
        let mut count = 0;
        for (total, &hu) in out[0].iter_mut().zip(row) {
            let tissue = u64::from(hu > TISSUE_HU);
            *total += tissue;
            count += tissue;
        }
        out[1][r % dims[1]] += count;
        out[2][r / dims[1]] += count;
    }
    out
}
