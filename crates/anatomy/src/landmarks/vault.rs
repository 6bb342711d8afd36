//! Whether there is skin over the vault: where a skull was cut out of its scan, its blurred outermost voxels pass for some.

use super::LandmarkError;
use super::profile::{Profile, Skin};
use monro_geometry::{Patient, Structure, Vector};

/// Rays from the height of the foramina: degrees above the horizontal, and their step about the vertical.
const UP: [f64; 6] = [10.0, 22.0, 34.0, 46.0, 58.0, 70.0];
const STEP: usize = 15;
const RAYS: usize = UP.len() * 360 / STEP;
/// Bone is sought so far below the skin, mm, in such steps: muscle at the temples is 20 mm thick.
const DEEP: f64 = 35.0;
const FINE: f64 = 0.25;
/// Skin over the vault is 3 mm thick and more. Less than this is none, mm,
const NONE_MM: f64 = 1.5;
/// and so is less than so many voxels, unless it is as thick as skin, mm: blurred bone takes one, 1.4 in a template of 2 mm.
const NONE_VOXELS: f64 = 1.5;
const SKIN_MM: f64 = 3.0;

/// `left` is the direction across the profile.
///
/// # Errors
/// [`LandmarkError::BareSkull`] where most of the vault has no skin over it.
pub(super) fn check(skin: &Skin<'_>, profile: &Profile, left: Vector<Patient>) -> Result<(), LandmarkError> {
    let rays = UP.into_iter().flat_map(|up| (0..360).step_by(STEP).map(move |about| [up, f64::from(about as u16)]));
    let mut covers: Vec<Cover> = rays.filter_map(|ray| cover(skin, direction(profile, left, ray), profile)).collect();
    let bare = covers.iter().filter(|cover| cover.is_none()).count();
    if covers.len() < RAYS / 4 || 2 * bare <= covers.len() {
        return Ok(());
    }
    covers.sort_by(|a, b| a.mm.total_cmp(&b.mm));
    Err(LandmarkError::BareSkull { thickness_mm: covers[covers.len() / 2].mm })
}

/// So many degrees above the horizontal, and about the vertical from forward to the left.
fn direction(profile: &Profile, left: Vector<Patient>, [up, about]: [f64; 2]) -> Vector<Patient> {
    let ([forward, vertical], [up, about]) = ([0.0, 90.0].map(|a| profile.ray(a).1), [up, about].map(f64::to_radians));
    (forward * about.cos() + left * about.sin()) * up.cos() + vertical * up.sin()
}

/// What lies over the bone in a direction.
struct Cover {
    mm: f64,
    /// Length of a voxel in that direction.
    voxel_mm: f64,
}

impl Cover {
    fn is_none(&self) -> bool {
        self.mm < NONE_MM.max(SKIN_MM.min(NONE_VOXELS * self.voxel_mm))
    }
}

/// `None` where the scan ends before the skin does, or no bone lies below it.
fn cover(skin: &Skin<'_>, direction: Vector<Patient>, profile: &Profile) -> Option<Cover> {
    let from = profile.ray(0.0).0;
    let out = skin.leave(from, direction)?;
    let is_bone = |depth: &f64| skin.structure(from + direction * (out - depth)) == Some(Structure::Skull);
    let mm = (0..(DEEP / FINE) as usize).map(|n| n as f64 * FINE).find(is_bone)?;
    Some(Cover { mm, voxel_mm: skin.voxel_mm(direction) })
}
