//! Queries by boxes: triangles whose boxes meet each other or a point's surroundings.

use super::{Bvh, Node};
use crate::{Patient, Point};
use core::ops::{ControlFlow, Range};

/// Lowest and highest corner.
pub(crate) type Box3 = [[f64; 3]; 2];

impl Bvh {
    /// The triangles in the order of their slots, near ones near each other: their numbers.
    pub(crate) fn numbers(&self) -> &[u32] {
        &self.order
    }

    /// And their corners.
    pub(crate) fn slots(&self) -> &[[Point<Patient>; 3]] {
        &self.corners
    }

    /// Shows the slots of each pair of a triangle of this hierarchy and one of another whose boxes (by slot) meet, once, in an
    /// order that depends on the triangles alone, until `visit` breaks; of a hierarchy and itself each pair of different triangles.
    /// Triangles with coordinates that are not finite may be shown or not.
    pub(crate) fn box_pairs(
        &self,
        other: &Self,
        boxes: [&[Box3]; 2],
        mut visit: impl FnMut([usize; 2]) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let same = core::ptr::eq(self, other);
        let empty = self.nodes.is_empty() || other.nodes.is_empty();
        let mut stack = if empty { Vec::new() } else { vec![(0u32, 0u32)] };
        while let Some((i, j)) = stack.pop() {
            let (a, b) = (&self.nodes[i as usize], &other.nodes[j as usize]);
            let itself = same && i == j;
            if !itself && !meet(&[a.low, a.high], &[b.low, b.high]) {
                continue;
            }
            match (a.count, b.count) {
                (0, 0) if itself => stack.extend([(i + 1, a.first), (a.first, a.first), (i + 1, i + 1)]),
                (0, _) if b.count > 0 || extent(a) >= extent(b) => stack.extend([(a.first, j), (i + 1, j)]),
                (_, 0) => stack.extend([(i, b.first), (i, j + 1)]),
                _ => slot_pairs([slots(a), slots(b)], itself, boxes, &mut visit)?,
            }
        }
        ControlFlow::Continue(())
    }

    /// Shows each triangle whose box comes within `reach` (mm) of a point, with its corners.
    pub(crate) fn near(&self, p: Point<Patient>, reach: f64, mut visit: impl FnMut(u32, &[Point<Patient>; 3])) {
        let p = p.to_array();
        let around = [p.map(|c| c - reach), p.map(|c| c + reach)];
        let mut stack = if self.nodes.is_empty() { Vec::new() } else { vec![0u32] };
        while let Some(i) = stack.pop() {
            let node = &self.nodes[i as usize];
            if !meet(&[node.low, node.high], &around) {
                continue;
            }
            if node.count == 0 {
                stack.extend([node.first, i + 1]);
                continue;
            }
            for slot in slots(node) {
                if meet(&of_triangle(&self.corners[slot]), &around) {
                    visit(self.order[slot], &self.corners[slot]);
                }
            }
        }
    }
}

/// The slots of a leaf.
fn slots(leaf: &Node) -> Range<usize> {
    leaf.first as usize..(leaf.first + leaf.count) as usize
}

/// The pairs of two leaves, or of one with itself.
fn slot_pairs(
    [of, with]: [Range<usize>; 2],
    itself: bool,
    boxes: [&[Box3]; 2],
    visit: &mut impl FnMut([usize; 2]) -> ControlFlow<()>,
) -> ControlFlow<()> {
    for p in of {
        for q in with.clone().filter(|&q| !itself || p < q) {
            if meet(&boxes[0][p], &boxes[1][q]) {
                visit([p, q])?;
            }
        }
    }
    ControlFlow::Continue(())
}

/// The longest side of a node's box, mm.
fn extent(node: &Node) -> f64 {
    (0..3).map(|a| node.high[a] - node.low[a]).fold(0.0, f64::max)
}

/// The box of a triangle.
pub(crate) fn of_triangle([a, b, c]: &[Point<Patient>; 3]) -> Box3 {
    let [a, b, c] = [a, b, c].map(|p| p.to_array());
    [core::array::from_fn(|k| a[k].min(b[k]).min(c[k])), core::array::from_fn(|k| a[k].max(b[k]).max(c[k]))]
}

fn meet(a: &Box3, b: &Box3) -> bool {
    (0..3).all(|k| a[0][k] <= b[1][k] && b[0][k] <= a[1][k])
}
