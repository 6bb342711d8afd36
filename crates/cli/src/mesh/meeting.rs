//! Where parts of a mesh from elsewhere meet that share nothing there: triangles through each other, hanging nodes, vertices
//! that are doubled but for rounding.

use super::facts::place;
use monro_geometry::{Crossings, HangingNode, LooseFaces, TetMesh, TriangleMesh};
use serde_json::{Value, json};

/// What was found, and what is to be said of it.
pub(super) struct Meeting {
    pub(super) json: Value,
    pub(super) doubts: Vec<String>,
}

/// Triangles of a surface that pass through each other.
pub(super) fn of_surface(mesh: &TriangleMesh) -> Meeting {
    let found = mesh.crossings();
    let json = json!({ "self_crossing": crossing_json(mesh, &found) });
    Meeting { json, doubts: crossing_words("the surface passes through itself", mesh, &found).into_iter().collect() }
}

/// Elements that do not share what they meet in.
pub(super) fn of_tetrahedra(mesh: &TetMesh) -> Meeting {
    let (hanging, loose) = mesh.unshared();
    let mut doubts: Vec<String> = hanging.map(hanging_words).into_iter().chain(loose.map(loose_words)).collect();
    let boundary = TriangleMesh { vertices: mesh.vertices.clone(), triangles: mesh.boundary(|_| true) };
    let found = boundary.crossings();
    // Where elements share nothing, the faces in which they should lie on each other: not to be told twice.
    if doubts.is_empty() {
        doubts.extend(crossing_words("the outer surface passes through itself", &boundary, &found));
    }
    let json = json!({
        "hanging_nodes": hanging.map_or(0, |h| h.vertices),
        "loose_faces": loose.map_or(0, |l| l.faces),
        "self_crossing": crossing_json(&boundary, &found),
    });
    Meeting { json, doubts }
}

/// How many pairs of triangles cross, and where the first do; null where none do.
fn crossing_json(mesh: &TriangleMesh, found: &Crossings) -> Value {
    found.pairs.first().map_or(
        Value::Null,
        |&first| json!({ "pairs": found.pairs.len(), "at_lps_mm": mesh.crossing_place(first).to_array() }),
    )
}

fn crossing_words(what: &str, mesh: &TriangleMesh, found: &Crossings) -> Option<String> {
    let &first = found.pairs.first()?;
    let more = if found.cut_short { " or more" } else { "" };
    let at = mesh.crossing_place(first).to_array();
    Some(format!(
        "{what}: {}{more} pair(s) of triangles cross or lie on each other, the first at {} mm",
        found.pairs.len(),
        place(at)
    ))
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
