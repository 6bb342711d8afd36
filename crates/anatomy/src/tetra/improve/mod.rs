//! Local improvement: coarsening to the count, then flips, collapses and smoothing around the worst elements.
//!
//! Every change must better the worst element it touches, so the passes can stop at any time.

mod collapse;
mod relabel;
mod relax;
mod ring;
mod volume;
mod work;

use super::size::SizeField;
use super::vec3::{distance, lerp};
pub(super) use work::Work;

/// Bars of the passes: elements below are worked on. 0.46 is the sine of 27 degrees.
const BARS: [f64; 4] = [0.30, 0.38, 0.44, 0.47];
/// Passes once points have the places that the volumes ask for.
const LAST_BARS: [f64; 3] = [0.40, 0.46, 0.485];
/// Worst elements may be left to the last resorts below this bar: leaving the surface by a little, changing the label.
const RESORT: f64 = 0.45;
/// By how much of an edge they may leave the surface.
const LOOSE: [f64; 6] = [0.04, 0.08, 0.12, 0.16, 0.2, 0.2];

/// Edges shorter than this part of an element's longest are merged first.
const SHORT: f64 = 0.3;
/// A merge may leave a surface by this part of the element's longest edge.
const SAG: f64 = 0.03;

const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

impl Work<'_> {
    /// Improves until the bars are met or the passes are used up.
    pub(super) fn improve(&mut self) {
        BARS.into_iter().for_each(|bar| self.pass(bar));
    }

    /// The last passes, with resorts for elements that nothing else betters.
    pub(super) fn finish(&mut self) {
        LAST_BARS.into_iter().for_each(|bar| self.pass(bar));
        for loose in LOOSE {
            self.loose = loose;
            self.pass(RESORT);
            self.relabel_worst(RESORT);
        }
        self.loose = 0.0;
    }

    fn pass(&mut self, bar: f64) {
        for t in self.below(bar) {
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
        [(tet[i], tet[j]), (tet[j], tet[i])].into_iter().any(|(v, w)| {
            let floor = self.worst_around(v) + 1e-6;
            self.collapse(v, w, floor, SAG.max(self.loose) * size)
        })
    }

    /// Merges points that are closer than wanted, nearest first, until `aim.target` elements are left or no edge is
    /// shorter than `aim.limit` wanted lengths.
    pub(super) fn coarsen(&mut self, size: &SizeField, aim: &Coarse) {
        for _ in 0..8 {
            let before = self.count();
            let mut used = vec![false; self.points.len()];
            for (_, v, w) in self.short_edges(size, aim) {
                if self.count() <= aim.target {
                    return;
                }
                if used[v as usize] || used[w as usize] {
                    continue;
                }
                let floor = aim.floor.min(self.worst_around(v) + 1e-6);
                let sag = aim.sag * size.edge(self.points[w as usize], aim.finest);
                if self.collapse(v, w, floor, sag) {
                    (used[v as usize], used[w as usize]) = (true, true);
                }
            }
            if self.count() == before {
                return;
            }
        }
    }

    /// Edges with their length over the wanted one, shortest first; each from a point that may go to one that stays.
    fn short_edges(&self, size: &SizeField, aim: &Coarse) -> Vec<(f64, u32, u32)> {
        let mut keys = Vec::new();
        for (t, tet) in self.tets.iter().enumerate() {
            if self.is_alive(t as u32) {
                keys.extend(EDGES.map(|[i, j]| {
                    let (a, b) = (tet[i].min(tet[j]), tet[i].max(tet[j]));
                    u64::from(a) << 32 | u64::from(b)
                }));
            }
        }
        keys.sort_unstable();
        keys.dedup();
        let mut edges = Vec::new();
        for k in keys {
            let (a, b) = ((k >> 32) as u32, k as u32);
            let may_go = |v: u32, w: u32| {
                let (mv, mw) = (self.masks[v as usize], self.masks[w as usize]);
                mv & !mw == 0 && (aim.sag > 0.0 || mv.count_ones() == 1)
            };
            let ends = [(a, b), (b, a)].into_iter().filter(|e| may_go(e.0, e.1));
            let (p, q) = (self.points[a as usize], self.points[b as usize]);
            let score = distance(p, q) / size.edge(lerp(p, q, 0.5), aim.finest);
            if score < aim.limit {
                edges.extend(ends.map(|(v, w)| (score, v, w)));
            }
        }
        edges.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then((x.1, x.2).cmp(&(y.1, y.2))));
        edges
    }
}

/// How far to coarsen.
#[derive(Debug, Clone, Copy)]
pub(super) struct Coarse {
    /// Finest wanted edge, mm.
    pub(super) finest: f64,
    /// Stop at this many elements.
    pub(super) target: usize,
    /// Leave edges longer than this many wanted lengths.
    pub(super) limit: f64,
    /// Merge on surfaces too, as long as they sag by no more than this many wanted lengths; 0 leaves them alone.
    pub(super) sag: f64,
    /// Make no element worse than this, unless the elements before were worse.
    pub(super) floor: f64,
}
