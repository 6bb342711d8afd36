//! A bounding-volume hierarchy over the triangles of a mesh: nearest point, ray and inside queries.

mod boxes;
mod morton;
mod nearest;

pub(crate) use boxes::{Box3, of_triangle};
pub use nearest::nearest_on_triangle;

use crate::{Patient, Point, TriangleMesh, Vector, bounds};
use nearest::Four;

const LEAF: usize = 4;

#[derive(Debug, Clone, Copy)]
struct Node {
    low: [f64; 3],
    high: [f64; 3],
    /// First triangle (leaf) or index of the right child (inner; the left child is the next node).
    first: u32,
    /// Triangles in a leaf; 0 for an inner node.
    count: u32,
}

/// The hierarchy, with its own copy of the corners in leaf order.
#[derive(Debug, Clone)]
pub struct Bvh {
    nodes: Vec<Node>,
    /// The same for the nearest point: four boxes side by side.
    fours: Vec<Four>,
    order: Vec<u32>,
    /// Where each triangle is in `order`.
    place: Vec<u32>,
    corners: Vec<[Point<Patient>; 3]>,
}

/// Where a ray meets the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance along the ray in lengths of its direction vector.
    pub t: f64,
    /// The triangle hit.
    pub triangle: usize,
    /// Whether the ray goes in (against the triangle's normal).
    pub entering: bool,
}

/// The nearest point of the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    /// The point.
    pub point: Point<Patient>,
    /// Its distance in mm.
    pub distance: f64,
    /// The triangle it lies on.
    pub triangle: usize,
}

impl Bvh {
    /// Builds the hierarchy by median splits along the longest axis of the centroids. An empty mesh is allowed and
    /// answers every query with nothing.
    pub fn new(mesh: &TriangleMesh) -> Self {
        let all: Vec<[Point<Patient>; 3]> = (0..mesh.triangles.len()).map(|t| mesh.corners(t)).collect();
        let centroids: Vec<[f64; 3]> = all.iter().map(centroid).collect();
        let order = (0..all.len() as u32).collect();
        Self::build(&all, order, &|part| halve(part, &centroids))
    }

    /// The same in a fraction of the time, halved along a Morton curve through the centroids, for a single pass: its boxes are
    /// a little larger, so that queries take longer.
    pub(crate) fn along_curve(all: &[[Point<Patient>; 3]]) -> Self {
        Self::build(all, morton::order(all.iter().map(centroid)), &|_| {})
    }

    /// `halve` brings one half of a part's triangles before the other.
    fn build(all: &[[Point<Patient>; 3]], mut order: Vec<u32>, halve: &impl Fn(&mut [u32])) -> Self {
        let mut nodes = Vec::with_capacity(all.len());
        if !order.is_empty() {
            split(&mut nodes, &mut order, 0, all, halve);
        }
        let corners: Vec<_> = order.iter().map(|&t| all[t as usize]).collect();
        let mut place = vec![0; order.len()];
        order.iter().enumerate().for_each(|(slot, &t)| place[t as usize] = slot as u32);
        let fours = nearest::fours(&nodes, &corners);
        Self { nodes, fours, order, place, corners }
    }

    /// All crossings of the ray `origin + t * direction`, `t >= 0`, sorted by `t`.
    pub fn ray_all(&self, origin: Point<Patient>, direction: Vector<Patient>) -> Vec<Hit> {
        let mut hits = Vec::new();
        let mut stack = vec![0usize];
        while let Some(i) = stack.pop() {
            let Some(node) = self.nodes.get(i) else { continue };
            if !ray_meets_box(node, origin, direction) {
                continue;
            }
            if node.count == 0 {
                stack.extend([i + 1, node.first as usize]);
                continue;
            }
            for slot in node.first as usize..(node.first + node.count) as usize {
                if let Some((t, entering)) = ray_triangle(origin, direction, self.corners[slot]) {
                    hits.push(Hit { t, triangle: self.order[slot] as usize, entering });
                }
            }
        }
        hits.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.triangle.cmp(&b.triangle)));
        hits
    }

    /// The first crossing of a ray.
    pub fn ray(&self, origin: Point<Patient>, direction: Vector<Patient>) -> Option<Hit> {
        self.ray_all(origin, direction).into_iter().next()
    }

    /// Whether `p` lies inside a closed surface: odd crossings, by majority over three skew directions, so that a ray
    /// grazing an edge does not decide alone.
    pub fn contains(&self, p: Point<Patient>) -> bool {
        const DIRECTIONS: [[f64; 3]; 3] =
            [[0.5713, 0.3217, 0.7551], [-0.6917, 0.6133, -0.3813], [0.1171, -0.8893, 0.4421]];
        let odd = DIRECTIONS.iter().filter(|d| self.ray_all(p, Vector::from_array(**d)).len() % 2 == 1).count();
        odd >= 2
    }
}

fn centroid(corners: &[Point<Patient>; 3]) -> [f64; 3] {
    core::array::from_fn(|a| corners.iter().map(|p| p.to_array()[a]).sum::<f64>() / 3.0)
}

fn split(
    nodes: &mut Vec<Node>,
    order: &mut [u32],
    first: u32,
    all: &[[Point<Patient>; 3]],
    halve: &impl Fn(&mut [u32]),
) {
    let at = nodes.len();
    if order.len() <= LEAF {
        let [low, high] = bounds(order.iter().flat_map(|&t| all[t as usize].map(Point::to_array))).unwrap_or_default();
        nodes.push(Node { low, high, first, count: order.len() as u32 });
        return;
    }
    nodes.push(Node { low: [0.0; 3], high: [0.0; 3], first, count: 0 });
    halve(order);
    let middle = order.len() / 2;
    let (left, right) = order.split_at_mut(middle);
    split(nodes, left, first, all, halve);
    let other = nodes.len();
    split(nodes, right, first + middle as u32, all, halve);
    let [low, high] = bounds([at + 1, other].iter().flat_map(|&n| [nodes[n].low, nodes[n].high])).unwrap_or_default();
    nodes[at] = Node { low, high, first: other as u32, count: 0 };
}

