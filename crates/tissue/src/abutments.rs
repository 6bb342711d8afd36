//! A rigid, frictionless wall that vertices lie against at rest, as the brain against the skull: they slide along it, lift off,
//! and never go beyond.
//!
//! The wall goes through the rest positions of these vertices and bends smoothly between them: over each face of the outer
//! surface it is half-way from the face to the mean of its corners' planes, which on a ball is the ball (as in Boubekeur and Alexa,
//! "Phong tessellation", 2008, with 1/2 for 3/4). With the facets for a wall a vertex could not slide, and with the plane of the
//! nearest vertex there was the more room the further it slid: a brain under pressure turned by four degrees, and the skull held
//! 9 ml more.
//!
//! A vertex goes to the minimum of its own quadratic energy on the inner side, which is found by its multipliers (projected
//! Gauss-Seidel on the dual, exact in one round for a single plane): a stiff penalty would leave single precision nothing of
//! what is across it.

use crate::bytes;
use crate::contact::closest::point_triangle;
use crate::membrane::{Membranes, OUTSIDE};
use crate::vec3::{V3, add, axpy, cross, dot, scale, shift, sub, unit, xyz};
use monro_geometry::by_point;

/// Rounds over the planes of a vertex that lies on several.
const ROUNDS: usize = 24;
/// Planes that a vertex lies on at most.
pub(crate) const MOST: usize = 8;

/// A vertex that lies against a plane through its rest position.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Abutment {
    pub(crate) node: u32,
    /// Unit normal of the plane, away from the tissue.
    pub(crate) outward: V3,
    /// Rate at which the vertex is slowed down, 1/s.
    pub(crate) drag: f32,
}

/// The planes of each vertex, and the faces of the outer surface between such vertices; all empty where there are none.
#[derive(Debug, Clone, Default)]
pub(crate) struct Abutments {
    /// Vertices that lie on planes, in order.
    nodes: Vec<u32>,
    /// First plane of each vertex and one more, and the planes' outward normals.
    first: Vec<u32>,
    outward: Vec<V3>,
    /// Rates at which their vertices are slowed down, 1/s.
    drag: Vec<f32>,
    /// Faces, with the normal of each corner's plane that fits best.
    faces: Vec<([u32; 3], [V3; 3])>,
    /// First face of each vertex and one more, and the faces.
    begin: Vec<u32>,
    around: Vec<u32>,
}

/// Where the wall is that a vertex lies against.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    /// The vertex nearest at rest: all of its planes count where it lies on several.
    vertex: u32,
    /// The nearest point of the wall, and its outward normal there.
    point: V3,
    normal: V3,
}

impl Abutments {
    /// Of a model with vertices at `rest`.
    pub(crate) fn new(mut all: Vec<Abutment>, membranes: &Membranes, rest: &[[f32; 4]]) -> Self {
        if all.is_empty() {
            return Self::default();
        }
        all.sort_by_key(|a| a.node);
        let first = (0..=rest.len() as u32).map(|v| all.partition_point(|a| a.node < v) as u32).collect();
        let mut out = Self { first, outward: all.iter().map(|a| a.outward).collect(), ..Self::default() };
        out.drag = all.iter().map(|a| a.drag).collect();
        out.nodes = (0..rest.len() as u32).filter(|&v| out.on(v)).collect();
        let outer = membranes.faces.iter().filter(|f| f.outer == OUTSIDE && f.nodes.iter().all(|&v| out.on(v)));
        out.faces = outer.map(|f| (f.nodes, out.normals(f.nodes, rest))).collect();
        let corners = (0..).zip(&out.faces).flat_map(|(f, face)| face.0.map(|v| (v, f)));
        (out.begin, out.around) = by_point(corners.collect::<Vec<_>>().into_iter(), rest.len());
        out
    }

