//! What a solve tells.

use super::StaticError;
use monro_geometry::d3::{axpy, cross, distance, sub};
use monro_geometry::{Patient, Point, Vector};
use std::collections::BTreeMap;

/// Share of the elements turned inside out from which on a body is taken to collapse.
const COLLAPSED: f64 = 0.01;

/// What forces turn about a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// The place: the mean of the vertices that they act on, as they are in the end.
    pub about: Point<Patient>,
    /// Their moment on the tissue, mN mm.
    pub mn_mm: Vector<Patient>,
    /// Mean distance of these vertices from the place, mm.
    pub reach: f64,
}

impl Moment {
    /// Of forces (mN) at places (mm from an origin); `None` where there are none.
    pub(super) fn of(all: &[([f64; 3], [f64; 3])], origin: Point<Patient>) -> Option<Self> {
        let share = 1.0 / all.len() as f64;
        let about = all.iter().fold([0.0; 3], |c, (x, _)| axpy(c, share, *x));
        let moment = all.iter().fold([0.0; 3], |m, &(x, f)| axpy(m, 1.0, cross(sub(x, about), f)));
        let reach = all.iter().map(|(x, _)| share * distance(*x, about)).sum();
        let [place, mn_mm] = [about, moment].map(Vector::from_array);
        (!all.is_empty()).then(|| Self { about: origin + place, mn_mm, reach })
    }
}

/// An equilibrium, or the best found.
#[derive(Debug, Clone, PartialEq)]
pub struct StaticSolution {
    /// Displacement of each vertex of the mesh, mm.
    pub displacement: Vec<Vector<Patient>>,
    /// Force of the supports on each vertex, mN; zero in free components.
    ///
    /// Where the mesh was refined, a new vertex's force is halved between the two that it lies between, as far as it takes: beside
    /// the border of two sets that is on both. What a set bears is in [`sets`](Self::sets).
    pub reaction: Vec<Vector<Patient>>,
    /// Force of each set of supports on the tissue, mN, in the components that it holds: summed up on the mesh that the answer
    /// was found on, and without what a rod moves. What two sets hold counts in both.
    pub sets: BTreeMap<u32, Vector<Patient>>,
    /// Moment of the same forces of each set on the tissue.
    pub set_moments: BTreeMap<u32, Moment>,
    /// Force of each sphere on the tissue, mN.
    pub contacts: Vec<Vector<Patient>>,
    /// Force of each rod on the tissue, mN.
    pub rods: Vec<Vector<Patient>>,
    /// Moment of each rod on the tissue; `None` of one that holds no vertex.
    pub rod_moments: Vec<Option<Moment>>,
    /// Vertices of the mesh that it was found on inside each rod that a support, or a rod before it, moves otherwise: they do
    /// not go with this rod.
    pub contested: Vec<usize>,
    /// Force out of balance over the forces that act.
    pub residual: f64,
    /// Share of the imposed motion that was reached: below 1 only when the solver had to stop.
    pub share: f64,
    /// Whether the tolerance was met with all of the motion imposed, no element turned inside out, and the mesh as fine as
    /// [`Finer::Times`](super::Finer::Times) asked.
    pub converged: bool,
    /// Why it is no answer; `None` when it is one.
    pub stop: Option<Stop>,
    /// Elements of the mesh that it was found on.
    pub tets: usize,
    /// How many of them are left without volume or turned inside out: the answer means nothing around them.
    pub turned: usize,
    /// The element of the given mesh that is the first of these, or holds it.
    pub first_turned: Option<usize>,
    /// Whether forces balance each other, but the body would not stay so: no state in which it does was found from there.
    pub unstable: bool,
    /// Whether it was stopped before it was known whether the body would stay so.
    pub unlooked: bool,
    /// A finer mesh whose solution was given up: this one is that of the mesh before it.
    pub unfinished: Option<Unfinished>,
    /// What the last refinement changed; `None` when there was none. What a finer mesh would still change is of that order.
    pub change: Option<MeshChange>,
    /// Where spheres and tissue overlap in the end.
    pub overlaps: Vec<Overlap>,
    /// Sum of the sizes of the loads (pressures over their faces, weights), mN.
    pub loads_mn: f64,
    /// Sum of the forces out of balance over the sum of the loads and of the spheres' forces.
    pub unborne: f64,
    /// Tools whose elements were not made as small as they should be.
    pub coarse: Vec<Coarse>,
    /// Vertices of the given mesh that are held by themselves in some components, with no held edge or face around them, and these
    /// components: where the mesh was refined, what holds them is a point, and has no force of its own that does not depend on
    /// the mesh.
    pub points: Vec<(u32, [bool; 3])>,
    /// Newton steps taken.
    pub steps: u32,
    /// Products with the Hessian.
    pub products: u32,
}

