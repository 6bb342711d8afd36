//! Rigid, frictionless planes that single vertices lie on: they slide along them, lift off, and never go beyond.
//!
//! A vertex goes to the minimum of its own quadratic energy on the inner side, which is found by its multipliers (projected
//! Gauss-Seidel on the dual, exact in one round for a single plane): a stiff penalty would leave single precision nothing of
//! what is across it.

use crate::bytes;
use crate::model::Abutment;
use crate::vec3::{V3, add, axpy, cross, dot, scale, sub};

/// Rounds over the planes of a vertex that lies on several.
const ROUNDS: usize = 24;
/// Planes that count at most of those that a vertex lies on.
const MOST: usize = 8;

/// The planes of each vertex; all empty where there are none.
#[derive(Debug, Clone, Default)]
pub(super) struct Abutments {
    /// First plane of each vertex and one more, and the planes' outward normals.
    first: Vec<u32>,
    outward: Vec<V3>,
}

impl Abutments {
    /// Of a model with so many vertices; `all` are in the order of their nodes.
    pub(super) fn new(all: &[Abutment], vertices: usize) -> Self {
        if all.is_empty() {
            return Self::default();
        }
        let first = (0..=vertices as u32).map(|v| all.partition_point(|a| a.node < v) as u32).collect();
        Self { first, outward: all.iter().map(|a| a.outward).collect() }
    }

    /// Whether there is any.
    #[inline(always)]
    pub(super) fn any(&self) -> bool {
        !self.outward.is_empty()
    }

    /// Whether vertex `v` lies on any.
    #[inline(always)]
    pub(super) fn on(&self, v: u32) -> bool {
        self.any() && self.first[v as usize] < self.first[v as usize + 1]
    }

    /// Changes the gradient and the Hessian of vertex `v`, `way` from its rest position, so that it does not go beyond; all else
    /// that acts on it is in them already.
    pub(super) fn act(&self, v: u32, way: V3, g: &mut V3, h: &mut [f32; 6]) {
        let planes = &self.outward[self.first[v as usize] as usize..self.first[v as usize + 1] as usize];
        let free = solve(h, *g);
        let mut step = free;
        let mut pressed = [0.0f32; MOST];
        for _ in 0..if planes.len() > 1 { ROUNDS } else { 1 } {
            for (press, &n) in pressed.iter_mut().zip(planes) {
                let yields = solve(h, n);
                let beyond = dot(n, sub(way, step));
                let more = (beyond / dot(n, yields)).max(-*press);
                *press += more;
                step = axpy(step, more, yields);
            }
        }
        if step != free {
            // The step itself, for whoever solves for it.
            (*g, *h) = (step, [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
        }
    }

    /// Bytes that they take.
    pub(super) fn bytes(&self) -> usize {
        bytes::of(&self.first) + bytes::of(&self.outward)
    }
}

/// Solves a symmetric system `h d = g`.
fn solve([xx, yy, zz, xy, xz, yz]: &[f32; 6], g: V3) -> V3 {
    let rows = [[*xx, *xy, *xz], [*xy, *yy, *yz], [*xz, *yz, *zz]];
    let columns = [cross(rows[1], rows[2]), cross(rows[2], rows[0]), cross(rows[0], rows[1])];
    let sum = columns.iter().zip(g).fold([0.0; 3], |sum, (c, g)| add(sum, scale(*c, g)));
    scale(sum, 1.0 / dot(rows[0], columns[0]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_vertex_goes_to_its_least_energy_on_the_inner_side(
            spread in prop::array::uniform6(-1.0..1.0f32),
            g in prop::array::uniform3(-5.0..5.0f32),
            way in prop::array::uniform3(-1.0..1.0f32),
            towards in prop::array::uniform3(-1.0..1.0f32),
        ) {
            prop_assume!(dot(towards, towards) > 0.01);
            let n = scale(towards, 1.0 / dot(towards, towards).sqrt());
            // From the plane or from the inner side of it.
            let way = axpy(way, -dot(n, way).max(0.0), n);
            let h = [4.0, 5.0, 6.0, spread[0], spread[1], spread[2]];
            let all = Abutments::new(&[Abutment { node: 1, outward: n }], 3);
            prop_assert!(all.on(1) && !all.on(0) && !all.on(2));
            let (mut gradient, mut hessian) = (g, h);
            all.act(1, way, &mut gradient, &mut hessian);
            let (free, went) = (solve(&h, g), solve(&hessian, gradient));
            let beyond = dot(n, sub(way, free));
            if beyond <= 0.0 {
                prop_assert_eq!(free, went);
                return Ok(());
            }
            // On the plane; what is left of the gradient there pushes straight outward.
            let at = dot(n, sub(way, went));
            prop_assert!(at.abs() < 1e-5, "{at} for {beyond}");
            let times = |[xx, yy, zz, xy, xz, yz]: [f32; 6], d: V3| {
                [dot([xx, xy, xz], d), dot([xy, yy, yz], d), dot([xz, yz, zz], d)]
            };
            let left = sub(g, times(h, went));
            let across = axpy(left, -dot(left, n), n);
            prop_assert!(dot(left, n) < 0.0 && dot(across, across).sqrt() < 1e-5 * (1.0 + dot(g, g).sqrt()), "{left:?}");
        }
    }

    #[test]
    fn a_vertex_in_a_corner_stays_there_and_leaves_it_along_each_wall() {
        let walls = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.6, 0.0, 0.8]];
        let all = Abutments::new(&walls.map(|outward| Abutment { node: 0, outward }), 1);
        let h = [4.0, 5.0, 6.0, 1.0, -1.0, 0.5];
        let went = |g: V3| {
            let (mut gradient, mut hessian) = (g, h);
            all.act(0, [0.0; 3], &mut gradient, &mut hessian);
            scale(solve(&hessian, gradient), -1.0)
        };
        let inside = |p: V3| walls.iter().all(|&n| dot(n, p) < 1e-3);
        assert!(inside(went([-3.0, 4.0, -2.0])) && went([-3.0, 4.0, -2.0]).iter().all(|v| v.abs() < 1e-3));
        let along = went([-3.0, -4.0, -2.0]);
        assert!(inside(along) && along[1] > 0.5 && along[0].abs() < 1e-3, "{along:?}");
        let off = went([30.0, -4.0, 2.0]);
        assert!(off == scale(solve(&h, [30.0, -4.0, 2.0]), -1.0) && inside(off), "{off:?}");
    }
}
