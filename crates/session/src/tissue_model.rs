//! What a case's regions are made of, and where the brain is held.

use crate::{SessionError, septa};
use monro_case::Case;
use monro_geometry::{Bvh, Patient, Point, Structure, TetMesh, TriangleMesh, Vector};
use monro_guidance::Plan;
use monro_tissue::{Attachment, AttachmentKind, CollisionResponse, Material, Mode, ModelOptions, ThinMembrane};
use std::collections::BTreeMap;

/// Radius of the opening in skull and dura around the path, mm: a twist-drill or small burr hole (5 to 14 mm across).
/// Inside it the surface of the brain is free.
pub const BURR_HOLE_RADIUS_MM: f64 = 6.0;

/// The lowest part of the surface, mm in height, that stays held where the skull lets the brain slide: brain stem and cord, or
/// where the scan is cut.
pub const HELD_BASE_MM: f64 = 15.0;

/// Rate at which the film and the fine threads between skull and brain slow a sliding surface down, 1/s: a choice, so that the brain
/// comes to rest within a second. Nobody has measured it, and at rest it bears nothing.
const SKULL_DRAG_PER_S: f64 = 30.0;

/// What the skull does to the surface of the brain outside of the burr hole.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Skull {
    /// It holds it in place: as long as the fluid around the brain is there, which leaves no gap.
    #[default]
    Held,
    /// The brain slides along it and may leave it, as when fluid around it is lost; but for the lowest [`HELD_BASE_MM`], which are
    /// held.
    Slides {
        /// Whether it slides along falx and tentorium, too, where the case has them, and never goes through these.
        septa: bool,
    },
}

impl Skull {
    /// Whether the brain slides along it.
    pub const fn slides(self) -> bool {
        matches!(self, Self::Slides { .. })
    }

    /// Whether falx and tentorium are to part it, where the case has them.
    pub const fn wants_septa(self) -> bool {
        matches!(self, Self::Slides { septa: true })
    }
}

/// How the regions of a case become a soft body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModelSettings {
    /// Which mechanics.
    pub mode: Mode,
    /// What happens where the catheter meets the tissue.
    pub collision: CollisionResponse,
    /// What it is made of.
    pub materials: Materials,
    /// What the skull does to the brain.
    pub skull: Skull,
}

