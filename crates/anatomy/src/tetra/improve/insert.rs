//! New points in the few elements that nothing else betters.

use super::ring::Ring;
use super::work::Work;
use super::{EDGES, ROOMY};
use monro_geometry::d3::{add, distance, scale};

/// It is tried for so many elements at most, fewer where so many elements would be copied: each try keeps a copy of the mesh.
const MOST: usize = 24;
const COPIED: usize = 6_000_000;
/// Rounds of bettering what lies around a new point, and the part of what was lacking that a point must save.
const ROUNDS: usize = 3;
const WORTH: f64 = 0.1;

impl Work<'_> {
    /// Splits an edge of each element below `bar` where that and what can then be done around it betters the whole
    /// (Klingner and Shewchuk 2007: new points help where flips and moves do not).
    pub(super) fn insert_points(&mut self, bar: f64) {
        let most = (COPIED / (EDGES.len() * self.count().max(1))).clamp(1, MOST);
        for t in self.below(bar).into_iter().take(most) {
            if self.is_alive(t) && self.quality[t as usize] < bar {
                let edges = self.inner_first(t);
                let _inserted = edges.into_iter().any(|ends| self.insert_point(ends, bar));
            }
        }
    }

    /// The edges of an element: those inside of a label first, the longest of either first.
    fn inner_first(&self, t: u32) -> [[u32; 2]; 6] {
        let tet = self.tets[t as usize];
        let mut edges = EDGES.map(|e| e.map(|k| tet[k]));
        let length = |[a, b]: [u32; 2]| distance(self.points[a as usize], self.points[b as usize]);
        let inside = |[a, b]: [u32; 2]| (self.masks[a as usize] & self.masks[b as usize]).count() < 2;
        edges.sort_by(|&x, &y| inside(y).cmp(&inside(x)).then(length(y).total_cmp(&length(x))));
        edges
    }

    fn insert_point(&mut self, ends: [u32; 2], bar: f64) -> bool {
        let Some(ring) = Ring::new(self, ends[0], ends[1]) else { return false };
        let (before, kept) = (self.lacking(bar), self.clone());
        let [p, q] = ends.map(|v| self.points[v as usize]);
        let (middle, length) = (scale(add(p, q), 0.5), distance(p, q));
        let new = self.add_point_on(&ring, middle);
        self.apply_split(&ring, new);
        // Onto its surface, if it is on one.
        let freedom = self.freedom(new);
        if let Some(place) = self.constrain(new, &freedom, middle, length) {
            self.try_move(new, place, 0.0);
        }
        for _ in 0..ROUNDS {
            self.better_around(new);
        }
        let is_better = self.lacking(bar) < (1.0 - WORTH) * before;
        if !is_better {
            *self = kept;
        }
        is_better
    }

    /// How much the elements below `bar` lack, together.
    fn lacking(&self, bar: f64) -> f64 {
        self.below(bar).into_iter().map(|t| bar - self.quality[t as usize]).sum()
    }

    /// Betters the elements around a point and around its neighbours, the worst first.
    fn better_around(&mut self, v: u32) {
        let mut near = self.around(&self.stars[v as usize]);
        self.sort_by_quality(&mut near);
        self.mend_all(near, ROOMY);
    }
}
