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
//! Units: mm, s, kg, hence mN and kPa (1 kPa = 1 mN/mm2). Positions go in and come out in the frame of the mesh (patient,
//! LPS mm); only [`Model::nodes_into`] counts from [`Model::origin`]. The model knows labels and regions, no organs.
//!
//! A rod of 3 mm is pushed into a cube, and the same cube is stretched to rest:
//!
//! ```
//! use monro_geometry::{Point, TetMesh};
//! use monro_tissue::*;
//! use std::collections::BTreeMap;
//!
//! // A cube of 20 mm in five tetrahedra of label 4.
//! let corner = |i: u32| Point::from_array([i & 1, i >> 1 & 1, i >> 2].map(|c| 20.0 * f64::from(c)));
//! let vertices = (0..8).map(corner).collect();
//! let tets = vec![[0, 1, 2, 4], [3, 2, 1, 7], [5, 1, 4, 7], [6, 4, 2, 7], [1, 2, 4, 7]];
//! let mesh = TetMesh { vertices, tets, labels: vec![4; 5] };
//!
//! let options = ModelOptions {
//!     mode: Mode::Physical(PhysicalOptions::default()),
//!     materials: BTreeMap::from([(4, Material::BRAIN)]),
//!     attachments: (0..4).map(|node| Attachment { node, kind: AttachmentKind::Fixed }).collect(),
//!     collision: CollisionResponse::Insertion,
//! };
//! let model = Model::new(&mesh, &options)?;
//! let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
//! let tool = Tool { tip: TipShape::Round, radius_mm: 1.5 };
//! let pose = |z: f64| ToolPose { tip: Point::new(9.0, 8.0, z), tail: Point::new(9.0, 8.0, z + 100.0) };
//! for frame in 0..60 {
//!     // 10 mm/s in frames of a sixtieth of a second.
//!     let at = |frame: i32| pose(21.0 - f64::from(frame) / 6.0);
//!     let motion = ToolMotion { tool, from: at(frame), to: at(frame + 1) };
//!     let report = stepper.step(&model, &mut state, &[motion], &FrameSettings::default());
//!     if frame == 59 {
//!         assert_eq!(report.tools[0].label, Some(4));
//!         assert!(report.tools[0].axial_force_mn > 10.0 && report.inverted == 0);
//!     }
//! }
//!
//! // The top is drawn up by 0.02 mm, a thousandth; supports hold all that attachments held.
//! let support = |node, z| Support { node, set: u32::from(z > 0.0), displacement_mm: [None, None, Some(z)] };
//! let supports = (0..8).map(|node| support(node, if node < 4 { 0.0 } else { 0.02 })).collect();
//! let problem = StaticProblem { supports, ..StaticProblem::default() };
//! let free = ModelOptions { attachments: Vec::new(), ..options };
//! let rest = equilibrium(&mesh, &free, &problem, &StaticOptions::default(), &mut || true)?;
//! assert!(rest.converged);
//! let force: f64 = rest.reaction[4..].iter().map(|r| r.z).sum();
//! // E (3 kPa) times strain times 400 mm2.
//! assert!((force - 1.2).abs() < 0.01, "{force} mN");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Simplifications: tissue is cut along the axis of a tool but the mesh is never split; self-contact is not modelled
//! ([`monro_geometry::Walls`] finds where tissue has passed through itself);
//! tools are rigid and straight.

mod abutments;
mod bytes;
mod contact;
mod csf;
mod cuts;
mod dense;
mod error;
mod fast;
mod identity;
mod marks;
mod material;
mod membrane;
mod model;
mod nodes;
mod options;
mod paper;
mod physical;
mod reaction;
mod report;
mod rigid;
mod slabs;
mod space;
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
pub use physical::elastic::NO_VOLUME;
pub use report::{Event, StepReport, ToolReport};
pub use state::State;
pub use statics::{
    Coarse, EmbeddedRod, Finer, MeshChange, Moment, Overlap, Pressure, SphereContact, StaticError, StaticOptions,
    StaticProblem, StaticSolution, Stop, Support, Unfinished, equilibrium,
};
pub use step::{Stage, Stepper};
pub use tool::{TipShape, Tool, ToolMotion, ToolPose};
