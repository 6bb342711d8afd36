//! A rigid, frictionless wall that vertices lie against at rest, as the brain against the skull: they slide along it, lift off,
//! and never go beyond.
//!
//! The wall is given by planes through the rest positions of these vertices. Where a vertex has come nearer to the rest position
//! of another one along the surface it lies against that one's planes, so that it follows a wall that bends.
//!
//! A vertex goes to the minimum of its own quadratic energy on the inner side, which is found by its multipliers (projected
//! Gauss-Seidel on the dual, exact in one round for a single plane): a stiff penalty would leave single precision nothing of
//! what is across it.

use crate::bytes;
use crate::membrane::{Membranes, OUTSIDE};
use crate::vec3::{V3, add, axpy, cross, dot, scale, shift, sub, xyz};
use monro_geometry::by_point;

/// Rounds over the planes of a vertex that lies on several.
const ROUNDS: usize = 24;
/// Planes that count at most of those that a vertex lies on.
const MOST: usize = 8;

/// A vertex that lies against a plane through its rest position.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Abutment {
    pub(crate) node: u32,
    /// Unit normal of the plane, away from the tissue.
    pub(crate) outward: V3,
    /// Rate at which the vertex is slowed down, 1/s.
    pub(crate) drag: f32,
}

/// The planes of each vertex, and the others beside it on the outer surface that have some; all empty where there are none.
#[derive(Debug, Clone, Default)]
pub(crate) struct Abutments {
    /// First plane of each vertex and one more, and the planes' outward normals.
    first: Vec<u32>,
    outward: Vec<V3>,
    /// Rates at which their vertices are slowed down, 1/s.
    drag: Vec<f32>,
    /// First neighbour of each vertex and one more, and the neighbours.
    begin: Vec<u32>,
    beside: Vec<u32>,
}

impl Abutments {
    /// Of a model with so many vertices.
    pub(crate) fn new(mut all: Vec<Abutment>, membranes: &Membranes, vertices: usize) -> Self {
        if all.is_empty() {
            return Self::default();
        }
        all.sort_by_key(|a| a.node);
        let first = (0..=vertices as u32).map(|v| all.partition_point(|a| a.node < v) as u32).collect();
        let mut out = Self { first, outward: all.iter().map(|a| a.outward).collect(), ..Self::default() };
        out.drag = all.iter().map(|a| a.drag).collect();
        let faces = membranes.faces.iter().filter(|f| f.outer == OUTSIDE);
        let edges = faces.flat_map(|f| [0, 1, 2].map(|i| [f.nodes[i], f.nodes[(i + 1) % 3]]));
        // Each edge is one of two faces, which have it in opposite directions.
        let both: Vec<(u32, u32)> = edges.filter(|e| e.iter().all(|&v| out.on(v))).map(|[a, b]| (a, b)).collect();
        (out.begin, out.beside) = by_point(both.into_iter(), vertices);
        out
    }

    /// Whether there is any.
    #[inline(always)]
    pub(crate) fn any(&self) -> bool {
        !self.outward.is_empty()
    }

    /// Whether vertex `v` lies on any.
    #[inline(always)]
    pub(crate) fn on(&self, v: u32) -> bool {
        self.any() && self.first[v as usize] < self.first[v as usize + 1]
    }

    /// Vertices that lie on some, in order.
    fn nodes(&self) -> impl Iterator<Item = u32> {
        (0..self.first.len().saturating_sub(1) as u32).filter(|&v| self.on(v))
    }

    /// Number of planes.
    pub(crate) fn len(&self) -> usize {
        self.outward.len()
    }

    /// Sets for each vertex the one whose planes it lies against now: the nearest at rest, down along the surface from itself.
    pub(crate) fn follow(&self, positions: &[[f32; 4]], rest: &[[f32; 4]], at: &mut Vec<u32>) {
        at.clear();
        if !self.any() {
            return;
        }
        at.extend(0..positions.len() as u32);
        for v in self.nodes() {
            let x = xyz(positions[v as usize]);
            let away = |w: u32| {
                let d = sub(x, xyz(rest[w as usize]));
                dot(d, d)
            };
            let mut best = (away(v), v);
            loop {
                let beside = self.begin[best.1 as usize] as usize..self.begin[best.1 as usize + 1] as usize;
                let next =
                    self.beside[beside].iter().map(|&w| (away(w), w)).fold(best, |a, b| if b.0 < a.0 { b } else { a });
                if next.1 == best.1 {
                    break;
                }
                best = next;
            }
            at[v as usize] = best.1;
        }
    }