impl StaticSolution {
    /// What forces are large or small against: the sum of what the supports bear, or of the loads where these are larger (they
    /// may balance each other), mN.
    pub fn at_work_mn(&self) -> f64 {
        self.reaction.iter().map(|r| r.norm()).sum::<f64>().max(self.loads_mn)
    }
}

/// Why what was found is no answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// The caller asked to stop.
    Asked,
    /// [`StaticOptions::steps`](super::StaticOptions::steps) were taken.
    Steps,
    /// [`StaticOptions::products`](super::StaticOptions::products) were taken.
    Products,
    /// No step brings the forces nearer to balance.
    Stuck,
    /// The body flew away.
    Lost,
    /// A sphere lies inside the tissue that it should push aside: see [`StaticSolution::overlaps`].
    Through,
    /// Supports, rods and spheres do not bear the loads: see [`StaticSolution::unborne`].
    Unborne,
}

/// Where a sphere and the tissue overlap in the end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overlap {
    /// Which sphere.
    pub sphere: usize,
    /// Whether the overlap is so deep that this is no answer.
    pub passed: bool,
    /// Whether the sphere's centre lies inside the tissue.
    pub centre_inside: bool,
    /// How deep the surface that is free reaches into the sphere, mm.
    pub depth_mm: f64,
    /// Held vertices inside the sphere; they cannot give way, and it presses on none of them.
    pub held: usize,
    /// How deep the deepest of them is, mm.
    pub held_mm: f64,
}

/// A tool whose elements were not made as small as they should be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coarse {
    /// "rod" or "sphere".
    pub what: &'static str,
    /// Which.
    pub index: usize,
    /// Edge that its elements should have, mm.
    pub wanted_mm: f64,
    /// Edge down to which they were refined, mm.
    pub least_mm: f64,
    /// Longest edge of the smallest given element around it, mm.
    pub given_mm: f64,
}

/// What changed from one mesh to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshChange {
    /// Elements before.
    pub tets: usize,
    /// Relative L2 change of the displacement at the vertices of the given mesh.
    pub displacement: f64,
    /// What that is at the same rate for eight times as many elements, where there were less than eight times: a mesh of a
    /// third more elements changes little of what is still missing. (Forces are mostly missed at the very places that are
    /// made finer, so nothing of the kind is known of them.)
    pub displacement_eightfold: f64,
    /// Largest change of the force of a set of supports (what several hold shared out), a sphere or a rod, over the largest of these forces (or a tenth of what
    /// all vertices bear or of all loads, where a set's forces or the loads balance each other).
    pub force: f64,
    /// Largest change of the moment of a set (that holds nothing that another one holds) or a rod about its middle, over the
    /// largest of these moments (or a quarter of what all vertices bear or of all loads, times the mean distance of its vertices
    /// from there, where these turn against each other).
    pub moment: f64,
    /// The set of supports whose force (what several hold shared out) changed by the largest share of itself, and that share at
    /// its rate to eight times as many elements, in this refinement or in those before as such changes fall; of sets that bear
    /// more than a ten-thousandth of what all vertices do. It is more than [`Self::force`] where forces balance each other in
    /// or between sets.
    pub set: Option<(u32, f64)>,
}

/// What was reached on a finer mesh that was given up.
#[derive(Debug, Clone, PartialEq)]
pub struct Unfinished {
    /// Its elements.
    pub tets: usize,
    /// Force out of balance over the forces that act; infinite when it was not begun or could not be made.
    pub residual: f64,
    /// How many of its elements were turned inside out.
    pub turned: usize,
    /// Why it ended; `None` when only turned elements spoilt it, or when it was refused.
    pub stop: Option<Stop>,
    /// Why it could not be begun.
    pub refused: Option<StaticError>,
}

impl Unfinished {
    /// Of what was found on a finer mesh: nothing where time was up before, an error where it made no problem.
    pub(super) fn of(tets: usize, found: Option<Result<&StaticSolution, StaticError>>) -> Self {
        let none = Self { tets, residual: f64::INFINITY, turned: 0, stop: None, refused: None };
        match found {
            None => Self { stop: Some(Stop::Asked), ..none },
            Some(Err(error)) => Self { refused: Some(error), ..none },
            Some(Ok(f)) => Self { residual: f.residual, turned: f.turned, stop: f.stop, ..none },
        }
    }

    /// Whether the load rather than the solver is to blame: the body folds, flies away or turns inside out in many places. A
    /// few turned elements lie at sharp edges of what is driven.
    pub fn is_collapse(&self) -> bool {
        self.residual.is_finite() && self.stop != Some(Stop::Asked) && self.turned as f64 > COLLAPSED * self.tets as f64
    }
}
