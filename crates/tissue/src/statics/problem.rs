//! What is imposed on a body, and when it is refused.

use super::{Moment, refine};
use crate::{Attachment, AttachmentKind, ModelError};
use monro_geometry::{Patient, Point, TetMesh, Vector};
use std::collections::{BTreeMap, BTreeSet};
use thiserror::Error;

/// Supports and loads.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StaticProblem {
    /// Vertices with a prescribed displacement (mm) in some components; a component that is `None` is free.
    pub supports: Vec<Support>,
    /// Dead force per volume at rest, mN/mm3 (1 N/m3 is 1e-6 mN/mm3).
    pub body_force_mn_mm3: [f64; 3],
    /// Pressures on parts of the outer surface.
    pub pressures: Vec<Pressure>,
    /// Rigid spheres that press on the outer surface.
    pub contacts: Vec<SphereContact>,
    /// Rods stuck to the tissue around them.
    pub rods: Vec<EmbeddedRod>,
}

impl StaticProblem {
    /// Whether a sphere has friction: then the answer depends on its way.
    pub fn rubs(&self) -> bool {
        self.contacts.iter().any(|c| c.friction > 0.0)
    }

    /// Whether supports, loads or rods move the tissue, whatever spheres do.
    pub fn moves_by_itself(&self) -> bool {
        let supports = self.supports.iter().flat_map(|s| s.displacement_mm).flatten();
        let loads = self.pressures.iter().map(|p| p.kpa).chain(self.body_force_mn_mm3);
        let rods = self.rods.iter().flat_map(|r| r.displacement_mm.to_array());
        supports.chain(loads).chain(rods).any(|v| v != 0.0)
    }

    /// Sum of the forces on the vertices that each set holds, in the components that it holds there. What several hold counts
    /// in each.
    pub(super) fn of_sets(&self, force: &[Vector<Patient>]) -> BTreeMap<u32, Vector<Patient>> {
        sums(&self.held(), force, |_, _| 1.0)
    }

    /// Moments of the same forces on vertices that are at `x` (mm from an origin) in the end.
    pub(super) fn moments(
        &self,
        force: &[Vector<Patient>],
        (x, origin): (&[[f64; 3]], Point<Patient>),
    ) -> BTreeMap<u32, Moment> {
        let mut of = BTreeMap::<u32, BTreeMap<u32, [f64; 3]>>::new();
        for (set, node, a) in self.held() {
            of.entry(set).or_default().entry(node).or_default()[a] = force[node as usize].to_array()[a];
        }
        let moment = |acts: BTreeMap<u32, [f64; 3]>| {
            Moment::of(&acts.into_iter().map(|(n, f)| (x[n as usize], f)).collect::<Vec<_>>(), origin)
        };
        of.into_iter().filter_map(|(set, acts)| Some((set, moment(acts)?))).collect()
    }

    /// The sums with what several hold shared out evenly: a row of vertices between two sets is as wide as the mesh is coarse.
    pub(super) fn shared_out(&self, force: &[Vector<Patient>]) -> BTreeMap<u32, Vector<Patient>> {
        let held = self.held();
        let mut sets = vec![[0.0; 3]; force.len()];
        held.iter().for_each(|&(_, node, a)| sets[node as usize][a] += 1.0);
        sums(&held, force, |node, a| 1.0 / sets[node][a])
    }

    /// The moments of sets that hold nothing that another one holds: of the others a part depends on how wide the mesh is.
    pub(super) fn moments_alone(
        &self,
        force: &[Vector<Patient>],
        places: (&[[f64; 3]], Point<Patient>),
    ) -> BTreeMap<u32, Moment> {
        let mut holds = BTreeMap::<(u32, usize), Vec<u32>>::new();
        self.held().iter().for_each(|&(set, node, a)| holds.entry((node, a)).or_default().push(set));
        let shared: BTreeSet<u32> = holds.into_values().filter(|sets| sets.len() > 1).flatten().collect();
        let mut moments = self.moments(force, places);
        moments.retain(|set, _| !shared.contains(set));
        moments
    }

    /// Which set holds which vertex in which component; a set may name one twice.
    fn held(&self) -> BTreeSet<(u32, u32, usize)> {
        let of = |s: &Support| {
            let (set, node, axes) = (s.set, s.node, s.displacement_mm.map(|d| d.is_some()));
            (0..3).filter(move |&a| axes[a]).map(move |a| (set, node, a))
        };
        self.supports.iter().flat_map(of).collect()
    }
}

