//! Local improvement: coarsening to the count, then flips, collapses and smoothing around the worst elements.
//!
//! Every change must better the worst element it touches, so the passes can stop at any time.

mod bodies;
mod coarsen;
mod collapse;
mod insert;
mod mask;
mod pull;
mod relabel;
mod relax;
mod ring;
mod split;
mod tighten;
mod volume;
mod work;

use super::adjacency::EDGES;
pub(super) use coarsen::Coarse;
pub(super) use mask::MOST_LABELS;
use monro_geometry::d3::distance;
pub(super) use volume::{Bounds, GOOD};
pub(super) use work::Work;

/// Bars of the passes: elements below are worked on. 0.46 is the sine of 27 degrees.
const BARS: [f64; 4] = [0.30, 0.38, 0.44, 0.47];
/// Passes once points have the places that the volumes ask for.
const LAST_BARS: [f64; 2] = [0.40, 0.46];
/// One more where too many elements are worse than [`GOOD`], which count for the first percentile.
const GOOD_BAR: f64 = 0.475;
/// More passes, at this bar, as long as more than this part of the elements is worse than [`GOOD`].
const MORE_BAR: f64 = 0.50;
const MORE_PASSES: usize = 6;
const FEW: f64 = 0.009;
/// Worst elements may be left to the last resorts below this bar: leaving the surface by a little, changing the label. It is
/// the sine of 25.2 and 154.8 degrees, and stands for a radius ratio of 0.203. With a bar at 26.7 degrees more
/// elements went through the resorts, which moved surfaces by up to 0.9 mm.
const RESORT: f64 = 0.426;
/// Their neighbours are bettered up to this, and up to that when next to none are left.
const ROOMY: f64 = 0.55;
const ROOMIER: f64 = 0.65;
/// More than this part of the elements is many.
const MANY: f64 = 0.02;
/// By how much of an edge they may leave the surface;
const LOOSE: [f64; 14] = [0.03, 0.06, 0.06, 0.09, 0.12, 0.16, 0.2, 0.25, 0.3, 0.3, 0.35, 0.4, 0.5, 0.6];
/// from which of these on neighbours are bettered, labels changed, and points put in.
const ROOM_FROM: usize = 1;
const RELABEL_FROM: usize = 2;
const INSERT_FROM: usize = 4;
/// An element that changes its label may be as thick as this part of its longest edge, as its surface moves by as much;
const THIN: f64 = 0.15;
/// as thick as it is from this looseness on, when next to none are left. Then two rings of neighbours are bettered, too.
const ANY: f64 = 0.3;

/// Edges shorter than this part of an element's longest are merged first.
const SHORT: f64 = 0.3;
/// A merge may leave a surface by this part of the element's longest edge.
const SAG: f64 = 0.03;

impl Work<'_> {
    /// Improves until the bars are met or the passes are used up.
    pub(super) fn improve(&mut self) {
        BARS.into_iter().for_each(|bar| self.pass(bar));
    }

    /// Betters the worst elements only, before points are merged that most of the others lose again.
    pub(super) fn improve_worst(&mut self) {
        BARS[..2].iter().for_each(|&bar| self.pass(bar));
    }

    /// The last passes, with resorts for elements that nothing else betters.
    pub(super) fn finish(&mut self) {
        LAST_BARS.into_iter().for_each(|bar| self.pass(bar));
        for (i, loose) in LOOSE.into_iter().enumerate() {
            if self.below(RESORT).is_empty() {
                break;
            }
            if i >= INSERT_FROM {
                self.insert_points(RESORT);
            }
            self.loose = loose;
            self.pass(RESORT);
            if i >= RELABEL_FROM {
                self.relabel_worst(RESORT, if loose < ANY { THIN } else { f64::INFINITY });
            }
            if i >= ROOM_FROM {
                self.make_room(RESORT, if loose < ANY { 1 } else { 2 });
            }
        }
        self.loose = 0.0;
        self.tighten();
        self.pull_points();
        self.pull_middles();
        // What moved for others may have made room for these.
        self.pull_points();
        self.leave_few();
    }

    /// Goes on until few elements have an angle below 28 degrees: where a mesh is coarse for what it shows, more had than one
    /// in a hundred. Without merges, which are no help here and cost the count.
    fn leave_few(&mut self) {
        let few = |work: &Self| !work.has_more_below(GOOD, FEW);
        if !few(self) {
            self.pass(GOOD_BAR);
        }
        self.merges = false;
        for _ in 0..MORE_PASSES {
            if few(self) {
                break;
            }
            self.pass(MORE_BAR);
        }
        self.merges = true;
    }

    /// Betters the good neighbours of elements below a bar, so many rings of them, which are then less in their way: of each
    /// for itself, or where these are many, as where many labels meet, of all at once. They share most of them.
    fn make_room(&mut self, bar: f64, rings: usize) {
        let (up_to, bad) = (if rings > 1 { ROOMIER } else { ROOMY }, self.below(bar));
        let near = |work: &Self, bad: Vec<u32>| (0..rings).fold(bad, |near, _| work.around(&near));
        if bad.len() as f64 > MANY * self.count() as f64 {
            return self.mend_all(near(self, bad), up_to);
        }
        for t in bad {
            if self.is_alive(t) {
                self.mend_all(near(self, vec![t]), up_to);
            }
        }
    }

    fn pass(&mut self, bar: f64) {
        self.mend_all(self.below(bar), bar);
    }

    /// Tries to better those of some elements that are below a bar, in their order.
    fn mend_all(&mut self, tets: Vec<u32>, bar: f64) {
        for t in tets {
            if self.is_alive(t) && self.quality[t as usize] < bar {
                self.mend(t, bar);
            }
        }
    }

    /// Tries to better one element: topology first, then its points.
    fn mend(&mut self, t: u32, bar: f64) {
        let tet = self.tets[t as usize];
        let length = |[i, j]: [usize; 2]| distance(self.points[tet[i] as usize], self.points[tet[j] as usize]);
        let mut edges = EDGES.map(|e| (length(e), e));
        edges.sort_unstable_by(|x, y| x.0.total_cmp(&y.0));
        let (shortest, longest) = (edges[0].0, edges[5].0);
        // Where surfaces meet the cuts leave points almost in one place.
        if shortest < SHORT * longest && self.merge_edge(t, edges[0].1, longest) {
            return;
        }
        if EDGES.into_iter().any(|[i, j]| self.remove_edge(tet[i], tet[j])) || (0..4).any(|i| self.swap_face(t, i)) {
            return;
        }
        for v in tet {
            self.relax(v);
            if self.quality[t as usize] >= bar {
                return;
            }
        }
        for (_, e) in edges {
            if self.merge_edge(t, e, longest) {
                return;
            }
        }
    }

    /// Merges the ends of an edge of `t`, in either direction, if that betters the worst element around.
    fn merge_edge(&mut self, t: u32, [i, j]: [usize; 2], size: f64) -> bool {
        let tet = self.tets[t as usize];
        self.merges
            && [(tet[i], tet[j]), (tet[j], tet[i])].into_iter().any(|(v, w)| {
                let floor = self.worst_around(v) + 1e-6;
                self.collapse(v, w, floor, SAG.max(self.loose) * size)
            })
    }
}
