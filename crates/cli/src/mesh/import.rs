//! Meshes from elsewhere: checked, told about, converted.

use super::facts::{SurfaceFacts, bounds, label_facts, place, shapes_json, shapes_words};
use super::{meeting, merged, out};
use crate::args::MeshArgs;
use crate::console::{Console, seconds_json};
use crate::mesh_file::{AnyMesh, Encoded, Format, Read};
use anyhow::{Result, bail};
use monro_anatomy::shapes::ShapeSummary;
use monro_anatomy::tetra::{LARGEST_DIHEDRAL, LEAST_DIHEDRAL, LEAST_RADIUS_RATIO};
use monro_geometry::{TetLocator, TetMesh, TriangleMesh};
use serde_json::{Value, json};

/// What was found of a mesh: for programs, for people, and what may be wrong with it.
struct Found {
    json: Value,
    words: Vec<String>,
    doubts: Vec<String>,
}

/// Refuses options that mean something for labels only: passed over, they would seem done.
pub(super) fn check_options(args: &MeshArgs) -> Result<()> {
    let given = [
        ("--keep", args.keep.is_some()),
        ("--fine", args.fine.is_some()),
        ("--path", args.path.is_some()),
        ("--elements", args.elements.is_some()),
        ("--density", args.density.is_some()),
        ("--growth", args.growth.is_some()),
        ("--coarsest", args.coarsest.is_some()),
        ("--report", args.report.is_some()),
    ];
    let given: Vec<&str> = given.into_iter().filter_map(|(name, given)| given.then_some(name)).collect();
    if given.is_empty() {
        return Ok(());
    }
    bail!(
        "{} says how labels are meshed, but {} is a mesh already, which is checked and converted as it is; leave that out, or give the label volume",
        given.join(", "),
        args.labels.display()
    )
}

/// Writes a mesh that was read. What is plainly broken was refused on the way; with `--strict` doubts refuse it too.
pub(super) fn convert(Read { mesh, remarks }: &Read, format: Format, args: &MeshArgs, console: &Console) -> Result<()> {
    let Found { json, words, doubts } = console.stage("check", || match mesh {
        AnyMesh::Tetrahedra(mesh) => of_tetrahedra(mesh),
        AnyMesh::Surface(mesh) => of_surface(mesh),
    });
    if args.strict && !doubts.is_empty() {
        bail!("{} is refused by --strict: {}", args.labels.display(), doubts.join("; "));
    }
    let Encoded { bytes, remark } = format.encode(mesh)?;
    let remarks: Vec<&String> = remarks.iter().chain(&doubts).chain(&remark).collect();
    remarks.iter().for_each(|remark| console.warn(remark));
    console.stage("write", || out::write(&args.out, &bytes))?;
    let out = args.out.display().to_string();
    let seconds = seconds_json(&console.stages());
    let json = merged(json, json!({ "out": out, "seconds": seconds, "remarks": remarks }));
    console.result(&json, &format!("{}\n{out}", words.join("\n")));
    Ok(())
}

fn of_tetrahedra(mesh: &TetMesh) -> Found {
    let shapes = ShapeSummary::of(mesh);
    let counts = [mesh.tets.len(), mesh.vertices.len()];
    let mut words = vec![shapes_words(counts, &shapes)];
    let mut doubts: Vec<String> = of_shapes(&shapes).into_iter().chain(of_overlap(mesh)).collect();
    let unshared = meeting::of_tetrahedra(mesh);
    doubts.extend(unshared.doubts);
    let mut labels = Vec::new();
    for (label, elements) in mesh.label_counts() {
        let surface = SurfaceFacts::from(&mesh.surface(|l| l == label));
        let volume = mesh.label_volume(label);
        words.push(format!("label {label}: {elements} elements, {volume:.2} mm3, {}", surface.words()));
        doubts.extend(of_pinches(&format!("the surface of label {label}"), &surface));
        labels.push(label_facts(label, elements, volume, &surface));
    }
    let outer = SurfaceFacts::from(&mesh.surface(|_| true));
    // A mesh of one label would be told twice.
    if labels.len() > 1 {
        words.push(format!("all together: {}", outer.words()));
        doubts.extend(of_pinches("the outer surface", &outer));
    }
    let bounds = bounds(&mesh.vertices);
    words.push(box_words(bounds));
    let json = json!({ "elements": counts[0], "vertices": counts[1], "labels": labels, "outer": outer.json(), "bounds_mm": bounds });
    Found { json: merged(merged(json, shapes_json(&shapes)), unshared.json), words, doubts }
}