fn sums(
    held: &BTreeSet<(u32, u32, usize)>,
    force: &[Vector<Patient>],
    share: impl Fn(usize, usize) -> f64,
) -> BTreeMap<u32, Vector<Patient>> {
    let mut sums = BTreeMap::<u32, [f64; 3]>::new();
    for &(set, node, a) in held {
        sums.entry(set).or_default()[a] += share(node as usize, a) * force[node as usize].to_array()[a];
    }
    sums.into_iter().map(|(set, sum)| (set, Vector::from_array(sum))).collect()
}

/// A rigid sphere that moves along a straight line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SphereContact {
    /// Radius, mm.
    pub radius_mm: f64,
    /// Coulomb's coefficient; 0 for none.
    pub friction: f64,
    /// Its centre at first, outside of the tissue.
    pub from: Point<Patient>,
    /// Its centre in the end.
    pub to: Point<Patient>,
}

/// A rigid rod with rounded ends inside the tissue, without slip: tissue no further from its axis than the radius moves
/// with it. What a support holds stays with the support.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EmbeddedRod {
    /// Radius, mm.
    pub radius_mm: f64,
    /// Ends of its axis.
    pub ends: [Point<Patient>; 2],
    /// Its motion, mm.
    pub displacement_mm: Vector<Patient>,
}

/// A prescribed displacement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Support {
    /// Vertex of the mesh.
    pub node: u32,
    /// Which set it belongs to: new vertices of a refined mesh are held between vertices of one set, and where two sets
    /// adjoin on one smooth side of the body.
    pub set: u32,
    /// Displacement of each component, mm; `None` leaves it free.
    pub displacement_mm: [Option<f64>; 3],
}

/// A pressure that follows the surface and pushes it into the tissue.
#[derive(Debug, Clone, PartialEq)]
pub struct Pressure {
    /// Faces of the outer surface, in any orientation.
    pub faces: Vec<[u32; 3]>,
    /// Pressure, kPa.
    pub kpa: f64,
}

/// Why a problem was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum StaticError {
    /// Only physical mode has an energy.
    #[error("equilibrium needs a model in physical mode")]
    NotPhysical,
    /// Attachments are springs.
    #[error(
        "{springs} attachment(s) are springs, which the equilibrium does not know; hold their vertices by supports, or take them away"
    )]
    Springs {
        /// How many.
        springs: usize,
    },
    /// Attachments lie against planes.
    #[error(
        "{nodes} attachment(s) lie against planes, which the equilibrium does not know; hold their vertices by supports, or take \
         steps in time"
    )]
    Abutting {
        /// How many.
        nodes: usize,
    },
    /// A support, an attachment or a face names a vertex that does not exist.
    #[error("vertex {vertex} does not exist: the mesh has {vertices}")]
    Vertex {
        /// The vertex.
        vertex: u32,
        /// Vertices in the mesh.
        vertices: usize,
    },
    /// A displacement, force or pressure is not finite.
    #[error("{what} is not finite")]
    NotFinite {
        /// Which.
        what: &'static str,
    },
    /// A face of a pressure is not on the outer surface.
    #[error("the face {0:?} is not on the outer surface; pressure can act only there")]
    Face([u32; 3]),
    /// A sphere or rod has no size.
    #[error("{what} {index} has radius {radius_mm} mm; wanted a number above 0")]
    Radius {
        /// Which kind.
        what: &'static str,
        /// Which.
        index: usize,
        /// Its radius, mm.
        radius_mm: f64,
    },
    /// A sphere's friction is no coefficient.
    #[error("sphere {sphere} has friction {friction}; wanted a number from 0 (Coulomb's coefficient)")]
    Friction {
        /// Which sphere.
        sphere: usize,
        /// Its friction.
        friction: f64,
    },
    /// A rod holds nothing.
    #[error(
        "rod {rod} of radius {radius_mm} mm has no vertex inside: it lies outside of the tissue, or is too thin for the mesh around it, which is refined down to 1/128 of its edges; place it inside, make it thicker, or give a finer mesh there"
    )]
    Rod {
        /// Which.
        rod: usize,
        /// Its radius, mm.
        radius_mm: f64,
    },
    /// Supports or other rods hold all that a rod would.
    #[error(
        "rod {rod} holds nothing: supports or rods before it already hold all of the {vertices} vertices inside it; take one of them away, or move them apart"
    )]
    Taken {
        /// Which.
        rod: usize,
        /// Vertices inside it.
        vertices: usize,
    },
    /// A sphere meets only what is held.
    #[error(
        "sphere {sphere} meets only vertices that are held ({vertices}, the deepest {depth_mm:.4} mm inside it): they cannot give way, so it has no force; hold less of the surface under it, or move it"
    )]
    OnlyHeld {
        /// Which.
        sphere: usize,
        /// Held vertices inside it.
        vertices: usize,
        /// How deep the deepest is, mm.
        depth_mm: f64,
    },
    /// A sphere begins inside the tissue.
    #[error(
        "the centre of sphere {sphere} begins inside tetrahedron {tet}; it comes from outside, so begin it a radius ({radius_mm} mm) away from the surface"
    )]
    Inside {
        /// Which sphere.
        sphere: usize,
        /// The element that holds its centre at first.
        tet: usize,
        /// Its radius, mm.
        radius_mm: f64,
    },
    /// The loads move a part of the body that nothing holds.
    #[error(
        "the loads push the part of the body with vertex {vertex} away: {force_mn:.4?} mN and a moment of {moment_mn_mm:.4?} mN mm about its centre are borne by no support where the body lies, so it is carried away or swings round; hold vertices against them"
    )]
    Unheld {
        /// A vertex of the part.
        vertex: usize,
        /// Force that nothing bears, mN.
        force_mn: [f64; 3],
        /// Moment that nothing bears, mN mm.
        moment_mn_mm: [f64; 3],
    },
    /// A face is named twice in one pressure.
    #[error("the face {0:?} is listed twice in one pressure; it would be pushed twice as hard")]
    Twice([u32; 3]),
    /// The model itself.
    #[error(transparent)]
    Model(#[from] ModelError),
}

