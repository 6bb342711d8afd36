//! Which element does which edge.
//!
//! An element's volume needs its four vertices at hand; two opposite edges of it need no more. So each edge is given to one
//! of the elements around it, at most two opposite ones to each, and nothing but elements is left to go through. There is
//! more room than edges (three edges in two elements, roughly), so all find a place if those in the way move on (cuckoo
//! hashing, Pagh and Rodler 2004).

/// The corners of an element, its order turned so that edge `2 * i` or `2 * i + 1` of [`EDGES`] is that of its first or last
/// two corners: three even permutations, which keep the volume's sign.
pub(super) const TURNS: [[usize; 4]; 3] = [[0, 1, 2, 3], [0, 2, 3, 1], [0, 3, 1, 2]];

/// Corners of the six edges, opposite ones side by side.
const EDGES: [[usize; 2]; 6] = [[0, 1], [2, 3], [0, 2], [3, 1], [0, 3], [1, 2]];

/// Stands for no edge.
pub(super) const NONE: u32 = u32::MAX;

/// How often an edge may push others away, for each edge of the mesh in the mean.
const PATIENCE: usize = 30;

/// The edges of a mesh and who does them.
#[derive(Debug, Clone, Default)]
pub(super) struct Matching {
    /// Distinct edges, the smaller vertex first, sorted.
    pub(super) edges: Vec<[u32; 2]>,
    /// Of each element: its turn, and the edges at its first and last two corners.
    pub(super) of_tet: Vec<(u8, [u32; 2])>,
    /// Edges of which a corner moves that no element had room for.
    pub(super) loose: Vec<u32>,
    /// All six edges of each element.
    pub(super) edges_of: Vec<[u32; 6]>,
}

/// Finds the edges and gives each of which a corner `moves` to an element: one of those that hold that corner.
pub(super) fn of_tets(tets: &[[u32; 4]], moves: impl Fn(u32) -> bool) -> Matching {
    let mut all: Vec<([u32; 2], u32, u8)> = Vec::with_capacity(tets.len() * 6);
    for (t, tet) in tets.iter().enumerate() {
        for (i, e) in EDGES.iter().enumerate() {
            let (a, b) = (tet[e[0]], tet[e[1]]);
            all.push(([a.min(b), a.max(b)], t as u32, i as u8));
        }
    }
    all.sort_unstable();
    let mut table = Table { edges_of: vec![[NONE; 6]; tets.len()], ..Table::default() };
    for same in all.chunk_by(|a, b| a.0 == b.0) {
        let number = table.edges.len() as u32;
        table.edges.push(same[0].0);
        table.start.push(table.around.len() as u32);
        for &(_, t, i) in same {
            table.around.push((t, i));
            table.edges_of[t as usize][i as usize] = number;
        }
    }
    table.start.push(table.around.len() as u32);
    table.fill(tets.len(), moves)
}

#[derive(Debug, Default)]
struct Table {
    edges: Vec<[u32; 2]>,
    /// Elements around each edge, and which of their edges it is.
    start: Vec<u32>,
    around: Vec<(u32, u8)>,
    edges_of: Vec<[u32; 6]>,
    /// Of each element: its turn and which of the two places are taken.
    taken: Vec<(u8, [bool; 2])>,
}

impl Table {
    fn fill(mut self, tets: usize, moves: impl Fn(u32) -> bool) -> Matching {
        self.taken = vec![(0, [false; 2]); tets];
        let (mut loose, mut waiting) = (Vec::new(), Vec::new());
        let mut turns_left = PATIENCE * self.edges.len();
        for edge in 0..self.edges.len() as u32 {
            if !self.edges[edge as usize].iter().any(|&v| moves(v)) {
                continue;
            }
            waiting.push(edge);
            while let Some(edge) = waiting.pop() {
                if self.place(edge) {
                    continue;
                }
                if turns_left == 0 {
                    loose.push(edge);
                    continue;
                }
                turns_left -= 1;
                self.push_in(edge, turns_left, &mut waiting);
            }
        }
        let edge_at = |t: usize, slot: usize| {
            let (turn, taken) = self.taken[t];
            if taken[slot] { self.edges_of[t][2 * turn as usize + slot] } else { NONE }
        };
        let of_tet = (0..tets).map(|t| (self.taken[t].0, [edge_at(t, 0), edge_at(t, 1)])).collect();
        Matching { edges: self.edges, of_tet, loose, edges_of: self.edges_of }
    }

