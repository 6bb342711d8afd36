//! The nearest point of a surface.
//!
//! The hierarchy's nodes by fours: boxes of four children are looked at together, in half the steps and without a guess at
//! each of them, and the last ones are those of single triangles, most of which need no look themselves.

use super::{Bvh, Nearest, Node, of_triangle};
use crate::{Patient, Point};

/// Entries of the list of what is still to be looked at: four, and three more for each further level, of which there are
/// fifteen at most, as an array may have 2^32 triangles.
const DEEPEST: usize = 52;

/// Four children: nodes, or triangles by their slots. Boxes that are not there are infinitely far.
#[derive(Debug, Clone)]
pub(super) struct Four {
    low: [[f64; 4]; 3],
    high: [[f64; 4]; 3],
    child: [u32; 4],
    triangles: bool,
}

impl Four {
    fn of(triangles: bool) -> Self {
        Self { low: [[f64::INFINITY; 4]; 3], high: [[f64::NEG_INFINITY; 4]; 3], child: [0; 4], triangles }
    }

    fn set(&mut self, lane: usize, child: u32, [low, high]: [[f64; 3]; 2]) {
        for a in 0..3 {
            (self.low[a][lane], self.high[a][lane]) = (low[a], high[a]);
        }
        self.child[lane] = child;
    }

    /// Squares of the distances of a point from the boxes.
    fn distances_squared(&self, p: [f64; 3]) -> [f64; 4] {
        let larger = |a: f64, b: f64| if a > b { a } else { b };
        let mut sum = [0.0; 4];
        for ((low, high), p) in self.low.iter().zip(&self.high).zip(p) {
            for (lane, sum) in sum.iter_mut().enumerate() {
                let off = larger(larger(low[lane] - p, p - high[lane]), 0.0);
                *sum += off * off;
            }
        }
        sum
    }
}

/// A hierarchy by fours, the root first.
pub(super) fn fours(nodes: &[Node], corners: &[[Point<Patient>; 3]]) -> Vec<Four> {
    let mut out = Vec::with_capacity(nodes.len());
    if !nodes.is_empty() {
        gather(nodes, 0, corners, &mut out);
    }
    out
}

/// Adds what is below a node.
fn gather(nodes: &[Node], at: u32, corners: &[[Point<Patient>; 3]], out: &mut Vec<Four>) {
    let (own, node) = (out.len(), &nodes[at as usize]);
    out.push(Four::of(node.count > 0));
    if node.count > 0 {
        for lane in 0..node.count {
            let slot = node.first + lane;
            out[own].set(lane as usize, slot, of_triangle(&corners[slot as usize]));
        }
        return;
    }
    let halves = [at + 1, node.first];
    let below = halves.into_iter().flat_map(|half| match &nodes[half as usize] {
        leaf if leaf.count > 0 => [Some(half), None],
        inner => [Some(half + 1), Some(inner.first)],
    });
    for (lane, child) in below.flatten().enumerate() {
        let number = out.len() as u32;
        out[own].set(lane, number, [nodes[child as usize].low, nodes[child as usize].high]);
        gather(nodes, child, corners, out);
    }
}

impl Bvh {
    /// The point of the surface nearest to `p`; `None` for an empty mesh or a non-finite point.
    pub fn nearest(&self, p: Point<Patient>) -> Option<Nearest> {
        self.nearer_than(p, None)
    }

    /// As [`Bvh::nearest`], several times faster where `near`, a triangle thought to be near the nearest one, is: the
    /// answer for the point before in a coherent order. Of several points equally near it may choose another one.
    pub fn nearest_from(&self, near: usize, p: Point<Patient>) -> Option<Nearest> {
        let Some(&slot) = self.place.get(near) else { return self.nearest(p) };
        let point = nearest_on_triangle(p, self.corners[slot as usize]);
        let distance = p.distance(point);
        self.nearer_than(p, distance.is_finite().then_some(Nearest { point, distance, triangle: near }))
    }

    /// The nearest point, or `best` where there is none nearer.
    fn nearer_than(&self, p: Point<Patient>, mut best: Option<Nearest>) -> Option<Nearest> {
        let mut limit = best.map_or(f64::INFINITY, |b| (p - b.point).norm_squared());
        // Two lists, which are made empty faster than one of pairs.
        let (mut waiting, mut reach) = ([0u32; DEEPEST], [0f64; DEEPEST]);
        let mut depth = usize::from(!self.fours.is_empty());
        while depth > 0 {
            depth -= 1;
            if reach[depth] >= limit {
                continue;
            }
            let four = &self.fours[waiting[depth] as usize];
            let distances = four.distances_squared(p.to_array());
            if four.triangles {
                for (&slot, d) in four.child.iter().zip(distances) {
                    if d < limit {
                        self.try_triangle(slot as usize, p, &mut limit, &mut best);
                    }
                }
                continue;
            }
            let first = depth;
            for (&child, d) in four.child.iter().zip(distances).filter(|&(_, d)| d < limit) {
                // The nearest comes last, so that it is taken first.
                let mut at = depth;
                while at > first && reach[at - 1] < d {
                    (waiting[at], reach[at]) = (waiting[at - 1], reach[at - 1]);
                    at -= 1;
                }
                (waiting[at], reach[at]) = (child, d);
                depth += 1;
            }
        }
        best
    }

    fn try_triangle(&self, slot: usize, p: Point<Patient>, limit: &mut f64, best: &mut Option<Nearest>) {
        let point = nearest_on_triangle(p, self.corners[slot]);
        let d = (p - point).norm_squared();
        if d < *limit {
            *limit = d;
            *best = Some(Nearest { point, distance: d.sqrt(), triangle: self.order[slot] as usize });
        }
    }
}

/// Nearest point of a triangle (Ericson, Real-Time Collision Detection, 5.1.5).
pub fn nearest_on_triangle(p: Point<Patient>, [a, b, c]: [Point<Patient>; 3]) -> Point<Patient> {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let sum = va + vb + vc;
    a + ab * (vb / sum) + ac * (vc / sum)
}