fn box_words([low, high]: [[f64; 3]; 2]) -> String {
    format!("from {} to {} mm, LPS", place(low), place(high))
}

fn of_shapes(shapes: &ShapeSummary) -> Option<String> {
    let bad = shapes.bad?;
    Some(format!(
        "{} element(s) of bad shape: dihedral angles {:.2} to {:.2} degrees (bad is below {LEAST_DIHEDRAL:.0} or above {LARGEST_DIHEDRAL:.0}), radius ratio {:.4} (bad is below {LEAST_RADIUS_RATIO}); the worst at {} mm",
        bad.count,
        shapes.dihedral_min,
        shapes.dihedral_max,
        shapes.radius_ratio_min,
        place(bad.worst_at)
    ))
}

fn of_overlap(mesh: &TetMesh) -> Option<String> {
    let found = TetLocator::new(mesh).ok()?.overlap()?;
    let [one, other] = found.pair;
    let at = place(found.at.to_array());
    Some(format!(
        "{} element(s) lie in others, the first are tetrahedra {one} and {other} at {at} mm: parts of the mesh overlap, and volumes count twice",
        found.elements
    ))
}

/// Where a closed surface meets itself.
fn of_pinches(which: &str, surface: &SurfaceFacts) -> Option<String> {
    let at = surface.pinched_at.filter(|_| surface.closed)?;
    Some(format!("{which} is not two-manifold: it meets itself near {} mm", place(at)))
}

fn of_surface(mesh: &TriangleMesh) -> Found {
    let facts = SurfaceFacts::from(mesh);
    let topology = mesh.topology();
    let (area, volume) = (mesh.area(), facts.closed.then(|| mesh.signed_volume()));
    let mut doubts = Vec::new();
    if topology.boundary_edges > 0 {
        let at = facts.pinched_at.map_or_else(String::new, |at| format!(", near {} mm for one", place(at)));
        let edges = topology.boundary_edges;
        doubts.push(format!("the surface is open: {edges} edge(s) have a triangle on one side only{at}"));
    } else {
        doubts.extend(of_pinches("the surface", &facts));
        doubts.extend(of_sides(mesh));
    }
    let flat = (0..mesh.triangles.len()).filter(|&t| mesh.area_vector(t).norm() == 0.0);
    if let (count @ 1.., Some(first)) = (flat.clone().count(), flat.clone().next()) {
        doubts.push(format!("{count} triangle(s) have no area, the first is triangle {first}"));
    }
    let crossing = meeting::of_surface(mesh);
    doubts.extend(crossing.doubts);
    let (counts, bounds) = ([mesh.triangles.len(), mesh.vertices.len()], bounds(&mesh.vertices));
    let inside = volume.map_or_else(String::new, |v| format!(", {v:.2} mm3"));
    let words = vec![
        format!("{} triangles, {} vertices, {}, {area:.2} mm2{inside}", counts[0], counts[1], facts.words()),
        box_words(bounds),
    ];
    let json = json!({ "elements": counts[0], "vertices": counts[1], "outer": facts.json(), "area_mm2": area, "volume_mm3": volume, "bounds_mm": bounds });
    Found { json: merged(json, crossing.json), words, doubts }
}

