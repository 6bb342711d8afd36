//! Writing.

use super::{TETRAHEDRON, TRIANGLE};
use core::fmt::Write as _;
use monro_geometry::{Point, TetMesh, bounds};
use std::collections::BTreeMap;

/// What lies on the two sides of an interface; `None` is the outside.
type Pair = (u16, Option<u16>);

/// Encodes a labelled mesh as MSH 4.1 binary, with its interfaces as triangles.
pub fn encode(mesh: &TetMesh) -> Vec<u8> {
    let interfaces = interfaces(mesh);
    let labels: Vec<u16> = mesh.label_counts().into_iter().map(|(label, _)| label).collect();
    let mut out = b"$MeshFormat\n4.1 1 8\n".to_vec();
    out.extend_from_slice(&1i32.to_le_bytes());
    out.extend_from_slice(b"\n$EndMeshFormat\n");
    out.extend_from_slice(names(&labels, &interfaces).as_bytes());
    let bounds = bounds(mesh.vertices.iter().map(|p| p.to_array())).unwrap_or_default();
    section(&mut out, "Entities", |out| entities(out, &labels, &interfaces, bounds));
    section(&mut out, "Nodes", |out| nodes(out, mesh, &labels));
    section(&mut out, "Elements", |out| elements(out, mesh, &labels, &interfaces));
    out
}

fn section(out: &mut Vec<u8>, name: &str, body: impl FnOnce(&mut Vec<u8>)) {
    out.extend_from_slice(format!("${name}\n").as_bytes());
    body(out);
    out.extend_from_slice(format!("\n$End{name}\n").as_bytes());
}

/// The triangles of each interface, seen from outside of its lower label.
fn interfaces(mesh: &TetMesh) -> BTreeMap<Pair, Vec<[u32; 3]>> {
    let mut out: BTreeMap<Pair, Vec<[u32; 3]>> = BTreeMap::new();
    for wall in mesh.walls().into_iter().filter(|wall| wall.behind != Some(wall.label)) {
        out.entry((wall.label, wall.behind)).or_default().push(wall.corners);
    }
    out
}

/// Physical groups: a volume's is its label, a surface's its number from 1.
fn names(labels: &[u16], interfaces: &BTreeMap<Pair, Vec<[u32; 3]>>) -> String {
    let mut out = format!("$PhysicalNames\n{}\n", labels.len() + interfaces.len());
    // Writing to a String cannot fail.
    for (i, (label, behind)) in interfaces.keys().enumerate() {
        let behind = behind.map_or("outside".into(), |b| format!("label_{b}"));
        let _ = writeln!(out, "2 {} \"label_{label}-{behind}\"", i + 1);
    }
    for label in labels {
        let _ = writeln!(out, "3 {label} \"label_{label}\"");
    }
    out + "$EndPhysicalNames\n"
}

/// Tags of entities begin at 1: Gmsh takes 0 for "none".
const fn volume_tag(at: usize) -> i32 {
    at as i32 + 1
}

fn entities(out: &mut Vec<u8>, labels: &[u16], interfaces: &BTreeMap<Pair, Vec<[u32; 3]>>, bounds: [[f64; 3]; 2]) {
    sizes(out, &[0, 0, interfaces.len(), labels.len()]);
    let entity = |out: &mut Vec<u8>, tag: i32, group: i32, boundary: &[i32]| {
        ints(out, &[tag]);
        doubles(out, bounds.as_flattened());
        sizes(out, &[1]);
        ints(out, &[group]);
        sizes(out, &[boundary.len()]);
        ints(out, boundary);
    };
    for i in 0..interfaces.len() {
        entity(out, i as i32 + 1, i as i32 + 1, &[]);
    }
    for (at, &label) in labels.iter().enumerate() {
        let mut boundary = Vec::new();
        for (i, &(one, two)) in interfaces.keys().enumerate() {
            // A negative tag is a surface seen from its other side.
            match () {
                () if one == label => boundary.push(i as i32 + 1),
                () if two == Some(label) => boundary.push(-(i as i32 + 1)),
                () => {}
            }
        }
        entity(out, volume_tag(at), i32::from(label), &boundary);
    }
}

/// All nodes in one block of the first volume.
fn nodes(out: &mut Vec<u8>, mesh: &TetMesh, labels: &[u16]) {
    let n = mesh.vertices.len();
    if labels.is_empty() {
        return sizes(out, &[0, 0, 0, 0]);
    }
    sizes(out, &[1, n, 1, n]);
    ints(out, &[3, volume_tag(0), 0]);
    sizes(out, &[n]);
    (1..=n).for_each(|tag| sizes(out, &[tag]));
    mesh.vertices.iter().for_each(|p: &Point<_>| doubles(out, &p.to_array()));
}

fn elements(out: &mut Vec<u8>, mesh: &TetMesh, labels: &[u16], interfaces: &BTreeMap<Pair, Vec<[u32; 3]>>) {
    let triangles: usize = interfaces.values().map(Vec::len).sum();
    let count = triangles + mesh.tets.len();
    sizes(out, &[interfaces.len() + labels.len(), count, usize::from(count > 0), count]);
    let mut tag = 0;
    let mut element = |out: &mut Vec<u8>, nodes: &[u32]| {
        tag += 1;
        sizes(out, &[tag]);
        nodes.iter().for_each(|&v| sizes(out, &[v as usize + 1]));
    };
    for (i, faces) in interfaces.values().enumerate() {
        ints(out, &[2, i as i32 + 1, TRIANGLE]);
        sizes(out, &[faces.len()]);
        faces.iter().for_each(|f| element(out, f));
    }
    for (at, &label) in labels.iter().enumerate() {
        let of_label = || mesh.tets.iter().zip(&mesh.labels).filter(|(_, l)| **l == label);
        ints(out, &[3, volume_tag(at), TETRAHEDRON]);
        sizes(out, &[of_label().count()]);
        of_label().for_each(|(t, _)| element(out, t));
    }
}

fn ints(out: &mut Vec<u8>, values: &[i32]) {
    values.iter().for_each(|v| out.extend_from_slice(&v.to_le_bytes()));
}

fn sizes(out: &mut Vec<u8>, values: &[usize]) {
    values.iter().for_each(|&v| out.extend_from_slice(&(v as u64).to_le_bytes()));
}

fn doubles(out: &mut Vec<u8>, values: &[f64]) {
    values.iter().for_each(|v| out.extend_from_slice(&v.to_le_bytes()));
}
