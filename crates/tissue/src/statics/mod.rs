//! Quasi-static equilibrium: what the tissue comes to rest at under given displacements and loads.
//!
//! Newton's method on the energy of physical mode in double precision. Each linear system is solved by conjugate gradients
//! as far as the step deserves; products with the Hessian come straight from the elements, no matrix is stored. A line
//! search keeps the energy falling, so inverted trial states do no harm.

mod loads;
mod newton;

use crate::{Model, ModelError};
use monro_geometry::{Patient, Vector};
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
}

/// A prescribed displacement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Support {
    /// Vertex of the mesh.
    pub node: u32,
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

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StaticOptions {
    /// Largest allowed ratio of the force out of balance to the forces that act.
    pub tolerance: f64,
    /// Most Newton steps.
    pub steps: u32,
    /// Most products with the Hessian, over all steps.
    pub products: u32,
}

impl Default for StaticOptions {
    fn default() -> Self {
        Self { tolerance: 1e-6, steps: 60, products: 100_000 }
    }
}

/// An equilibrium, or the best found.
#[derive(Debug, Clone, PartialEq)]
pub struct StaticSolution {
    /// Displacement of each vertex of the mesh, mm.
    pub displacement: Vec<Vector<Patient>>,
    /// Force of the supports on each vertex, mN; zero in free components.
    pub reaction: Vec<Vector<Patient>>,
    /// Force out of balance over the forces that act.
    pub residual: f64,
    /// Whether the tolerance was met.
    pub converged: bool,
    /// Newton steps taken.
    pub steps: u32,
    /// Products with the Hessian.
    pub products: u32,
}

/// Why a problem was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum StaticError {
    /// Only physical mode has an energy.
    #[error("equilibrium needs a model in physical mode")]
    NotPhysical,
    /// A support or a face names a vertex that does not exist.
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
    /// The model itself.
    #[error(transparent)]
    Model(#[from] ModelError),
}

impl Model {
    /// Finds the equilibrium. `keep_going` is asked before each product with the Hessian: return `false` to stop with the
    /// best state so far (a time budget belongs to the caller).
    ///
    /// # Errors
    /// When the model is not in physical mode or the problem names what is not there.
    pub fn equilibrium(
        &self,
        problem: &StaticProblem,
        options: &StaticOptions,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Result<StaticSolution, StaticError> {
        let elastic = self.elastic().ok_or(StaticError::NotPhysical)?;
        let loads = loads::Loads::new(self, elastic, problem)?;
        let solved = newton::solve(elastic, &loads, options, keep_going);
        let back = |of: &[[f64; 3]]| self.number.iter().map(|&n| Vector::from_array(of[n as usize])).collect();
        let moved: Vec<[f64; 3]> =
            solved.x.iter().zip(&elastic.rest).map(|(x, r)| core::array::from_fn(|a| x[a] - r[a])).collect();
        Ok(StaticSolution {
            displacement: back(&moved),
            reaction: back(&solved.reaction),
            residual: solved.residual,
            converged: solved.residual <= options.tolerance,
            steps: solved.steps,
            products: solved.products,
        })
    }
}