/// Pieces of a closed surface that are inside out; one with its inside out within another one is a cavity.
fn of_sides(mesh: &TriangleMesh) -> Option<String> {
    let pieces = pieces(mesh);
    let volumes: Vec<(f64, [[f64; 3]; 2])> = pieces.iter().map(|p| (p.signed_volume(), bounds(&p.vertices))).collect();
    let within = |[low, high]: [[f64; 3]; 2], [l, h]: [[f64; 3]; 2]| (0..3).all(|a| l[a] <= low[a] && high[a] <= h[a]);
    let is_cavity = |of| volumes.iter().any(|&(v, around)| v > 0.0 && within(of, around));
    let wrong: Vec<f64> = volumes.iter().filter(|(v, b)| *v < 0.0 && !is_cavity(*b)).map(|p| p.0).collect();
    (!wrong.is_empty()).then(|| {
        let (n, all) = (wrong.len(), pieces.len());
        format!(
            "{n} of {all} piece(s) are inside out (volume {:.2} mm3): turn their triangles",
            wrong.iter().sum::<f64>()
        )
    })
}

/// The connected pieces, each with its own vertices.
fn pieces(mesh: &TriangleMesh) -> Vec<TriangleMesh> {
    let (of, count) = mesh.components();
    let mut out = vec![TriangleMesh::default(); count];
    // A vertex belongs to one piece.
    let mut number = vec![u32::MAX; mesh.vertices.len()];
    for (triangle, &piece) in mesh.triangles.iter().zip(&of) {
        let piece = &mut out[piece as usize];
        let corners = triangle.map(|v| {
            let number = &mut number[v as usize];
            if *number == u32::MAX {
                *number = piece.vertices.len() as u32;
                piece.vertices.push(mesh.vertices[v as usize]);
            }
            *number
        });
        piece.triangles.push(corners);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Point;

    fn cube(low: f64, edge: f64) -> TriangleMesh {
        let corner = |i: u32| [0, 1, 2].map(|a| low + if i >> a & 1 == 1 { edge } else { 0.0 });
        let triangles = vec![
            [0, 2, 1],
            [1, 2, 3],
            [4, 5, 6],
            [5, 7, 6],
            [0, 1, 4],
            [1, 5, 4],
            [2, 6, 3],
            [3, 6, 7],
            [0, 4, 2],
            [2, 4, 6],
            [1, 3, 5],
            [3, 7, 5],
        ];
        TriangleMesh { vertices: (0..8).map(|i| Point::from_array(corner(i))).collect(), triangles }
    }

    fn turned(mut mesh: TriangleMesh) -> TriangleMesh {
        mesh.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        mesh
    }

    #[test]
    fn a_surface_inside_out_is_told_and_a_cavity_is_not() {
        assert!(of_surface(&cube(0.0, 2.0)).doubts.is_empty());
        let inward = of_surface(&turned(cube(0.0, 2.0)));
        assert!(inward.doubts[0].contains("inside out (volume -8.00 mm3)"), "{:?}", inward.doubts);
        let mut hollow = cube(0.0, 4.0);
        hollow.append(&turned(cube(1.0, 1.0)));
        assert!(of_surface(&hollow).doubts.is_empty(), "{:?}", of_surface(&hollow).doubts);
        let mut beside = cube(0.0, 4.0);
        beside.append(&turned(cube(9.0, 1.0)));
        assert!(of_surface(&beside).doubts[0].contains("1 of 2"), "{:?}", of_surface(&beside).doubts);
    }

    #[test]
    fn an_open_surface_is_told_with_a_place_and_has_no_volume() {
        let mut open = cube(0.0, 2.0);
        open.triangles.pop();
        let found = of_surface(&open);
        assert!(found.doubts[0].contains("3 edge(s)") && found.json["volume_mm3"].is_null(), "{:?}", found.doubts);
        assert_eq!((&found.json["outer"]["closed"], &found.json["elements"]), (&false.into(), &11.into()));
    }
}