impl ModelSettings {
    /// A mode with tissue that is punctured and cut, and the default materials.
    pub const fn of(mode: Mode) -> Self {
        Self { mode, collision: CollisionResponse::Insertion, materials: Materials::HEAD, skull: Skull::Held }
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
pub(crate) fn options(case: &Case, openings: &[Point<Patient>], settings: &ModelSettings) -> ModelOptions {
    let label = |s: Structure| u16::from(s.label());
    let mut materials = BTreeMap::from([(label(Structure::Brain), settings.materials.brain)]);
    for s in Structure::ALL.into_iter().filter(|s| s.is_ventricle()) {
        materials.insert(label(s), settings.materials.ventricles);
    }
    ModelOptions {
        mode: settings.mode,
        materials,
        attachments: attachments(case, openings, settings.skull),
        collision: settings.collision,
    }
}

/// Holds the surface outside of the burr holes, or lets it slide. Where elements are so large that no vertex lies in one, the nearest is free all
/// the same: held all over, pia cannot dimple, and is punctured as soon as it is touched.
fn attachments(Case { tets, septa, .. }: &Case, openings: &[Point<Patient>], skull: Skull) -> Vec<Attachment> {
    let triangles = tets.boundary(|_| true);
    let mut nodes: Vec<u32> = triangles.iter().flatten().copied().collect();
    nodes.sort_unstable();
    nodes.dedup();
    let away = |n: u32, from: Point<Patient>| tets.vertices[n as usize].distance(from);
    let radius = |hole: Point<Patient>| {
        nodes.iter().map(|&n| away(n, hole)).fold(f64::INFINITY, f64::min).max(BURR_HOLE_RADIUS_MM)
    };
    let holes: Vec<_> = openings.iter().map(|&hole| (hole, radius(hole))).collect();
    nodes.retain(|&n| holes.iter().all(|&(hole, radius)| away(n, hole) > radius));
    if !skull.slides() {
        return nodes.into_iter().map(|node| Attachment { node, kind: AttachmentKind::Fixed }).collect();
    }
    let surface = TriangleMesh { vertices: tets.vertices.clone(), triangles };
    let normals = surface.vertex_normals();
    let height = |n: u32| tets.vertices[n as usize].z;
    let base = nodes.iter().map(|&n| height(n)).fold(f64::INFINITY, f64::min) + HELD_BASE_MM;
    let kind = |node: u32| match normals[node as usize] {
        // Where the surface has no side, nothing can slide along it.
        outward if height(node) <= base || outward == Vector::ZERO => AttachmentKind::Fixed,
        outward => AttachmentKind::Abutting { outward: outward.to_array(), drag_per_s: SKULL_DRAG_PER_S },
    };
    let mut out: Vec<Attachment> = nodes.into_iter().map(|node| Attachment { node, kind: kind(node) }).collect();
    if let Some(septa) = septa.as_ref().filter(|_| skull.wants_septa()) {
        let free = inner_brain(tets, &surface.triangles);
        out.extend(septa::walls(tets, septa, |v| free[v as usize], SKULL_DRAG_PER_S));
    }
    out
}

/// Whether a vertex lies in brain with nothing else around it, nor on the surface.
fn inner_brain(tets: &TetMesh, surface: &[[u32; 3]]) -> Vec<bool> {
    let mut out = vec![true; tets.vertices.len()];
    let others = tets.tets.iter().zip(&tets.labels).filter(|(_, l)| **l != u16::from(Structure::Brain.label()));
    let beside = others.flat_map(|(t, _)| *t);
    surface.iter().flatten().copied().chain(beside).for_each(|v| out[v as usize] = false);
    out
}

/// Where the path first meets the surface of the simulated tissue, and how deep that is under the entry, mm.
///
/// # Errors
/// A path that begins in the tissue, or never meets it.
pub(crate) fn opening(tets: &TetMesh, plan: &Plan) -> Result<(Point<Patient>, f64), SessionError> {
    let surface: TriangleMesh = tets.surface(|_| true);
    let tree = Bvh::new(&surface);
    let hits = tree.ray_all(plan.entry(), plan.direction());
    if hits.first().is_some_and(|h| !h.entering) {
        let back = tree.ray_all(plan.entry(), -plan.direction());
        return Err(SessionError::EntryInside { deep_mm: back.first().map_or(0.0, |h| h.t) });
    }
    let hit = hits.into_iter().find(|h| h.entering && h.t < plan.length());
    hit.map(|h| (plan.at_depth(h.t), h.t)).ok_or(SessionError::PathMisses { length_mm: plan.length() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::deformation::tests::case;
    use monro_guidance::Side;

    #[test]
    fn a_burr_hole_between_the_vertices_of_a_coarse_mesh_had_none_that_was_free() {
        let case = case();
        let tets = &case.tets;
        let held = |opening| attachments(&case, &[opening], Skull::Held).len();
        let mut surface: Vec<u32> = tets.boundary(|_| true).into_iter().flatten().collect();
        surface.sort_unstable();
        surface.dedup();
        // In the middle of four vertices 10 mm apart; on one of them.
        for (opening, free) in [(Point::new(35.0, 35.0, 60.0), 4), (Point::new(30.0, 30.0, 60.0), 1)] {
            assert_eq!(surface.len() - held(opening), free, "{opening:?}");
        }
    }

    #[test]
    fn a_brain_that_slides_is_held_at_its_base_and_lies_against_the_skull_elsewhere() {
        let case = case();
        let tets = &case.tets;
        let slides = Skull::Slides { septa: true };
        let all = attachments(&case, &[Point::new(30.0, 30.0, 60.0)], slides);
        assert_eq!(all.len(), attachments(&case, &[Point::new(30.0, 30.0, 60.0)], Skull::Held).len());
        for a in all {
            let (p, middle) = (tets.vertices[a.node as usize], Point::new(30.0, 30.0, 30.0));
            match a.kind {
                AttachmentKind::Fixed => assert!(p.z <= HELD_BASE_MM, "{p:?}"),
                AttachmentKind::Abutting { outward, .. } => {
                    assert!(
                        p.z > HELD_BASE_MM && (p - middle).dot(Vector::from_array(outward)) > 0.0,
                        "{p:?} {outward:?}"
                    );
                }
                other => panic!("{other:?}"),
            }
        }
    }

    #[test]
    fn an_entry_in_the_brain_was_said_not_to_meet_it() {
        let case = case();
        let from = |z: f64| {
            let plan = Plan::new(Side::Right, Point::new(31.0, 29.0, z), case.plan.target()).expect("plan");
            opening(&case.tets, &plan)
        };
        assert!(from(80.0).is_ok_and(|(_, deep)| (deep - 20.0).abs() < 1e-9));
        let inside = from(55.0).expect_err("inside");
        assert!(matches!(inside, SessionError::EntryInside { deep_mm } if (deep_mm - 5.0).abs() < 1e-9), "{inside}");
        assert!(inside.to_string().contains("5.0 mm"), "{inside}");
    }
}
