//! A tree of spheres over the tetrahedra, refitted as they move (paper, section II.4).
//!
//! The shape of the tree is built once at rest; a refit only moves and resizes the spheres, bottom up. Each sphere holds
//! all vertices below it, so a query never loses an element.
//!
//! Spheres are kept from step to step as long as no vertex has gone far from where it was when they were fitted: a query
//! takes them for larger by that much, and fits the leaves that it comes to anew. So what it finds does not depend on
//! their age.

use crate::fast::Pool;
use crate::nodes::longest_way;
use crate::vec3::{V3, axpy, dot, norm, scale, sub, xyz};
use crate::{bytes, slabs};

const LEAF: usize = 8;
/// Spheres are fitted anew when a vertex has moved by more than this share of the mean radius of the leaves.
const SLACK: f32 = 0.5;

/// Topology of the tree: constant, part of the model.
#[derive(Debug, Clone)]
pub(crate) struct SphereTree {
    nodes: Vec<Node>,
    /// Elements in leaf order.
    order: Vec<u32>,
    /// Vertices of each leaf, each once, and where those of a leaf begin.
    vertices: Vec<u32>,
    starts: Vec<u32>,
    /// Leaves cut into pieces for threads.
    cuts: Vec<usize>,
}

#[derive(Debug, Clone, Copy)]
struct Node {
    /// First slot of `order` (leaf) or index of the right child (inner; the left child is the next node).
    first: u32,
    /// Elements of a leaf; 0 for an inner node.
    count: u32,
    /// Number of a leaf among the leaves.
    leaf: u32,
}

/// The spheres of one state: centre and radius.
#[derive(Debug, Clone, Default)]
pub(crate) struct Spheres {
    /// One per node of the tree.
    nodes: Vec<[f32; 4]>,
    /// One per leaf.
    leaves: Vec<[f32; 4]>,
    /// Positions that they were fitted to, the longest way of a vertex from there, and how long it may become, mm.
    fitted: Vec<[f32; 4]>,
    moved: f32,
    slack: f32,
}

impl Spheres {
    /// Bytes that they take.
    pub(crate) fn bytes(&self) -> usize {
        bytes::of(&self.nodes) + bytes::of(&self.leaves) + bytes::of(&self.fitted)
    }
}

impl SphereTree {
    /// Builds by median splits of the centroids along the longest axis.
    pub(crate) fn new(positions: &[[f32; 4]], tets: &[[u32; 4]]) -> Self {
        let centroids: Vec<V3> = tets
            .iter()
            .map(|t| {
                let sum = t.iter().fold([0.0; 3], |s, &v| axpy(s, 1.0, xyz(positions[v as usize])));
                scale(sum, 0.25)
            })
            .collect();
        let mut order: Vec<u32> = (0..tets.len() as u32).collect();
        let mut nodes = Vec::with_capacity(tets.len() / 2);
        split(&mut nodes, &mut order, 0, &centroids);
        let (mut vertices, mut starts) = (Vec::new(), vec![0]);
        for node in nodes.iter_mut().filter(|n| n.count > 0) {
            node.leaf = starts.len() as u32 - 1;
            let slots = &order[node.first as usize..(node.first + node.count) as usize];
            let mut own: Vec<u32> = slots.iter().flat_map(|&t| tets[t as usize]).collect();
            own.sort_unstable();
            own.dedup();
            vertices.extend(own);
            starts.push(vertices.len() as u32);
        }
        let cuts = slabs::even_cuts(starts.len() - 1);
        Self { nodes, order, vertices, starts, cuts }
    }

    /// Bytes that it takes.
    pub(crate) fn bytes(&self) -> usize {
        bytes::of(&self.nodes) + bytes::of(&self.order) + bytes::of(&self.vertices) + bytes::of(&self.starts)
    }

    /// Makes the spheres fit for queries at these positions: fits them anew if there are none or they are too old. They are of this tree.
    pub(crate) fn follow(&self, spheres: &mut Spheres, positions: &[[f32; 4]], pool: &Pool) {
        if spheres.fitted.len() == positions.len() {
            spheres.moved = longest_way(positions, &spheres.fitted);
            if spheres.moved <= spheres.slack {
                return;
            }
        }
        self.refit(spheres, positions, pool);
        spheres.fitted.clear();
        spheres.fitted.extend_from_slice(positions);
        let radii: f32 = spheres.leaves.iter().map(|s| s[3]).sum();
        spheres.moved = 0.0;
        spheres.slack = SLACK * radii / spheres.leaves.len() as f32;
    }

