//! Whether there is skin where the nasion is sought: a face that was cut off for anonymity leaves bone and cavities bare,
//! and a head that was cut and turned a plane without a nose.

use super::profile::{Profile, Skin};
use monro_geometry::{Patient, Point, Vector};

/// Rays from the height of the foramina: degrees above forward, mm aside. They meet brow, root of the nose and cheeks.
const ANGLES: [f64; 8] = [-45.0, -38.0, -31.0, -24.0, -17.0, -10.0, -3.0, 4.0];
const ASIDE: [f64; 7] = [-24.0, -16.0, -8.0, 0.0, 8.0, 16.0, 24.0];
/// Skin is at least 3 mm thick there, and has no more than so many HU; voxels of a millimetre blur bone into its inner half.
const UNDER_MM: f64 = 1.5;
const BONE_HU: f64 = 200.0;
/// In larger voxels than this, mm, nothing can be told.
const FINE_MM: f64 = 2.6;
/// Part of the places that are bare by chance: none in three heads and three phantoms.
const BARE: f64 = 0.06;
/// A nose is sought so many degrees below the nasion, and what is beside it so many mm aside. It stands out by this at least,
/// mm: on three heads on 35 other grids in all by 6 to 27 below what was the nasion, by -1 to 4 below what was none,
/// and 8 where that lay on the brow, close above the nose.
const BELOW: [f64; 3] = [3.0, 6.0, 9.0];
const BESIDE: [f64; 2] = [-16.0, 16.0];
const NOSE_MM: f64 = 5.0;
/// What either means, and the way out.
const NOT_TRUSTED: &str = "so the nasion is not to be trusted and entry points may be off by 30 mm; take the scan as it was \
                           before, or give the path with --plan FILE.mrk.json";

/// A sentence where bone lies bare at the front of the head; `left` is the direction across the profile.
pub(super) fn bare_finding(skin: &Skin<'_>, profile: &Profile, left: Vector<Patient>) -> Option<String> {
    let bare = bare(skin, profile, left)?;
    (bare > BARE).then(|| {
        format!(
            "the front of the head has bone without skin over it ({:.0} % of the places around the nasion): the face seems to \
             be removed or cut off, {NOT_TRUSTED}",
            100.0 * bare
        )
    })
}

/// Part of the places around the nasion at which bone is bare; `None` where too little is shown to tell.
fn bare(skin: &Skin<'_>, profile: &Profile, left: Vector<Patient>) -> Option<f64> {
    if skin.coarsest_mm() > FINE_MM {
        return None;
    }
    let under = |(degrees, aside): (f64, f64)| {
        let (at, out) = left_at(skin, profile.ray(degrees), left * aside)?;
        skin.hu(at - out * UNDER_MM)
    };
    let rays = ANGLES.into_iter().flat_map(|degrees| ASIDE.map(|aside| (degrees, aside)));
    let found: Vec<f64> = rays.filter_map(under).collect();
    let bare = found.iter().filter(|&&hu| hu > BONE_HU).count();
    (found.len() >= ANGLES.len() * ASIDE.len() / 2).then(|| bare as f64 / found.len() as f64)
}

/// Where a ray of the profile, moved aside, leaves the head, and its direction.
fn left_at(
    skin: &Skin<'_>,
    (middle, direction): (Point<Patient>, Vector<Patient>),
    aside: Vector<Patient>,
) -> Option<(Point<Patient>, Vector<Patient>)> {
    let from = middle + aside;
    Some((from + direction * skin.leave(from, direction)?, direction))
}

/// A sentence where no nose stands out below the nasion, a sample of the profile; none where too little is shown to tell.
pub(super) fn nose_finding(skin: &Skin<'_>, profile: &Profile, left: Vector<Patient>, nasion: f64) -> Option<String> {
    let angle = Profile::angle(nasion);
    let (base, out) = profile.ray(angle);
    let height = |(degrees, aside): (f64, f64)| {
        let (at, _) = left_at(skin, profile.ray(degrees), left * aside)?;
        Some((at - base).dot(out))
    };
    let mean = |asides: &[f64]| {
        let rays = BELOW.into_iter().flat_map(|below| asides.iter().map(move |aside| (angle - below, *aside)));
        let heights: Vec<f64> = rays.filter_map(height).collect();
        let enough = 2 * heights.len() > BELOW.len() * asides.len();
        enough.then(|| heights.iter().sum::<f64>() / heights.len() as f64)
    };
    let nose = mean(&[0.0])? - mean(&BESIDE)?;
    (nose < NOSE_MM).then(|| {
        format!(
            "no nose stands out below the nasion ({nose:.1} mm over what is beside it): the face seems to be cut off, \
             {NOT_TRUSTED}"
        )
    })
}
