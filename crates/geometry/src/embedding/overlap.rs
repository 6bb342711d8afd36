//! Elements that lie in one another.

use super::TetLocator;
use crate::{Patient, Point};
use core::fmt;

/// A point whose weights in an element are all above this lies inside of it, not on its rim.
const INSIDE: f64 = 1e-4;

/// Elements that lie in one another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overlap {
    /// Elements found in others.
    pub elements: usize,
    /// The first of them and the other one.
    pub pair: [usize; 2],
    /// A point in both, mm.
    pub at: Point<Patient>,
}

impl fmt::Display for Overlap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (elements, [one, other], [x, y, z]) = (self.elements, self.pair, self.at.to_array());
        write!(
            f,
            "{elements} element(s) lie in others, the first are tetrahedra {one} and {other} at ({x:.1}, {y:.1}, {z:.1}) mm: \
             parts of the mesh overlap, and volumes count twice"
        )
    }
}

impl TetLocator {
    /// Looks for elements that overlap without sharing a face, as two bodies that were put into one another. Tried are the
    /// middles of all elements, and the corners of those at the boundary, which bounds what overlaps: parts that only graze
    /// each other may be missed. `None` where there is none.
    pub fn overlap(&self) -> Option<Overlap> {
        let mut at_boundary = vec![false; self.tets.len()];
        self.behind.iter().for_each(|&(t, _)| at_boundary[t as usize] = true);
        let mut found: Option<Overlap> = None;
        for (t, corners_too) in at_boundary.into_iter().enumerate() {
            let Some((other, at)) = self.overlapping(t, corners_too) else { continue };
            let first = found.get_or_insert(Overlap { elements: 0, pair: [t, other], at });
            first.elements += 1;
        }
        found
    }

    /// Another element, and a point of `t` inside of it: its middle, or one of its corners.
    fn overlapping(&self, t: usize, corners_too: bool) -> Option<(usize, Point<Patient>)> {
        let corners = self.tets[t].map(|v| self.vertices[v as usize]);
        let middle = corners[0].lerp(corners[1], 0.5).lerp(corners[2].lerp(corners[3], 0.5), 0.5);
        let tried = if corners_too { &corners[..] } else { &[] };
        core::iter::once(&middle).chain(tried).find_map(|&p| {
            let inside = |&&o: &&u32| o as usize != t && self.weights(o as usize, p).iter().all(|&w| w > INSIDE);
            self.cells.candidates(p).iter().find(inside).map(|&o| (o as usize, p))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::block;
    use super::*;

    #[test]
    fn two_bodies_put_into_one_another_were_taken() {
        let mut mesh = block(2);
        let whole = TetLocator::new(&mesh).expect("valid").overlap();
        assert_eq!(whole, None);
        let (first, n) = (mesh.vertices.len() as u32, mesh.tets.len());
        let moved: Vec<_> = mesh.vertices.iter().map(|p| Point::new(p.x + 1.7, p.y + 0.1, p.z + 0.2)).collect();
        mesh.vertices.extend(moved);
        mesh.tets.extend_from_within(..);
        mesh.tets[n..].iter_mut().flatten().for_each(|v| *v += first);
        mesh.labels.extend_from_within(..);
        let found = TetLocator::new(&mesh).expect("valid").overlap().expect("overlapping");
        assert!(found.pair[0] < n && found.pair[1] >= n && (1.7..=2.0).contains(&found.at.x), "{found:?}");
    }
}