    /// Fits the spheres to the positions, children before parents.
    fn refit(&self, spheres: &mut Spheres, positions: &[[f32; 4]], pool: &Pool) {
        let Spheres { nodes, leaves, .. } = spheres;
        leaves.resize(self.starts.len() - 1, [0.0; 4]);
        pool.each_part(leaves, &self.cuts, &mut [(); slabs::PIECES], &|i, leaves, ()| {
            for (leaf, sphere) in (self.cuts[i]..).zip(leaves) {
                *sphere = around(self.corners(leaf), positions);
            }
        });
        nodes.resize(self.nodes.len(), [0.0; 4]);
        for (i, node) in self.nodes.iter().enumerate().rev() {
            nodes[i] = if node.count == 0 {
                around_two(nodes[i + 1], nodes[node.first as usize])
            } else {
                leaves[node.leaf as usize]
            };
        }
    }

    /// Vertices of a leaf.
    fn corners(&self, leaf: usize) -> &[u32] {
        &self.vertices[self.starts[leaf] as usize..self.starts[leaf + 1] as usize]
    }

    /// Calls `found` with each element whose leaf comes within `reach` of the segment `a b`, at the positions that the
    /// spheres have followed.
    pub(crate) fn near_segment(
        &self,
        (spheres, positions): (&Spheres, &[[f32; 4]]),
        a: V3,
        b: V3,
        reach: f32,
        stack: &mut Vec<u32>,
        mut found: impl FnMut(u32),
    ) {
        stack.clear();
        stack.push(0);
        while let Some(i) = stack.pop() {
            let Some(s) = spheres.nodes.get(i as usize) else { continue };
            if !is_near(s, a, b, reach + spheres.moved) {
                continue;
            }
            let node = self.nodes[i as usize];
            if node.count == 0 {
                stack.push(node.first);
                stack.push(i + 1);
            } else if is_near(&around(self.corners(node.leaf as usize), positions), a, b, reach) {
                let slots = &self.order[node.first as usize..(node.first + node.count) as usize];
                slots.iter().for_each(|&t| found(t));
            }
        }
    }
}

fn split(nodes: &mut Vec<Node>, order: &mut [u32], first: u32, centroids: &[V3]) {
    let at = nodes.len();
    nodes.push(Node { first, count: order.len() as u32, leaf: 0 });
    if order.len() <= LEAF {
        return;
    }
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for &t in order.iter() {
        for a in 0..3 {
            low[a] = low[a].min(centroids[t as usize][a]);
            high[a] = high[a].max(centroids[t as usize][a]);
        }
    }
    let axis = (0..3).fold(0, |best, a| if high[a] - low[a] > high[best] - low[best] { a } else { best });
    let middle = order.len() / 2;
    order.select_nth_unstable_by(middle, |&a, &b| {
        centroids[a as usize][axis].total_cmp(&centroids[b as usize][axis]).then(a.cmp(&b))
    });
    let (left, right) = order.split_at_mut(middle);
    split(nodes, left, first, centroids);
    nodes[at] = Node { first: nodes.len() as u32, count: 0, leaf: 0 };
    split(nodes, right, first + middle as u32, centroids);
}

/// A sphere around the box of some vertices.
fn around(vertices: &[u32], positions: &[[f32; 4]]) -> [f32; 4] {
    let (mut low, mut high) = ([f32::INFINITY; 4], [f32::NEG_INFINITY; 4]);
    for &v in vertices {
        let p = positions[v as usize];
        for a in 0..4 {
            low[a] = if p[a] < low[a] { p[a] } else { low[a] };
            high[a] = if p[a] > high[a] { p[a] } else { high[a] };
        }
    }
    let centre: V3 = core::array::from_fn(|a| 0.5 * (low[a] + high[a]));
    let mut radius2 = 0f32;
    for &v in vertices {
        let d = sub(xyz(positions[v as usize]), centre);
        radius2 = radius2.max(dot(d, d));
    }
    [centre[0], centre[1], centre[2], radius2.sqrt()]
}

/// The smallest sphere around two.
fn around_two(p: [f32; 4], q: [f32; 4]) -> [f32; 4] {
    let d = sub(xyz(q), xyz(p));
    let distance = norm(d);
    if distance + q[3] <= p[3] {
        return p;
    }
    if distance + p[3] <= q[3] {
        return q;
    }
    let radius = 0.5 * (distance + p[3] + q[3]);
    let c = axpy(xyz(p), (radius - p[3]) / distance, d);
    // Rounding must not let a vertex stick out.
    [c[0], c[1], c[2], radius * (1.0 + 1e-6)]
}