    /// Slows vertices down over a time, s.
    pub(crate) fn slow(&self, velocities: &mut [[f32; 4]], dt: f32) {
        for v in self.nodes() {
            let own = self.first[v as usize] as usize..self.first[v as usize + 1] as usize;
            let kept = (-dt * self.drag[own].iter().copied().fold(0.0, f32::max)).exp();
            velocities[v as usize] = velocities[v as usize].map(|s| kept * s);
        }
    }

    /// Puts vertices that have gone beyond back onto the planes that they lie against.
    pub(crate) fn put_back(&self, at: &[u32], rest: &[[f32; 4]], positions: &mut [[f32; 4]]) {
        for v in self.nodes() {
            let (p, wall) = (&mut positions[v as usize], at[v as usize]);
            for &n in self.planes(wall) {
                let beyond = dot(n, sub(xyz(*p), xyz(rest[wall as usize])));
                shift(p, -beyond.max(0.0), n);
            }
        }
    }

    /// Forces (mN) by which each wall presses on the vertices that lie against it, as far as these are to be balanced by what is in
    /// `missing`: that of a vertex on several planes is borne by one after the other.
    pub(crate) fn pressed(&self, at: &[u32], missing: &[[f64; 3]]) -> Vec<(u32, [f64; 3])> {
        let press = |v: u32| {
            let mut left = missing[v as usize];
            for n in self.planes(at[v as usize]).iter().map(|n| n.map(f64::from)) {
                let along = (0..3).map(|i| left[i] * n[i]).sum::<f64>().min(0.0);
                (0..3).for_each(|i| left[i] -= along * n[i]);
            }
            (v, [0, 1, 2].map(|i| missing[v as usize][i] - left[i]))
        };
        self.nodes().map(press).collect()
    }

    fn planes(&self, v: u32) -> &[V3] {
        &self.outward[self.first[v as usize] as usize..self.first[v as usize + 1] as usize]
    }

    /// Bytes that they take.
    pub(crate) fn bytes(&self) -> usize {
        bytes::of(&self.first)
            + bytes::of(&self.outward)
            + bytes::of(&self.drag)
            + bytes::of(&self.begin)
            + bytes::of(&self.beside)
    }
}

/// What vertices lie against in a substep.
#[derive(Clone, Copy)]
pub(crate) struct Against<'a> {
    pub(crate) abutments: &'a Abutments,
    /// For each vertex the one whose planes count ([`Abutments::follow`]).
    pub(crate) at: &'a [u32],
}

