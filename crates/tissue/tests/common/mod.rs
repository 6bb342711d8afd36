//! Meshes and tools that the tests share.

#![allow(dead_code, reason = "each test binary uses its own part")]
#![allow(unreachable_pub, reason = "a module shared by test binaries")]

use monro_geometry::{Patient, Point, TetMesh};
use monro_tissue::{
    Attachment, AttachmentKind, CollisionResponse, Material, Mode, ModelOptions, PaperOptions, PhysicalOptions,
    TipShape, Tool, ToolMotion, ToolPose,
};
use std::collections::BTreeMap;

/// A block of cubes of `size` mm with its lower corner at the origin, each cut into six tetrahedra; `label` gives the
/// label of a cube.
pub fn block(cells: [usize; 3], size: f64, label: impl Fn([usize; 3]) -> u16) -> TetMesh {
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

/// Vertices whose position `keep` accepts.
pub fn nodes(mesh: &TetMesh, keep: impl Fn(Point<Patient>) -> bool) -> Vec<u32> {
    (0..mesh.vertices.len() as u32).filter(|&v| keep(mesh.vertices[v as usize])).collect()
}

/// Brain (label 4) and ventricle (label 5) with some nodes fixed.
pub fn options(mode: Mode, fixed: &[u32]) -> ModelOptions {
    ModelOptions {
        mode,
        materials: BTreeMap::from([(4, Material::BRAIN), (5, Material::VENTRICLE)]),
        attachments: fixed.iter().map(|&node| Attachment { node, kind: AttachmentKind::Fixed }).collect(),
        collision: CollisionResponse::Insertion,
    }
}

/// Paper mode.
pub fn paper() -> Mode {
    Mode::Paper(PaperOptions::default())
}

/// Physical mode.
pub fn physical() -> Mode {
    Mode::Physical(PhysicalOptions::default())
}

/// A 3 mm rod along z whose tip goes from one point to another.
pub fn rod(from: [f64; 3], to: [f64; 3]) -> ToolMotion {
    let pose = |t: [f64; 3]| ToolPose { tip: Point::from_array(t), tail: Point::new(t[0], t[1], t[2] + 120.0) };
    ToolMotion { tool: Tool { tip: TipShape::Round, radius_mm: 1.5 }, from: pose(from), to: pose(to) }
}
