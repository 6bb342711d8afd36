//! Rigid motions that supports leave free: the answer then stays where the solver began, one of many.

use monro_geometry::{DisjointSets, NO_TET, Patient, Point, TetMesh, Vector, tet_neighbours};
use monro_tissue::{EmbeddedRod, StaticProblem};
use std::collections::{BTreeMap, BTreeSet};

/// Share of the largest pivot below which a motion is free.
const FREE: f64 = 1e-9;
const NAMES: [&str; 6] =
    ["sliding along x", "sliding along y", "sliding along z", "turning about x", "turning about y", "turning about z"];

/// Says which rigid motions of which separate piece of the body nothing prescribes; `None` when all are. Rods hold what they
/// are in.
pub(super) fn free(mesh: &TetMesh, problem: &StaticProblem) -> Option<String> {
    if problem.supports.is_empty() {
        return None;
    }
    let pieces = pieces(mesh, problem);
    let loose: Vec<(&Piece, (usize, String))> =
        pieces.iter().filter_map(|p| Some((p, p.free(mesh, problem)?))).collect();
    let (piece, (count, which)) = loose.first()?;
    let so = if problem.contacts.is_empty() {
        "where it lies in these is chance, and loads along them are borne by nothing; hold a few nodes more"
    } else {
        "only spheres that touch bear loads along them, and where these do not either, it lies by chance, and what pushes it meets no force; hold a few nodes more if it should not"
    };
    let of = match pieces.len() {
        1 => "the body".to_owned(),
        n => format!(
            "the separate piece with tetrahedron {} ({} of {} tetrahedra; {} of {n} such pieces are loose)",
            piece.first,
            piece.tets,
            mesh.tets.len(),
            loose.len()
        ),
    };
    Some(format!("the supports leave {count} of the six rigid motions of {of} free{which}: {so}"))
}

/// Says that the body is in pieces that share nothing: `None` where it is one.
pub(super) fn apart(mesh: &TetMesh, problem: &StaticProblem) -> Option<String> {
    let pieces = pieces(mesh, problem);
    let [one, two, ..] = &pieces[..] else { return None };
    Some(format!(
        "the mesh is in {} pieces that share no vertex (that of tetrahedron {} has {}, that of tetrahedron {} has {}{}): they do not act \
         on each other",
        pieces.len(),
        one.first,
        one.tets,
        two.first,
        two.tets,
        if pieces.len() > 2 { ", ..." } else { "" }
    ))
}

/// Says which parts hang at the rest of the body in a vertex or an edge alone, so that they can turn about it; `None` without any.
/// Elements share no face there: nothing resists, though all hangs together.
pub(super) fn hinged(mesh: &TetMesh, problem: &StaticProblem) -> Option<String> {
    let mut parts = parted(mesh, problem, &by_faces(mesh));
    let mut parts_at = vec![0_u32; mesh.vertices.len()];
    parts.iter().flat_map(|p| &p.vertices).for_each(|&v| parts_at[v as usize] += 1);
    for part in &mut parts {
        part.joints = part.vertices.iter().copied().filter(|&v| parts_at[v as usize] > 1).collect();
    }
    let loose: Vec<(&Piece, usize)> =
        parts.iter().filter(|p| !p.joints.is_empty()).filter_map(|p| Some((p, p.free(mesh, problem)?.0))).collect();
    let (part, count) = loose.first()?;
    let at = mesh.vertices[part.joints[0] as usize];
    Some(format!(
        "the part with tetrahedron {} ({} of {} tetrahedra; {} of {} such parts) shares no face with the others and hangs at them by \
         {} node(s), one at ({:.6}, {:.6}, {:.6}) m, which leave {count} of its six rigid motions free: only what it runs into stops \
         it; give it faces in common with the rest, or hold it",
        part.first,
        part.tets,
        mesh.tets.len(),
        loose.len(),
        parts.len(),
        part.joints.len(),
        at.x * 1e-3,
        at.y * 1e-3,
        at.z * 1e-3,
    ))
}

/// What of a mesh hangs together.
#[derive(Default)]
struct Piece {
    first: usize,
    tets: usize,
    vertices: Vec<u32>,
    /// Its vertices that others have, too, if these are to hold it.
    joints: Vec<u32>,
    /// Its supports, by number.
    supports: Vec<usize>,
    /// Whether a rod is in it.
    has_rod: bool,
}

/// The separate pieces of a mesh, in the order of their first elements, where a vertex in common is enough to hang together.
fn pieces(mesh: &TetMesh, problem: &StaticProblem) -> Vec<Piece> {
    let mut sets = DisjointSets::new(mesh.vertices.len());
    mesh.tets.iter().for_each(|t| (1..4).for_each(|i| sets.join(t[0], t[i])));
    let groups: Vec<u32> = mesh.tets.iter().map(|t| sets.root(t[0])).collect();
    parted(mesh, problem, &groups)
}

