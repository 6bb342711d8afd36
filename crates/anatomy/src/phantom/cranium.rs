//! The bony box: the cranial cavity, the skull around it and the bones of the face.

use super::shapes::{At, at, capsule, ellipse, ellipsoid, folded, join, meet, without};

/// Height in the head's frame below which the canal of the cord is no longer intracranial: the foramen magnum.
pub(super) const FORAMEN_MAGNUM_Z: f64 = -74.0;

/// The cranial cavity: cerebral vault over the floors of the three fossae, and the canal of the cord.
pub(super) fn cavity(p: At) -> f64 {
    let q = folded(p);
    let vault = ellipsoid(q, at(0.0, 14.0, 6.0), [67.0, 84.0, 70.0]);
    if q.z > 14.0 {
        return vault;
    }
    // The roof of the orbits and the planum; behind them the floor falls away into the fossae below.
    let floor = -24.0 - q.z - (q.x - 20.0).max(0.0) * 0.12;
    let upper = meet(vault, floor, 10.0);
    let middle = ellipsoid(q, at(35.0, -3.0, -22.0), [27.0, 35.0, 25.0]);
    let posterior = ellipsoid(q, at(0.0, 48.0, -34.0), [53.0, 45.0, 36.0]);
    let stem = capsule(q, (at(0.0, 14.0, -26.0), 15.0), (at(0.0, 27.0, -66.0), 13.5));
    let canal = capsule(q, (at(0.0, 27.0, -66.0), 13.0), (at(0.0, 33.0, -150.0), 9.5));
    let hollow = join(join(join(upper, middle, 8.0), posterior, 8.0), join(stem, canal, 6.0), 5.0);
    without(hollow, base(q), 4.0)
}

/// Bone that stands into the cavity: the body of the sphenoid, the clivus and the petrous pyramids (folded point).
pub(super) fn base(q: At) -> f64 {
    let sphenoid = ellipsoid(q, at(0.0, -16.0, -39.0), [15.0, 20.0, 13.0]);
    let clivus = capsule(q, (at(0.0, -2.0, -34.0), 5.0), (at(0.0, 10.0, -68.0), 4.0));
    let petrous = capsule(q, (at(61.0, 31.0, -38.0), 11.0), (at(15.0, 9.0, -38.0), 5.0));
    join(join(sphenoid, clivus, 5.0), petrous, 4.0)
}

/// Thickness of the vault: thick at forehead and occiput, thin at the temples.
fn thickness(p: At) -> f64 {
    let along = ((p.y - 14.0) / 84.0).powi(2).min(1.2);
    let across = (p.x / 67.0).powi(2).min(1.2);
    6.0 + 1.8 * along - 1.8 * across
}

/// The outer face of the skull around the cavity.
pub(super) fn skull(p: At, cavity: f64) -> f64 {
    let box_of_bone = cavity - thickness(p);
    // Below the foramen magnum the cavity goes on as the spinal canal, whose bone is the spine's.
    meet(box_of_bone, FORAMEN_MAGNUM_Z - 3.0 - p.z, 3.0)
}

/// Bones of the face and the upper cervical spine (folded point); only meaningful below `z = 0`.
pub(super) fn face_bones(q: At) -> f64 {
    let brow = ellipsoid(q, at(0.0, -62.0, -30.0), [44.0, 17.0, 10.0]);
    let orbit_rim = ellipsoid(q, at(31.0, -58.0, -46.0), [23.0, 22.0, 21.0]);
    let nasal = capsule(q, (at(2.0, -70.0, -38.0), 5.0), (at(2.5, -79.0, -56.0), 2.5));
    let maxilla = ellipsoid(q, at(16.0, -57.0, -80.0), [24.0, 20.0, 19.0]);
    let cheek = capsule(q, (at(40.0, -62.0, -62.0), 7.0), (at(54.0, -38.0, -57.0), 4.0));
    let arch = capsule(q, (at(54.0, -38.0, -57.0), 2.5), (at(58.0, 8.0, -50.0), 2.5));
    let ramus = capsule(q, (at(49.0, 4.0, -56.0), 4.5), (at(43.0, -14.0, -120.0), 7.0));
    let face = join(join(join(brow, orbit_rim, 5.0), join(maxilla, cheek, 6.0), 5.0), nasal, 4.0);
    let hollowed = without(face, orbit(q), 2.0);
    hollowed.min(arch).min(ramus).min(spine(q))
}

