//! What a model is built from beside its mesh, and what a step is told.

use crate::Material;
use std::collections::BTreeMap;

/// Everything but the mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelOptions {
    /// Which mechanics.
    pub mode: Mode,
    /// Material of each label of the mesh; a label without one is refused.
    pub materials: BTreeMap<u16, Material>,
    /// Nodes held in place.
    pub attachments: Vec<Attachment>,
    /// What happens where a tool meets the tissue.
    pub collision: CollisionResponse,
}

/// The two mechanics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mode {
    /// Position-based dynamics as in the paper.
    Paper(PaperOptions),
    /// Energy minimisation with moduli.
    Physical(PhysicalOptions),
}

/// Options of paper mode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PaperOptions {
    /// Coefficient of the global volume constraint, equation (9), in `0..=1`.
    pub global_volume: f64,
    /// Velocity damping of equation (1), in `0..=1` per second: the share of the non-rigid motion lost in a second is
    /// `1 - (1 - damping)` to the power of the time.
    pub damping: f64,
    /// Where dihedral angles are kept.
    pub dihedral: DihedralScope,
}

/// Where equation (7) acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DihedralScope {
    /// Between neighbouring triangles of the outer surface and of the walls between regions. The six edge lengths of a
    /// tetrahedron already fix its own angles.
    Surface,
    /// Also at the six edges of each tetrahedron, as the paper's text has it: six more constraints per element.
    Elements,
}

/// Options of physical mode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhysicalOptions {
    /// Share of the shear energy that acts on the mean deformation around each node instead of the elements' own, in
    /// `0..=0.5`: takes away bending stiffness that linear tetrahedra have too much of. 0 is the cheapest.
    pub nodal_shear: f64,
}

/// What a tool does to the tissue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CollisionResponse {
    /// Membranes resist, dimple and yield; then the tip cuts, and the shaft holds and rubs.
    Insertion,
    /// The paper's plain response: tissue is pushed out of the tool, nothing is ever punctured.
    Plain,
}

/// A node held in place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Attachment {
    /// Vertex of the mesh.
    pub node: u32,
    /// How it is held.
    pub kind: AttachmentKind,
}

/// How a node is held.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AttachmentKind {
    /// It does not move.
    Fixed,
    /// A spring of zero rest length ties it to its rest position. Not for [`crate::equilibrium`], which refuses it.
    Spring {
        /// Stiffness, mN/mm.
        stiffness_mn_per_mm: f64,
    },
    /// It lies against a rigid, frictionless plane through its rest position: it slides along it and lifts off, and never goes
    /// beyond. A node may lie against up to eight. Many on one surface make a wall that bends smoothly between them, and along which
    /// each of them slides. Not for [`crate::equilibrium`], which refuses it.
    Abutting {
        /// Normal of the plane, away from the tissue (patient frame); of any length but 0.
        outward: [f64; 3],
        /// Rate at which what lies between wall and node takes the node's velocity, 1/s; 0: without drag. It bears nothing at rest.
        drag_per_s: f64,
    },
    /// Some components do not move, the others are free, as on rollers. In paper mode and for [`crate::equilibrium`]; a
    /// [`crate::Model`] in physical mode refuses it.
    Guided {
        /// Which of x, y and z (patient frame) do not move.
        held: [bool; 3],
    },
}

/// Shortest step, s.
const SHORTEST_S: f64 = 2.5e-4;
/// Largest pressure of the fluid, kPa.
pub(crate) const MOST_PRESSURE_KPA: f64 = 100.0;

