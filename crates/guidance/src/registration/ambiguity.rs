//! Landmarks that fit as well with some of their names exchanged.
//!
//! Both sides of a head are much the same: of nasion and a point on either side, left and right can be exchanged, and the patient
//! is registered face down with hardly a residual. So can the corners of both eyes and both ears all together. No sum over the
//! landmarks tells; a look at another place does.

use super::landmarks::{chi_square, freedom};
use super::naming::{Naming, names_moved, namings, renamed};
use super::{Landmark, LandmarkRegistration, Recheck};
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
    /// Those that may be exchanged, two or more.
    pub names: Vec<String>,
    /// How far the target would be from where it is taken to be, mm.
    pub apart_mm: f64,
    /// The registration with the names exchanged.
    pub to_from: Rigid<To, From>,
}

impl<To: Frame, From: Frame> fmt::Display for Ambiguity<To, From> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<String> = self.names.iter().map(|name| format!("'{name}'")).collect();
        let (last, others) = names.split_last().ok_or(fmt::Error)?;
        write!(
            f,
            "these landmarks fit about as well with {} and {last} exchanged (left and right are the patient's), with the target {:.0} mm from there; touch another landmark, off the plane between the two sides, or check at one that was not touched",
            others.join(", "),
            self.apart_mm
        )
    }
}

impl<To: Frame, From: Frame> Ambiguity<To, From> {
    /// Whether a check at a landmark, `touched` and `marked` there, would have held under this naming as it has: then it proves
    /// nothing.
    pub fn holds_too(&self, touched: Point<From>, marked: Point<To>, check: &Recheck) -> bool {
        check.holds() && self.to_from.point(touched).distance(marked) <= check.limit
    }
}

impl<To: Frame, From: Frame> LandmarkRegistration<To, From> {
    /// How else `landmarks`, of which this is the registration, may be named, so that `target` would be elsewhere; what fits
    /// best comes first.
    pub fn ambiguities(&self, landmarks: &[Landmark<To, From>], target: Point<To>) -> Vec<Ambiguity<To, From>> {
        let own = chi_square(landmarks, &self.to_from);
        let freedom = freedom(landmarks).max(1.0);
        let most = |other: f64| own + CLEARLY * (own.min(other) / freedom).max(1.0);
        let named = |order: Naming| {
            let (other, to_from) = renamed(landmarks, &order)?;
            (other < most(other)).then_some((other, order, to_from))
        };
        let mut found: Vec<_> = namings(landmarks, most(own)).into_iter().filter_map(named).collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        let at = self.to_from.inverse().point(target);
        let ambiguity = |(_, order, to_from): (f64, Naming, Rigid<To, From>)| {
            let names = names_moved(landmarks, &order);
            Ambiguity { names, apart_mm: to_from.point(at).distance(target), to_from }
        };
        found.into_iter().map(ambiguity).filter(|a| a.apart_mm > MATTERS_MM).collect()
    }
}
