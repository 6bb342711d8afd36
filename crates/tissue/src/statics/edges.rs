//! The edges of a mesh, numbered, so that marks on them are looked up and not searched for.

use super::bisect::{Fine, key};
use monro_geometry::TET_EDGES;

/// Edges of the elements.
pub(super) struct Edges {
    /// Their ends, in order.
    pub(super) ends: Vec<[u32; 2]>,
    /// Those around each element.
    pub(super) around: Vec<[u32; 6]>,
    /// The longest of each element; equal lengths go by vertex numbers, the same for every element.
    pub(super) longest: Vec<u32>,
}

/// Whether one of some edges is marked.
pub(super) fn any(edges: &[u32; 6], marked: &[bool]) -> bool {
    edges.iter().any(|&e| marked[e as usize])
}

impl Edges {
    pub(super) fn of(mesh: &Fine) -> Self {
        let all = mesh.tets.iter().flat_map(|t| TET_EDGES.map(|[i, j]| key(t[i], t[j])));
        let mut places: Vec<([u32; 2], u32)> = all.zip(0..).collect();
        places.sort_unstable();
        let (mut ends, mut around) = (Vec::new(), vec![[0; 6]; mesh.tets.len()]);
        for (e, place) in places {
            if ends.last() != Some(&e) {
                ends.push(e);
            }
            around[place as usize / 6][place as usize % 6] = ends.len() as u32 - 1;
        }
        let length: Vec<f64> = ends.iter().map(|&e| mesh.length2(e)).collect();
        let longer = |a: u32, b: u32| length[a as usize].total_cmp(&length[b as usize]).then(a.cmp(&b)).is_ge();
        let longest = around.iter().map(|e| e.iter().skip(1).fold(e[0], |a, &b| if longer(a, b) { a } else { b }));
        let longest = longest.collect();
        Self { ends, around, longest }
    }

    /// An element with a marked edge has its longest edge marked, too.
    pub(super) fn close(&self, marked: &mut [bool]) {
        let mut goes_on = true;
        while goes_on {
            goes_on = false;
            for (around, &longest) in self.around.iter().zip(&self.longest) {
                if !marked[longest as usize] && any(around, marked) {
                    (marked[longest as usize], goes_on) = (true, true);
                }
            }
        }
    }
}