/// How one call of `step` goes through time. A step never fails: what is out of its range is brought into it, and gravity or
/// fluid that is not finite is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameSettings {
    /// Time of the frame, s: 2.5e-4 to 1; what is no number is 1/60. [`crate::State::time_s`] counts what was taken.
    pub dt_s: f64,
    /// Least number of equal steps the frame is cut into; a fast tool raises it. 1 to 1000, and no more than
    /// 2.5e-4 s each allow: what moves in less is lost in the last digits of positions in single precision (a beam of 160 mm
    /// falls alike in steps down to 2.6e-4 s, 10 % less far in steps of 1.7e-4, not at all in 1.7e-5).
    pub substeps: u32,
    /// Iterations of the solver per substep, 1 to 10,000.
    pub iterations: u32,
    /// Gravity, mm/s2, patient frame. Fluid has more pressure below for it as fluid at rest does, also where all falls.
    pub gravity_mm_s2: [f64; 3],
    /// Do some iterations only where the tissue moves more than on average (the paper's predicted deformation space): two of
    /// three, in physical mode every second one while the tissue is calm.
    pub predicted_space: bool,
    /// Physical mode: what is done to the fluid of the ventricles.
    pub csf: Csf,
}

/// What is done to the fluid in all regions of fluid material, which are one communicating space.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Csf {
    /// Nothing: the pressure is that at rest.
    #[default]
    AtRest,
    /// This much pressure more than at rest, kPa (1 mmHg is 0.133322 kPa), above that around the tissue: pressure raised
    /// inside and around alike deforms nothing. Under gravity it is that in the middle of the fluid.
    Pressure {
        /// The difference, kPa, -100 to 100.
        kpa: f64,
    },
    /// This much volume less than at rest, ml, as far as that takes no more suction than three times the tissue's shear
    /// modulus (walls that meet are not modelled); negative for an infusion, as far as 100 kPa go.
    Drained {
        /// The volume, ml.
        ml: f64,
    },
}

impl Csf {
    /// A share of it.
    fn brought_on(self, share: f64) -> Self {
        match self {
            Self::AtRest => Self::AtRest,
            Self::Pressure { kpa } => Self::Pressure { kpa: kpa * share },
            Self::Drained { ml } => Self::Drained { ml: ml * share },
        }
    }

    fn sane(self) -> Self {
        match self {
            Self::Pressure { kpa } if kpa.is_finite() => {
                Self::Pressure { kpa: kpa.clamp(-MOST_PRESSURE_KPA, MOST_PRESSURE_KPA) }
            }
            Self::Drained { ml } if ml.is_finite() => self,
            _ => Self::AtRest,
        }
    }
}

impl Default for PaperOptions {
    fn default() -> Self {
        Self { global_volume: 0.5, damping: 0.95, dihedral: DihedralScope::Surface }
    }
}

impl Default for PhysicalOptions {
    fn default() -> Self {
        // Chosen on the reference scenes: no scene worse than nodal-averaged elements, the beam better.
        Self { nodal_shear: 0.1 }
    }
}

impl Default for FrameSettings {
    fn default() -> Self {
        Self {
            dt_s: 1.0 / 60.0,
            substeps: 1,
            iterations: 10,
            gravity_mm_s2: [0.0; 3],
            predicted_space: false,
            csf: Csf::AtRest,
        }
    }
}

impl FrameSettings {
    /// The settings with a share of gravity and of what is done to the fluid, for bringing them on slowly.
    #[must_use]
    pub fn brought_on(&self, share: f64) -> Self {
        Self { gravity_mm_s2: self.gravity_mm_s2.map(|g| g * share), csf: self.csf.brought_on(share), ..*self }
    }

    /// The settings with what is unusable made usable: no step shorter than [`SHORTEST_S`], at least one iteration.
    pub(crate) fn sane(&self) -> Self {
        let dt_s = if self.dt_s.is_finite() { self.dt_s.clamp(SHORTEST_S, 1.0) } else { 1.0 / 60.0 };
        let gravity_mm_s2 = self.gravity_mm_s2.map(|g| if g.is_finite() { g } else { 0.0 });
        Self {
            dt_s,
            substeps: self.substeps.clamp(1, ((dt_s / SHORTEST_S).round() as u32).clamp(1, 1000)),
            iterations: self.iterations.clamp(1, 10_000),
            gravity_mm_s2,
            predicted_space: self.predicted_space,
            csf: self.csf.sane(),
        }
    }
}
