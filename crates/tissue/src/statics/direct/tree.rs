//! The order in which unknowns are eliminated: nested dissection by coordinates (George 1973).
//!
//! The body is cut into two halves again and again; vertices of elements that lie in both are kept for last. What is eliminated
//! together is a part; parts come after those they are made of, and what a part has to do with any later one is its border.

use std::collections::BTreeSet;

/// Points that are not worth another cut.
const LEAF: usize = 24;

/// No later part.
const NONE: usize = usize::MAX;

/// Points that are eliminated together.
#[derive(Debug, Clone)]
pub(super) struct Part {
    pub(super) own: Vec<u32>,
    /// Points of later parts that these have to do with, or those of earlier ones below them.
    pub(super) border: Vec<u32>,
    /// Elements of which a point is eliminated here and none before.
    pub(super) elements: Vec<u32>,
    /// The parts right below.
    pub(super) below: Vec<usize>,
}

/// All parts, each after those below it.
#[derive(Debug, Clone)]
pub(super) struct Tree {
    pub(super) parts: Vec<Part>,
    /// Part in which each point is eliminated.
    pub(super) part_of: Vec<usize>,
}

/// Which half of what is being cut a point is in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Side {
    Low,
    High,
    /// In a part already, or kept for last.
    Placed,
}

struct Cutter<'a> {
    at: &'a [[f64; 3]],
    /// Points of each element.
    elements: &'a [Vec<u32>],
    side: Vec<Side>,
    tree: Tree,
}

impl Tree {
    /// An order for points at `at` that belong to elements.
    pub(super) fn new(at: &[[f64; 3]], elements: &[Vec<u32>]) -> Self {
        let tree = Self { parts: Vec::new(), part_of: vec![NONE; at.len()] };
        let mut cutter = Cutter { at, elements, side: vec![Side::Low; at.len()], tree };
        cutter.cut((0..at.len() as u32).collect(), (0..elements.len() as u32).collect());
        cutter.tree
    }
}

impl Cutter<'_> {
    /// Cuts points with the elements that have any of them; the number of their last part.
    fn cut(&mut self, mut points: Vec<u32>, elements: Vec<u32>) -> usize {
        if points.len() <= LEAF {
            return self.place(points, elements, Vec::new());
        }
        self.halve(&mut points);
        let last = self.between(&elements);
        last.iter().for_each(|&p| self.side[p as usize] = Side::Placed);
        let of = |side: Side| points.iter().copied().filter(|&p| self.side[p as usize] == side).collect::<Vec<u32>>();
        let (low, high) = (of(Side::Low), of(Side::High));
        if low.is_empty() || high.is_empty() {
            return self.place(points, elements, Vec::new());
        }
        let (below_low, rest): (Vec<u32>, Vec<u32>) = elements.into_iter().partition(|&e| self.any(e, Side::Low));
        let (below_high, own): (Vec<u32>, Vec<u32>) = rest.into_iter().partition(|&e| self.any(e, Side::High));
        let below = vec![self.cut(low, below_low), self.cut(high, below_high)];
        self.place(last, own, below)
    }

    /// Marks the two halves along the longest side of the points' box.
    fn halve(&mut self, points: &mut [u32]) {
        let ends = |a: usize| {
            let along = points.iter().map(|&p| self.at[p as usize][a]);
            along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
        };
        let long = |a: usize| ends(a).1 - ends(a).0;
        let axis = (1..3).fold(0, |best, a| if long(a) > long(best) { a } else { best });
        points
            .sort_unstable_by(|&p, &q| self.at[p as usize][axis].total_cmp(&self.at[q as usize][axis]).then(p.cmp(&q)));
        let half = points.len() / 2;
        for (i, &p) in points.iter().enumerate() {
            self.side[p as usize] = if i < half { Side::Low } else { Side::High };
        }
    }

    fn any(&self, element: u32, side: Side) -> bool {
        self.elements[element as usize].iter().any(|&p| self.side[p as usize] == side)
    }

    /// The points of elements in both halves that lie in one of them: in that which has fewer.
    fn between(&self, elements: &[u32]) -> Vec<u32> {
        let both = elements.iter().filter(|&&e| self.any(e, Side::Low) && self.any(e, Side::High));
        let points: BTreeSet<u32> = both.flat_map(|&e| self.elements[e as usize].iter().copied()).collect();
        let of = |side: Side| points.iter().copied().filter(|&p| self.side[p as usize] == side).collect::<Vec<u32>>();
        let (low, high) = (of(Side::Low), of(Side::High));
        if low.len() < high.len() { low } else { high }
    }

    fn place(&mut self, own: Vec<u32>, elements: Vec<u32>, below: Vec<usize>) -> usize {
        let number = self.tree.parts.len();
        for &p in &own {
            self.side[p as usize] = Side::Placed;
            self.tree.part_of[p as usize] = number;
        }
        let here = elements.iter().flat_map(|&e| self.elements[e as usize].iter());
        let from_below = below.iter().flat_map(|&b| self.tree.parts[b].border.iter());
        let later = here.chain(from_below).copied().filter(|&p| self.tree.part_of[p as usize] == NONE);
        let border = later.collect::<BTreeSet<u32>>().into_iter().collect();
        self.tree.parts.push(Part { own, border, elements, below });
        number
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::block;

    #[test]
    fn every_point_is_eliminated_once_and_all_of_an_element_is_there_when_its_first_point_goes() {
        let mesh = block([6, 5, 4], 3.0);
        let at: Vec<[f64; 3]> = mesh.vertices.iter().map(|p| p.to_array()).collect();
        let elements: Vec<Vec<u32>> = mesh.tets.iter().map(|t| t.to_vec()).collect();
        let tree = Tree::new(&at, &elements);
        let mut count = vec![0; at.len()];
        let mut met = vec![false; elements.len()];
        for (number, part) in tree.parts.iter().enumerate() {
            part.own.iter().for_each(|&p| count[p as usize] += 1);
            assert!(part.border.iter().all(|&p| tree.part_of[p as usize] > number));
            assert!(part.below.iter().all(|&b| b < number));
            for &e in &part.elements {
                assert!(!core::mem::replace(&mut met[e as usize], true));
                let points = &elements[e as usize];
                let first = points.iter().map(|&p| tree.part_of[p as usize]).min();
                assert_eq!(first, Some(number));
                assert!(points.iter().all(|p| part.own.contains(p) || part.border.contains(p)));
            }
        }
        assert!(count.iter().all(|&c| c == 1) && met.iter().all(|&m| m));
        assert!(tree.parts.len() > 10 && tree.parts.iter().all(|p| p.own.len() <= 42), "cut where it is thin");
    }

    #[test]
    fn points_in_one_place_and_a_single_element_are_one_part() {
        let tree = Tree::new(&[[0.0; 3]; 40], &[(0..40).collect()]);
        assert_eq!(tree.parts.len(), 1);
        assert_eq!(tree.parts[0].own.len(), 40);
    }
}
