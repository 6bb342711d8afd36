//! A graded body-centred-cubic lattice of tetrahedra over an octree (Labelle and Shewchuk 2007, section 3).
//!
//! Vertices are the corners and centres of the leaves. Between two leaves of equal size lie tetrahedra of two centres and
//! an edge of the common face (or half that edge, where a smaller leaf has split it); between leaves of different size
//! the small centre is joined to its face by two half pyramids, the large one to the four small faces by eight.

use super::octree::{Node, Octree};
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Multiplicative hash for packed integers; the order of a map never reaches the output.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct PackedHasher(u64);

impl Hasher for PackedHasher {
    fn finish(&self) -> u64 {
        self.0
    }
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&b| self.write_u64(u64::from(b)));
    }
    fn write_u64(&mut self, x: u64) {
        // The finaliser of MurmurHash3: one product alone leaves high coordinates out of the low bits.
        let h = self.0 ^ x;
        let h = (h ^ h >> 33).wrapping_mul(0xFF51_AFD7_ED55_8CCD);
        let h = (h ^ h >> 33).wrapping_mul(0xC4CE_B9FE_1A85_EC53);
        self.0 = h ^ h >> 33;
    }
}

pub(super) type PackedMap<V> = HashMap<u64, V, BuildHasherDefault<PackedHasher>>;

/// Lattice vertices in octree units and tetrahedra of positive volume.
#[derive(Debug, Default)]
pub(super) struct Lattice {
    pub(super) points: Vec<[u32; 3]>,
    pub(super) tets: Vec<[u32; 4]>,
}

pub(super) fn lattice(tree: &Octree) -> Lattice {
    let mut b =
        Builder { out: Lattice::default(), corners: PackedMap::default(), centres: vec![u32::MAX; tree.nodes.len()] };
    for (at, node) in tree.nodes.iter().enumerate().filter(|(_, n)| n.is_leaf()) {
        let half = node.edge / 2;
        b.centres[at] = b.out.points.len() as u32;
        b.out.points.push(node.corner.map(|x| x + half));
        for c in 0..8u32 {
            b.corner([0, 1, 2].map(|a| node.corner[a as usize] + (c >> a & 1) * node.edge));
        }
    }
    for (at, node) in tree.nodes.iter().enumerate().filter(|(_, n)| n.is_leaf()) {
        for axis in 0..3 {
            b.face(tree, at, node, axis, -1);
            b.face(tree, at, node, axis, 1);
        }
    }
    b.out
}

const fn pack(p: [u32; 3]) -> u64 {
    p[0] as u64 | (p[1] as u64) << 21 | (p[2] as u64) << 42
}

struct Builder {
    out: Lattice,
    corners: PackedMap<u32>,
    centres: Vec<u32>,
}

impl Builder {
    fn corner(&mut self, p: [u32; 3]) -> u32 {
        let next = self.out.points.len() as u32;
        let id = *self.corners.entry(pack(p)).or_insert(next);
        if id == next {
            self.out.points.push(p);
        }
        id
    }

    /// Adds the tetrahedron, turned to positive volume.
    fn tet(&mut self, t: [u32; 4]) {
        let p = t.map(|v| self.out.points[v as usize].map(i64::from));
        let d = |i: usize| [0, 1, 2].map(|a| p[i][a] - p[0][a]);
        let (u, v, w) = (d(1), d(2), d(3));
        let volume = u[0] * (v[1] * w[2] - v[2] * w[1]) - u[1] * (v[0] * w[2] - v[2] * w[0])
            + u[2] * (v[0] * w[1] - v[1] * w[0]);
        self.out.tets.push(if volume > 0 { t } else { [t[0], t[2], t[1], t[3]] });
    }

    /// All tetrahedra that belong to one face of a leaf. Equal neighbours are done from the lower side.
    fn face(&mut self, tree: &Octree, at: usize, node: &Node, axis: usize, side: i64) {
        let mut step = [0; 3];
        step[axis] = side;
        let Some(other) = tree.neighbour(node, step) else { return };
        let square = square(node, axis, side);
        let neighbour = tree.nodes[other];
        match neighbour.edge.cmp(&node.edge) {
            std::cmp::Ordering::Equal if side > 0 => self.equal(at, other, square),
            std::cmp::Ordering::Equal => {}
            std::cmp::Ordering::Greater => self.half_pyramids(at, square, &neighbour),
            std::cmp::Ordering::Less => self.quarters(at, square),
        }
    }

