//! The names under which landmarks are written and printed.

use monro_case::markups::NamedPoint;
use monro_geometry::{Patient, Point};

/// Names of the six landmarks, in the order of [`named`]. None says 110 mm: where the scan ends below, the midline point and
/// Kocher's points lie lower, and a finding tells how far from the nasion.
const NAMES: [&str; 6] = ["nasion", "midline above nasion", "Kocher left", "Kocher right", "Monro left", "Monro right"];

/// Landmarks with their names: nasion, the midline 110 mm (or what a finding says) above it, Kocher's points and the foramina of Monro, left
/// before right.
pub fn named(points: [Point<Patient>; 6]) -> Vec<NamedPoint> {
    NAMES.iter().zip(points).map(|(label, position)| NamedPoint { label: (*label).into(), position }).collect()
}
