//! The names under which landmarks are written and printed.

use monro_case::markups::NamedPoint;
use monro_geometry::{Patient, Point};
use monro_guidance::Side;

/// Names of the six landmarks, in the order of [`named`]. None says 110 mm: where the scan ends below, the midline point and
/// Kocher's points lie lower, and a finding tells how far from the nasion.
const NAMES: [&str; 6] = ["nasion", "midline above nasion", "Kocher left", "Kocher right", "Monro left", "Monro right"];

/// Landmarks with their names: nasion, the midline 110 mm (or what a finding says) above it, Kocher's points and the foramina of Monro, left
/// before right.
pub fn named(points: [Point<Patient>; 6]) -> Vec<NamedPoint> {
    NAMES.iter().zip(points).map(|(label, position)| NamedPoint { label: (*label).into(), position }).collect()
}

/// The path that is planned by itself: from Kocher's point to the foramen of Monro of a side; `None` without these.
pub(crate) fn path(landmarks: &[NamedPoint], side: Side) -> Option<[Point<Patient>; 2]> {
    let [entry, target] = match side {
        Side::Left => [NAMES[2], NAMES[4]],
        Side::Right => [NAMES[3], NAMES[5]],
    };
    let of = |name: &str| landmarks.iter().find(|l| l.label == name).map(|l| l.position);
    Some([of(entry)?, of(target)?])
}