    /// Of each corner of a face, the normal of the plane that fits it best.
    fn normals(&self, nodes: [u32; 3], rest: &[[f32; 4]]) -> [V3; 3] {
        let [a, b, c] = nodes.map(|v| xyz(rest[v as usize]));
        let own = cross(sub(b, a), sub(c, a));
        nodes.map(|v| {
            let best = self.planes(v).iter().max_by(|m, n| dot(**m, own).total_cmp(&dot(**n, own)));
            best.copied().unwrap_or_default()
        })
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

    /// Number of planes.
    pub(crate) fn len(&self) -> usize {
        self.outward.len()
    }

    /// Finds for each vertex the place of the wall that it lies against now: beside the vertex nearest at rest, down along the
    /// surface from itself.
    pub(crate) fn follow(&self, positions: &[[f32; 4]], rest: &[[f32; 4]], at: &mut Vec<Place>) {
        at.clear();
        at.resize(if self.any() { positions.len() } else { 0 }, Place { vertex: 0, point: [0.0; 3], normal: [0.0; 3] });
        for &v in &self.nodes {
            let x = xyz(positions[v as usize]);
            let vertex = self.nearest(v, x, rest);
            at[v as usize] = match self.planes(vertex) {
                [_] => self.beside(vertex, x, rest),
                _ => None,
            }
            .unwrap_or(Place { vertex, point: xyz(rest[vertex as usize]), normal: self.planes(vertex)[0] });
        }
    }

    /// The vertex nearest to `x` at rest, down along the surface from `v`.
    fn nearest(&self, v: u32, x: V3, rest: &[[f32; 4]]) -> u32 {
        let away = |w: u32| {
            let d = sub(x, xyz(rest[w as usize]));
            dot(d, d)
        };
        let mut best = (away(v), v);
        loop {
            let beside = self.faces_around(best.1).flat_map(|f| f.0).map(|w| (away(w), w));
            let next = beside.fold(best, |a, b| if b.0 < a.0 { b } else { a });
            if next.1 == best.1 {
                return best.1;
            }
            best = next;
        }
    }

    /// The place of the smooth wall nearest to `x` on the faces around a vertex; `None` without any.
    fn beside(&self, vertex: u32, x: V3, rest: &[[f32; 4]]) -> Option<Place> {
        let found = self.faces_around(vertex).map(|(nodes, normals)| {
            let corners = nodes.map(|v| xyz(rest[v as usize]));
            (point_triangle(x, corners, 0.0), corners, normals)
        });
        let (near, corners, normals) = found.min_by(|a, b| a.0.distance2.total_cmp(&b.0.distance2))?;
        let mixed = |of: &[V3; 3]| (0..3).fold([0.0; 3], |sum, i| axpy(sum, near.weights[i], of[i]));
        let on_face = mixed(&corners);
        let rise = |i: usize| scale(normals[i], 0.5 * dot(normals[i], sub(corners[i], on_face)));
        let point = add(on_face, mixed(&[rise(0), rise(1), rise(2)]));
        Some(Place { vertex, point, normal: unit(mixed(normals))? })
    }

    fn faces_around(&self, v: u32) -> impl Iterator<Item = &([u32; 3], [V3; 3])> {
        let own = self.begin[v as usize] as usize..self.begin[v as usize + 1] as usize;
        self.around[own].iter().map(|&f| &self.faces[f as usize])
    }

    /// Points and normals of the planes that keep a vertex at such a place.
    fn walls<'a>(&'a self, place: &'a Place, rest: &[[f32; 4]]) -> impl Iterator<Item = (V3, V3)> + use<'a> {
        let several = self.planes(place.vertex);
        let corner = xyz(rest[place.vertex as usize]);
        let count = several.len();
        (0..count).map(move |i| if count > 1 { (corner, several[i]) } else { (place.point, place.normal) })
    }

    /// Slows vertices down over a time, s.
    pub(crate) fn slow(&self, velocities: &mut [[f32; 4]], dt: f32) {
        for &v in &self.nodes {
            let own = self.first[v as usize] as usize..self.first[v as usize + 1] as usize;
            let kept = (-dt * self.drag[own].iter().copied().fold(0.0, f32::max)).exp();
            velocities[v as usize] = velocities[v as usize].map(|s| kept * s);
        }
    }

    /// Puts vertices that have gone beyond back onto the wall that they lie against.
    pub(crate) fn put_back(&self, at: &[Place], rest: &[[f32; 4]], positions: &mut [[f32; 4]]) {
        for &v in &self.nodes {
            let p = &mut positions[v as usize];
            for (point, n) in self.walls(&at[v as usize], rest) {
                let beyond = dot(n, sub(xyz(*p), point));
                shift(p, -beyond.max(0.0), n);
            }
        }
    }

    /// Forces (mN) by which the wall presses on the vertices that lie against it, as far as these are to be balanced by what is in
    /// `missing`: that of a vertex on several planes is borne by one after the other.
    pub(crate) fn pressed(&self, at: &[Place], rest: &[[f32; 4]], missing: &[[f64; 3]]) -> Vec<(u32, [f64; 3])> {
        let press = |&v: &u32| {
            let mut left = missing[v as usize];
            for n in self.walls(&at[v as usize], rest).map(|w| w.1.map(f64::from)) {
                let along = (0..3).map(|i| left[i] * n[i]).sum::<f64>().min(0.0);
                (0..3).for_each(|i| left[i] -= along * n[i]);
            }
            (v, [0, 1, 2].map(|i| missing[v as usize][i] - left[i]))
        };
        self.nodes.iter().map(press).collect()
    }

    fn planes(&self, v: u32) -> &[V3] {
        &self.outward[self.first[v as usize] as usize..self.first[v as usize + 1] as usize]
    }

    /// Bytes that they take.
    pub(crate) fn bytes(&self) -> usize {
        let planes = bytes::of(&self.first) + bytes::of(&self.outward) + bytes::of(&self.drag);
        planes + bytes::of(&self.nodes) + bytes::of(&self.faces) + bytes::of(&self.begin) + bytes::of(&self.around)
    }
}

/// What vertices lie against in a substep.
#[derive(Clone, Copy)]
pub(crate) struct Against<'a> {
    pub(crate) abutments: &'a Abutments,
    /// For each vertex the place of the wall ([`Abutments::follow`]).
    pub(crate) at: &'a [Place],
}

