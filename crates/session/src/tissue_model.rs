//! What a case's regions are made of, and where the brain is held.

use monro_geometry::{Bvh, Patient, Point, Structure, TetMesh, TriangleMesh};
use monro_guidance::Plan;
use monro_tissue::{Attachment, AttachmentKind, CollisionResponse, Material, Mode, ModelOptions, ThinMembrane};
use std::collections::BTreeMap;

/// Radius of the opening in skull and dura around the path, mm: a twist-drill or small burr hole (5 to 14 mm across).
/// Inside it the surface of the brain is free.
pub const BURR_HOLE_RADIUS_MM: f64 = 6.0;

/// How the regions of a case become a soft body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModelSettings {
    /// Which mechanics.
    pub mode: Mode,
    /// What happens where the catheter meets the tissue.
    pub collision: CollisionResponse,
    /// What it is made of.
    pub materials: Materials,
}

impl ModelSettings {
    /// A mode with tissue that is punctured and cut, and the default materials.
    pub const fn of(mode: Mode) -> Self {
        Self { mode, collision: CollisionResponse::Insertion, materials: Materials::HEAD }
    }
}

/// Materials of the regions of a case.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Materials {
    /// Brain, with the thin fluid around it.
    pub brain: Material,
    /// All ventricles.
    pub ventricles: Material,
}

impl Materials {
    /// A head: the brain is wrapped in pia, which matters only in the burr hole, since the rest of its surface is held.
    pub const HEAD: Self = Self {
        brain: Material { membrane: Some(ThinMembrane::PIA), ..Material::BRAIN },
        ventricles: Material::VENTRICLE,
    };
}

/// Options of the soft body for a case: brain tissue, fluid ventricles, the skull side held except in the burr hole.
pub(crate) fn options(tets: &TetMesh, opening: Point<Patient>, settings: &ModelSettings) -> ModelOptions {
    let label = |s: Structure| u16::from(s.label());
    let mut materials = BTreeMap::from([(label(Structure::Brain), settings.materials.brain)]);
    for s in Structure::ALL.into_iter().filter(|s| s.is_ventricle()) {
        materials.insert(label(s), settings.materials.ventricles);
    }
    ModelOptions {
        mode: settings.mode,
        materials,
        attachments: attachments(tets, opening),
        collision: settings.collision,
    }
}

fn attachments(tets: &TetMesh, opening: Point<Patient>) -> Vec<Attachment> {
    let mut nodes: Vec<u32> = tets.boundary(|_| true).into_iter().flatten().collect();
    nodes.sort_unstable();
    nodes.dedup();
    nodes.retain(|&n| tets.vertices[n as usize].distance(opening) > BURR_HOLE_RADIUS_MM);
    nodes.into_iter().map(|node| Attachment { node, kind: AttachmentKind::Fixed }).collect()
}

/// Where the path first meets the surface of the simulated tissue, and how deep that is under the entry, mm.
pub(crate) fn opening(tets: &TetMesh, plan: &Plan) -> Option<(Point<Patient>, f64)> {
    let surface: TriangleMesh = tets.surface(|_| true);
    let hit = Bvh::new(&surface).ray_all(plan.entry(), plan.direction()).into_iter().find(|h| h.entering)?;
    (hit.t < plan.length()).then(|| (plan.at_depth(hit.t), hit.t))
}
