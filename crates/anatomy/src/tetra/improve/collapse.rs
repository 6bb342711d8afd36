//! Merging a point into a neighbour.

use super::mask::Mask;
use super::ring::{LONGEST, Ring};
use super::work::Work;
use monro_geometry::d3::{add, distance, scale};
use monro_geometry::{Point, nearest_on_triangle};

/// Longer rings than this are not collapsed (their link would have to be stored).
const MOST_NEIGHBOURS: usize = 96;

impl Work<'_> {
    /// Merges `v` into `w` when the mesh stays what it is (link condition in the mesh and in the surfaces), no element
    /// gets worse than `floor`, and surfaces keep within `sag` mm of where they belong.
    pub(super) fn collapse(&mut self, v: u32, w: u32, floor: f64, sag: f64) -> bool {
        let (mv, mw) = (self.masks[v as usize], self.masks[w as usize]);
        let inner = mv.count() == 1;
        if !mv.is_within(mw) || (!inner && !self.edge_on_surfaces(v, w)) {
            return false;
        }
        // Elements with both points vanish, the others must stay good.
        for &t in &self.stars[v as usize] {
            let tet = self.tets[t as usize];
            if !tet.contains(&w) && self.worth(tet.map(|x| if x == v { w } else { x })) <= floor {
                return false;
            }
        }
        if !inner && !self.surface_link(v, w) {
            return false;
        }
        // A surface cannot go further than its point.
        let length = distance(self.points[v as usize], self.points[w as usize]);
        if !inner {
            let near = length <= sag;
            let drift = self.drift[v as usize] + if near { length } else { self.left_behind(v, w) };
            if !near && (drift > sag || !self.surface_keeps(v, w, sag)) {
                return false;
            }
            self.drift[w as usize] = self.drift[w as usize].max(drift);
        }
        self.merge(v, w, inner);
        true
    }

    /// How far `v` lies from the surface triangles that take the place of those around it: the tip of a horn must not be
    /// merged away although what is left lies on the surface.
    fn left_behind(&self, v: u32, w: u32) -> f64 {
        let (from, to) = (self.points[v as usize], self.points[w as usize]);
        let mut least = f64::INFINITY;
        for &t in &self.stars[v as usize] {
            let tet = self.tets[t as usize];
            if tet.contains(&w) {
                continue;
            }
            for &skip in tet.iter().filter(|&&x| x != v) {
                let mut others = tet.iter().filter(|&&x| x != v && x != skip).map(|&x| self.points[x as usize]);
                if let (Some(_), Some(a), Some(b)) = (self.face_pair(t, skip), others.next(), others.next()) {
                    let near = nearest_on_triangle(Point::from_array(from), [a, b, to].map(Point::from_array));
                    least = least.min(distance(near.to_array(), from));
                }
            }
        }
        least
    }

    fn merge(&mut self, v: u32, w: u32, inner: bool) {
        let star = self.stars[v as usize].clone();
        let mut touched = Vec::new();
        for t in star {
            let (tet, label) = (self.tets[t as usize], self.labels[t as usize]);
            touched.extend(tet);
            self.remove(t);
            if !tet.contains(&w) {
                self.insert(tet.map(|x| if x == v { w } else { x }), label);
            }
        }
        if !inner {
            touched.sort_unstable();
            touched.dedup();
            touched.into_iter().filter(|&x| x != v).for_each(|x| self.refresh_mask(x));
        }
    }

    /// Neighbours of a point, sorted.
    fn neighbours(&self, v: u32) -> Vec<u32> {
        let mut all: Vec<u32> =
            self.stars[v as usize].iter().flat_map(|&t| self.tets[t as usize]).filter(|&x| x != v).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Whether an edge lies on the same surfaces as its first point.
    fn edge_on_surfaces(&self, v: u32, w: u32) -> bool {
        self.edge_mask(v, w) == self.masks[v as usize]
    }

    /// Link condition for a point and an edge on the same surfaces: the only common neighbours are those around the edge.
    fn surface_link(&self, v: u32, w: u32) -> bool {
        let Some(ring) = Ring::new(self, v, w) else { return false };
        let (a, b) = (self.neighbours(v), self.neighbours(w));
        if a.len() > MOST_NEIGHBOURS || b.len() > MOST_NEIGHBOURS {
            return false;
        }
        let around = if ring.closed { ring.len } else { ring.len + 1 };
        debug_assert!(around <= LONGEST + 1);
        a.iter().filter(|x| b.binary_search(x).is_ok()).count() == around && self.sheets_link(v, w, &a, &b)
    }

    /// In the surface of each label, and in the outer one, the two points may share two neighbours only: an edge to a third point
    /// may lie in the surface on both sides without its triangle doing so, also where it parts the label from others than the
    /// other edge does. Merged, the label would meet itself there.
    fn sheets_link(&self, v: u32, w: u32, a: &[u32], b: &[u32]) -> bool {
        let mask = self.masks[v as usize];
        for &x in a.iter().filter(|x| b.binary_search(x).is_ok()) {
            let at = self.masks[x as usize];
            if at.count() < 2 || (at & mask).count() == 0 {
                continue;
            }
            let (from, to) = (self.edge_mask(v, x), self.edge_mask(w, x));
            if from.count() >= 2 && to.count() >= 2 && !(from & to).is_within(self.face_mask(v, w, x)) {
                return false;
            }
        }
        true
    }

    /// Labels around an edge, with the outside.
    fn edge_mask(&self, a: u32, b: u32) -> Mask {
        // Too long a ring to order: assume the worst.
        Ring::new(self, a, b).map_or(Mask::ALL, |ring| {
            let labels =
                ring.tets[..ring.len].iter().fold(Mask::default(), |m, &t| m | Mask::of(self.labels[t as usize]));
            labels | if ring.closed { Mask::default() } else { Mask::OUTSIDE }
        })
    }

    /// What a face parts, labels or the outside; nothing where both sides are of one label.
    fn face_mask(&self, a: u32, b: u32, c: u32) -> Mask {
        let mut labels = self.stars[a as usize]
            .iter()
            .filter(|&&t| self.tets[t as usize].contains(&b) && self.tets[t as usize].contains(&c))
            .map(|&t| Mask::of(self.labels[t as usize]));
        match (labels.next(), labels.next()) {
            (Some(x), Some(y)) if x != y => x | y,
            (Some(x), None) => x | Mask::OUTSIDE,
            _ => Mask::default(),
        }
    }

    /// Whether the surface triangles around `v` still follow their surface after the merge.
    fn surface_keeps(&self, v: u32, w: u32, sag: f64) -> bool {
        let to = self.points[w as usize];
        for &t in &self.stars[v as usize] {
            let tet = self.tets[t as usize];
            if tet.contains(&w) {
                continue;
            }
            for &skip in tet.iter().filter(|&&x| x != v) {
                let Some(pair) = self.face_pair(t, skip) else { continue };
                let others: Vec<_> =
                    tet.iter().filter(|&&x| x != v && x != skip).map(|&x| self.points[x as usize]).collect();
                let middle = scale(add(add(others[0], others[1]), to), 1.0 / 3.0);
                let reach = distance(middle, to);
                let half = |p| scale(add(p, to), 0.5);
                let tests = [middle, half(others[0]), half(others[1])];
                if tests.into_iter().any(|p| self.sag(pair, p, reach) > sag) {
                    return false;
                }
            }
        }
        true
    }

    /// What the face of `t` opposite to `skip` separates; `None` inside one label, or seen from its higher label.
    fn face_pair(&self, t: u32, skip: u32) -> Option<(u8, Option<u8>)> {
        let face: Vec<u32> = self.tets[t as usize].into_iter().filter(|&x| x != skip).collect();
        let holds = |&x: &u32| x != t && face.iter().all(|v| self.tets[x as usize].contains(v));
        let own = self.labels[t as usize];
        match self.stars[face[0] as usize].iter().copied().find(holds) {
            None => Some((own, None)),
            Some(other) => {
                let other = self.labels[other as usize];
                (own < other).then_some((own, Some(other)))
            }
        }
    }
}
