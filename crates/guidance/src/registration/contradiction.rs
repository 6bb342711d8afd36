//! Landmarks that no rigid motion joins, and the mistake of the hand or of the file that would explain it.

use super::landmarks::{chi_square, fit, freedom};
use super::naming::{is_by_twos, moved, names_moved, namings, renamed, reordered};
use super::{Landmark, LandmarkRegistration};
use core::fmt;
use monro_geometry::Frame;

/// Residuals this many times what the noise explains, in the root mean square, are no noise: with three landmarks (chi-square
/// of three degrees of freedom) chance alone does that once in 10^15 times, and once in 3000 where the noise is twice what
/// was said; with more of them more seldom.
const FAR: f64 = 5.0;
/// Residuals this many times what the noise explains may still be those of a hand three times as unsteady as was said: they
/// are refused only where a mistake explains them far better. On a head, left and right exchanged leave hardly
/// more than this: mirrored, both sides are much the same.
const DOUBTFUL: f64 = 2.5;
/// What "far better" is: residuals this many times smaller. An unsteady hand shows with the mistake undone, too; of hands
/// three times as unsteady as was said, one in a hundred is refused for it.
const FAR_BETTER: f64 = 3.0;
/// Residuals that are no more than that are those of another naming where that has a sum of squares over the noise (over their
/// own, where that is more) that is smaller by this: e to the power of 9 times as likely.
const SURELY: f64 = 18.0;
/// A mistake is named when undoing it leaves residuals of at most this many times the noise.
const NEAR: f64 = 2.0;

/// Touched landmarks whose distances from each other are not those of the marked ones.
#[derive(Debug, Clone, PartialEq)]
pub struct Contradiction {
    /// Root mean square of the residuals, mm.
    pub residual: f64,
    /// How many times what the noise explains.
    pub excess: f64,
    /// Mistakes each of which alone would explain it.
    pub suspicions: Vec<Suspicion>,
}

/// A mistake.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Suspicion {
    /// An axis of the touched points has the wrong sign.
    Mirrored,
    /// These names, in the order given, were touched at the places of each other.
    Exchanged(Vec<String>),
    /// This one alone is wrong.
    Wrong(String),
}

impl fmt::Display for Suspicion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mirrored => {
                f.write_str("one axis of the touched points has the wrong sign (a mirrored, left-handed frame)")
            }
            Self::Exchanged(names) => write!(f, "the names of {} are exchanged", names.join(", ")),
            Self::Wrong(name) => write!(f, "'{name}' alone is wrong (touch it again or leave it out)"),
        }
    }
}

impl fmt::Display for Contradiction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the landmarks contradict each other: {:.1} mm (RMS) apart at best, {:.0} times what the noise of the touches explains; ",
            self.residual, self.excess
        )?;
        if self.suspicions.is_empty() {
            return f.write_str("are they in mm, in the tracked reference's frame, each under its own name?");
        }
        write!(f, "it would fit if {}", self.suspicions[0])?;
        self.suspicions[1..].iter().try_for_each(|s| write!(f, ", or if {s}"))?;
        f.write_str("; set that right, or touch the landmarks again")?;
        let is = |wanted: fn(&Suspicion) -> bool| self.suspicions.iter().any(wanted);
        if is(|s| *s == Suspicion::Mirrored) && is(|s| matches!(s, Suspicion::Exchanged(_))) {
            f.write_str(
                ". Both fit these points, and one of them puts left for right: find out which it is, and check afterwards at a landmark \
                 off the middle of the head that was not touched",
            )?;
        }
        Ok(())
    }
}

impl<To: Frame, From: Frame> LandmarkRegistration<To, From> {
    /// Whether `landmarks`, of which this is the registration, contradict each other so much that it must not be used.
    pub fn contradiction(&self, landmarks: &[Landmark<To, From>]) -> Option<Contradiction> {
        let excess = self.variance_ratio.sqrt();
        let squares: f64 = self.residuals.iter().map(|r| r.distance * r.distance).sum();
        let residual = (squares / self.residuals.len().max(1) as f64).sqrt();
        let suspicions = match excess {
            e if e > FAR => suspicions(landmarks),
            // Of all orders there are so many that one may fit by chance.
            e if e > DOUBTFUL => {
                let most = NEAR.min(e / FAR_BETTER);
                Some(misnamed(landmarks, most, is_by_twos)).filter(|found| !found.is_empty())?
            }
            _ => vec![likelier(landmarks, chi_square(landmarks, &self.to_from))?],
        };
        Some(Contradiction { residual, excess, suspicions })
    }
}

/// The names that were exchanged two by two for a registration that leaves `own`, if that is far more likely than that they
/// were not.
fn likelier<To: Frame, From: Frame>(landmarks: &[Landmark<To, From>], own: f64) -> Option<Suspicion> {
    let freedom = freedom(landmarks).max(1.0);
    let by_twos = namings(landmarks, own).into_iter().filter(|o| is_by_twos(o));
    let left = by_twos.filter_map(|o| Some((renamed(landmarks, &o)?.0, o)));
    let (other, order) = left.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let is_likelier = other + SURELY * (other / freedom).max(1.0) < own;
    is_likelier.then(|| Suspicion::Exchanged(names_moved(landmarks, &order)))
}

fn suspicions<To: Frame, From: Frame>(landmarks: &[Landmark<To, From>]) -> Vec<Suspicion> {
    let found = misnamed(landmarks, NEAR, |_| true);
    if found.is_empty() { wrong(landmarks).into_iter().collect() } else { found }
}

/// Mistakes that concern no place but signs or names, of those orders that are to be thought of, and leave residuals of at most
/// `most` times the noise.
fn misnamed<To: Frame, From: Frame>(
    landmarks: &[Landmark<To, From>],
    most: f64,
    thinkable: impl Fn(&[usize]) -> bool,
) -> Vec<Suspicion> {
    let mirrored = is_near(&reordered(landmarks, |i| i, true), most).then_some(Suspicion::Mirrored);
    mirrored.into_iter().chain(exchanged(landmarks, most, thinkable)).collect()
}

/// Whether a registration leaves residuals of at most `most` times the noise.
fn is_near<To: Frame, From: Frame>(landmarks: &[Landmark<To, From>], most: f64) -> bool {
    let freedom = freedom(landmarks);
    freedom > 0.0 && fit(landmarks).is_ok_and(|(pose, _)| chi_square(landmarks, &pose) / freedom <= most * most)
}

/// The fewest names that were exchanged, if that explains it.
fn exchanged<To: Frame, From: Frame>(
    landmarks: &[Landmark<To, From>],
    most: f64,
    thinkable: impl Fn(&[usize]) -> bool,
) -> Option<Suspicion> {
    let mut orders = namings(landmarks, most * most * freedom(landmarks));
    orders.retain(|o| thinkable(o));
    orders.sort_by_key(|o| moved(o));
    let order = orders.into_iter().find(|o| is_near(&reordered(landmarks, |i| o[i], false), most))?;
    Some(Suspicion::Exchanged(names_moved(landmarks, &order)))
}

/// The one landmark without which the others fit.
fn wrong<To: Frame, From: Frame>(landmarks: &[Landmark<To, From>]) -> Option<Suspicion> {
    let without = |i: usize| {
        let others = landmarks.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, l)| l.clone());
        others.collect::<Vec<_>>()
    };
    let mut alone = (0..landmarks.len()).filter(|&i| is_near(&without(i), NEAR));
    let first = alone.next()?;
    // When any of several would do, none is the one.
    alone.next().is_none().then(|| Suspicion::Wrong(landmarks[first].name.clone()))
}
