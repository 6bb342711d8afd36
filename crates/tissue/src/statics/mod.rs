//! Quasi-static equilibrium: what the tissue comes to rest at under given displacements, loads and rigid bodies.
//!
//! Newton's method on the energy of physical mode in double precision. Each linear system is solved by conjugate gradients
//! as far as the step deserves; products with the Hessian come straight from the elements, no matrix is stored. A line
//! search keeps the energy falling, so inverted trial states do no harm; imposed motion grows in steps that succeed.
//!
//! Around rods and spheres the mesh is refined inside the solver until its elements can tell their radius: what a thin rod
//! meets then depends on the rod and not on the mesh that happens to be there.

mod balance;
mod bisect;
mod held;
mod loads;
mod newton;
mod refine;
mod sphere;

use crate::{Model, ModelError, ModelOptions};
use monro_geometry::{Patient, Point, TetMesh, Vector};
use refine::Refined;
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

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StaticOptions {
    /// Largest allowed ratio of the force out of balance to the forces that act.
    pub tolerance: f64,
    /// Most Newton steps.
    pub steps: u32,
    /// Most products with the Hessian, over all steps.
    pub products: u32,
    /// How much finer than the given mesh the last solve is.
    pub finer: Finer,
}

/// How often every element is cut into eight, with the answer on one mesh as the start on the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Finer {
    /// So often.
    Times(u32),
    /// As often as that gives no more elements than this.
    UpTo(usize),
}

impl Finer {
    fn go_on(self, times: u32, tets: usize) -> bool {
        match self {
            Self::Times(n) => times < n,
            Self::UpTo(most) => 8 * tets <= most,
        }
    }
}

impl Default for StaticOptions {
    fn default() -> Self {
        Self { tolerance: 1e-6, steps: 2000, products: 200_000, finer: Finer::Times(0) }
    }
}