/// The problem with what attachments hold as supports in a set of their own: only supports are carried on to the vertices of
/// finer meshes. Where a support holds the same, it counts.
pub(super) fn with_attachments(problem: &StaticProblem, attachments: &[Attachment]) -> StaticProblem {
    let mut supported = BTreeMap::<u32, [bool; 3]>::new();
    for s in &problem.supports {
        let held = supported.entry(s.node).or_default();
        (0..3).for_each(|a| held[a] |= s.displacement_mm[a].is_some());
    }
    let set = problem.supports.iter().map(|s| s.set).max().map_or(0, |most| most.saturating_add(1));
    let support = |a: &Attachment| {
        let held = match a.kind {
            AttachmentKind::Fixed => [true; 3],
            AttachmentKind::Guided { held } => held,
            AttachmentKind::Spring { .. } | AttachmentKind::Abutting { .. } => return None,
        };
        let taken = supported.get(&a.node).copied().unwrap_or_default();
        let displacement_mm = [0, 1, 2].map(|i| (held[i] && !taken[i]).then_some(0.0));
        Some(Support { node: a.node, set, displacement_mm })
    };
    let mut whole = problem.clone();
    whole.supports.extend(attachments.iter().filter_map(support));
    whole
}

/// Refuses spheres that begin inside of the tissue.
pub(super) fn outside(mesh: &TetMesh, problem: &StaticProblem) -> Result<(), StaticError> {
    let points: Vec<[f64; 3]> = mesh.vertices.iter().map(|p| p.to_array()).collect();
    for (sphere, c) in problem.contacts.iter().enumerate() {
        if let Some(tet) = refine::holder(&points, &mesh.tets, c.from.to_array()) {
            return Err(StaticError::Inside { sphere, tet, radius_mm: c.radius_mm });
        }
    }
    Ok(())
}

pub(super) fn validate(vertices: usize, problem: &StaticProblem) -> Result<(), StaticError> {
    let named = problem.supports.iter().map(|s| s.node);
    let mut named = named.chain(problem.pressures.iter().flat_map(|p| p.faces.iter().flatten().copied()));
    if let Some(vertex) = named.find(|&v| v as usize >= vertices) {
        return Err(StaticError::Vertex { vertex, vertices });
    }
    for (index, c) in problem.contacts.iter().enumerate() {
        body("sphere", index, c.radius_mm, c.from.is_finite() && c.to.is_finite())?;
        if !(c.friction.is_finite() && c.friction >= 0.0) {
            return Err(StaticError::Friction { sphere: index, friction: c.friction });
        }
    }
    for (index, r) in problem.rods.iter().enumerate() {
        body("rod", index, r.radius_mm, r.ends.iter().all(|p| p.is_finite()) && r.displacement_mm.is_finite())?;
    }
    Ok(())
}

fn body(what: &'static str, index: usize, radius_mm: f64, finite: bool) -> Result<(), StaticError> {
    if !finite {
        Err(StaticError::NotFinite { what: "the place of a rod or sphere" })
    } else if radius_mm.is_finite() && radius_mm > 0.0 {
        Ok(())
    } else {
        Err(StaticError::Radius { what, index, radius_mm })
    }
}
