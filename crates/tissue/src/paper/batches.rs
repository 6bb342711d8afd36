//! Constraints in batches: up to sixteen that share no vertex, so that a batch is as many Gauss-Seidel steps at once.
//!
//! Two batches made from one group share no vertex either: a sweep works on both at once, one computing while the other
//! waits for its square roots and quotients.

use crate::fast::{Places, Row, WIDTH};

/// Unfinished groups, a bit for each: more than there are constraints around a vertex, else groups are finished half full.
type Open = u128;

/// Constraints of a group: two batches.
const GROUP: usize = 2 * WIDTH;

/// Groups `0..count` so that the members of a group share no vertex: up to [`GROUP`] each, near each other in order.
pub(super) fn groups<const N: usize>(nodes: &[[u16; N]], vertices: usize) -> Vec<Vec<u32>> {
    // Bit `g` of a vertex: it is in open group `g`.
    let mut inside: Vec<Open> = vec![0; vertices];
    let mut open: Vec<Vec<u32>> = vec![Vec::new(); Open::BITS as usize];
    let mut done = Vec::new();
    let mut finish = |group: &mut Vec<u32>, inside: &mut [Open], g: usize| {
        for &m in group.iter() {
            nodes[m as usize].iter().for_each(|&v| inside[usize::from(v)] &= !(1 << g));
        }
        done.push(core::mem::take(group));
    };
    for (i, own) in nodes.iter().enumerate() {
        let taken = |inside: &[Open]| own.iter().fold(0, |t, &v| t | inside[usize::from(v)]);
        if taken(&inside) == Open::MAX {
            let fullest = (0..open.len()).max_by_key(|&g| (open[g].len(), core::cmp::Reverse(g))).unwrap_or(0);
            finish(&mut open[fullest], &mut inside, fullest);
        }
        let g = taken(&inside).trailing_ones() as usize;
        open[g].push(i as u32);
        own.iter().for_each(|&v| inside[usize::from(v)] |= 1 << g);
        if open[g].len() == GROUP {
            finish(&mut open[g], &mut inside, g);
        }
    }
    done.extend(open.into_iter().filter(|g| !g.is_empty()));
    // The small groups left over first, the full ones after them.
    done.reverse();
    done
}

/// Members of one batch, lane by lane. An empty lane repeats the first of its eight: what eight lanes do at once is the same
/// in both, and may be written twice.
#[derive(Debug, Clone, Copy)]
pub(super) struct Members {
    pub(super) of: [u32; WIDTH],
    pub(super) count: usize,
    /// It shares no vertex with the next batch.
    pub(super) joined: bool,
}

impl Members {
    fn new(group: &[u32], joined: bool) -> Self {
        let of = core::array::from_fn(|l| group[if l < group.len() { l } else { repeated(l, group.len()) }]);
        Self { of, count: group.len(), joined }
    }

    /// One value for each lane.
    pub(super) fn row(&self, value: impl Fn(u32) -> f32) -> Row {
        self.of.map(value)
    }
}

/// The lane that the empty lane `lane` of a batch of `count` repeats.
fn repeated(lane: usize, count: usize) -> usize {
    let first = lane / 8 * 8;
    if first < count { first } else { 0 }
}

/// Batches of constraints on `N` vertices, and their places.
pub(super) fn batches<const N: usize>(nodes: &[[u16; N]], vertices: usize) -> (Vec<Members>, Places<N>) {
    let halves = |g: &Vec<u32>| {
        let joined = g.len() > WIDTH;
        g.chunks(WIDTH).enumerate().map(|(i, m)| Members::new(m, joined && i == 0)).collect::<Vec<_>>()
    };
    let members: Vec<Members> = groups(nodes, vertices).iter().flat_map(halves).collect();
    let rows = members.iter().map(|m| core::array::from_fn(|k| m.of.map(|i| nodes[i as usize][k]))).collect();
    (members, Places::new(rows))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::block;

    #[test]
    fn groups_share_no_vertex_leave_nothing_out_and_are_mostly_full() {
        let mesh = block([9, 8, 7], 1.0);
        let nodes: Vec<[u16; 4]> = mesh.tets.iter().map(|t| t.map(|v| v as u16)).collect();
        let groups = groups(&nodes, mesh.vertices.len());
        let mut seen: Vec<u32> = groups.concat();
        seen.sort_unstable();
        assert_eq!(seen, (0..mesh.tets.len() as u32).collect::<Vec<_>>());
        for g in &groups {
            let mut own: Vec<u16> = g.iter().flat_map(|&t| nodes[t as usize]).collect();
            let all = own.len();
            own.sort_unstable();
            own.dedup();
            assert_eq!(own.len(), all);
        }
        let (members, _) = batches(&nodes, mesh.vertices.len());
        assert!(members.len() * 13 < mesh.tets.len(), "{} batches", members.len());
        assert!(members.iter().filter(|m| m.joined).count() * 5 > members.len() * 2);
        for m in members.windows(2).filter(|m| m[0].joined) {
            let corners = |m: &Members| -> Vec<u16> { m.of.iter().flat_map(|&t| nodes[t as usize]).collect() };
            let next = corners(&m[1]);
            assert!(corners(&m[0]).iter().all(|v| !next.contains(v)));
        }
    }
}
