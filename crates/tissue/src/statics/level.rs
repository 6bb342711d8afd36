//! A mesh with its solution, and the way on to finer ones.

use super::refine::Refined;
use super::uncertain;
use super::{Finer, MeshChange, Moment, StaticError, StaticOptions, StaticProblem, StaticSolution, Stop, Unfinished};
use crate::{Model, ModelOptions};
use monro_geometry::{Patient, Point, TetMesh, Vector};

/// Rounds of local refinement.
const ROUNDS: u32 = 2;
/// Elements in the end over those at first, and over those that there may be of even size.
const TIMES: usize = 4;
const BEYOND: f64 = 1.25;
/// Elements that come of one that is marked, its neighbours' among them.
const PIECES: usize = 9;
/// A mesh that grows by less is not worth another solve.
const MORE: f64 = 1.3;
/// A solution out of balance by less than this is nearer to the truth than that of a coarser mesh.
const NEARLY: f64 = 1e-3;

/// Tolerance of where a body goes without its spheres, and the part of all steps and products that may be taken for that.
const SKETCH: f64 = 1e-3;
const SKETCHED: u32 = 10;

/// Errors of linear tetrahedra fall with the number of elements to this power.
const ORDER: f64 = 2.0 / 3.0;
/// Forces of a set that balance each other are counted with this share of what its vertices bear.
const BALANCED: f64 = 0.1;
/// How much a set's own force changed is told where it bears more than this share of what all vertices bear.
const BEARS: f64 = 1e-4;
/// Moments that balance each other likewise, with this share of what the same forces would turn at a set's mean distance.
const TURNING: f64 = 0.25;
/// A body that moves by less than this part of its size everywhere is at rest, and its forces are what rounding leaves.
const AT_REST: f64 = 1e-10;

/// How levels are solved.
pub(super) struct How<'a> {
    pub(super) model: &'a ModelOptions,
    pub(super) options: &'a StaticOptions,
    pub(super) keep_going: &'a mut dyn FnMut() -> bool,
}

/// A refined mesh with its solution.
pub(super) struct Level {
    refined: Refined,
    pub(super) solved: StaticSolution,
}

impl How<'_> {
    fn solve(&mut self, refined: &Refined, start: Option<&[Vector<Patient>]>) -> Result<StaticSolution, StaticError> {
        Model::new(&refined.mesh, self.model)?.solve(&refined.problem, start, self.options, self.keep_going)
    }

    /// Where supports, rods and loads alone take the given mesh, for spheres to meet it there. `None` where they leave it where it
    /// is, and where it comes to no rest without the spheres.
    fn without_spheres(&mut self, given: &Refined) -> Option<Vec<Vector<Patient>>> {
        let problem = &given.problem;
        if problem.contacts.is_empty() || !problem.moves_by_itself() {
            return None;
        }
        let mut alone = given.clone();
        alone.problem.contacts.clear();
        let (steps, products) = (self.options.steps / SKETCHED, self.options.products / SKETCHED);
        let options = StaticOptions { tolerance: SKETCH, steps, products, ..*self.options };
        let mut sketch = How { model: self.model, options: &options, keep_going: &mut *self.keep_going };
        let found = sketch.solve(&alone, None).ok()?;
        found.converged.then_some(found.displacement)
    }
}

impl Level {
    /// The given mesh, refined around tools.
    pub(super) fn first(mesh: &TetMesh, problem: &StaticProblem, how: &mut How<'_>) -> Result<Self, StaticError> {
        let given = Refined::new(mesh, problem);
        let moved = how.without_spheres(&given);
        let refined = given.around_tools(moved.as_deref(), how.keep_going);
        let solved = how.solve(&refined, None)?;
        Ok(Self { refined, solved })
    }

