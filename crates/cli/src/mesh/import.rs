//! Meshes from elsewhere: checked, told about, converted.

use super::facts::{SurfaceFacts, bounds, label_facts, place, shapes_json, shapes_words};
use super::{meeting, merged};
use crate::args::MeshArgs;
use crate::console::{Console, seconds_json};
use crate::mesh_file::{AnyMesh, Encoded, Format, Read};
use crate::output_file;
use anyhow::{Result, bail};
use monro_anatomy::shapes::ShapeSummary;
use monro_anatomy::tetra::{LARGEST_DIHEDRAL, LEAST_DIHEDRAL, LEAST_RADIUS_RATIO};
use monro_geometry::{Bvh, TetLocator, TetMesh, TriangleMesh};
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
    console.stage("write", || output_file::write(&args.out, &bytes))?;
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
    Some(TetLocator::new(mesh).ok()?.overlap()?.to_string())
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

/// Pieces of a closed surface that are inside out, and those in others that face outwards as these do: one with its inside
/// out within another one is a cavity.
fn of_sides(mesh: &TriangleMesh) -> Vec<String> {
    let pieces = pieces(mesh);
    let volumes: Vec<f64> = pieces.iter().map(TriangleMesh::signed_volume).collect();
    let deep = is_within_others(&pieces);
    let of = |wrong: &dyn Fn(usize) -> bool| {
        let wrong: Vec<f64> = (0..pieces.len()).filter(|&p| wrong(p)).map(|p| volumes[p]).collect();
        (wrong.len(), wrong.iter().sum::<f64>())
    };
    let (all, mut out) = (pieces.len(), Vec::new());
    if let (n @ 1.., volume) = of(&|p| volumes[p] < 0.0 && !deep[p]) {
        out.push(format!("{n} of {all} piece(s) are inside out (volume {volume:.2} mm3): turn their triangles"));
    }
    if let (n @ 1.., volume) = of(&|p| volumes[p] > 0.0 && deep[p]) {
        out.push(format!("{n} of {all} piece(s) lie in others ({volume:.2} mm3), which counts twice: turn their triangles if they are cavities"));
    }
    out
}

/// Whether each piece lies in an odd number of others.
fn is_within_others(pieces: &[TriangleMesh]) -> Vec<bool> {
    let boxes: Vec<[[f64; 3]; 2]> = pieces.iter().map(|p| bounds(&p.vertices)).collect();
    let within = |[low, high]: [[f64; 3]; 2], [l, h]: [[f64; 3]; 2]| (0..3).all(|a| l[a] <= low[a] && high[a] <= h[a]);
    let mut odd = vec![false; pieces.len()];
    for (around, piece) in pieces.iter().enumerate() {
        let inner = |p: &usize| *p != around && within(boxes[*p], boxes[around]);
        let candidates: Vec<usize> = (0..pieces.len()).filter(inner).collect();
        if candidates.is_empty() {
            continue;
        }
        let surface = Bvh::new(piece);
        candidates.into_iter().filter(|&p| surface.contains(pieces[p].vertices[0])).for_each(|p| odd[p] ^= true);
    }
    odd
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

    /// A ring around a square hole of 6 mm, 10 mm wide and high.
    fn frame() -> TriangleMesh {
        let square =
            |half: f64| [[-half, -half], [half, -half], [half, half], [-half, half]].map(|c| c.map(|x| x + 5.0));
        let ring = |half, z: f64| square(half).map(|[x, y]| Point::new(x, y, z));
        // Below outside, below inside, above outside, above inside.
        let vertices = [ring(5.0, 0.0), ring(3.0, 0.0), ring(5.0, 10.0), ring(3.0, 10.0)].concat();
        let quads = (0..4u32).flat_map(|i| {
            let j = (i + 1) % 4;
            [[i, j, 8 + j, 8 + i], [4 + j, 4 + i, 12 + i, 12 + j], [8 + i, 8 + j, 12 + j, 12 + i], [j, i, 4 + i, 4 + j]]
        });
        let triangles = quads.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        TriangleMesh { vertices, triangles }
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
        let mut twice = cube(0.0, 4.0);
        twice.append(&cube(1.0, 1.0));
        assert!(of_surface(&twice).doubts[0].contains("1 of 2 piece(s) lie in others (1.00 mm3)"));
        let mut island = cube(0.0, 10.0);
        island.append(&turned(cube(1.0, 8.0)));
        island.append(&cube(2.0, 3.0));
        assert!(of_surface(&island).doubts.is_empty(), "{:?}", of_surface(&island).doubts);
        // In the box of a frame of four bars, but beside them.
        let mut framed = frame();
        framed.append(&turned(cube(4.0, 1.0)));
        assert!(
            of_surface(&framed).doubts[0].contains("1 of 2 piece(s) are inside out"),
            "{:?}",
            of_surface(&framed).doubts
        );
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