/// Of each element the group of those that hang together by common faces.
fn by_faces(mesh: &TetMesh) -> Vec<u32> {
    let mut sets = DisjointSets::new(mesh.tets.len());
    for (t, beside) in (0..).zip(tet_neighbours(&mesh.tets, mesh.vertices.len())) {
        beside.into_iter().filter(|&other| other != NO_TET).for_each(|other| sets.join(t, other));
    }
    (0..mesh.tets.len() as u32).map(|t| sets.root(t)).collect()
}

/// The groups of elements, in the order of their first ones.
fn parted(mesh: &TetMesh, problem: &StaticProblem, groups: &[u32]) -> Vec<Piece> {
    let mut number = BTreeMap::<u32, usize>::new();
    let mut pieces: Vec<Piece> = Vec::new();
    for (first, (tet, &group)) in mesh.tets.iter().zip(groups).enumerate() {
        let at = *number.entry(group).or_insert(pieces.len());
        if at == pieces.len() {
            pieces.push(Piece { first, ..Piece::default() });
        }
        pieces[at].tets += 1;
        pieces[at].vertices.extend(tet);
    }
    let held: BTreeMap<u32, Vec<usize>> =
        problem.supports.iter().enumerate().fold(BTreeMap::new(), |mut held, (i, s)| {
            held.entry(s.node).or_insert_with(Vec::new).push(i);
            held
        });
    let rods: BTreeSet<u32> = problem.rods.iter().flat_map(|rod| beside(mesh, rod)).collect();
    for piece in &mut pieces {
        piece.vertices.sort_unstable();
        piece.vertices.dedup();
        piece.supports = piece.vertices.iter().filter_map(|v| held.get(v)).flatten().copied().collect();
        piece.has_rod = piece.vertices.iter().any(|v| rods.contains(v));
    }
    pieces
}

/// The vertices nearest to a rod's ends and to its middle.
fn beside(mesh: &TetMesh, rod: &EmbeddedRod) -> Vec<u32> {
    let [p, q] = rod.ends;
    let nearest = |at: Point<Patient>| {
        let off = |v: &u32| mesh.vertices[*v as usize].distance(at);
        (0..mesh.vertices.len() as u32).min_by(|a, b| off(a).total_cmp(&off(b)))
    };
    [p, q, p.lerp(q, 0.5)].into_iter().filter_map(nearest).collect()
}

impl Piece {
    /// How many motions nothing prescribes, and which, in words.
    fn free(&self, mesh: &TetMesh, problem: &StaticProblem) -> Option<(usize, String)> {
        if self.has_rod {
            return None;
        }
        let gram = gram(mesh, self, problem);
        let count = 6 - rank(gram);
        let largest = (0..6).map(|i| gram[i][i]).fold(0.0, f64::max);
        let axes: Vec<&str> = (0..6).filter(|&i| gram[i][i] <= FREE * largest).map(|i| NAMES[i]).collect();
        let which = match axes.len() {
            0 | 6 => String::new(),
            _ => format!(" (among them {})", axes.join(", ")),
        };
        (count > 0).then_some((count, which))
    }
}

/// Sums of products of what the six motions (about the middle of a piece) do to what of it is held.
fn gram(mesh: &TetMesh, piece: &Piece, problem: &StaticProblem) -> [[f64; 6]; 6] {
    let own = || piece.vertices.iter().map(|&v| mesh.vertices[v as usize]);
    let sum = own().fold([0.0; 3], |s, p| [s[0] + p.x, s[1] + p.y, s[2] + p.z]);
    let middle = Point::from_array(sum.map(|v| v / piece.vertices.len() as f64));
    let size = own().map(|p| p.distance(middle)).fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    let unit = |a: usize| Vector::from_array(core::array::from_fn(|i| f64::from(u8::from(i == a))));
    let mut gram = [[0.0; 6]; 6];
    let supports = piece.supports.iter().map(|&i| &problem.supports[i]);
    let supports = supports.map(|s| (s.node, s.displacement_mm.map(|value| value.is_some())));
    for (node, held) in supports.chain(piece.joints.iter().map(|&v| (v, [true; 3]))) {
        let arm = (mesh.vertices[node as usize] - middle) / size;
        for axis in (0..3).filter(|&a| held[a]) {
            let row: [f64; 6] = core::array::from_fn(|m| {
                let moved = if m < 3 { unit(m) } else { unit(m - 3).cross(arm) };
                moved.to_array()[axis]
            });
            gram.iter_mut().zip(row).for_each(|(g, r)| g.iter_mut().zip(row).for_each(|(v, c)| *v += r * c));
        }
    }
    gram
}