/// An equilibrium, or the best found.
#[derive(Debug, Clone, PartialEq)]
pub struct StaticSolution {
    /// Displacement of each vertex of the mesh, mm.
    pub displacement: Vec<Vector<Patient>>,
    /// Force of the supports on each vertex, mN; zero in free components.
    pub reaction: Vec<Vector<Patient>>,
    /// Force of each sphere on the tissue, mN.
    pub contacts: Vec<Vector<Patient>>,
    /// Force of each rod on the tissue, mN.
    pub rods: Vec<Vector<Patient>>,
    /// Force out of balance over the forces that act.
    pub residual: f64,
    /// Share of the imposed motion that was reached: below 1 only when the solver had to stop.
    pub share: f64,
    /// Whether the tolerance was met with all of the motion imposed.
    pub converged: bool,
    /// Elements of the mesh that it was found on.
    pub tets: usize,
    /// How many of them are left without volume or turned inside out: the answer means nothing around them.
    pub turned: usize,
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
    /// A sphere or rod has no size.
    #[error(
        "{what} {index} has radius {radius_mm} mm and friction {friction}; wanted a radius above 0, friction from 0"
    )]
    Body {
        /// Which kind.
        what: &'static str,
        /// Which.
        index: usize,
        /// Its radius, mm.
        radius_mm: f64,
        /// Its friction.
        friction: f64,
    },
    /// A rod holds nothing.
    #[error(
        "rod {rod} of radius {radius_mm} mm has no free vertex inside: it lies outside of the tissue, or the mesh is too coarse"
    )]
    Rod {
        /// Which.
        rod: usize,
        /// Its radius, mm.
        radius_mm: f64,
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
        "the loads push the part of the body with vertex {vertex} away: {force_mn:?} mN and a moment of {moment_mn_mm:?} mN mm about its centre are borne by no support, so there is no equilibrium; hold vertices against them"
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

/// Finds the equilibrium of a mesh at rest. The mesh is refined around rods and spheres, and as a whole as often as the
/// options ask; results are given at the vertices of `mesh`. `keep_going` is asked before each product with the Hessian:
/// return `false` to stop with the best state so far (a time budget belongs to the caller).
///
/// # Errors
/// When the model is not in physical mode, is refused, or the problem names what is not there.
pub fn equilibrium(
    mesh: &TetMesh,
    model: &ModelOptions,
    problem: &StaticProblem,
    options: &StaticOptions,
    keep_going: &mut dyn FnMut() -> bool,
) -> Result<StaticSolution, StaticError> {
    validate(mesh.vertices.len(), problem)?;
    outside(mesh, problem)?;
    let mut refined = Refined::new(mesh, problem).around_tools();
    let mut solved = on(&refined, model, None, options, keep_going)?;
    let mut times = 0;
    while options.finer.go_on(times, solved.tets) {
        if !solved.converged || !keep_going() {
            solved.converged = false;
            break;
        }
        times += 1;
        let finer = refined.clone().halved();
        let start = finer.prolonged(&solved.displacement);
        solved = on(&finer, model, Some(&start), options, keep_going)?;
        refined = finer;
    }
    solved.reaction = refined.gathered(solved.reaction);
    solved.displacement.truncate(refined.given());
    Ok(solved)
}

fn on(
    refined: &Refined,
    options: &ModelOptions,
    start: Option<&[Vector<Patient>]>,
    how: &StaticOptions,
    keep_going: &mut dyn FnMut() -> bool,
) -> Result<StaticSolution, StaticError> {
    Model::new(&refined.mesh, options)?.solve(&refined.problem, start, how, keep_going)
}

/// Refuses spheres that begin inside of the tissue.
fn outside(mesh: &TetMesh, problem: &StaticProblem) -> Result<(), StaticError> {
    let points: Vec<[f64; 3]> = mesh.vertices.iter().map(|p| p.to_array()).collect();
    for (sphere, c) in problem.contacts.iter().enumerate() {
        if let Some(tet) = refine::holder(&points, &mesh.tets, c.from.to_array()) {
            return Err(StaticError::Inside { sphere, tet, radius_mm: c.radius_mm });
        }
    }
    Ok(())
}

fn validate(vertices: usize, problem: &StaticProblem) -> Result<(), StaticError> {
    let named = problem.supports.iter().map(|s| s.node);
    let mut named = named.chain(problem.pressures.iter().flat_map(|p| p.faces.iter().flatten().copied()));
    if let Some(vertex) = named.find(|&v| v as usize >= vertices) {
        return Err(StaticError::Vertex { vertex, vertices });
    }
    let sphere = |(i, c): (usize, &SphereContact)| {
        ("sphere", i, c.radius_mm, c.friction, c.from.is_finite() && c.to.is_finite())
    };
    let rod = |(i, r): (usize, &EmbeddedRod)| {
        ("rod", i, r.radius_mm, 0.0, r.ends.iter().all(|p| p.is_finite()) && r.displacement_mm.is_finite())
    };
    let bodies = problem.contacts.iter().enumerate().map(sphere).chain(problem.rods.iter().enumerate().map(rod));
    for (what, index, radius_mm, friction, finite) in bodies {
        if !finite {
            return Err(StaticError::NotFinite { what: "the place of a rod or sphere" });
        }
        if !(radius_mm.is_finite() && radius_mm > 0.0 && friction >= 0.0) {
            return Err(StaticError::Body { what, index, radius_mm, friction });
        }
    }
    Ok(())
}

impl Model {
    /// Finds the equilibrium on this model's own mesh, however coarse it is around rods and spheres; otherwise as
    /// [`equilibrium`].
    ///
    /// # Errors
    /// When the model is not in physical mode or the problem names what is not there.
    pub fn equilibrium(
        &self,
        problem: &StaticProblem,
        options: &StaticOptions,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Result<StaticSolution, StaticError> {
        validate(self.number.len(), problem)?;
        self.solve(problem, None, options, keep_going)
    }

    fn solve(
        &self,
        problem: &StaticProblem,
        start: Option<&[Vector<Patient>]>,
        options: &StaticOptions,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Result<StaticSolution, StaticError> {
        let elastic = &self.elastic().ok_or(StaticError::NotPhysical)?;
        let loads = loads::Loads::new(self, elastic, problem)?;
        balance::check(elastic, &loads, problem, &self.number)?;
        let spheres = sphere::Spheres::new(self, elastic, problem);
        let start = start.map(|moved| {
            let mut x = elastic.rest.clone();
            for (d, &n) in moved.iter().zip(&self.number) {
                let d = d.to_array();
                (0..3).for_each(|a| x[n as usize][a] += d[a]);
            }
            x
        });
        let mut solved = newton::solve(elastic, (&loads, spheres), start, options, keep_going);
        let back = |of: &[[f64; 3]]| self.number.iter().map(|&n| Vector::from_array(of[n as usize])).collect();
        let moved: Vec<[f64; 3]> =
            solved.x.iter().zip(&elastic.rest).map(|(x, r)| core::array::from_fn(|a| x[a] - r[a])).collect();
        let rods = loads.rods.iter().map(|held| taken(held, &mut solved.reaction)).collect();
        Ok(StaticSolution {
            displacement: back(&moved),
            reaction: back(&solved.reaction),
            contacts: solved.contacts.iter().map(|&f| Vector::from_array(f)).collect(),
            rods,
            residual: solved.residual,
            share: solved.share,
            converged: solved.residual <= options.tolerance && solved.share >= 1.0,
            tets: self.tets.len(),
            turned: solved.turned,
            steps: solved.steps,
            products: solved.products,
        })
    }
}

/// The force of a rod, taken out of the reactions of what it holds.
fn taken(held: &[(u32, [bool; 3])], reaction: &mut [[f64; 3]]) -> Vector<Patient> {
    let mut sum = [0.0; 3];
    for &(node, by_rod) in held {
        for a in (0..3).filter(|&a| by_rod[a]) {
            sum[a] += core::mem::take(&mut reaction[node as usize][a]);
        }
    }
    Vector::from_array(sum)
}
