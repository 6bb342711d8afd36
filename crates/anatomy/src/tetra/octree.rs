//! A balanced octree over a cube: neighbouring leaves differ by one level at most, over faces, edges and corners.

/// No children.
const LEAF: u32 = u32::MAX;

#[derive(Debug, Clone, Copy)]
pub(super) struct Node {
    /// Lowest corner in units of half the smallest possible cell.
    pub(super) corner: [u32; 3],
    /// Edge in the same units; a power of two, at least 2.
    pub(super) edge: u32,
    first_child: u32,
}

impl Node {
    pub(super) const fn is_leaf(&self) -> bool {
        self.first_child == LEAF
    }
}

/// The tree; node 0 is the root cube.
#[derive(Debug, Clone)]
pub(super) struct Octree {
    pub(super) nodes: Vec<Node>,
}

impl Octree {
    /// Splits from the root (edge `2^levels` cells of 2 units) wherever `split(corner, edge)` says so, then balances.
    pub(super) fn new(levels: u32, split: impl Fn([u32; 3], u32) -> bool) -> Self {
        let root = Node { corner: [0; 3], edge: 2 << levels, first_child: LEAF };
        let mut tree = Self { nodes: vec![root] };
        let mut at = 0;
        while at < tree.nodes.len() {
            let node = tree.nodes[at];
            if node.edge > 2 && split(node.corner, node.edge) {
                tree.split(at);
            }
            at += 1;
        }
        tree.balance();
        tree
    }

    fn split(&mut self, at: usize) {
        let Node { corner, edge, .. } = self.nodes[at];
        self.nodes[at].first_child = self.nodes.len() as u32;
        let half = edge / 2;
        for c in 0..8u32 {
            let corner = [corner[0] + (c & 1) * half, corner[1] + (c >> 1 & 1) * half, corner[2] + (c >> 2) * half];
            self.nodes.push(Node { corner, edge: half, first_child: LEAF });
        }
    }

    /// The leaf that holds a point given in units; `None` outside the root.
    pub(super) fn leaf(&self, p: [i64; 3]) -> Option<usize> {
        let size = i64::from(self.nodes[0].edge);
        if p.iter().any(|&x| x < 0 || x >= size) {
            return None;
        }
        let mut at = 0;
        while !self.nodes[at].is_leaf() {
            let Node { corner, edge, first_child } = self.nodes[at];
            let upper = |a: usize| usize::from(p[a] >= i64::from(corner[a] + edge / 2));
            at = first_child as usize + upper(0) + 2 * upper(1) + 4 * upper(2);
        }
        Some(at)
    }

    /// The leaf at the middle of the cell of equal size, `step` cells away.
    pub(super) fn neighbour(&self, node: &Node, step: [i64; 3]) -> Option<usize> {
        let edge = i64::from(node.edge);
        self.leaf([0, 1, 2].map(|a| i64::from(node.corner[a]) + edge / 2 + step[a] * edge))
    }

    fn balance(&mut self) {
        let mut queue: Vec<usize> = (0..self.nodes.len()).filter(|&i| self.nodes[i].is_leaf()).collect();
        while let Some(at) = queue.pop() {
            let node = self.nodes[at];
            if !node.is_leaf() {
                continue;
            }
            for n in (0..27).filter(|&n| n != 13) {
                let step = [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1];
                while let Some(other) = self.neighbour(&node, step) {
                    if self.nodes[other].edge <= 2 * node.edge {
                        break;
                    }
                    let first = self.nodes.len();
                    self.split(other);
                    queue.extend(first..first + 8);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leaves_fill_the_cube_and_differ_by_one_level_at_most() {
        // Fine around one corner of the middle.
        let tree = Octree::new(6, |c, e| {
            let reach = 2 * i64::from(e);
            c.iter().all(|&x| (i64::from(x) + i64::from(e) / 2 - 50).abs() < reach)
        });
        let leaves: Vec<&Node> = tree.nodes.iter().filter(|n| n.is_leaf()).collect();
        let volume: u64 = leaves.iter().map(|n| u64::from(n.edge).pow(3)).sum();
        assert_eq!(volume, 128u64.pow(3));
        assert!(leaves.iter().any(|n| n.edge == 2) && leaves.iter().any(|n| n.edge >= 16));
        for n in leaves {
            for s in 0..27i64 {
                if let Some(other) = tree.neighbour(n, [s % 3 - 1, s / 3 % 3 - 1, s / 9 - 1]) {
                    assert!(tree.nodes[other].edge <= 2 * n.edge);
                }
            }
        }
    }
}