/// Parts triangles at the median along the longest axis of their centroids.
fn halve(order: &mut [u32], centroids: &[[f64; 3]]) {
    let [low, high] = bounds(order.iter().map(|&t| centroids[t as usize])).unwrap_or_default();
    let axis = (0..3).fold(0, |best, a| if high[a] - low[a] > high[best] - low[best] { a } else { best });
    order.select_nth_unstable_by(order.len() / 2, |&a, &b| {
        centroids[a as usize][axis].total_cmp(&centroids[b as usize][axis]).then(a.cmp(&b))
    });
}

fn ray_meets_box(node: &Node, origin: Point<Patient>, direction: Vector<Patient>) -> bool {
    let (o, d) = (origin.to_array(), direction.to_array());
    let (mut near, mut far) = (0f64, f64::INFINITY);
    for a in 0..3 {
        if d[a] == 0.0 {
            if o[a] < node.low[a] || o[a] > node.high[a] {
                return false;
            }
            continue;
        }
        let (t0, t1) = ((node.low[a] - o[a]) / d[a], (node.high[a] - o[a]) / d[a]);
        near = near.max(t0.min(t1));
        far = far.min(t0.max(t1));
    }
    // A hair of slack: a flat box must not lose a ray to rounding.
    near <= far * (1.0 + 1e-12) + 1e-12
}

/// Möller and Trumbore 1997; both sides count.
fn ray_triangle(
    origin: Point<Patient>,
    direction: Vector<Patient>,
    [a, b, c]: [Point<Patient>; 3],
) -> Option<(f64, bool)> {
    let (e1, e2) = (b - a, c - a);
    let p = direction.cross(e2);
    let det = e1.dot(p);
    if det == 0.0 {
        return None;
    }
    let s = origin - a;
    let u = s.dot(p) / det;
    let q = s.cross(e1);
    let v = direction.dot(q) / det;
    let t = e2.dot(q) / det;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0).then_some((t, det > 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::triangles::tests::octahedron;
    use proptest::prelude::*;

    /// A bumpy torus: closed, neither convex nor simply connected.
    fn torus() -> TriangleMesh {
        let (n, m) = (24u32, 12u32);
        let mut mesh = TriangleMesh::default();
        for i in 0..n {
            for j in 0..m {
                let (u, v) = (
                    f64::from(i) * std::f64::consts::TAU / f64::from(n),
                    f64::from(j) * std::f64::consts::TAU / f64::from(m),
                );
                let r = 1.0 + 0.2 * (3.0 * u).sin();
                mesh.vertices.push(Point::new(
                    (4.0 + r * v.cos()) * u.cos(),
                    (4.0 + r * v.cos()) * u.sin(),
                    r * v.sin(),
                ));
                let at = |i: u32, j: u32| (i % n) * m + j % m;
                mesh.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                mesh.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
        mesh
    }

    proptest! {
        #[test]
        fn nearest_agrees_with_brute_force(p in proptest::array::uniform3(-7.0..7.0f64), near in 0..600usize) {
            let mesh = torus();
            let p = Point::from_array(p);
            let bvh = Bvh::new(&mesh);
            let found = bvh.nearest(p).expect("not empty");
            // The hint changes the way, not the answer, even where there is no such triangle.
            let hinted = bvh.nearest_from(near, p).expect("not empty");
            prop_assert!((found.distance - hinted.distance).abs() < 1e-12);
            let brute = (0..mesh.triangles.len()).map(|t| p.distance(nearest_on_triangle(p, mesh.corners(t)))).fold(f64::INFINITY, f64::min);
            prop_assert!((found.distance - brute).abs() < 1e-12);
        }

        #[test]
        fn inside_agrees_with_the_winding_number(p in proptest::array::uniform3(-6.0..6.0f64)) {
            let mesh = torus();
            let p = Point::from_array(p);
            prop_assume!(Bvh::new(&mesh).nearest(p).expect("not empty").distance > 1e-6);
            // Solid angle of each triangle (Van Oosterom and Strackee 1983).
            let solid: f64 = (0..mesh.triangles.len()).map(|t| {
                let [a, b, c] = mesh.corners(t).map(|q| q - p);
                let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
                2.0 * a.cross(b).dot(c).atan2(la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
            }).sum();
            prop_assert_eq!(Bvh::new(&mesh).contains(p), solid.abs() > 2.0 * std::f64::consts::PI);
        }
    }

    #[test]
    fn a_ray_through_an_octahedron_goes_in_and_out() {
        let bvh = Bvh::new(&octahedron());
        let hits = bvh.ray_all(Point::new(0.2, 0.1, 5.0), Vector::new(0.0, 0.0, -1.0));
        assert_eq!(hits.len(), 2);
        assert!(hits[0].entering && !hits[1].entering);
        assert!((hits[0].t - 4.3).abs() < 1e-12 && (hits[1].t - 5.7).abs() < 1e-12);
    }

    #[test]
    fn an_empty_mesh_answers_nothing() {
        let bvh = Bvh::new(&TriangleMesh::default());
        assert!(bvh.nearest(Point::ORIGIN).is_none() && bvh.ray(Point::ORIGIN, Vector::new(1.0, 0.0, 0.0)).is_none());
        assert!(!bvh.contains(Point::ORIGIN));
    }
}
