//! Landmarks that no rigid motion joins, and the mistake of the hand or of the file that would explain it.

use super::landmarks::{chi_square, fit};
use super::{Landmark, LandmarkRegistration};
use core::fmt;
use monro_geometry::{Frame, Point};

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
/// A mistake is named when undoing it leaves residuals of at most this many times the noise.
const NEAR: f64 = 2.0;
/// Up to so many landmarks all orders are tried; beyond, only exchanges of two.
const ALL_ORDERS: usize = 6;

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
        f.write_str("; set that right, or touch the landmarks again")
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
            // Of orders that move more than two names there are so many that one may fit by chance.
            e if e > DOUBTFUL => {
                let most = NEAR.min(e / FAR_BETTER);
                Some(misnamed(landmarks, most, 2)).filter(|found| !found.is_empty())?
            }
            _ => return None,
        };
        Some(Contradiction { residual, excess, suspicions })
    }
}

fn suspicions<To: Frame, From: Frame>(landmarks: &[Landmark<To, From>]) -> Vec<Suspicion> {
    let found = misnamed(landmarks, NEAR, landmarks.len());
    if found.is_empty() { wrong(landmarks).into_iter().collect() } else { found }
}

/// Mistakes that concern no place but signs or at most `names` names, and leave residuals of at most `most` times the noise.
fn misnamed<To: Frame, From: Frame>(landmarks: &[Landmark<To, From>], most: f64, names: usize) -> Vec<Suspicion> {
    let mirrored = is_near(&reordered(landmarks, |i| i, true), most).then_some(Suspicion::Mirrored);
    mirrored.into_iter().chain(exchanged(landmarks, most, names)).collect()
}

/// The landmarks with the touch of `of(i)` at each `i`, its first coordinate negated or not.
pub(super) fn reordered<To: Frame, From: Frame>(
    landmarks: &[Landmark<To, From>],
    of: impl Fn(usize) -> usize,
    mirror: bool,
) -> Vec<Landmark<To, From>> {
    let one = |(i, l): (usize, &Landmark<To, From>)| {
        let [x, y, z] = landmarks[of(i)].touched.to_array();
        Landmark { touched: Point::new(if mirror { -x } else { x }, y, z), ..l.clone() }
    };
    landmarks.iter().enumerate().map(one).collect()
}

/// Whether a registration leaves residuals of at most `most` times the noise.
fn is_near<To: Frame, From: Frame>(landmarks: &[Landmark<To, From>], most: f64) -> bool {
    let freedom = 3 * landmarks.len() as i64 - 6;
    let ratio = || Some(chi_square(landmarks, &fit(landmarks).ok()?.0) / freedom as f64);
    freedom > 0 && ratio().is_some_and(|r| r <= most * most)
}

/// The fewest names that were exchanged, if that explains it.
fn exchanged<To: Frame, From: Frame>(landmarks: &[Landmark<To, From>], most: f64, names: usize) -> Option<Suspicion> {
    let n = landmarks.len();
    let fits = |o: &Vec<usize>| moved(o) <= names && is_near(&reordered(landmarks, |i| o[i], false), most);
    let order = orders(n).into_iter().find(fits)?;
    let exchanged = (0..n).filter(|&i| order[i] != i).map(|i| landmarks[i].name.clone());
    Some(Suspicion::Exchanged(exchanged.collect()))
}

/// Orders of `n` things but their own, those that move the fewest first.
fn orders(n: usize) -> Vec<Vec<usize>> {
    let mut all: Vec<Vec<usize>> = if n <= ALL_ORDERS {
        permutations(n)
    } else {
        let swapped = |(i, j)| {
            let mut order: Vec<usize> = (0..n).collect();
            order.swap(i, j);
            order
        };
        (0..n).flat_map(|i| (0..i).map(move |j| (i, j))).map(swapped).collect()
    };
    all.retain(|o| moved(o) > 0);
    all.sort_by_key(|o| moved(o));
    all
}

/// How many things an order moves.
fn moved(order: &[usize]) -> usize {
    order.iter().enumerate().filter(|(i, o)| i != *o).count()
}

fn permutations(n: usize) -> Vec<Vec<usize>> {
    let Some(last) = n.checked_sub(1) else { return vec![Vec::new()] };
    let extended = |shorter: Vec<usize>| {
        (0..n).map(move |at| {
            let mut longer = shorter.clone();
            longer.insert(at, last);
            longer
        })
    };
    permutations(last).into_iter().flat_map(extended).collect()
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
