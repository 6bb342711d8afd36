//! Landmarks that fit as well with two of their names exchanged.
//!
//! Both sides of a head are much the same: of nasion and a point on either side, left and right can be exchanged, and the patient
//! is registered face down with hardly a residual. No sum over the landmarks tells; a look at another place does.

use super::contradiction::reordered;
use super::landmarks::{chi_square, fit};
use super::{Landmark, LandmarkRegistration};
use core::fmt;
use monro_geometry::{Frame, Point, Rigid};

/// Another naming cannot be excluded unless its sum of squares over the noise is larger by this: e to the power of -4.5 = 1/90 of the
/// likelihood. Where residuals show more noise than was said, it grows with them.
const CLEARLY: f64 = 9.0;
/// A naming that puts the target nearer than this to where it is does not matter, mm.
const MATTERS_MM: f64 = 3.0;

/// A naming of the landmarks that the touches do not exclude.
#[derive(Debug, Clone, PartialEq)]
pub struct Ambiguity<To: Frame, From: Frame> {
    /// The two that may be exchanged.
    pub names: [String; 2],
    /// How far the target would be from where it is taken to be, mm.
    pub apart_mm: f64,
    /// The registration with the names exchanged.
    pub to_from: Rigid<To, From>,
}

impl<To: Frame, From: Frame> fmt::Display for Ambiguity<To, From> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b] = &self.names;
        write!(
            f,
            "these landmarks fit about as well with '{a}' and '{b}' exchanged (left and right are the patient's), with the target {:.0} mm from there; touch another landmark, off the plane between the two, or check at one that was not touched",
            self.apart_mm
        )
    }
}

impl<To: Frame, From: Frame> LandmarkRegistration<To, From> {
    /// Whether two of `landmarks`, of which this is the registration, may be exchanged, so that `target` would be elsewhere: of
    /// several such namings the one that fits best.
    pub fn ambiguity(&self, landmarks: &[Landmark<To, From>], target: Point<To>) -> Option<Ambiguity<To, From>> {
        let own = chi_square(landmarks, &self.to_from);
        let freedom = (3 * landmarks.len()).saturating_sub(6).max(1) as f64;
        let at = self.to_from.inverse().point(target);
        let exchanged = |(i, j): (usize, usize)| {
            let order = |k: usize| {
                if k == i {
                    j
                } else if k == j {
                    i
                } else {
                    k
                }
            };
            let others = reordered(landmarks, order, false);
            let pose: Rigid<To, From> = fit(&others).ok()?.0;
            let found = Ambiguity {
                names: [i, j].map(|k| landmarks[k].name.clone()),
                apart_mm: pose.point(at).distance(target),
                to_from: pose,
            };
            Some((chi_square(&others, &pose), found))
        };
        let pairs = (0..landmarks.len()).flat_map(|j| (0..j).map(move |i| (i, j)));
        let (other, found) = pairs
            .filter_map(exchanged)
            .filter(|(_, found)| found.apart_mm > MATTERS_MM)
            .min_by(|a, b| a.0.total_cmp(&b.0))?;
        let noise = (own.min(other) / freedom).max(1.0);
        (other < own + CLEARLY * noise).then_some(found)
    }
}