    /// Each element into eight, as often as the options say. Where a sphere rubs only as often as they ask for: its way is gone
    /// again from the start on each mesh, which takes minutes. Elements that turned inside out on one mesh may not on a finer one:
    /// asked for, that is tried, too, from rest.
    pub(super) fn refine_all(&mut self, how: &mut How<'_>) {
        if self.refined.problem.rubs() && matches!(how.options.finer, Finer::UpTo(_)) {
            return;
        }
        let mut times = 0;
        let asked = matches!(how.options.finer, Finer::Times(_));
        let goes_on = |solved: &StaticSolution| solved.converged || (asked && solved.stop.is_none());
        while goes_on(&self.solved) && how.options.finer.go_on(times, self.solved.tets) {
            let given_up = if (how.keep_going)() {
                let finer = self.refined.clone().halved();
                self.go_on(finer, how)
            } else {
                Some(Unfinished::of(8 * self.solved.tets, None))
            };
            if let Some(given_up) = given_up {
                // Asked for, it is missing; as good as it gets, it is what there is, unless finer meshes bear it no more.
                self.solved.converged = !asked && !given_up.is_collapse();
                self.solved.unfinished = Some(given_up);
                return;
            }
            times += 1;
        }
    }

    /// The elements with the largest errors, where there may be `most` of even size. Tools have the elements that they need
    /// already.
    pub(super) fn refine_uncertain(&mut self, most: usize, how: &mut How<'_>) {
        let problem = &self.refined.problem;
        if !(problem.rods.is_empty() && problem.contacts.is_empty()) {
            return;
        }
        let limit = ((TIMES * self.solved.tets) as f64).min(BEYOND * most as f64);
        for round in 1..=ROUNDS {
            let tets = self.solved.tets;
            let aim = tets as f64 * (limit / tets as f64).powf(1.0 / f64::from(ROUNDS + 1 - round));
            if !self.solved.converged || self.solved.unfinished.is_some() || aim < MORE * tets as f64 {
                continue;
            }
            let Some(finer) = self.finer_where_uncertain(aim as usize, how) else { continue };
            self.solved.unfinished = self.go_on(finer, how);
        }
    }

    fn finer_where_uncertain(&self, aim: usize, how: &How<'_>) -> Option<Refined> {
        let stiffness = |label: u16| how.model.materials.get(&label).map_or(1.0, |m| m.young_kpa);
        let mut count = (aim - self.solved.tets) / PIECES;
        while count > 0 {
            let marked = uncertain::worst(&self.refined.mesh, &self.solved.displacement, stiffness, count);
            if !marked.contains(&true) {
                return None;
            }
            let finer = self.refined.clone().halved_where(&marked);
            if finer.mesh.tets.len() <= aim + aim / 20 {
                return Some(finer);
            }
            count /= 2;
        }
        None
    }

    /// Takes the place of this level, if it is solved; else what was reached.
    fn go_on(&mut self, finer: Refined, how: &mut How<'_>) -> Option<Unfinished> {
        let start = self.solved.converged.then(|| finer.prolonged(&self.solved.displacement));
        let found = (how.keep_going)().then(|| how.solve(&finer, start.as_deref()));
        let tets = finer.mesh.tets.len();
        let asked = matches!(how.options.finer, Finer::Times(_));
        match found {
            Some(Ok(solved)) if solved.converged || (asked && is_nearly(&solved)) => {
                let unfinished = (!solved.converged).then(|| Unfinished::of(tets, Some(Ok(&solved))));
                let mut next = Self { refined: finer, solved };
                next.solved.change = Some(self.change(&next));
                *self = next;
                unfinished
            }
            other => Some(Unfinished::of(tets, other.as_ref().map(|found| found.as_ref().map_err(Clone::clone)))),
        }
    }

