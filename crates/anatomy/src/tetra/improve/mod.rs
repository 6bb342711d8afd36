//! Local improvement: coarsening to the count, then flips, collapses and smoothing around the worst elements.
//!
//! Every change must better the worst element it touches, so the passes can stop at any time.

mod collapse;
mod relax;
mod ring;
mod work;

use super::size::SizeField;
use super::vec3::{distance, lerp};
pub(super) use work::Work;

/// Bars of the passes: elements below are worked on. 0.46 is the sine of 27 degrees.
const BARS: [f64; 6] = [0.30, 0.36, 0.40, 0.43, 0.46, 0.46];
/// Coarsening leaves no element worse than this.
const COARSE_FLOOR: f64 = 0.36;

const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

impl Work<'_> {
    /// Improves until the bars are met or the passes are used up.
    pub(super) fn improve(&mut self) {
        for bar in BARS {
            let bad = self.below(bar);
            if bad.is_empty() {
                continue;
            }
            for t in bad {
                if self.is_alive(t) && self.quality[t as usize] < bar {
                    self.mend(t, bar);
                }
            }
        }
    }

    /// Tries to better one element: topology first, then its points.
    fn mend(&mut self, t: u32, bar: f64) {
        let tet = self.tets[t as usize];
        for [i, j] in EDGES {
            if self.remove_edge(tet[i], tet[j]) {
                return;
            }
        }
        if (0..4).any(|i| self.swap_face(t, i)) {
            return;
        }
        for v in tet {
            self.relax(v);
            if !self.is_alive(t) || self.quality[t as usize] >= bar {
                return;
            }
        }
        for [i, j] in EDGES {
            let floor = self.quality[t as usize] + 1e-6;
            for (v, w) in [(tet[i], tet[j]), (tet[j], tet[i])] {
                let length = distance(self.points[v as usize], self.points[w as usize]);
                if self.collapse(v, w, self.worst_around(v).max(floor), 0.05 * length) {
                    return;
                }
            }
        }
    }

    /// Merges points inside a label that are closer than wanted, nearest first, until `target` elements are left or no
    /// edge is shorter than `limit` wanted lengths.
    pub(super) fn coarsen(&mut self, size: &SizeField, finest: f64, target: usize, limit: f64) {
        for _ in 0..6 {
            let before = self.count();
            let mut used = vec![false; self.points.len()];
            for (_, v, w) in self.short_edges(size, finest, limit) {
                if self.count() <= target {
                    return;
                }
                if used[v as usize] || used[w as usize] {
                    continue;
                }
                let floor = COARSE_FLOOR.min(self.worst_around(v));
                if self.collapse(v, w, floor, 0.0) {
                    used[w as usize] = true;
                    let star = self.stars[w as usize].clone();
                    star.iter().for_each(|&t| self.tets[t as usize].iter().for_each(|&x| used[x as usize] = true));
                }
            }
            if self.count() == before {
                return;
            }
        }
    }

    /// Edges from a point inside a label, with their length over the wanted one, shortest first.
    fn short_edges(&self, size: &SizeField, finest: f64, limit: f64) -> Vec<(f64, u32, u32)> {
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
            let inner = |v: u32| self.masks[v as usize].count_ones() == 1;
            if !inner(a) && !inner(b) {
                continue;
            }
            let (p, q) = (self.points[a as usize], self.points[b as usize]);
            let score = distance(p, q) / size.edge(lerp(p, q, 0.5), finest);
            if score < limit {
                edges.extend([(a, b), (b, a)].into_iter().filter(|e| inner(e.0)).map(|(v, w)| (score, v, w)));
            }
        }
        edges.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then((x.1, x.2).cmp(&(y.1, y.2))));
        edges
    }
}
