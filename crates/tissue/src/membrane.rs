//! Membranes: the faces where tissue meets the outside or another region.

use crate::bytes;
use monro_geometry::TET_FACES;

/// Stands for the outside on one side of a membrane.
pub(crate) const OUTSIDE: u8 = u8::MAX;

/// A face between two regions, or between a region and the outside. Of two regions the one with the lower number is inside,
/// so that all faces of a wall have the same side in, whatever the order of the elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Membrane {
    /// Its vertices; the normal `(b - a) x (c - a)` points from `inner` to `outer`.
    pub(crate) nodes: [u32; 3],
    /// Region behind it.
    pub(crate) inner: u8,
    /// Region in front of it, or [`OUTSIDE`].
    pub(crate) outer: u8,
}

/// All membranes.
#[derive(Debug, Clone, Default)]
pub(crate) struct Membranes {
    pub(crate) faces: Vec<Membrane>,
    /// Elements behind membranes with the face's place in the element and its number, in order.
    behind: Vec<(u32, u8, u32)>,
}

impl Membranes {
    /// The membranes that element `tet` is behind.
    pub(crate) fn before(&self, tet: u32) -> impl Iterator<Item = &Membrane> {
        let first = self.behind.partition_point(|b| b.0 < tet);
        let own = self.behind[first..].iter().take_while(move |b| b.0 == tet);
        own.map(|b| &self.faces[b.2 as usize])
    }

    /// Bytes that they take.
    pub(crate) fn bytes(&self) -> usize {
        bytes::of(&self.faces) + bytes::of(&self.behind)
    }
}

/// Finds the membranes of a conforming mesh whose element `t` belongs to region `region[t]`.
pub(crate) fn find(tets: &[[u32; 4]], region: &[u8]) -> Membranes {
    let mut all: Vec<([u32; 3], u32, u8)> = Vec::with_capacity(tets.len() * 4);
    for (t, tet) in tets.iter().enumerate() {
        for (f, face) in TET_FACES.iter().enumerate() {
            let mut key = face.map(|i| tet[i]);
            key.sort_unstable();
            all.push((key, t as u32, f as u8));
        }
    }
    all.sort_unstable();
    let mut out = Membranes::default();
    for same in all.chunk_by(|a, b| a.0 == b.0) {
        let of = |s: &([u32; 3], u32, u8)| region[s.1 as usize];
        let other = |i: usize| same.get(1 - i).map_or(OUTSIDE, of);
        let in_ = usize::from(other(0) < of(&same[0]));
        let ((_, t, f), inner, outer) = (same[in_], of(&same[in_]), other(in_));
        if inner != outer {
            out.behind.push((t, f, out.faces.len() as u32));
            out.faces.push(Membrane { nodes: TET_FACES[f as usize].map(|i| tets[t as usize][i]), inner, outer });
        }
    }
    out.behind.sort_unstable();
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_glued_elements_of_two_regions_have_six_outer_faces_and_one_wall() {
        let tets = [[0, 1, 2, 3], [0, 2, 1, 4]];
        let m = find(&tets, &[0, 1]);
        assert_eq!(m.faces.len(), 7);
        let wall: Vec<_> = m.faces.iter().filter(|f| f.outer != OUTSIDE).collect();
        assert_eq!(wall.len(), 1);
        assert_eq!((wall[0].inner, wall[0].outer), (0, 1));
        assert_eq!(find(&tets, &[0, 0]).faces.len(), 6);
        let turned = find(&tets, &[1, 0]);
        let wall = turned.faces.iter().find(|f| f.outer != OUTSIDE).expect("a wall");
        assert_eq!((wall.inner, wall.outer, wall.nodes), (0, 1, [0, 1, 2]));
    }
}
