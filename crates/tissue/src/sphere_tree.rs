//! A tree of spheres over the tetrahedra, refitted as they move (paper, section II.4).
//!
//! The shape of the tree is built once at rest; a refit only moves and resizes the spheres, bottom up. Each sphere holds
//! all vertices below it, so a query never loses an element.

use crate::fast::Pool;
use crate::vec3::{V3, axpy, dot, norm, scale, sub, xyz};
use crate::{bytes, slabs};

const LEAF: usize = 8;

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
}

impl Spheres {
    /// Bytes that they take.
    pub(crate) fn bytes(&self) -> usize {
        bytes::of(&self.nodes) + bytes::of(&self.leaves)
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

    /// Fits the spheres to the positions, children before parents.
    pub(crate) fn refit(&self, spheres: &mut Spheres, positions: &[[f32; 4]], pool: &Pool) {
        let Spheres { nodes, leaves } = spheres;
        leaves.resize(self.starts.len() - 1, [0.0; 4]);
        pool.each_part(leaves, &self.cuts, &mut [(); slabs::PIECES], &|i, leaves, ()| {
            for (leaf, sphere) in (self.cuts[i]..).zip(leaves) {
                let own = self.starts[leaf] as usize..self.starts[leaf + 1] as usize;
                *sphere = around(&self.vertices[own], positions);
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

    /// Calls `found` with each element whose leaf comes within `reach` of the segment `a b`.
    pub(crate) fn near_segment(
        &self,
        spheres: &Spheres,
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
            // A hair of slack, so that rounding loses nothing.
            let limit = (s[3] + reach) * (1.0 + 1e-5);
            if distance2_to_segment(xyz(*s), a, b) > limit * limit {
                continue;
            }
            let node = self.nodes[i as usize];
            if node.count == 0 {
                stack.push(node.first);
                stack.push(i + 1);
            } else {
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
            tree.refit(&mut spheres, &p, &Pool::new(1));
            let mut found = vec![false; mesh.tets.len()];
            tree.near_segment(&spheres, a, b, reach, &mut Vec::new(), |t| found[t as usize] = true);
            for (t, tet) in mesh.tets.iter().enumerate() {
                // A vertex within reach is reason enough to be found.
                let near = tet.iter().any(|&v| distance2_to_segment(xyz(p[v as usize]), a, b) <= reach * reach);
                prop_assert!(!near || found[t], "tetrahedron {t}");
            }
        }
    }
}