impl Against<'_> {
    /// Changes the gradient and the Hessian of vertex `v`, which is at `x`, so that it does not go beyond; all else that acts on it
    /// is in them already.
    pub(crate) fn act(&self, v: u32, (x, rest): (V3, &[[f32; 4]]), g: &mut V3, h: &mut [f32; 6]) {
        let walls = || self.abutments.walls(&self.at[v as usize], rest);
        let free = solve(h, *g);
        let mut step = free;
        let mut pressed = [0.0f32; MOST];
        for _ in 0..if walls().count() > 1 { ROUNDS } else { 1 } {
            for (press, (point, n)) in pressed.iter_mut().zip(walls()) {
                let yields = solve(h, n);
                let beyond = dot(n, sub(sub(x, point), step));
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
            let all = Abutments::new(vec![Abutment { node: 1, outward: n, drag: 0.0 }], &Membranes::default(), &[[0.0; 4]; 3]);
            prop_assert!(all.on(1) && !all.on(0) && !all.on(2));
            let (mut gradient, mut hessian) = (g, h);
            let mut at = Vec::new();
            all.follow(&[[0.0; 4], [way[0], way[1], way[2], 1.0], [0.0; 4]], &[[0.0; 4]; 3], &mut at);
            let against = Against { abutments: &all, at: &at };
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
        let all = Abutments::new(walls_of, &Membranes::default(), &[[0.0; 4]]);
        let h = [4.0, 5.0, 6.0, 1.0, -1.0, 0.5];
        let went = |g: V3| {
            let (mut gradient, mut hessian) = (g, h);
            let mut at = Vec::new();
            all.follow(&[[0.0; 4]], &[[0.0; 4]], &mut at);
            let against = Against { abutments: &all, at: &at };
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
        let all = Abutments::new(planes.collect(), &membranes, &rest);
        let (mut positions, mut wall) = (rest.clone(), Vec::new());
        all.follow(&positions, &rest, &mut wall);
        assert!(wall.iter().zip(0..).all(|(w, v)| w.vertex == v && w.point == xyz(rest[v as usize])));
        // The first one goes round by 122 degrees, 1 mm beyond; another one is drawn away from the wall.
        (positions[0], positions[21]) = (at(122.0, radius + 1.0, 0.1), at(100.0, radius - 4.0, 0.9));
        all.follow(&positions, &rest, &mut wall);
        assert_eq!((wall[0].vertex, wall[21].vertex), (24, 21));
        let drawn = positions[21];
        all.put_back(&wall, &rest, &mut positions);
        let [x, y, ..] = positions[0];
        assert!((x.hypot(y) - radius).abs() < 2e-3 && positions[21] == drawn, "{:?}", positions[0]);
        let mut speed = vec![[1.0f32, -2.0, 0.5, 0.0]; rest.len()];
        all.slow(&mut speed, 0.25);
        assert!((speed[7][1] + 2.0 * (-0.5f32).exp()).abs() < 1e-6);
        let pressed = all.pressed(&wall, &rest, &vec![[0.0, -3.0, 0.0]; rest.len()]);
        let of = |v: u32| pressed.iter().find(|p| p.0 == v).map(|p| p.1).expect("lies against a wall");
        // There the wall bears what is across it of a force that drives upwards, and none of one that leads away.
        let (sin, cos) = 122f64.to_radians().sin_cos();
        assert!((of(0)[0] + 3.0 * sin * cos).abs() < 0.02 && (of(0)[1] + 3.0 * sin * sin).abs() < 0.02, "{:?}", of(0));
        assert_eq!(all.pressed(&wall, &rest, &vec![[0.0, 3.0, 0.0]; rest.len()])[0].1, [0.0; 3]);
        // Turned within the wall, all vertices still lie on it: facets would be 0.04 mm within it half-way, the planes of the nearest
        // ones as much without.
        for degrees in [1.0, 2.5, 5.0, 7.0] {
            let turned = |v: usize| at(10.0 * (v / 2) as f32 + degrees, radius, (v % 2) as f32);
            let positions: Vec<[f32; 4]> =
                (0..rest.len() - 2).map(turned).chain(rest[rest.len() - 2..].to_vec()).collect();
            all.follow(&positions, &rest, &mut wall);
            for (p, w) in positions.iter().zip(&wall) {
                assert!(dot(w.normal, sub(xyz(*p), w.point)).abs() < 2e-3, "{p:?} {w:?} at {degrees}");
            }
        }
    }
}
