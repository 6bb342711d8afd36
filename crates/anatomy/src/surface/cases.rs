//! The marching-cubes cases, derived rather than copied.
//!
//! On every face of a cell the cut edges are joined by directed segments; where a face is ambiguous (inside corners on
//! a diagonal) the caller decides by the sign of the bilinear saddle (Nielson and Hamann 1991). The segments close into
//! loops, each loop is filled by triangles. Both cells at a face see the same segments and no diagonal is ever laid
//! into a face, so each edge of the surface has exactly two triangles and each vertex one fan, whatever the data.

use std::sync::OnceLock;

/// Corner `c` of a cell lies at `(c & 1, c >> 1 & 1, c >> 2)`. Each row goes round one face, counter-clockwise seen from
/// outside the cell.
pub(super) const FACES: [[usize; 4]; 6] =
    [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// A corner of a triangle: one of the 12 cell edges, or this, the middle of the loop that follows.
pub(super) const MIDDLE: u8 = 12;

/// One loop: its edges in order and its triangles over them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Loop {
    pub(super) edges: Vec<u8>,
    pub(super) triangles: Vec<[u8; 3]>,
}

/// All cases: `config` is the bit set of inside corners, `joined` the bit set of ambiguous faces (in the order of
/// [`FACES`], counting ambiguous ones only) whose inside corners are joined.
#[derive(Debug)]
pub(super) struct Cases {
    first: [u16; 257],
    loops: Vec<Vec<Loop>>,
}

impl Cases {
    pub(super) fn get() -> &'static Self {
        static CASES: OnceLock<Cases> = OnceLock::new();
        CASES.get_or_init(Self::build)
    }

    pub(super) fn loops(&self, config: u8, joined: usize) -> &[Loop] {
        &self.loops[usize::from(self.first[usize::from(config)]) + joined]
    }

    /// Whether `config` has an ambiguous face.
    pub(super) fn is_ambiguous(&self, config: u8) -> bool {
        let at = usize::from(config);
        self.first[at + 1] - self.first[at] > 1
    }

    fn build() -> Self {
        let mut first = [0; 257];
        let mut loops = Vec::new();
        for config in 0..=255u8 {
            first[usize::from(config)] = loops.len() as u16;
            let faces = FACES.iter().filter(|f| ambiguous(config, f)).count();
            loops.extend((0..1usize << faces).map(|joined| trace(config, joined)));
        }
        first[256] = loops.len() as u16;
        Self { first, loops }
    }
}

const fn inside(config: u8, corner: usize) -> bool {
    config >> corner & 1 == 1
}

/// Whether the inside corners of a face are exactly two opposite ones.
pub(super) const fn ambiguous(config: u8, face: &[usize; 4]) -> bool {
    let first = inside(config, face[0]);
    first == inside(config, face[2])
        && inside(config, face[1]) == inside(config, face[3])
        && first != inside(config, face[1])
}

/// Number of the edge between two neighbouring corners: four along x, then y, then z.
const fn edge_between(a: usize, b: usize) -> u8 {
    let low = if a < b { a } else { b };
    match a ^ b {
        1 => (low >> 1) as u8,
        2 => 4 + ((low & 1) | (low >> 1 & 2)) as u8,
        _ => 8 + (low & 3) as u8,
    }
}

/// The two corners of an edge, lower first.
pub(super) const fn edge_corners(edge: u8) -> [usize; 2] {
    let i = (edge & 3) as usize;
    match edge >> 2 {
        0 => [i << 1, i << 1 | 1],
        1 => [(i & 1) | (i & 2) << 1, (i & 1) | (i & 2) << 1 | 2],
        _ => [i, i | 4],
    }
}

/// Whether two edges bound a common face.
fn share_face(a: u8, b: u8) -> bool {
    let on = |face: &[usize; 4], e: u8| edge_corners(e).iter().all(|c| face.contains(c));
    FACES.iter().any(|f| on(f, a) && on(f, b))
}