/// Rank of a symmetric matrix without negative eigenvalues, by elimination with the largest diagonal first.
fn rank(mut m: [[f64; 6]; 6]) -> usize {
    let largest = (0..6).map(|i| m[i][i]).fold(0.0, f64::max);
    let mut left: Vec<usize> = (0..6).collect();
    while let Some(at) = (0..left.len()).max_by(|&a, &b| m[left[a]][left[a]].total_cmp(&m[left[b]][left[b]])) {
        let p = left[at];
        if m[p][p] <= FREE * largest {
            break;
        }
        left.swap_remove(at);
        for &i in &left {
            let factor = m[i][p] / m[p][p];
            (0..6).for_each(|j| m[i][j] -= factor * m[p][j]);
        }
    }
    6 - left.len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_tissue::Support;

    fn told(held: &[(u32, [bool; 3])]) -> Option<String> {
        let vertices = [[0.0; 3], [20.0, 0.0, 0.0], [0.0, 20.0, 0.0], [0.0, 0.0, 20.0]].map(Point::from_array).to_vec();
        let mesh = TetMesh { vertices, tets: vec![[0, 1, 2, 3]], labels: vec![1] };
        let one = |&(node, axes): &(u32, [bool; 3])| Support {
            node,
            set: 0,
            displacement_mm: axes.map(|held| held.then_some(0.0)),
        };
        free(&mesh, &StaticProblem { supports: held.iter().map(one).collect(), ..StaticProblem::default() })
    }

    /// A body of which only z was held slid away in x and y without a word.
    #[test]
    fn motions_that_nothing_holds_are_counted_and_named() {
        let z = [false, false, true];
        let said = told(&[(0, z), (1, z), (2, z)]).expect("slides");
        assert!(said.contains("leave 3 of") && said.contains("along x, sliding along y, turning about z"), "{said}");
        assert!(told(&[(0, [true; 3]), (1, [true; 3])]).expect("turns").contains("leave 1 of"));
        assert_eq!(told(&[(0, [true; 3]), (1, [true; 3]), (2, z)]), None);
    }

    /// A sphere went into a piece that nothing held: no force, and nothing but "does not touch it" said why.
    #[test]
    fn a_piece_that_nothing_holds_was_vouched_for_by_another() {
        let corners = |x: f64| [[x, 0.0, 0.0], [x + 20.0, 0.0, 0.0], [x, 20.0, 0.0], [x, 0.0, 20.0]];
        let vertices = [corners(0.0), corners(50.0)].concat().into_iter().map(Point::from_array).collect();
        let mesh = TetMesh { vertices, tets: vec![[0, 1, 2, 3], [4, 5, 6, 7]], labels: vec![1; 2] };
        let all = |node: u32| Support { node, set: 0, displacement_mm: [Some(0.0); 3] };
        let problem = |nodes: &[u32]| StaticProblem {
            supports: nodes.iter().map(|&n| all(n)).collect(),
            ..StaticProblem::default()
        };
        let said = free(&mesh, &problem(&[0, 1, 2])).expect("loose");
        assert!(said.contains("leave 6 of the six") && said.contains("tetrahedron 1 (1 of 2"), "{said}");
        assert_eq!(free(&mesh, &problem(&[0, 1, 2, 4, 5, 6])), None);
        let ends = [Point::new(52.0, 1.0, 1.0), Point::new(55.0, 2.0, 2.0)];
        let rod = EmbeddedRod { radius_mm: 1.0, ends, displacement_mm: Vector::ZERO };
        assert_eq!(free(&mesh, &StaticProblem { rods: vec![rod], ..problem(&[0, 1, 2]) }), None);
    }

    /// It swung by 130 mm about the vertex, until it passed through the rest.
    #[test]
    fn a_part_that_hung_at_a_vertex_or_an_edge_was_taken_for_held() {
        let vertices = [
            [0.0; 3],
            [20.0, 0.0, 0.0],
            [0.0, 20.0, 0.0],
            [0.0, 0.0, 20.0],
            [20.0, 20.0, 20.0],
            [40.0, 0.0, 0.0],
            [40.0, 9.0, 9.0],
        ];
        let all = |node: u32| Support { node, set: 0, displacement_mm: [Some(0.0); 3] };
        let told = |second: [u32; 4], held: &[u32]| {
            let vertices = vertices.map(Point::from_array).to_vec();
            let mesh = TetMesh { vertices, tets: vec![[0, 1, 2, 3], second], labels: vec![1; 2] };
            let supports = held.iter().map(|&n| all(n)).collect();
            hinged(&mesh, &StaticProblem { supports, ..StaticProblem::default() })
        };
        let vertex = told([1, 5, 4, 6], &[0, 2, 3]).expect("turns");
        assert!(
            vertex.contains("tetrahedron 1 (1 of 2") && vertex.contains("by 1 node(s), one at (0.020000"),
            "{vertex}"
        );
        assert!(vertex.contains("leave 3 of its six rigid motions free"), "{vertex}");
        let edge = told([1, 2, 4, 5], &[0, 2, 3]).expect("swings");
        assert!(edge.contains("by 2 node(s)") && edge.contains("leave 1 of its six"), "{edge}");
        assert_eq!(told([1, 2, 4, 5], &[0, 2, 3, 5]), None);
        assert_eq!(told([1, 2, 3, 4], &[0, 2, 3]), None);
    }
}
