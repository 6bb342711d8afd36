//! Quasi-static equilibrium: what the tissue comes to rest at under given displacements, loads and rigid bodies.
//!
//! Newton's method on the energy of physical mode in double precision. Each linear system is solved by conjugate gradients
//! as far as the step deserves; products with the Hessian come straight from the elements. Where these would take more work than
//! the factors of a matrix (slender bodies, near incompressible), a state near by is factored for them ([`direct`]). A line search keeps the energy falling, so inverted trial states do no harm; imposed motion grows in steps that succeed. Pressures
//! on open surfaces have no energy: there systems are solved by biconjugate gradients, and steps are whole ones.
//!
//! Around rods and spheres the mesh is refined inside the solver until its elements can tell their radius: what a thin rod
//! meets then depends on the rod and not on the mesh that happens to be there.

mod balance;
mod bisect;
mod direct;
mod edges;
mod held;
mod level;
mod linear;
mod loads;
mod newton;
mod overlap;
mod patches;
mod problem;
mod refine;
mod site;
mod sphere;
mod stable;
mod told;
mod uncertain;
mod unsymmetric;

use crate::{AttachmentKind, Model, ModelOptions};
use level::{How, Level};
use monro_geometry::{Patient, TetMesh, Vector};
use problem::{outside, validate, with_attachments};
use std::collections::BTreeSet;

pub use problem::{EmbeddedRod, Pressure, SphereContact, StaticError, StaticProblem, Support};
pub use told::{Coarse, MeshChange, Moment, Overlap, StaticSolution, Stop, Unfinished};

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StaticOptions {
    /// Largest allowed ratio of the force out of balance to the forces that act.
    pub tolerance: f64,
    /// Most Newton steps, and most steps of the imposed motion; ten times as many (and products) where spheres rub.
    pub steps: u32,
    /// Most products with the Hessian, over all steps.
    pub products: u32,
    /// How much finer than the given mesh the last solve is.
    pub finer: Finer,
}

/// How much finer the mesh becomes, with the answer on one mesh as the start on the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Finer {
    /// Every element is cut into eight so often.
    Times(u32),
    /// The same as often as that gives no more elements than this; then elements are made smaller where the answer is least
    /// certain, up to four times as many, and at most a quarter more than this.
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

/// Finds the equilibrium of a mesh at rest. The mesh is refined around rods and spheres, and as a whole as the options ask; results are given at the vertices of `mesh`. `keep_going` is asked before each product with the Hessian:
/// return `false` to stop with the best state so far (a time budget belongs to the caller).
///
/// Attachments that are fixed or guided are taken as supports that hold at rest, in a set of their own; a support of the same
/// vertex counts before them. Look at [`StaticSolution::converged`] before anything else.
///
/// # Errors
/// When the model is not in physical mode, is refused or has springs, or the problem names what is not there.
pub fn equilibrium(
    mesh: &TetMesh,
    model: &ModelOptions,
    problem: &StaticProblem,
    options: &StaticOptions,
    keep_going: &mut dyn FnMut() -> bool,
) -> Result<StaticSolution, StaticError> {
    let count = |is: fn(&AttachmentKind) -> bool| model.attachments.iter().filter(|a| is(&a.kind)).count();
    let springs = count(|a| matches!(a, AttachmentKind::Spring { .. }));
    can_hold(springs, count(|a| matches!(a, AttachmentKind::Abutting { .. })))?;
    let problem = &with_attachments(problem, &model.attachments);
    validate(mesh.vertices.len(), problem)?;
    outside(mesh, problem)?;
    let model = &ModelOptions { attachments: Vec::new(), ..model.clone() };
    let mut how = How { model, options, keep_going };
    let mut level = Level::first(mesh, problem, &mut how)?;
    overlap::refuse(&level.solved)?;
    level.refine_all(&mut how);
    if let Finer::UpTo(most) = options.finer {
        level.refine_uncertain(most, &mut how);
    }
    Ok(level.given(mesh, problem))
}

/// Refuses attachments that only steps know.
fn can_hold(springs: usize, abutting: usize) -> Result<(), StaticError> {
    match (springs, abutting) {
        (0, 0) => Ok(()),
        (0, nodes) => Err(StaticError::Abutting { nodes }),
        (springs, _) => Err(StaticError::Springs { springs }),
    }
}

impl Model {
    /// Finds the equilibrium on this model's own mesh, however coarse it is around rods and spheres; otherwise as
    /// [`equilibrium`].
    ///
    /// # Errors
    /// When the model is not in physical mode or has springs, or the problem names what is not there.
    pub fn equilibrium(
        &self,
        problem: &StaticProblem,
        options: &StaticOptions,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Result<StaticSolution, StaticError> {
        validate(self.number.len(), problem)?;
        can_hold(self.tethers.len(), self.abutments.len())?;
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
        let spheres = sphere::Spheres::new(self, elastic, (problem, &loads.support));
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
        let by_rods: Vec<_> = loads.rods.iter().map(|held| taken(held, (&mut solved.reaction, &solved.x))).collect();
        let turned: BTreeSet<u32> = solved.turned.iter().copied().collect();
        let held = |n: u32| loads.support[n as usize].iter().any(Option::is_some);
        let overlaps = overlap::all(self, (elastic, &solved.x), (&problem.contacts, &solved.spheres), held);
        let through = overlaps.iter().any(|o| o.passed).then_some(Stop::Through);
        let stop = solved.stop.or(through);
        let reaction = back(&solved.reaction);
        let at: Vec<[f64; 3]> = self.number.iter().map(|&n| solved.x[n as usize]).collect();
        Ok(StaticSolution {
            displacement: back(&moved),
            sets: problem.of_sets(&reaction),
            set_moments: problem.moments(&reaction, (&at, self.origin)),
            reaction,
            contacts: solved.contacts.iter().map(|&f| Vector::from_array(f)).collect(),
            rods: by_rods
                .iter()
                .map(|of| of.iter().fold(Vector::ZERO, |s, &(_, f)| s + Vector::from_array(f)))
                .collect(),
            rod_moments: by_rods.iter().map(|of| Moment::of(of, self.origin)).collect(),
            contested: loads.contested,
            residual: solved.residual,
            share: solved.share,
            converged: stop.is_none() && turned.is_empty(),
            stop,
            overlaps,
            loads_mn: solved.loads,
            unborne: solved.unborne,
            coarse: Vec::new(),
            points: Vec::new(),
            tets: self.tets.len(),
            turned: turned.len(),
            unstable: solved.unstable,
            unlooked: solved.unlooked,
            first_turned: self.tet_number.iter().position(|t| turned.contains(t)),
            unfinished: None,
            change: None,
            steps: solved.steps,
            products: solved.products,
        })
    }
}

/// Where a rod holds what, and the forces, taken out of the reactions of what it holds.
fn taken(held: &[(u32, [bool; 3])], (reaction, x): (&mut [[f64; 3]], &[[f64; 3]])) -> Vec<([f64; 3], [f64; 3])> {
    let mut of = |&(node, by_rod): &(u32, [bool; 3])| {
        let whole = &mut reaction[node as usize];
        let force = core::array::from_fn(|a| if by_rod[a] { core::mem::take(&mut whole[a]) } else { 0.0 });
        (x[node as usize], force)
    };
    held.iter().map(&mut of).collect()
}
