//! Where parts of a mesh from elsewhere meet that share nothing there: triangles through each other, hanging nodes, vertices
//! that are doubled but for rounding.

use super::facts::place;
use monro_geometry::{HangingNode, LooseFaces, SelfCrossing, TetMesh, TriangleMesh};
use serde_json::{Value, json};

/// What was found, and what is to be said of it.
pub(super) struct Meeting {
    pub(super) json: Value,
    pub(super) doubts: Vec<String>,
}

/// Triangles of a surface that pass through each other.
pub(super) fn of_surface(mesh: &TriangleMesh) -> Meeting {
    let found = mesh.self_crossing();
    let doubts = found.map(|found| format!("the {found}")).into_iter().collect();
    Meeting { json: json!({ "self_crossing": crossing_json(found.as_ref()) }), doubts }
}

/// Elements that do not share what they meet in.
pub(super) fn of_tetrahedra(mesh: &TetMesh) -> Meeting {
    let (hanging, loose) = mesh.unshared();
    let mut doubts = words(hanging, loose);
    let boundary = TriangleMesh { vertices: mesh.vertices.clone(), triangles: mesh.boundary(|_| true) };
    let found = boundary.self_crossing();
    // Where elements share nothing, the faces in which they should lie on each other: not to be told twice.
    if doubts.is_empty() {
        doubts.extend(found.map(|found| format!("the outer {found}")));
    }
    let json = json!({
        "hanging_nodes": hanging.map_or(0, |h| h.vertices),
        "loose_faces": loose.map_or(0, |l| l.faces),
        "self_crossing": crossing_json(found.as_ref()),
    });
    Meeting { json, doubts }
}

/// How many pairs of triangles cross, and where the first do; null where none do.
pub(super) fn crossing_json(found: Option<&SelfCrossing>) -> Value {
    found.map_or(Value::Null, |found| json!({ "pairs": found.pairs, "at_lps_mm": found.at.to_array() }))
}

/// What is to be said of elements that do not share what they meet in.
pub(crate) fn unshared_words(mesh: &TetMesh) -> Vec<String> {
    let (hanging, loose) = mesh.unshared();
    words(hanging, loose)
}

fn words(hanging: Option<HangingNode>, loose: Option<LooseFaces>) -> Vec<String> {
    hanging.map(hanging_words).into_iter().chain(loose.map(loose_words)).collect()
}

fn hanging_words(h: HangingNode) -> String {
    format!(
        "{} hanging node(s): vertices that lie on a face or an edge of an element without being its corner, the first is vertex {} on tetrahedron {} at {} mm; elements there are not joined",
        h.vertices,
        h.vertex,
        h.tet,
        place(h.at.to_array())
    )
}

fn loose_words(l: LooseFaces) -> String {
    let ([tet, other], [vertex, twin]) = (l.tets, l.vertices);
    format!(
        "{} face(s) lie on others with vertices of their own that differ only by rounding, the first of tetrahedra {tet} and {other} with vertices {vertex} and {twin} at {} mm: merge vertices in the same place, for elements there are not joined",
        l.faces,
        place(l.at.to_array())
    )
}
