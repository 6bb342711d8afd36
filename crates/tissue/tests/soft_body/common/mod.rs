//! Meshes and tools that the tests share.

use monro_geometry::{Patient, Point, TetMesh, Vector};
use monro_tissue::{
    Attachment, AttachmentKind, CollisionResponse, Material, Mode, ModelOptions, PaperOptions, PhysicalOptions,
    TipShape, Tool, ToolMotion, ToolPose,
};
use std::collections::BTreeMap;

/// A block of cubes of `size` mm with its lower corner at the origin, each cut into six tetrahedra; `label` gives the
/// label of a cube.
pub(crate) fn block(cells: [usize; 3], size: f64, label: impl Fn([usize; 3]) -> u16) -> TetMesh {
    let n = cells.map(|c| c + 1);
    let at = |c: [usize; 3]| (c[0] + n[0] * (c[1] + n[1] * c[2])) as u32;
    let mut mesh = TetMesh::default();
    for i in 0..n[0] * n[1] * n[2] {
        let c = [i % n[0], i / n[0] % n[1], i / n[0] / n[1]].map(|v| v as f64 * size);
        mesh.vertices.push(Point::from_array(c));
    }
    const PATHS: [([usize; 3], bool); 6] = [
        ([0, 1, 2], false),
        ([1, 2, 0], false),
        ([2, 0, 1], false),
        ([0, 2, 1], true),
        ([2, 1, 0], true),
        ([1, 0, 2], true),
    ];
    for i in 0..cells[0] * cells[1] * cells[2] {
        let cube = [i % cells[0], i / cells[0] % cells[1], i / cells[0] / cells[1]];
        for (path, mirrored) in PATHS {
            let mut c = cube;
            let mut tet = [at(c); 4];
            for (corner, axis) in tet[1..].iter_mut().zip(path) {
                c[axis] += 1;
                *corner = at(c);
            }
            if mirrored {
                tet.swap(1, 2);
            }
            mesh.tets.push(tet);
            mesh.labels.push(label(cube));
        }
    }
    mesh
}

/// A cube of brain (label 4), `edge` mm long and in so many cells along it, with a horn of a ventricle (label 5) along y in
/// its middle, of that radius and height in mm; corners within are displaced by the share `skew` of a cell. With the vertices
/// of its sides and bottom.
pub(crate) fn cube_with_horn(
    edge: f64,
    (cells, skew): (usize, f64),
    [radius, height]: [f64; 2],
) -> (TetMesh, Vec<u32>) {
    let size = edge / cells as f64;
    let mut mesh = block([cells; 3], size, |c| {
        let [x, z] = [c[0], c[2]].map(|c| (c as f64 + 0.5) * size);
        if (x - 0.5 * edge).hypot(z - height) < radius { 5 } else { 4 }
    });
    let is_end = |v: f64| [0.0, edge].contains(&v);
    for (i, p) in mesh.vertices.iter_mut().enumerate().filter(|(_, p)| ![p.x, p.y, p.z].into_iter().any(is_end)) {
        *p += Vector::from_array([12.9, 78.2, 37.7].map(|w: f64| skew * size * (w * i as f64).sin()));
    }
    let held = nodes(&mesh, |p| is_end(p.x) || is_end(p.y) || p.z == 0.0);
    (mesh, held)
}

/// Vertices whose position `keep` accepts.
pub(crate) fn nodes(mesh: &TetMesh, keep: impl Fn(Point<Patient>) -> bool) -> Vec<u32> {
    (0..mesh.vertices.len() as u32).filter(|&v| keep(mesh.vertices[v as usize])).collect()
}

/// Brain (label 4) and ventricle (label 5) with some nodes fixed.
pub(crate) fn options(mode: Mode, fixed: &[u32]) -> ModelOptions {
    ModelOptions {
        mode,
        materials: BTreeMap::from([(4, Material::BRAIN), (5, Material::VENTRICLE)]),
        attachments: fixed.iter().map(|&node| Attachment { node, kind: AttachmentKind::Fixed }).collect(),
        collision: CollisionResponse::Insertion,
    }
}

/// The same in physical mode with nothing fixed, and a brain of this Poisson's ratio.
pub(crate) fn material(poisson: f64) -> ModelOptions {
    let mut o = options(physical(), &[]);
    o.materials.insert(4, Material { poisson, ..Material::BRAIN });
    o
}

/// Paper mode.
pub(crate) fn paper() -> Mode {
    Mode::Paper(PaperOptions::default())
}

/// Physical mode.
pub(crate) fn physical() -> Mode {
    Mode::Physical(PhysicalOptions::default())
}

/// A 3 mm rod along z whose tip goes from one point to another.
pub(crate) fn rod(from: [f64; 3], to: [f64; 3]) -> ToolMotion {
    let pose = |t: [f64; 3]| ToolPose { tip: Point::from_array(t), tail: Point::new(t[0], t[1], t[2] + 120.0) };
    ToolMotion { tool: Tool { tip: TipShape::Round, radius_mm: 1.5 }, from: pose(from), to: pose(to) }
}
