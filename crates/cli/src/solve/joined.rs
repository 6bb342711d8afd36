//! What seems to be one in a scene and is not: elements that meet without sharing vertices, pieces, and a surface that is held
//! line by line.

use crate::mesh::meeting;
use monro_geometry::TetMesh;
use monro_tissue::StaticProblem;
use std::collections::{BTreeMap, BTreeSet};

/// Elements that meet without sharing what they meet in.
pub(super) fn unshared(mesh: &TetMesh) -> Vec<String> {
    let told = |words| format!("in the mesh {words}: neither motion nor force goes from one to the other there");
    meeting::unshared_words(mesh).into_iter().map(told).collect()
}

/// Sets that hold lines or single vertices only, though together they hold faces: on a finer mesh the tissue between them is free.
pub(super) fn lines(mesh: &TetMesh, problem: &StaticProblem, sets: &[(String, Vec<u32>)]) -> Option<String> {
    let mut of = BTreeMap::<u32, BTreeSet<u32>>::new();
    for s in &problem.supports {
        of.entry(s.node).or_default().insert(s.set);
    }
    let held: Vec<[u32; 3]> =
        mesh.boundary(|_| true).into_iter().filter(|f| f.iter().all(|v| of.contains_key(v))).collect();
    let shared = |f: &[u32; 3]| {
        let [a, b, c] = f.map(|v| &of[&v]);
        a.iter().filter(|s| b.contains(s) && c.contains(s)).copied().collect::<Vec<_>>()
    };
    let with_faces: BTreeSet<u32> = held.iter().flat_map(shared).collect();
    // Between two sets that hold faces, the solver holds those of both together.
    let only_lines = |f: &&[u32; 3]| f.iter().all(|v| of[v].iter().all(|s| !with_faces.contains(s)));
    let between: Vec<[u32; 3]> = held.iter().filter(only_lines).copied().collect();
    let named: BTreeSet<&str> =
        between.iter().flatten().flat_map(|v| &of[v]).map(|&s| sets[s as usize].0.as_str()).collect();
    let first = between.first()?;
    // The two ends of a body that is one element long hold its sides together, too, and are to be free between them.
    (named.len() > 2).then(|| {
        format!(
            "{} outer faces (the first is {first:?}) are held by {} sets together of which none holds a face (\"{}\" ...): on a \
             finer mesh the tissue between them is free, so that the answer is another one on each mesh; if they are one \
             surface, make them one set, with \"field:NAME\" for values that differ",
            between.len(),
            named.len(),
            named.iter().take(2).copied().collect::<Vec<_>>().join("\", \"")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Point;
    use monro_tissue::Support;

    /// A slab of cells with its top held row by row was a third too soft on the next mesh, and nothing said why.
    #[test]
    fn a_surface_held_line_by_line_is_told_and_one_set_is_not() {
        let at = |i: u32, j: u32, k: u32| 9 * k + 3 * j + i;
        let corners = (0..2).flat_map(|k| (0..3).flat_map(move |j| (0..3).map(move |i| [i, j, k])));
        let vertices = corners.map(|c| Point::from_array(c.map(f64::from))).collect();
        let mut tets = Vec::new();
        for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            for [a, b, c] in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [1, 0, 2], [0, 2, 1], [2, 1, 0]] {
                let mut p = [i, j, 0];
                let mut tet = vec![at(p[0], p[1], p[2])];
                for axis in [a, b, c] {
                    p[axis] += 1;
                    tet.push(at(p[0], p[1], p[2]));
                }
                tets.push([tet[0], tet[1], tet[2], tet[3]]);
            }
        }
        let mesh = TetMesh { vertices, labels: vec![1; tets.len()], tets };
        let told = |set: fn(u32) -> u32| {
            let supports: Vec<Support> =
                (9..18).map(|node| Support { node, set: set(node), displacement_mm: [Some(0.0); 3] }).collect();
            let count = supports.iter().map(|s| s.set).max().map_or(0, |m| m + 1);
            let sets: Vec<_> = (0..count).map(|s| (format!("row{s}"), vec![])).collect();
            lines(&mesh, &StaticProblem { supports, ..StaticProblem::default() }, &sets)
        };
        let rows = told(|node| (node - 9) / 3).expect("told");
        assert!(
            rows.contains("8 outer faces") && rows.contains("by 3 sets together") && rows.contains("\"row0\""),
            "{rows}"
        );
        assert_eq!((told(|_| 0), told(|node| u32::from(node < 12))), (None, None));
    }
}