fn trace(config: u8, mut joined: usize) -> Vec<Loop> {
    let mut next = [u8::MAX; 12];
    for face in &FACES {
        let cut = |i: usize| edge_between(face[i % 4], face[(i + 1) % 4]);
        if ambiguous(config, face) {
            let join = joined & 1 == 1;
            joined >>= 1;
            for i in 0..4 {
                // Segments run from an edge that enters the inside to one that leaves it: outward triangles.
                match (inside(config, face[i]), join) {
                    (true, false) => next[usize::from(cut(i + 3))] = cut(i),
                    (false, true) => next[usize::from(cut(i))] = cut(i + 3),
                    _ => {}
                }
            }
            continue;
        }
        let leaves = (0..4).find(|&i| inside(config, face[i]) && !inside(config, face[(i + 1) % 4]));
        let enters = (0..4).find(|&i| !inside(config, face[i]) && inside(config, face[(i + 1) % 4]));
        if let (Some(from), Some(to)) = (leaves, enters) {
            next[usize::from(cut(to))] = cut(from);
        }
    }
    close_loops(next)
}

fn close_loops(mut next: [u8; 12]) -> Vec<Loop> {
    let mut loops = Vec::new();
    for start in 0..12u8 {
        let mut edges = Vec::new();
        let mut at = start;
        while next[usize::from(at)] != u8::MAX {
            edges.push(at);
            at = std::mem::replace(&mut next[usize::from(at)], u8::MAX);
        }
        if !edges.is_empty() {
            let triangles = fill(&edges).unwrap_or_else(|| around_middle(&edges));
            loops.push(Loop { edges, triangles });
        }
    }
    loops
}

/// Triangles of a polygon by ear clipping, without a diagonal between two edges of one face; `None` if there is no way.
fn fill(polygon: &[u8]) -> Option<Vec<[u8; 3]>> {
    let n = polygon.len();
    if n == 3 {
        return Some(vec![[polygon[0], polygon[1], polygon[2]]]);
    }
    (0..n).find_map(|ear| {
        let (before, after) = (polygon[(ear + n - 1) % n], polygon[(ear + 1) % n]);
        if share_face(before, after) {
            return None;
        }
        let rest: Vec<u8> = polygon.iter().enumerate().filter(|&(i, _)| i != ear).map(|(_, &e)| e).collect();
        let mut triangles = fill(&rest)?;
        triangles.push([before, polygon[ear], after]);
        Some(triangles)
    })
}

fn around_middle(polygon: &[u8]) -> Vec<[u8; 3]> {
    let n = polygon.len();
    (0..n).map(|i| [polygon[i], polygon[(i + 1) % n], MIDDLE]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_and_corners_are_inverse() {
        for e in 0..12 {
            let [a, b] = edge_corners(e);
            assert_eq!(edge_between(a, b), e);
            assert_eq!(edge_between(b, a), e);
        }
    }

    #[test]
    fn every_case_uses_each_cut_edge_once_and_fills_its_loops() {
        let cases = Cases::get();
        for config in 0..=255u8 {
            let faces = FACES.iter().filter(|f| ambiguous(config, f)).count();
            let cut = (0..12).filter(|&e| edge_corners(e).iter().filter(|&&c| inside(config, c)).count() == 1);
            let cut: Vec<u8> = cut.collect();
            for joined in 0..1 << faces {
                let loops = cases.loops(config, joined);
                let mut used: Vec<u8> = loops.iter().flat_map(|l| l.edges.clone()).collect();
                used.sort_unstable();
                assert_eq!(used, cut, "{config} {joined}");
                for l in loops {
                    let middle = l.triangles.iter().any(|t| t.contains(&MIDDLE));
                    assert_eq!(l.triangles.len(), if middle { l.edges.len() } else { l.edges.len() - 2 });
                }
            }
        }
    }
}