    fn equal(&mut self, at: usize, other: usize, square: [[u32; 3]; 4]) {
        let (a, b) = (self.centres[at], self.centres[other]);
        for i in 0..4 {
            let (p, q) = (square[i], square[(i + 1) % 4]);
            let (c, d) = (self.corner(p), self.corner(q));
            match self.corners.get(&pack(middle(p, q))).copied() {
                Some(m) => {
                    self.tet([a, b, c, m]);
                    self.tet([a, b, m, d]);
                }
                None => self.tet([a, b, c, d]),
            }
        }
    }

    /// From a small leaf to a larger neighbour: the diagonal starts at the middle of the large face.
    fn half_pyramids(&mut self, at: usize, square: [[u32; 3]; 4], large: &Node) {
        // Seen from the large leaf the middle of its face has two coordinates at its own middle.
        let half = large.corner.map(|x| x + large.edge / 2);
        let start = (0..4).max_by_key(|&i| (0..3).filter(|&a| square[i][a] == half[a]).count()).unwrap_or(0);
        let v = [0, 1, 2, 3].map(|i| self.corner(square[(start + i) % 4]));
        let centre = self.centres[at];
        self.tet([centre, v[0], v[1], v[2]]);
        self.tet([centre, v[0], v[2], v[3]]);
    }

    fn quarters(&mut self, at: usize, square: [[u32; 3]; 4]) {
        let centre = self.centres[at];
        let hub = self.corner(middle(square[0], square[2]));
        for i in 0..4 {
            let (p, q) = (square[i], square[(i + 1) % 4]);
            let (c, m, d) = (self.corner(p), self.corner(middle(p, q)), self.corner(q));
            self.tet([centre, hub, c, m]);
            self.tet([centre, hub, m, d]);
        }
    }
}

fn middle(p: [u32; 3], q: [u32; 3]) -> [u32; 3] {
    [0, 1, 2].map(|a| (p[a] + q[a]) / 2)
}

/// The corners of a face in circular order.
fn square(node: &Node, axis: usize, side: i64) -> [[u32; 3]; 4] {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[i, j]: [u32; 2]| {
        let mut p = node.corner;
        p[axis] += if side > 0 { node.edge } else { 0 };
        p[u] += i * node.edge;
        p[v] += j * node.edge;
        p
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::{Point, TetMesh};

    #[test]
    fn a_graded_lattice_conforms_and_has_the_angles_of_its_five_forms() {
        let tree = Octree::new(5, |c, e| {
            let d2: i64 = c.iter().map(|&x| (i64::from(x) + i64::from(e) / 2 - 21).pow(2)).sum();
            (d2 as f64).sqrt() < 1.5 * f64::from(e)
        });
        let l = lattice(&tree);
        let mesh = TetMesh {
            vertices: l.points.iter().map(|p| Point::from_array(p.map(f64::from))).collect(),
            labels: vec![1; l.tets.len()],
            tets: l.tets,
        };
        mesh.validate().expect("positive volumes");
        let sizes: std::collections::BTreeSet<u32> =
            tree.nodes.iter().filter(|n| n.is_leaf()).map(|n| n.edge).collect();
        assert!(sizes.len() >= 3, "{sizes:?}");
        // No crack inside: every boundary face has a vertex within the outermost layer of cells.
        let size = f64::from(tree.nodes[0].edge);
        for f in mesh.boundary(|_| true) {
            let near = |v: u32| {
                let p = mesh.vertices[v as usize].to_array();
                let leaf = tree.leaf(p.map(|x| (x as i64).min(size as i64 - 1))).expect("inside");
                let edge = f64::from(tree.nodes[leaf].edge);
                p.iter().any(|&x| x <= edge || x >= size - edge)
            };
            assert!(f.iter().any(|&v| near(v)), "crack at {f:?}");
        }
        let t = mesh.surface(|_| true).topology();
        assert!(t.is_closed() && t.is_oriented() && t.non_manifold_edges == 0, "{t:?}");
        let worst = (0..mesh.tets.len()).map(|t| mesh.quality(t).min_dihedral).fold(f64::INFINITY, f64::min);
        // The worst of the five forms (half pyramid and quarter) has 45 degrees.
        assert!(worst.to_degrees() > 44.9, "{}", worst.to_degrees());
    }
}
