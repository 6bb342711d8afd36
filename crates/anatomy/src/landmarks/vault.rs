//! Whether there is skin over the vault: where a skull was cut out of its scan, its blurred outermost voxels pass for some.

use super::LandmarkError;
use super::profile::Skin;
use super::surroundings::Surroundings;
use monro_geometry::{Patient, Structure, Vector};

/// Rays from the foramina: degrees above the horizontal, and their step about the vertical.
const UP: [f64; 6] = [10.0, 22.0, 34.0, 46.0, 58.0, 70.0];
const STEP: u16 = 15;
const RAYS: usize = UP.len() * 360 / STEP as usize;
/// Bone is sought so far below the skin, mm, in such steps: muscle at the temples is 20 mm thick.
const DEEP: f64 = 35.0;
const FINE: f64 = 0.25;
/// Skin over the vault is 3 mm thick and more. Less than this is none, mm,
const NONE_MM: f64 = 1.5;
/// and so is less than so many voxels, unless it is as thick as skin, mm: blurred bone takes one, 1.4 in a template of 2 mm.
const NONE_VOXELS: f64 = 1.5;
const SKIN_MM: f64 = 3.0;

/// # Errors
/// [`LandmarkError::BareSkull`] where most of the vault has no skin over it.
pub(super) fn check(skin: &Skin<'_>, surroundings: &Surroundings<'_>) -> Result<(), LandmarkError> {
    let rays = UP.into_iter().flat_map(|up| (0..360).step_by(STEP.into()).map(move |about| [up, f64::from(about)]));
    let ways = rays.map(|ray| surroundings.pose.direction(towards(ray)));
    let mut covers: Vec<Cover> = ways.filter_map(|way| cover(skin, surroundings, way)).collect();
    let bare = covers.iter().filter(|cover| cover.is_none()).count();
    if covers.len() < RAYS / 4 || 2 * bare <= covers.len() {
        return Ok(());
    }
    covers.sort_by(|a, b| a.mm.total_cmp(&b.mm));
    Err(LandmarkError::BareSkull { thickness_mm: covers[covers.len() / 2].mm })
}

/// So many degrees above the horizontal, and about the vertical from forward to the left: lateral, posterior, superior.
fn towards(ray: [f64; 2]) -> [f64; 3] {
    let [up, about] = ray.map(f64::to_radians);
    [about.sin() * up.cos(), -about.cos() * up.cos(), up.sin()]
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
fn cover(skin: &Skin<'_>, surroundings: &Surroundings<'_>, way: Vector<Patient>) -> Option<Cover> {
    let from = surroundings.origin();
    let out = skin.leave(from, way)?;
    let is_bone = |depth: &f64| surroundings.structure(from + way * (out - depth)) == Structure::Skull;
    let mm = (0..(DEEP / FINE) as usize).map(|n| n as f64 * FINE).find(is_bone)?;
    Some(Cover { mm, voxel_mm: skin.voxel_mm(way) })
}