/// Whether a sphere comes within `reach` of the segment `a b`, with a hair of slack, so that rounding loses nothing.
fn is_near(sphere: &[f32; 4], a: V3, b: V3, reach: f32) -> bool {
    let limit = (sphere[3] + reach) * (1.0 + 1e-5);
    distance2_to_segment(xyz(*sphere), a, b) <= limit * limit
}

fn distance2_to_segment(p: V3, a: V3, b: V3) -> f32 {
    let (ab, ap) = (sub(b, a), sub(p, a));
    let length2 = dot(ab, ab);
    let t = if length2 > 0.0 { (dot(ap, ab) / length2).clamp(0.0, 1.0) } else { 0.0 };
    let d = axpy(ap, -t, ab);
    dot(d, d)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::block;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_element_near_a_segment_is_lost_after_the_mesh_has_moved(
            a in proptest::array::uniform3(-30.0..30.0f32),
            b in proptest::array::uniform3(-30.0..30.0f32),
            reach in 0.1..5.0f32,
            bend in -0.02..0.02f32,
        ) {
            let mesh = block([6, 5, 4], 8.0);
            let mut p: Vec<[f32; 4]> = mesh.vertices.iter().map(|v| [v.x as f32 - 24.0, v.y as f32 - 20.0, v.z as f32 - 16.0, 1.0]).collect();
            let tree = SphereTree::new(&p, &mesh.tets);
            for v in &mut p {
                v[2] += bend * v[0] * v[0];
                v[1] += bend * v[0] * v[2];
            }
            let mut spheres = Spheres::default();
            tree.follow(&mut spheres, &p, &Pool::new(1));
            let mut found = vec![false; mesh.tets.len()];
            tree.near_segment((&spheres, &p), a, b, reach, &mut Vec::new(), |t| found[t as usize] = true);
            for (t, tet) in mesh.tets.iter().enumerate() {
                // A vertex within reach is reason enough to be found.
                let near = tet.iter().any(|&v| distance2_to_segment(xyz(p[v as usize]), a, b) <= reach * reach);
                prop_assert!(!near || found[t], "tetrahedron {t}");
            }
        }

        #[test]
        fn old_spheres_find_the_same_elements_in_the_same_order_as_new_ones(
            a in proptest::array::uniform3(-30.0..30.0f32),
            b in proptest::array::uniform3(-30.0..30.0f32),
            reach in 0.0..5.0f32,
            bend in -0.02..0.02f32,
        ) {
            let mesh = block([6, 5, 4], 8.0);
            let mut p: Vec<[f32; 4]> = mesh.vertices.iter().map(|v| [v.x as f32 - 24.0, v.y as f32 - 20.0, v.z as f32 - 16.0, 1.0]).collect();
            let (tree, pool) = (SphereTree::new(&p, &mesh.tets), Pool::new(1));
            let mut old = Spheres::default();
            tree.follow(&mut old, &p, &pool);
            for _ in 0..5 {
                p.iter_mut().for_each(|v| v[2] += 0.2 * bend * v[0] * v[1]);
                tree.follow(&mut old, &p, &pool);
                let mut new = Spheres::default();
                tree.follow(&mut new, &p, &pool);
                let found = |spheres: &Spheres| {
                    let mut list = Vec::new();
                    tree.near_segment((spheres, &p), a, b, reach, &mut Vec::new(), |t| list.push(t));
                    list
                };
                prop_assert_eq!(found(&old), found(&new));
            }
        }
    }

    #[test]
    fn spheres_are_fitted_anew_when_they_are_too_old_or_of_no_place() {
        let mesh = block([4, 4, 4], 8.0);
        let rest: Vec<[f32; 4]> = mesh.vertices.iter().map(|v| [v.x as f32, v.y as f32, v.z as f32, 1.0]).collect();
        let (tree, pool, mut spheres) = (SphereTree::new(&rest, &mesh.tets), Pool::new(1), Spheres::default());
        tree.follow(&mut spheres, &rest, &pool);
        let shifted = |by: f32| -> Vec<[f32; 4]> { rest.iter().map(|p| [p[0], p[1] + by, p[2], p[3]]).collect() };
        tree.follow(&mut spheres, &shifted(1.0), &pool);
        assert!((spheres.moved - 1.0).abs() < 1e-5 && spheres.fitted == rest);
        let far = shifted(40.0);
        tree.follow(&mut spheres, &far, &pool);
        assert!(spheres.moved == 0.0 && spheres.fitted == far);
        let mut lost = far.clone();
        lost[7][0] = f32::NAN;
        tree.follow(&mut spheres, &lost, &pool);
        tree.follow(&mut spheres, &far, &pool);
        assert!(spheres.moved == 0.0 && spheres.fitted == far);
    }
}
