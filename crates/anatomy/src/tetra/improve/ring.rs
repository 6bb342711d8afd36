//! Replacing the elements around an edge (Shewchuk 2002: edge removal by Klincsek's dynamic programming), also where the
//! edge lies between two labels or on the outer surface: then the surface's edge is flipped with it.

use super::super::adjacency::FACES;
use super::work::Work;

/// Longest ring that is looked at.
pub(super) const LONGEST: usize = 8;

/// The elements around an edge `a b`, in order, counter-clockwise seen along it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ring {
    pub(super) ends: [u32; 2],
    /// Points around; element `i` lies between point `i` and `i + 1`.
    pub(super) points: [u32; LONGEST + 1],
    pub(super) tets: [u32; LONGEST],
    /// Elements.
    pub(super) len: usize,
    /// Elements all around; otherwise the edge is on the outer surface and there is one point more than elements.
    pub(super) closed: bool,
}

impl Ring {
    /// `None` when there are too many elements or they do not form one ring or arc.
    pub(super) fn new(work: &Work<'_>, a: u32, b: u32) -> Option<Self> {
        let mut parts = [(0u32, 0u32, 0u32); LONGEST];
        let mut len = 0;
        let star = |v: u32| &work.stars[v as usize];
        let (star, other) = if star(b).len() < star(a).len() { (star(b), a) } else { (star(a), b) };
        for &t in star {
            let tet = work.tets[t as usize];
            // Of an element around one end it is the other one that counts.
            if let Some((u, v)) = corner(tet, other).and_then(|_| across(tet, a, b)) {
                if len == LONGEST {
                    return None;
                }
                parts[len] = (u, v, t);
                len += 1;
            }
        }
        let parts = &parts[..len];
        // An arc starts where no other element ends.
        let start = parts.iter().position(|p| parts.iter().all(|q| q.1 != p.0));
        let mut at = parts.get(start.unwrap_or(0))?;
        let mut ring =
            Self { ends: [a, b], points: [at.0; LONGEST + 1], tets: [0; LONGEST], len, closed: start.is_none() };
        for i in 0..len {
            ring.tets[i] = at.2;
            ring.points[i + 1] = at.1;
            match parts.iter().find(|p| p.0 == at.1) {
                Some(next) => at = next,
                None if i + 1 == len => {}
                None => return None,
            }
        }
        // Closed exactly after all elements, or open at the end.
        (ring.closed == (ring.points[len] == ring.points[0])).then_some(ring)
    }

    /// Parts with one label: `(first point, elements, label)`. `None` for more than two.
    pub(super) fn sectors(&self, work: &Work<'_>) -> Option<Sectors> {
        let label = |i: usize| work.labels[self.tets[i % self.len] as usize];
        let changes = |i: &usize| label(*i) != label((*i + self.len - 1) % self.len);
        let mut starts = (if self.closed { 0 } else { 1 }..self.len).filter(changes);
        match (starts.next(), starts.next(), starts.next()) {
            (None, ..) => Some(Sectors { count: 1, first: [0, 0], len: [self.len, 0], label: [label(0); 2] }),
            (Some(s), Some(e), None) if self.closed => {
                Some(Sectors { count: 2, first: [s, e], len: [e - s, self.len - (e - s)], label: [label(s), label(e)] })
            }
            _ => None,
        }
    }

    /// The point `i`, going round.
    pub(super) fn point(&self, i: usize) -> u32 {
        if self.closed { self.points[i % self.len] } else { self.points[i] }
    }
}

/// One or two runs of elements of one label around an edge.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sectors {
    pub(super) count: usize,
    pub(super) first: [usize; 2],
    pub(super) len: [usize; 2],
    pub(super) label: [u8; 2],
}

