//! Which edges of a mesh one set of vertices holds: what the set is, a side of the body, a wall or sheet inside, or a line.
//!
//! A set is a list of vertices; what lies between them must be read from the mesh. It is read from the plainest to the
//! least plain: outer faces, faces between two regions, other faces inside, then edges on the outside, between regions,
//! inside. What all of whose vertices the set holds counts, from the second reading on only where it reaches a vertex that
//! no plainer reading has explained: otherwise it is a chord from one held side to another through tissue that is free. The
//! edges of elements whose four vertices the set holds always count.

use super::bisect::key;
use monro_geometry::TET_FACES;
use std::collections::{BTreeMap, BTreeSet};

/// Displacement (mm) at which each vertex is held in one component; `None` where it is free.
pub(super) type Held = Vec<Option<f64>>;

type Edge = [u32; 2];

/// Where a face or an edge lies, the plainest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Place {
    Outside,
    Between,
    Inside,
}

const PLACES: [Place; 3] = [Place::Outside, Place::Between, Place::Inside];

pub(super) fn all(held: &Held, nodes: &[u32]) -> bool {
    nodes.iter().all(|&v| held[v as usize].is_some())
}

pub(super) fn edges(nodes: &[u32]) -> impl Iterator<Item = Edge> {
    nodes.iter().enumerate().flat_map(|(i, &a)| nodes[..i].iter().map(move |&b| key(a, b)))
}

/// The edges that one set holds.
pub(super) fn held_edges(tets: &[[u32; 4]], labels: &[u16], held: &Held) -> BTreeSet<Edge> {
    let faces = faces(tets, labels, held);
    let mut found = Reading::default();
    for place in PLACES {
        let here = faces.iter().filter(|(f, p)| **p == place && all(held, &f[..]));
        found.add(here.map(|(f, _)| &f[..]), place == Place::Outside);
    }
    let solid = tets.iter().filter(|t| all(held, &t[..]));
    solid.for_each(|t| found.edges.extend(edges(t)));
    let mut places = BTreeMap::<Edge, Place>::new();
    for (face, &place) in &faces {
        for e in edges(face).filter(|e| all(held, &e[..])) {
            places.entry(e).and_modify(|p| *p = place.min(*p)).or_insert(place);
        }
    }
    for place in PLACES {
        found.add(places.iter().filter(|(_, p)| **p == place).map(|(e, _)| &e[..]), false);
    }
    found.edges
}

/// What has been read so far.
#[derive(Default)]
struct Reading {
    edges: BTreeSet<Edge>,
    explained: BTreeSet<u32>,
}

impl Reading {
    /// Takes the parts that reach a vertex not explained before, or all of them.
    fn add<'a>(&mut self, parts: impl Iterator<Item = &'a [u32]>, whatever: bool) {
        let new: Vec<&[u32]> = parts.filter(|p| whatever || p.iter().any(|v| !self.explained.contains(v))).collect();
        for part in new {
            self.edges.extend(edges(part));
            self.explained.extend(part);
        }
    }
}

/// Faces with at least two held vertices, by their vertices in order.
fn faces(tets: &[[u32; 4]], labels: &[u16], held: &Held) -> BTreeMap<[u32; 3], Place> {
    let mut out = BTreeMap::<[u32; 3], (u16, Place)>::new();
    for (tet, &label) in tets.iter().zip(labels) {
        for corners in TET_FACES {
            let mut face = corners.map(|i| tet[i]);
            if face.iter().filter(|&&v| held[v as usize].is_some()).count() < 2 {
                continue;
            }
            face.sort_unstable();
            let second = |first: &mut (u16, Place)| {
                first.1 = if first.0 == label { Place::Inside } else { Place::Between };
            };
            out.entry(face).and_modify(second).or_insert((label, Place::Outside));
        }
    }
    out.into_iter().map(|(face, (_, place))| (face, place)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::block;

    type Corner = [f64; 3];

    /// A block of 3 x 3 x 3 cells of 1 mm, held where `hold` says: its held edges, by their ends.
    fn held(label: impl Fn([f64; 3]) -> u16, hold: impl Fn([f64; 3]) -> bool) -> (Vec<[Corner; 2]>, Vec<[Corner; 4]>) {
        let mesh = block([3, 3, 3], 1.0);
        let at = |v: u32| mesh.vertices[v as usize].to_array();
        let held: Held = mesh.vertices.iter().map(|p| hold(p.to_array()).then_some(0.0)).collect();
        let middle = |t: &[u32; 4]| core::array::from_fn(|k| t.iter().map(|&v| at(v)[k]).sum::<f64>() / 4.0);
        let labels: Vec<u16> = mesh.tets.iter().map(|t| label(middle(t))).collect();
        let solid = mesh.tets.iter().filter(|t| all(&held, &t[..])).map(|t| t.map(at)).collect();
        (held_edges(&mesh.tets, &labels, &held).into_iter().map(|e| e.map(at)).collect(), solid)
    }

    fn beside(p: [f64; 3]) -> bool {
        p.iter().any(|v| *v == 0.0 || *v == 3.0)
    }

    /// Whether both ends lie on one side of the block.
    fn on_side([a, b]: [[f64; 3]; 2]) -> bool {
        (0..3).any(|k| a[k] == b[k] && (a[k] == 0.0 || a[k] == 3.0))
    }

    #[test]
    fn an_edge_from_one_held_side_to_another_is_not_held_even_between_regions() {
        // The wall between the regions crosses the body, with its border on the held surface.
        for label in [|_: [f64; 3]| 1, |p: [f64; 3]| 1 + u16::from(p[0] > 1.0)] {
            let (edges, solid) = held(label, beside);
            for e in edges.into_iter().filter(|e| !on_side(*e)) {
                assert!(solid.iter().any(|t| e.iter().all(|end| t.contains(end))), "{e:?}");
            }
        }
    }

    #[test]
    fn a_wall_between_two_regions_is_held_as_a_whole_and_nothing_beside_it() {
        let (edges, _) = held(|p| 1 + u16::from(p[0] > 1.0), |p| p[0] == 1.0);
        // Of 3 x 3 squares, two triangles each: 12 + 12 sides and 9 diagonals.
        assert_eq!(edges.len(), 33);
    }

    #[test]
    fn a_line_that_ends_on_a_held_side_is_held_up_to_it() {
        let line = |p: [f64; 3]| p[1] == 1.0 && p[2] == 1.0;
        let (edges, _) = held(|_| 1, |p| p[0] == 0.0 || line(p));
        for x in [0.0, 1.0, 2.0] {
            assert!(edges.iter().any(|e| e.contains(&[x, 1.0, 1.0]) && e.contains(&[x + 1.0, 1.0, 1.0])), "{x}");
        }
    }
}