impl Against<'_> {
    /// Changes the gradient and the Hessian of vertex `v`, which is at `x`, so that it does not go beyond; all else that acts on it
    /// is in them already.
    pub(crate) fn act(&self, v: u32, (x, rest): (V3, &[[f32; 4]]), g: &mut V3, h: &mut [f32; 6]) {
        let wall = self.at[v as usize];
        let (planes, way) = (self.abutments.planes(wall), sub(x, xyz(rest[wall as usize])));
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
            let all = Abutments::new(vec![Abutment { node: 1, outward: n, drag: 0.0 }], &Membranes::default(), 3);
            prop_assert!(all.on(1) && !all.on(0) && !all.on(2));
            let (mut gradient, mut hessian) = (g, h);
            let against = Against { abutments: &all, at: &[0, 1, 2] };
            against.act(1, (way, &[[0.0; 4]; 3]), &mut gradient, &mut hessian);
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
        let walls_of = walls.map(|outward| Abutment { node: 0, outward, drag: 0.0 }).to_vec();
        let all = Abutments::new(walls_of, &Membranes::default(), 1);
        let h = [4.0, 5.0, 6.0, 1.0, -1.0, 0.5];
        let went = |g: V3| {
            let (mut gradient, mut hessian) = (g, h);
            let against = Against { abutments: &all, at: &[0] };
            against.act(0, ([0.0; 3], &[[0.0; 4]]), &mut gradient, &mut hessian);
            scale(solve(&hessian, gradient), -1.0)
        };
        let inside = |p: V3| walls.iter().all(|&n| dot(n, p) < 1e-3);
        assert!(inside(went([-3.0, 4.0, -2.0])) && went([-3.0, 4.0, -2.0]).iter().all(|v| v.abs() < 1e-3));
        let along = went([-3.0, -4.0, -2.0]);
        assert!(inside(along) && along[1] > 0.5 && along[0].abs() < 1e-3, "{along:?}");
        let off = went([30.0, -4.0, 2.0]);
        assert!(off == scale(solve(&h, [30.0, -4.0, 2.0]), -1.0) && inside(off), "{off:?}");
    }

    /// As the brain in the skull: with the plane at its own place a vertex left it along the tangent.
    #[test]
    fn a_vertex_that_slides_along_a_bend_follows_it() {
        // A strip of a cylinder of 10 mm about the z axis, seen from inside, in steps of 10 degrees.
        let (steps, radius) = (18u32, 10.0f32);
        let at = |degrees: f32, r: f32, z: f32| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            [r * cos, r * sin, z, 1.0]
        };
        let rest: Vec<[f32; 4]> =
            (0..=steps).flat_map(|i| [0.0, 1.0].map(|z| at(10.0 * i as f32, radius, z))).collect();
        let face = |nodes| crate::membrane::Membrane { nodes, inner: 0, outer: OUTSIDE };
        let quad = |i: u32| [face([2 * i, 2 * i + 2, 2 * i + 1]), face([2 * i + 2, 2 * i + 3, 2 * i + 1])];
        let mut membranes = Membranes::default();
        membranes.faces.extend((0..steps).flat_map(quad));
        let planes = (0..).zip(&rest).map(|(node, p)| Abutment {
            node,
            outward: [p[0] / radius, p[1] / radius, 0.0],
            drag: 2.0,
        });
        let all = Abutments::new(planes.collect(), &membranes, rest.len());
        let (mut positions, mut wall) = (rest.clone(), Vec::new());
        all.follow(&positions, &rest, &mut wall);
        assert!(wall.iter().zip(0..).all(|(&w, v)| w == v));
        // The first one goes round by 120 degrees, 1 mm beyond; another one is drawn away from the wall.
        (positions[0], positions[21]) = (at(122.0, radius + 1.0, 0.1), at(100.0, radius - 4.0, 0.9));
        all.follow(&positions, &rest, &mut wall);
        assert_eq!((wall[0], wall[21]), (24, 21));
        let drawn = positions[21];
        all.put_back(&wall, &rest, &mut positions);
        let [x, y, ..] = positions[0];
        assert!((x.hypot(y) - radius).abs() < 0.01 && positions[21] == drawn, "{:?}", positions[0]);
        let mut speed = vec![[1.0f32, -2.0, 0.5, 0.0]; rest.len()];
        all.slow(&mut speed, 0.25);
        assert!((speed[7][1] + 2.0 * (-0.5f32).exp()).abs() < 1e-6);
        let pressed = all.pressed(&wall, &vec![[0.0, -3.0, 0.0]; rest.len()]);
        let of = |v: u32| pressed.iter().find(|p| p.0 == v).map(|p| p.1).expect("lies against a wall");
        // At 120 degrees the wall bears what is across it of a force that drives upwards, and none of one that leads away.
        let (sin, cos) = 120f64.to_radians().sin_cos();
        assert!((of(0)[0] + 3.0 * sin * cos).abs() < 1e-5 && (of(0)[1] + 3.0 * sin * sin).abs() < 1e-5, "{:?}", of(0));
        assert_eq!(all.pressed(&wall, &vec![[0.0, 3.0, 0.0]; rest.len()])[0].1, [0.0; 3]);
    }
}
