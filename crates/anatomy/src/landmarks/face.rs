//! Whether there is skin where the nasion is sought: a face that was cut off for anonymity leaves bone and cavities bare,
//! and a head that was cut and turned a plane.

use super::profile::{Profile, Skin};
use monro_geometry::{Patient, Plane, Point, Vector};

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
/// Degrees below the nasion at which nose and sockets are met, and how far from flat these are at least, mm (root mean square):
/// 2.4 to 8.9 on three heads, turned and cut in thirty ways; planes of cuts have 0.4 to 1.4 in voxels up to 5 mm.
const BELOW: [f64; 3] = [3.0, 6.0, 9.0];
const FLAT_MM: f64 = 1.8;
/// So many places tell.
const ENOUGH: usize = 12;

/// A sentence where bone lies bare at the front of the head; `left` is the direction across the profile.
pub(super) fn bare_finding(skin: &Skin<'_>, profile: &Profile, left: Vector<Patient>) -> Option<String> {
    let bare = bare(skin, profile, left)?;
    (bare > BARE).then(|| {
        format!(
            "the front of the head has bone without skin over it ({:.0} % of the places around the nasion): the face seems to \
             be removed or cut off, so the nasion is not to be trusted and entry points may be off by 30 mm; take the scan as it \
             was before, or give the path with --plan FILE.mrk.json",
            100.0 * bare
        )
    })
}

/// Part of the places around the nasion at which bone is bare; `None` where too little is shown to tell.
fn bare(skin: &Skin<'_>, profile: &Profile, left: Vector<Patient>) -> Option<f64> {
    if skin.coarsest_mm() > FINE_MM {
        return None;
    }
    let under = |(degrees, aside): (f64, f64)| -> Option<f64> {
        let (middle, direction) = profile.ray(degrees);
        let from = middle + left * aside;
        skin.hu(from + direction * (skin.leave(from, direction)? - UNDER_MM))
    };
    let rays = ANGLES.into_iter().flat_map(|degrees| ASIDE.map(|aside| (degrees, aside)));
    let found: Vec<f64> = rays.filter_map(under).collect();
    let bare = found.iter().filter(|&&hu| hu > BONE_HU).count();
    (found.len() >= ANGLES.len() * ASIDE.len() / 2).then(|| bare as f64 / found.len() as f64)
}

/// A sentence where the skin below the nasion, a sample of the profile, is a plane.
pub(super) fn flat_finding(skin: &Skin<'_>, profile: &Profile, left: Vector<Patient>, nasion: f64) -> Option<String> {
    let place = |degrees: f64, aside: f64| {
        let (middle, direction) = profile.ray(degrees);
        let from = middle + left * aside;
        Some(from + direction * skin.leave(from, direction)?)
    };
    let angle = Profile::angle(nasion);
    let places = BELOW.into_iter().flat_map(|below| ASIDE.map(|aside| place(angle - below, aside)));
    let places: Vec<Point<Patient>> = places.flatten().collect();
    let off = off_plane(&places, profile.ray(angle).1)?;
    (places.len() >= ENOUGH && off < FLAT_MM).then(|| {
        format!(
            "below the nasion, where the nose should be, the head ends in a plane ({off:.1} mm from flat): the face seems to be \
             cut off, so the nasion is not to be trusted and entry points may be off by 30 mm; take the scan as it was before, or \
             give the path with --plan FILE.mrk.json"
        )
    })
}

/// How far places lie from the plane that fits them best, root mean square, mm; `out` is a way that it faces.
fn off_plane(places: &[Point<Patient>], out: Vector<Patient>) -> Option<f64> {
    let first = places.first()?;
    let count = places.len() as f64;
    let middle = *first + places.iter().fold(Vector::ZERO, |sum, p| sum + (*p - *first)) / count;
    let plane = Plane::fitted(middle, out, places.iter().copied())?;
    Some((places.iter().map(|p| plane.signed_distance(*p).powi(2)).sum::<f64>() / count).sqrt())
}
