//! Queries by boxes: triangles whose boxes meet each other or a point's surroundings.

use super::Bvh;
use crate::{Patient, Point};
use core::ops::ControlFlow;

type Box3 = [[f64; 3]; 2];
/// Two triangles: their numbers and their corners.
pub(crate) type BoxPair<'a> = ([u32; 2], [&'a [Point<Patient>; 3]; 2]);

impl Bvh {
    /// Shows each pair of different triangles whose boxes meet once, in an order that depends on the mesh alone, until
    /// `visit` breaks. Triangles with coordinates that are not finite may be shown or not.
    pub(crate) fn box_pairs(&self, mut visit: impl FnMut(BoxPair<'_>) -> ControlFlow<()>) -> ControlFlow<()> {
        let boxes: Vec<Box3> = self.corners.iter().map(of_triangle).collect();
        let mut stack = if self.nodes.is_empty() { Vec::new() } else { vec![(0u32, 0u32)] };
        while let Some((i, j)) = stack.pop() {
            let [a, b] = [i, j].map(|n| &self.nodes[n as usize]);
            if i != j && !meet(&[a.low, a.high], &[b.low, b.high]) {
                continue;
            }
            match (a.count, b.count) {
                (0, 0) if i == j => stack.extend([(i + 1, a.first), (a.first, a.first), (i + 1, i + 1)]),
                (0, _) => stack.extend([(a.first, j), (i + 1, j)]),
                (_, 0) => stack.extend([(i, b.first), (i, j + 1)]),
                _ => self.leaf_pairs(i, j, &boxes, &mut visit)?,
            }
        }
        ControlFlow::Continue(())
    }

    /// The pairs of two leaves, or of one with itself.
    fn leaf_pairs(
        &self,
        i: u32,
        j: u32,
        boxes: &[Box3],
        visit: &mut impl FnMut(BoxPair<'_>) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let slots = |n: u32| {
            let node = &self.nodes[n as usize];
            node.first as usize..(node.first + node.count) as usize
        };
        for p in slots(i) {
            for q in slots(j).filter(|&q| i != j || p < q) {
                if meet(&boxes[p], &boxes[q]) {
                    visit(([self.order[p], self.order[q]], [&self.corners[p], &self.corners[q]]))?;
                }
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
            for slot in node.first as usize..(node.first + node.count) as usize {
                if meet(&of_triangle(&self.corners[slot]), &around) {
                    visit(self.order[slot], &self.corners[slot]);
                }
            }
        }
    }
}

fn of_triangle([a, b, c]: &[Point<Patient>; 3]) -> Box3 {
    let [a, b, c] = [a, b, c].map(|p| p.to_array());
    [core::array::from_fn(|k| a[k].min(b[k]).min(c[k])), core::array::from_fn(|k| a[k].max(b[k]).max(c[k]))]
}

fn meet(a: &Box3, b: &Box3) -> bool {
    (0..3).all(|k| a[0][k] <= b[1][k] && b[0][k] <= a[1][k])
}
