//! Other namings of touched landmarks: which of them was touched where.

use super::Landmark;
use super::landmarks::{chi_square, fit};
use monro_geometry::{Frame, Point, Rigid};

/// So many namings are looked at, and no more: of more that are alike in shape none tells anything.
const MOST: usize = 2000;
/// And so many beginnings of them: of many landmarks close together, for their noise, there are more than can be gone through.
const BEGINNINGS: usize = 200_000;

/// The touches in the order in which other namings have them: of the landmark at each place, the number of the one that was
/// touched there.
pub(super) type Naming = Vec<usize>;

/// All namings but the given one under which a registration may leave a sum of squares over the noise of at most `most`, the
/// first 2000: those under which no distance between two landmarks is off by more than two residuals can be that together
/// make up that sum. In the order of their numbers.
pub(super) fn namings<To: Frame, From: Frame>(landmarks: &[Landmark<To, From>], most: f64) -> Vec<Naming> {
    let variance = landmarks.iter().map(|l| l.noise.inner().trace()).fold(0.0, f64::max);
    let off = (2.0 * most * variance).sqrt();
    let mut search = Search { landmarks, off, left: BEGINNINGS, found: Vec::new() };
    search.extend(&mut Vec::new());
    search.found.retain(|order| moved(order) > 0);
    search.found
}

/// How many landmarks have another's place.
pub(super) fn moved(order: &[usize]) -> usize {
    order.iter().enumerate().filter(|(i, o)| i != *o).count()
}

/// The names of those.
pub(super) fn names_moved<To: Frame, From: Frame>(landmarks: &[Landmark<To, From>], order: &[usize]) -> Vec<String> {
    let names = landmarks.iter().zip(order).enumerate().filter(|(i, (_, o))| i != *o);
    names.map(|(_, (l, _))| l.name.clone()).collect()
}

/// The registration under a naming, and its sum of squares over the noise.
pub(super) fn renamed<To: Frame, From: Frame>(
    landmarks: &[Landmark<To, From>],
    order: &[usize],
) -> Option<(f64, Rigid<To, From>)> {
    let others = reordered(landmarks, |i| order[i], false);
    let pose = fit(&others).ok()?.0;
    Some((chi_square(&others, &pose), pose))
}

/// Whether all of them were exchanged two by two, as left and right are.
pub(super) fn is_by_twos(order: &[usize]) -> bool {
    order.iter().enumerate().all(|(i, &o)| order[o] == i)
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

/// A search for namings, place by place.
struct Search<'a, To: Frame, From: Frame> {
    landmarks: &'a [Landmark<To, From>],
    /// How far off a distance may be, mm.
    off: f64,
    /// Beginnings that may still be looked at.
    left: usize,
    found: Vec<Naming>,
}

impl<To: Frame, From: Frame> Search<'_, To, From> {
    fn extend(&mut self, order: &mut Naming) {
        if self.found.len() == MOST || self.left == 0 {
            return;
        }
        self.left -= 1;
        if order.len() == self.landmarks.len() {
            self.found.push(order.clone());
            return;
        }
        for next in 0..self.landmarks.len() {
            if !order.contains(&next) && self.fits(order, next) {
                order.push(next);
                self.extend(order);
                order.pop();
            }
        }
    }

    /// Whether the touch of landmark `next` may be that of the one after `order`, by its distances from those before.
    fn fits(&self, order: &[usize], next: usize) -> bool {
        let [to, from] = [&self.landmarks[order.len()], &self.landmarks[next]];
        self.landmarks.iter().zip(order).all(|(before, &o)| {
            let touched = from.touched.distance(self.landmarks[o].touched);
            (touched - to.marked.distance(before.marked)).abs() <= self.off
        })
    }
}
