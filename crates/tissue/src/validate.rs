//! What makes a mesh or a set of options unusable, found before anything is computed from it.

use crate::ModelError;
use crate::abutments::MOST;
use crate::options::{Attachment, AttachmentKind, Mode, ModelOptions};
use crate::physical::elastic::volume_gradient;
use crate::vec3::xyz;
use monro_geometry::{TET_EDGES, TetMesh};

/// An element thinner than this share of its longest edge cubed is flat.
const FLAT: f64 = 1e-7;

pub(crate) fn mesh(mesh: &TetMesh) -> Result<(), ModelError> {
    mesh.validate()?;
    if mesh.tets.is_empty() {
        return Err(ModelError::Empty);
    }
    for tet in 0..mesh.tets.len() {
        if mesh.volume(tet) < FLAT * longest_edge(mesh, tet).powi(3) {
            return Err(flat(mesh, tet));
        }
    }
    mesh.check_conforming()?;
    duplicate_vertices(mesh)
}

fn longest_edge(mesh: &TetMesh, tet: usize) -> f64 {
    let p = mesh.corners(tet);
    TET_EDGES.iter().map(|&[a, b]| p[a].distance(p[b])).fold(0.0, f64::max)
}

fn flat(mesh: &TetMesh, tet: usize) -> ModelError {
    ModelError::Flat { tet, volume_mm3: mesh.volume(tet), edge_mm: longest_edge(mesh, tet) }
}

/// Refuses elements that single precision leaves no volume, far from the middle of the mesh: `tets` and `rest` are the model's, whose
/// elements stand in `order`.
pub(crate) fn rounded(
    mesh: &TetMesh,
    (tets, order): (&[[u32; 4]], &[u32]),
    rest: &[[f32; 4]],
) -> Result<(), ModelError> {
    let at = |v: u32| xyz(rest[v as usize]).map(f64::from);
    let volume = |tet: &[u32; 4]| volume_gradient(tet.map(at)).0;
    let lost = tets.iter().zip(order).find(|(tet, _)| volume(tet) <= 0.0);
    lost.map_or(Ok(()), |(_, &tet)| Err(flat(mesh, tet as usize)))
}

fn duplicate_vertices(mesh: &TetMesh) -> Result<(), ModelError> {
    // Adding zero makes one zero out of the two.
    let mut keys: Vec<([u64; 3], usize)> =
        mesh.vertices.iter().map(|p| p.to_array().map(|v| (v + 0.0).to_bits())).zip(0..).collect();
    keys.sort_unstable();
    match keys.windows(2).find(|w| w[0].0 == w[1].0) {
        Some(w) => Err(ModelError::DuplicateVertex { first: w[0].1, second: w[1].1 }),
        None => Ok(()),
    }
}

pub(crate) fn options(mesh: &TetMesh, options: &ModelOptions) -> Result<(), ModelError> {
    for (&label, m) in &options.materials {
        m.check().map_err(|fault| ModelError::Material { label, fault })?;
    }
    share("number of materials", options.materials.len() as f64, 0.0, 255.0, "at most 255")?;
    if let Some(tet) = mesh.labels.iter().position(|l| !options.materials.contains_key(l)) {
        let label = mesh.labels[tet];
        let tets = mesh.labels.iter().filter(|&&l| l == label).count();
        return Err(ModelError::NoMaterial { label, tets, tet });
    }
    for (attachment, a) in options.attachments.iter().enumerate() {
        if a.node as usize >= mesh.vertices.len() {
            return Err(ModelError::Attachment { attachment, node: a.node, vertices: mesh.vertices.len() });
        }
        if let AttachmentKind::Spring { stiffness_mn_per_mm } = a.kind {
            share("stiffness of an attachment", stiffness_mn_per_mm, 0.0, 1e9, "0 to 1e9 mN/mm")?;
        }
        if let AttachmentKind::Abutting { outward, drag_per_s } = a.kind {
            let length = outward.iter().map(|v| v * v).sum::<f64>().sqrt();
            share("length of an attachment's normal", length, 1e-6, 1e6, "1e-6 to 1e6")?;
            share("drag of an attachment", drag_per_s, 0.0, 1e6, "0 to 1e6 per second")?;
        }
        if matches!((a.kind, options.mode), (AttachmentKind::Guided { .. }, Mode::Physical(_))) {
            return Err(ModelError::Guided { attachment });
        }
    }
    few_planes(options)?;
    match options.mode {
        Mode::Paper(p) => {
            share("coefficient of the global volume", p.global_volume, 0.0, 1.0, "0 to 1")?;
            share("damping", p.damping, 0.0, 1.0, "0 to 1")
        }
        Mode::Physical(p) => share("nodal share of the shear energy", p.nodal_shear, 0.0, 0.5, "0 to 0.5"),
    }
}

fn few_planes(options: &ModelOptions) -> Result<(), ModelError> {
    let abuts = |a: &&Attachment| matches!(a.kind, AttachmentKind::Abutting { .. });
    let mut nodes: Vec<u32> = options.attachments.iter().filter(abuts).map(|a| a.node).collect();
    nodes.sort_unstable();
    let crowded = nodes.chunk_by(|a, b| a == b).find(|same| same.len() > MOST);
    crowded.map_or(Ok(()), |c| Err(ModelError::Planes { node: c[0], planes: c.len(), most: MOST }))
}

fn share(name: &'static str, value: f64, low: f64, high: f64, wanted: &'static str) -> Result<(), ModelError> {
    if (low..=high).contains(&value) { Ok(()) } else { Err(ModelError::Option { name, value, wanted }) }
}