/// The fat-filled cone of the orbit (folded point).
pub(super) fn orbit(q: At) -> f64 {
    let cup = ellipsoid(q, at(31.0, -62.0, -46.0), [18.5, 25.0, 17.0]);
    join(cup, capsule(q, (at(29.0, -58.0, -45.0), 15.0), (at(13.0, -30.0, -37.0), 3.5)), 4.0)
}

/// Air inside the head: nose, sinuses, throat, mastoid cells and ear canals (folded point).
pub(super) fn air(q: At) -> f64 {
    let nose = without(ellipsoid(q, at(0.0, -58.0, -70.0), [13.0, 31.0, 18.0]), q.x - 1.3, 1.0);
    let turbinate = capsule(q, (at(8.5, -80.0, -67.0), 2.2), (at(8.5, -40.0, -70.0), 2.8));
    let nose = without(nose, turbinate, 1.5);
    let maxillary = ellipsoid(q, at(27.0, -57.0, -78.0), [11.5, 15.0, 14.5]);
    let ethmoid = ellipsoid(q, at(7.0, -52.0, -44.0), [4.5, 17.0, 9.0]);
    let frontal = ellipsoid(q, at(9.0, -72.0, -30.0), [8.0, 3.5, 8.0]);
    let sphenoid = ellipsoid(q, at(7.0, -20.0, -40.0), [6.0, 11.0, 7.0]);
    let throat = capsule(q, (at(0.0, -20.0, -74.0), 9.0), (at(0.0, -6.0, -150.0), 9.0));
    let ear = capsule(q, (at(90.0, 20.0, -44.0), 3.0), (at(58.0, 17.0, -42.0), 2.5));
    let mastoid = ellipsoid(q, at(58.0, 33.0, -45.0), [6.0, 8.0, 9.0]);
    let sinuses = maxillary.min(ethmoid).min(frontal).min(sphenoid);
    join(nose, throat, 5.0).min(sinuses).min(ear).min(mastoid)
}

/// A ring of vertebrae around the spinal canal (folded point).
fn spine(q: At) -> f64 {
    let centre = 26.0 + (-66.0 - q.z) * 6.0 / 84.0;
    let ring = ellipse([q.x, q.y - centre], [21.0, 17.0]);
    let disc = (q.z + 103.0).abs() - 2.0;
    let below = q.z - (FORAMEN_MAGNUM_Z - 6.0);
    let body = ellipsoid(at(q.x, q.y, 0.0), at(0.0, centre - 17.0, 0.0), [13.0, 9.0, 1e3]);
    without(join(ring, body, 4.0).max(below), disc, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_box_is_closed_above_and_open_at_the_foramen_magnum() {
        let top = at(0.0, 14.0, 79.0);
        assert!(cavity(top) > 0.0 && skull(top, cavity(top)) < 0.0);
        let hole = at(0.0, 28.5, FORAMEN_MAGNUM_Z);
        assert!(cavity(hole) < -8.0);
        let around = at(17.0, 28.5, FORAMEN_MAGNUM_Z);
        assert!(cavity(around) > 0.0 && skull(around, cavity(around)) < 0.0);
    }

    #[test]
    fn no_air_touches_the_cavity() {
        for i in 0..200_000u32 {
            let (a, b, c) = (f64::from(i % 61), f64::from(i / 61 % 61), f64::from(i / 3721));
            let q = at(a * 1.5, -110.0 + b * 3.6, -110.0 + c * 3.6);
            assert!(!(air(q) < 0.0 && cavity(q) < 0.0), "{q:?}");
        }
    }
}
