//! Merging points that are closer than wanted.

use super::super::size::SizeField;
use super::work::Work;
use monro_geometry::d3::distance;

/// Rounds at most.
const ROUNDS: usize = 8;
/// Edges that are to be short because of the path are left alone from so many wanted lengths on: what the count asks for beyond
/// is merged elsewhere.
const ALONG: f64 = 0.9;

/// How far to coarsen.
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct Coarse {
    /// Finest wanted edge, mm.
    pub(in super::super) finest: f64,
    /// Stop at this many elements.
    pub(in super::super) target: usize,
    /// Leave edges longer than this many wanted lengths.
    pub(in super::super) limit: f64,
    /// Merge on surfaces too, as long as they sag by no more than this many wanted lengths; 0 leaves them alone.
    pub(in super::super) sag: f64,
    /// Make no element worse than this, unless the elements before were worse.
    pub(in super::super) floor: f64,
}

/// The edge wanted at a point, mm, and whether it is so short because of the path.
type Wanted = (f64, bool);

/// An edge with its length over the wanted one, from a point that may go to one that stays.
type Short = (f64, u32, u32);

impl Work<'_> {
    /// Merges points that are closer than wanted, nearest first, until `aim.target` elements are left or no edge is
    /// shorter than `aim.limit` wanted lengths. After the first round only edges at points where something has changed
    /// are looked at again.
    pub(in super::super) fn coarsen(&mut self, size: &SizeField, aim: &Coarse) {
        if self.count() <= aim.target {
            return;
        }
        let wanted: Vec<_> = self.points.iter().map(|&p| size.edge_and_cause(p, aim.finest)).collect();
        let mut at: Vec<u32> = (0..self.points.len() as u32).collect();
        for _ in 0..ROUNDS {
            let edges = self.short_edges(&wanted, aim, &at);
            at = self.merge_short(edges, &wanted, aim);
            if at.is_empty() || self.count() <= aim.target {
                return;
            }
        }
    }

    /// One round; returns the points whose surroundings have changed.
    fn merge_short(&mut self, edges: Vec<Short>, wanted: &[Wanted], aim: &Coarse) -> Vec<u32> {
        let mut used = vec![false; self.points.len()];
        let mut changed = Vec::new();
        for (_, v, w) in edges {
            if self.count() <= aim.target {
                break;
            }
            if used[v as usize] || used[w as usize] {
                changed.push(v);
                continue;
            }
            let floor = aim.floor.min(self.worst_around(v) + 1e-6);
            if self.collapse(v, w, floor, aim.sag * wanted[w as usize].0) {
                (used[v as usize], used[w as usize]) = (true, true);
                changed.push(w);
            }
        }
        changed.sort_unstable();
        changed.dedup();
        changed
    }

    /// Edges at some points that are shorter than the limit, shortest first.
    fn short_edges(&self, wanted: &[Wanted], aim: &Coarse, at: &[u32]) -> Vec<Short> {
        let mut asked = vec![false; self.points.len()];
        at.iter().for_each(|&v| asked[v as usize] = true);
        let may_go = |v: u32, w: u32| {
            let (mv, mw) = (self.masks[v as usize], self.masks[w as usize]);
            mv.is_within(mw) && (aim.sag > 0.0 || mv.count() == 1)
        };
        let mut edges = Vec::new();
        let mut near: Vec<(u32, f64)> = Vec::new();
        for &v in at {
            near.clear();
            for w in self.stars[v as usize].iter().flat_map(|&t| self.tets[t as usize]).filter(|&w| w != v) {
                let length = distance(self.points[v as usize], self.points[w as usize]);
                let (at_v, at_w) = (wanted[v as usize], wanted[w as usize]);
                let (score, along) = (length / (0.5 * (at_v.0 + at_w.0)), at_v.1 || at_w.1);
                let limit = if along { aim.limit.min(ALONG) } else { aim.limit };
                // Each is found once for every element around it.
                if score < limit && (w > v || !asked[w as usize]) && near.iter().all(|n| n.0 != w) {
                    near.push((w, score));
                }
            }
            for &(w, score) in &near {
                edges.extend([(v, w), (w, v)].into_iter().filter(|e| may_go(e.0, e.1)).map(|(v, w)| (score, v, w)));
            }
        }
        edges.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then((x.1, x.2).cmp(&(y.1, y.2))));
        edges
    }
}
