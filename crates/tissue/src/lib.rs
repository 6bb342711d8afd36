//! Soft tissue: a labelled tetrahedral mesh, materials, attachments and rigid tools, stepped through time.
//!
//! Four types, four lifetimes:
//!
//! | type | what | changes |
//! |---|---|---|
//! | [`Model`] | mesh, materials, attachments, constants of the solver, sphere tree | never; share it between threads |
//! | [`State`] | positions, velocities, pressures, where each tool has cut | each step |
//! | [`Stepper`] | scratch memory of one running simulation | each step, holds nothing that matters |
//! | [`StepReport`] | events, forces, counts of one step | given back by the step |
//!
//! Two modes share all of it. **Paper mode** is position-based dynamics with the constraints and the normalised
//! coefficients of the paper that Monro starts from (see README; equations 1 to 11, its slips corrected where they are used). **Physical mode**
//! minimises the energy of a near-incompressible neo-Hookean solid, so that moduli in kPa go in and come out again.
//!
//! Units: mm, s, kg, hence mN and kPa (1 kPa = 1 mN/mm2). The model knows labels and regions, no organs.
//!
//! Simplifications: tissue is cut along the axis of a tool but the mesh is never split; self-contact is not modelled
//! (`geometry::Walls` finds where tissue has passed through itself);
//! tools are rigid and straight.

mod bytes;
mod contact;
mod csf;
mod cuts;
mod error;
mod fast;
mod material;
mod membrane;
mod model;
mod options;
mod paper;
mod physical;
mod reaction;
mod report;
mod rigid;
mod slabs;
mod sphere_tree;
mod state;
mod statics;
mod step;
mod tool;
mod untangle;
mod validate;
mod vec3;
mod volumes;

pub use bytes::Held;
pub use error::ModelError;
pub use material::{Insertion, Material, MaterialFault, PaperCoefficients, ThinMembrane};
pub use model::Model;
pub use options::{
    Attachment, AttachmentKind, CollisionResponse, Csf, DihedralScope, FrameSettings, Mode, ModelOptions, PaperOptions,
    PhysicalOptions,
};
pub use report::{Event, StepReport, ToolReport};
pub use state::State;
pub use statics::{
    Coarse, EmbeddedRod, Finer, MeshChange, Overlap, Pressure, SphereContact, StaticError, StaticOptions,
    StaticProblem, StaticSolution, Stop, Support, Unfinished, equilibrium,
};
pub use step::{Stage, Stepper};
pub use tool::{TipShape, Tool, ToolMotion, ToolPose};