    fn around(&self, edge: u32) -> core::ops::Range<usize> {
        self.start[edge as usize] as usize..self.start[edge as usize + 1] as usize
    }

    /// Puts an edge where there is room: beside its opposite rather than alone.
    fn place(&mut self, edge: u32) -> bool {
        let mut empty = None;
        for k in self.around(edge) {
            let (t, i) = self.around[k];
            let (turn, taken) = self.taken[t as usize];
            if taken == [false; 2] {
                empty = empty.or(Some((t, i)));
            } else if turn == i / 2 && !taken[usize::from(i % 2)] {
                self.taken[t as usize].1[usize::from(i % 2)] = true;
                return true;
            }
        }
        let Some((t, i)) = empty else { return false };
        self.taken[t as usize] = (i / 2, [i % 2 == 0, i % 2 == 1]);
        true
    }

    /// Puts an edge into one of its elements, where the fewest are in its way; `salt` varies which of those.
    fn push_in(&mut self, edge: u32, salt: usize, waiting: &mut Vec<u32>) {
        let around = &self.around[self.around(edge)];
        let first = salt.wrapping_mul(0x9E37_79B9) / 7 % around.len();
        let turned = (0..around.len()).map(|k| around[(first + k) % around.len()]);
        let Some((t, i)) = turned.min_by_key(|&(t, i)| self.in_the_way(t, i).count()) else { return };
        waiting.extend(self.in_the_way(t, i));
        let (turn, taken) = self.taken[t as usize];
        let slot = usize::from(i % 2);
        let stays = turn == i / 2 && taken[1 - slot];
        self.taken[t as usize] = (i / 2, [stays; 2]);
        self.taken[t as usize].1[slot] = true;
    }

    /// Edges that must leave element `t` before its edge `i` can come.
    fn in_the_way(&self, t: u32, i: u8) -> impl Iterator<Item = u32> {
        let ((turn, taken), edges) = (self.taken[t as usize], self.edges_of[t as usize]);
        let leaves = move |other: &usize| taken[*other] && (turn != i / 2 || *other == usize::from(i % 2));
        (0..2).filter(leaves).map(move |other| edges[2 * turn as usize + other])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::block;

    #[test]
    fn every_edge_is_done_once_at_its_own_corners() {
        let mesh = block([7, 6, 5], 1.0);
        for held in [0, 40, 200] {
            each_is_done_once(&mesh, |v| v >= held);
        }
    }

    fn each_is_done_once(mesh: &monro_geometry::TetMesh, moves: impl Fn(u32) -> bool) {
        let m = of_tets(&mesh.tets, &moves);
        assert_eq!(m.edges, mesh.edges());
        let mut done = vec![0; m.edges.len()];
        for (tet, (turn, edges)) in mesh.tets.iter().zip(&m.of_tet) {
            let turned = TURNS[*turn as usize].map(|i| tet[i]);
            for (slot, &e) in edges.iter().enumerate().filter(|e| *e.1 != NONE) {
                let (a, b) = (turned[2 * slot], turned[2 * slot + 1]);
                assert_eq!(m.edges[e as usize], [a.min(b), a.max(b)]);
                done[e as usize] += 1;
            }
        }
        m.loose.iter().for_each(|&e| done[e as usize] += 1);
        let wanted = |e: &[u32; 2]| usize::from(e.iter().any(|&v| moves(v)));
        assert!(done.iter().zip(&m.edges).all(|(&n, e)| n == wanted(e)));
        assert!(m.loose.len() * 10 < m.edges.len(), "{} of {} found no place", m.loose.len(), m.edges.len());
    }

    #[test]
    fn one_element_does_two_edges_and_leaves_four() {
        let m = of_tets(&[[0, 1, 2, 3]], |_| true);
        assert_eq!((m.edges.len(), m.loose.len()), (6, 4));
    }
}