/// The other two corners of an element, by those of an edge, such that all four are in a positive order.
const OTHERS: [[[usize; 2]; 4]; 4] = [
    [[0, 0], [2, 3], [3, 1], [1, 2]],
    [[3, 2], [0, 0], [0, 3], [2, 0]],
    [[1, 3], [3, 0], [0, 0], [0, 1]],
    [[2, 1], [0, 2], [1, 0], [0, 0]],
];

/// The other two points of an element with the edge `a b`, such that `(a, b, u, v)` is positive.
fn across(tet: [u32; 4], a: u32, b: u32) -> Option<(u32, u32)> {
    let [k, l] = OTHERS[corner(tet, a)?][corner(tet, b)?];
    Some((tet[k], tet[l]))
}

/// Which corner of an element a point is. All four are compared: with ways out in between it takes longer.
fn corner(tet: [u32; 4], v: u32) -> Option<usize> {
    let [a, b, c, d] = tet.map(|x| usize::from(x == v));
    (a | b | c | d == 1).then_some(b + 2 * c + 3 * d)
}

/// New elements of a ring.
struct Plan {
    tets: Vec<([u32; 4], u8)>,
    worst: f64,
}

impl Work<'_> {
    /// Removes the edge `a b` when the best other filling of its ring beats the present worst element.
    pub(super) fn remove_edge(&mut self, a: u32, b: u32) -> bool {
        let Some(ring) = Ring::new(self, a, b) else { return false };
        let Some(sectors) = ring.sectors(self) else { return false };
        let tets = &ring.tets[..ring.len];
        let old = tets.iter().map(|&t| self.quality[t as usize]).fold(f64::INFINITY, f64::min);
        let on_surface = sectors.count == 2 || !ring.closed;
        if on_surface && !self.may_flip(&ring, &sectors) {
            return false;
        }
        let Some(plan) = self.plan(&ring, &sectors, old.max(0.0) + 1e-6) else { return false };
        if plan.worst <= old + 1e-6 {
            return false;
        }
        tets.iter().for_each(|&t| self.remove(t));
        for (tet, label) in plan.tets {
            self.insert(tet, label);
        }
        if on_surface {
            ring.ends.into_iter().chain(ring.points[..=ring.len].iter().copied()).for_each(|v| self.refresh_mask(v));
        }
        true
    }

    /// Whether the surface edge may be replaced by the one across: the new edge must not exist yet (or be interior to
    /// the one element that goes), and must lie as close to the surface as the old one or nearly so.
    fn may_flip(&self, ring: &Ring, sectors: &Sectors) -> bool {
        let (from, to) = match ring.closed {
            true => (ring.point(sectors.first[0]), ring.point(sectors.first[1])),
            false => (ring.points[0], ring.points[ring.len]),
        };
        let single = |i: usize| sectors.len[i] == 1;
        let goes = single(0) || (sectors.count == 2 && single(1));
        if goes {
            // The diagonal exists inside the element that goes; elsewhere it must be inside the same label.
            let Some(other) = Ring::new(self, from, to) else { return false };
            if !other.closed || other.sectors(self).is_none_or(|s| s.count != 1) {
                return false;
            }
        } else if self.has_edge(from, to) {
            return false;
        }
        let [a, b] = ring.ends;
        let pair = if ring.closed { (sectors.label[0], Some(sectors.label[1])) } else { (sectors.label[0], None) };
        self.edge_fits([from, to], [a, b], pair)
    }

    /// A filling of all sectors, each worse than `floor` nowhere.
    fn plan(&self, ring: &Ring, sectors: &Sectors, floor: f64) -> Option<Plan> {
        let mut plan = Plan { tets: Vec::new(), worst: f64::INFINITY };
        for s in 0..sectors.count {
            // A closed ring of one label is a polygon of its `len` points; a sector has one point more than elements.
            let whole = ring.closed && sectors.count == 1;
            let n = if whole { ring.len } else { sectors.len[s] + 1 };
            let mut polygon = [0u32; LONGEST + 1];
            (0..n).for_each(|i| polygon[i] = ring.point(sectors.first[s] + i));
            let worst = self.fill(ring.ends, &polygon[..n], sectors.label[s], floor, &mut plan.tets)?;
            plan.worst = plan.worst.min(worst);
        }
        Some(plan)
    }

    /// Triangulates a polygon around the edge so that the worst of the two elements on each triangle is best.
    fn fill(
        &self,
        [a, b]: [u32; 2],
        polygon: &[u32],
        label: u8,
        floor: f64,
        out: &mut Vec<([u32; 4], u8)>,
    ) -> Option<f64> {
        let n = polygon.len();
        let mut best = [[f64::INFINITY; LONGEST + 1]; LONGEST + 1];
        let mut apex = [[0usize; LONGEST + 1]; LONGEST + 1];
        for span in 2..n {
            for i in 0..n - span {
                let k = i + span;
                best[i][k] = f64::NEG_INFINITY;
                for j in i + 1..k {
                    let bound = best[i][j].min(best[j][k]);
                    if bound <= best[i][k].max(floor) {
                        continue;
                    }
                    let [p, q, r] = [polygon[i], polygon[j], polygon[k]];
                    let first = self.worth([p, q, r, b]);
                    if first <= best[i][k].max(floor) {
                        continue;
                    }
                    let worst = bound.min(first).min(self.worth([p, r, q, a]));
                    if worst > best[i][k] {
                        (best[i][k], apex[i][k]) = (worst, j);
                    }
                }
            }
        }
        if best[0][n - 1] <= floor {
            return None;
        }
        let mut stack = vec![(0, n - 1)];
        while let Some((i, k)) = stack.pop() {
            if k - i >= 2 {
                let j = apex[i][k];
                let [p, q, r] = [polygon[i], polygon[j], polygon[k]];
                out.extend([([p, q, r, b], label), ([p, r, q, a], label)]);
                stack.extend([(i, j), (j, k)]);
            }
        }
        Some(best[0][n - 1])
    }

    /// Replaces the face of `t` opposite to its corner `i` by the edge across (two elements become three).
    pub(super) fn swap_face(&mut self, t: u32, i: usize) -> bool {
        let tet = self.tets[t as usize];
        // As seen from within.
        let [p, r, q] = FACES[i].map(|k| tet[k]);
        let d = tet[i];
        let holds = |&x: &u32| x != t && [q, r].iter().all(|v| self.tets[x as usize].contains(v));
        let Some(other) = self.stars[p as usize].iter().copied().find(holds) else { return false };
        if self.labels[other as usize] != self.labels[t as usize] {
            return false;
        }
        let Some(e) = self.tets[other as usize].into_iter().find(|v| ![p, q, r].contains(v)) else { return false };
        let old = self.quality[t as usize].min(self.quality[other as usize]) + 1e-6;
        let new = [[e, d, p, q], [e, d, q, r], [e, d, r, p]];
        if new.iter().any(|&n| self.worth(n) <= old) {
            return false;
        }
        let label = self.labels[t as usize];
        self.remove(t);
        self.remove(other);
        for n in new {
            self.insert(n, label);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_and_the_other_two_corners_are_in_a_positive_order() {
        let tet = [7, 3, 9, 5];
        for (i, j) in (0..4).flat_map(|i| (0..4).map(move |j| (i, j))).filter(|(i, j)| i != j) {
            let (u, v) = across(tet, tet[i], tet[j]).expect("an edge of it");
            let order = [tet[i], tet[j], u, v].map(|x| corner(tet, x).expect("a corner of it"));
            let pairs = (0..4).flat_map(|x| (x + 1..4).map(move |y| (x, y)));
            assert_eq!(pairs.filter(|&(x, y)| order[x] > order[y]).count() % 2, 0, "{order:?}");
            assert_eq!(order.iter().map(|o| 1 << o).sum::<u32>(), 15, "{order:?}");
        }
        assert_eq!(across(tet, 7, 4), None);
    }
}