    fn change(&self, next: &Self) -> MeshChange {
        let given = self.refined.given();
        let (old, new) = (&self.solved.displacement[..given], &next.solved.displacement[..given]);
        let apart: f64 = old.iter().zip(new).map(|(a, b)| (*a - *b).norm_squared()).sum();
        let all: f64 = new.iter().map(|d| d.norm_squared()).sum();
        let (before, forces) = (self.forces(), next.forces());
        let most = |of: &mut dyn Iterator<Item = f64>| of.fold(0.0, f64::max);
        let force_apart = most(&mut before.iter().zip(&forces).map(|(a, b)| (*a - *b).norm()));
        let share = |part: f64, all: f64| if all > 0.0 { part / all } else { 0.0 };
        let mut reach = self.refined.mesh.vertices[..given].iter().map(|p| (*p - Point::ORIGIN).norm());
        let moves = most(&mut old.iter().chain(new).map(|d| d.norm())) > AT_REST * most(&mut reach);
        let force = most(&mut forces.iter().map(|f| f.norm())).max(BALANCED * next.solved.at_work_mn());
        let displacement = share(apart.sqrt(), all.sqrt());
        MeshChange {
            tets: self.solved.tets,
            displacement,
            displacement_eightfold: displacement * eightfold(self.solved.tets, next.solved.tets),
            force: if moves { share(force_apart, force) } else { 0.0 },
            moment: if moves { self.moment_change(next) } else { 0.0 },
            set: self.set_change(next).filter(|_| moves),
        }
    }

    /// The set of supports whose force changed by the largest share of itself, at its rate to eight times as many elements: in
    /// this step, or in those before, as such changes fall. A step that makes little finer tells little of what the one before
    /// it left.
    fn set_change(&self, next: &Self) -> Option<(u32, f64)> {
        let sets = |level: &Self| level.refined.problem.shared_out(&level.solved.reaction);
        let (before, least) = (sets(self), BEARS * next.solved.at_work_mn());
        let bears = sets(next).into_iter().filter(|(_, f)| f.norm() > least);
        let share = |(set, now): (u32, Vector<Patient>)| Some((set, (now - *before.get(&set)?).norm() / now.norm()));
        let rate = eightfold(self.solved.tets, next.solved.tets);
        let now = bears.filter_map(share).map(|(set, share)| (set, share * rate));
        let falls = |c: MeshChange| (c.tets as f64 / self.solved.tets as f64).powf(ORDER);
        let left = self.solved.change.and_then(|c| c.set.map(|(set, share)| (set, share * falls(c))));
        now.chain(left).max_by(|a, b| a.1.total_cmp(&b.1))
    }

    fn moment_change(&self, next: &Self) -> f64 {
        let (before, moments) = (self.moments(), next.moments());
        let pairs = before.iter().zip(&moments).filter_map(|(a, b)| a.zip(*b));
        let apart = pairs.map(|(a, b)| (a.mn_mm - b.mn_mm).norm()).fold(0.0, f64::max);
        let large = |m: &Moment| m.mn_mm.norm().max(TURNING * next.solved.at_work_mn() * m.reach);
        let largest = moments.iter().flatten().map(large).fold(0.0, f64::max);
        if largest > 0.0 { apart / largest } else { 0.0 }
    }

    /// Moments of sets and rods that tell of the answer and not of the mesh.
    fn moments(&self) -> Vec<Option<Moment>> {
        let Self { refined: Refined { mesh, problem, .. }, solved } = self;
        let place = |(p, d): (&Point<Patient>, &Vector<Patient>)| (*p + *d).to_array();
        let there: Vec<[f64; 3]> = mesh.vertices.iter().zip(&solved.displacement).map(place).collect();
        let sets = problem.moments_alone(&solved.reaction, (&there, Point::ORIGIN));
        sets.into_values().map(Some).chain(solved.rod_moments.iter().copied()).collect()
    }

    /// Forces of sets, spheres and rods that tell of the answer and not of the mesh.
    fn forces(&self) -> Vec<Vector<Patient>> {
        let StaticSolution { reaction, contacts, rods, .. } = &self.solved;
        let sets = self.refined.problem.shared_out(reaction);
        sets.into_values().chain(contacts.iter().chain(rods).copied()).collect()
    }

    /// The answer at the vertices of the given mesh.
    pub(super) fn given(self, mesh: &TetMesh, problem: &StaticProblem) -> StaticSolution {
        let Self { refined, mut solved } = self;
        solved.reaction = refined.gathered(solved.reaction);
        solved.displacement.truncate(refined.given());
        solved.first_turned = solved.first_turned.map(|t| refined.part_of(t));
        (solved.coarse, solved.points) = (refined.coarse, Refined::new(mesh, problem).points());
        solved
    }
}

/// Whether a solution that was stopped misses balance by little.
fn is_nearly(solved: &StaticSolution) -> bool {
    solved.stop == Some(Stop::Asked) && solved.residual < NEARLY && solved.turned == 0 && solved.share >= 1.0
}

/// What eight times as many elements change over what these many more do. The error of linear tetrahedra falls with the square
/// of their edges, so with their number to the power of two thirds: of an error e, `count` times as many take away
/// e (1 - count^(-2/3)).
fn eightfold(before: usize, now: usize) -> f64 {
    let taken = |count: f64| 1.0 - count.powf(-ORDER);
    // A hundredth more elements tell nothing of a mesh.
    let count = (now as f64 / before.max(1) as f64).clamp(1.01, 8.0);
    taken(8.0) / taken(count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::block;
    use crate::{CollisionResponse, Material, Mode, PhysicalOptions, SphereContact, Support};
    use monro_geometry::Point;

    /// A clamped plate that gave way 26 % too little changed by 4.3 % from its last mesh, which had 1.28 times the elements of
    /// the one before, and was called converged.
    #[test]
    fn a_small_step_from_mesh_to_mesh_hides_what_is_missing() {
        let error = |tets: usize| (tets as f64).powf(-2.0 / 3.0);
        let change = |now: usize| error(9408) - error(now);
        for now in [10_000, 12_040, 20_000, 75_264] {
            let found = change(now) * eightfold(9408, now);
            assert!((found / change(8 * 9408) - 1.0).abs() < 1e-9, "{now}: {found}");
        }
        assert!((eightfold(75_264, 96_276) * 0.043 - 0.213).abs() < 1e-3);
        assert_eq!((eightfold(100, 6400), eightfold(0, 0) > 1.0), (1.0, true));
    }

    #[test]
    fn a_start_from_a_coarser_mesh_forgot_friction() {
        let mesh = block([4, 4, 2], 5.0);
        let options = ModelOptions {
            mode: Mode::Physical(PhysicalOptions::default()),
            materials: mesh.labels.iter().map(|&l| (l, Material { poisson: 0.3, ..Material::BRAIN })).collect(),
            attachments: Vec::new(),
            collision: CollisionResponse::Insertion,
        };
        let z = |keep: fn(f64, f64) -> f64| mesh.vertices.iter().map(|p| p.z).reduce(keep).expect("vertices");
        let (low, high) = (z(f64::min), z(f64::max));
        let below = (0..mesh.vertices.len()).filter(|&v| mesh.vertices[v].z == low);
        let supports = below.map(|v| Support { node: v as u32, set: 0, displacement_mm: [Some(0.0); 3] }).collect();
        let [x, y] = [mesh.vertices[0].x + 9.0, mesh.vertices[0].y + 10.0];
        let (from, to) = (Point::new(x, y, high + 8.0), Point::new(x + 1.5, y, high + 6.5));
        let contacts = vec![SphereContact { radius_mm: 8.0, friction: 0.3, from, to }];
        let problem = StaticProblem { supports, contacts, ..StaticProblem::default() };
        let (model, ask) = (Model::new(&mesh, &options).expect("model"), StaticOptions::default());
        let way = model.solve(&problem, None, &ask, &mut || true).expect("solved");
        let again = model.solve(&problem, Some(&way.displacement), &ask, &mut || true).expect("solved");
        assert!(way.converged && way.contacts[0].x > 1.0, "{:?}", way.contacts);
        assert!((way.contacts[0] - again.contacts[0]).norm() < 1e-3 * way.contacts[0].norm(), "{:?}", again.contacts);
    }
}
