//! One step through time.
//!
//! A frame is cut into substeps, more of them for a fast tool, so that no tool jumps over an element. Each substep sees to
//! the sphere tree, lists what touches, predicts, solves, and lets membranes yield and anchors slip. After all of them the
//! state is checked at one place: if it is not finite, or elements have turned over, it is taken back and tried again with
//! half the time step.

use crate::abutments::{Against, Place};
use crate::contact::{self, Coupling, Room, Rule, Scene, ToolState};
use crate::csf::FluidSpace;
use crate::fast::{MOST_THREADS, Pool, Row, widest};
use crate::model::Solver;
use crate::nodes::{Nodes, longest_way};
use crate::options::FrameSettings;
use crate::paper::{self, Extent, Inertia, PaperModel, PaperScratch, Predict, WHOLE_EVERY};
use crate::physical::descent::{Body, Descent, DescentScratch};
use crate::physical::rhythm::Substep;
use crate::report::{Event, StepReport, ToolReport};
use crate::sphere_tree::Spheres;
use crate::tool::{Rod, ToolMotion, travel};
use crate::untangle::{CRUSHED, Crushed, unknot, untangle};
use crate::vec3::{V3, dot, norm, scale, sub, xyz};
use crate::volumes::Survey;
use crate::{Csf, Model, State, slabs};
use monro_geometry::{Embedding, Vector};
use std::sync::Arc;

/// A tool moves at most this share of its radius in a substep, and of the finest elements' edges: pressed further in at once,
/// these are crushed, and thrown about by what comes of it.
pub(crate) const STRIDE: f64 = 0.5;
/// No frame is cut finer than this for speed alone; what moves faster than that has been put elsewhere.
pub(crate) const MOST_SUBSTEPS: u32 = 64;
/// How often a frame that ended in numbers that are not finite, or in turned elements, is tried again with half the step.
/// The solver turns most of these back by itself; but where they are finer than the tool, those left after a membrane gave
/// way were thrown further with every frame.
const RETRIES: u32 = 4;
/// and in so many substeps at most.
const MOST_RETRIED: u32 = 4096;
/// Frames that tissue is given to come out of a knot by itself.
const PATIENCE: u32 = 15;
/// Bound points that are moved together.
const POINTS: usize = 1024;
/// Elements that are worth a thread of their own.
const THREAD_TETS: usize = 4000;

/// A part of a step that has just ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Finding what touches.
    Collision,
    /// The solver.
    Deformation,
    /// Checks of the result and the report.
    Check,
}

/// Scratch memory of a running simulation: made once, so that a step does not allocate.
#[derive(Debug, Clone)]
pub struct Stepper {
    /// The model that all of it is for.
    of: u64,
    pub(crate) backup: State,
    pub(crate) previous: Vec<[f32; 4]>,
    pub(crate) spheres: Spheres,
    pub(crate) found: contact::Found,
    pub(crate) couplings: Vec<Coupling>,
    /// What tools take up in physical mode.
    pub(crate) rooms: Vec<Room>,
    pub(crate) tethers: Vec<V3>,
    pub(crate) paper: PaperScratch,
    pub(crate) descent: DescentScratch,
    pub(crate) fluid: FluidSpace,
    /// Weight of fluid that has come in since rest, or left, on its nodes, and what rooms do beside pressing, mN.
    pub(crate) loads: Vec<(u32, V3)>,
    /// For each node the place of the wall that it lies against.
    pub(crate) against: Vec<Place>,
    events: Vec<Event>,
    residual: f32,
    /// Longest way of a node from rest in the state that was measured last, mm.
    farthest: f32,
    /// Share of the tissue in the predicted deformation space.
    space: f64,
    /// Memory for volumes.
    pub(crate) growth: Vec<Row>,
    /// Memory for crushed elements.
    pub(crate) crushed: Crushed,
    pub(crate) nodes: Nodes,
    pool: Arc<Pool>,
}

impl Stepper {
    /// Scratch for a model, with as many threads as there are processors and as the model can use.
    pub fn new(model: &Model) -> Self {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        Self::with_threads(model, processors.min(MOST_THREADS).min(model.tet_count() / THREAD_TETS + 1))
    }

    /// Scratch for a model and so many threads, the caller's among them: they change the time, never the result.
    pub fn with_threads(model: &Model, threads: usize) -> Self {
        Self::with_pool(model, Arc::new(Pool::new(threads)))
    }

    fn with_pool(model: &Model, pool: Arc<Pool>) -> Self {
        Self {
            of: model.id,
            backup: model.rest_state(),
            previous: model.rest.clone(),
            spheres: Spheres::default(),
            found: contact::Found::default(),
            couplings: Vec::new(),
            rooms: Vec::new(),
            tethers: vec![[0.0; 3]; model.tethers.len()],
            paper: PaperScratch::default(),
            descent: DescentScratch::default(),
            fluid: FluidSpace::new(model),
            loads: Vec::new(),
            against: Vec::new(),
            events: Vec::new(),
            residual: 0.0,
            farthest: 0.0,
            space: 1.0,
            growth: Vec::new(),
            crushed: Crushed::default(),
            nodes: Nodes::new(model.rest.len()),
            pool,
        }
    }

    /// Threads that a step works on.
    pub fn threads(&self) -> usize {
        self.pool.threads()
    }

    /// Moves points that are bound to the mesh with its nodes (see [`Model::nodes_into`]), on the threads of a step, which
    /// are still awake right after one. The same bits as [`Embedding::apply`]. No allocation.
    ///
    /// # Panics
    /// When there are fewer nodes than the mesh has, or more places in `out` than points.
    pub fn move_points(&self, points: &Embedding, nodes: &[[f32; 4]], out: &mut [[f32; 4]]) {
        self.pool.each_chunk(out, POINTS, &|first, out| points.apply_from(first, nodes, out));
    }

    /// Advances `state` by one frame during which the tools move as told. Never fails: what goes wrong is taken back,
    /// tried with smaller steps, and reported. The same input gives the same bits, on any number of threads.
    pub fn step(
        &mut self,
        model: &Model,
        state: &mut State,
        tools: &[ToolMotion],
        settings: &FrameSettings,
    ) -> StepReport {
        self.step_observed(model, state, tools, settings, &mut |_| {})
    }

    /// As [`Stepper::step`], telling `done` at the end of each stage of each substep (for timing; this crate has no clock).
    pub fn step_observed(
        &mut self,
        model: &Model,
        state: &mut State,
        tools: &[ToolMotion],
        settings: &FrameSettings,
        done: &mut dyn FnMut(Stage),
    ) -> StepReport {
        let settings = settings.sane();
        self.pool.wake();
        state.tools.resize_with(tools.len(), ToolState::default);
        if self.of != model.id {
            *self = Self::with_pool(model, Arc::clone(&self.pool));
        }
        self.nodes.copy(state, &mut self.backup, &self.pool);
        let jumped = self.put_elsewhere(model, state, tools);
        let Tried { mut survey, failures, substeps } = self.try_step(model, state, tools, &settings, done);
        let mut report = StepReport { substeps, ..StepReport::default() };
        report.rollbacks = failures.iter().filter(|e| matches!(e, Event::RolledBack { .. })).count() as u32;
        // What was measured last may be the state before, or one that was not accepted.
        if failures.contains(&Event::Held) || survey.inverted > 0 {
            survey = self.survey_anew(model, state);
        }
        if self.untie(model, state, &settings) {
            survey = self.survey_anew(model, state);
        }
        report.events = failures;
        report.events.extend(jumped);
        report.events.append(&mut self.events);
        report.inverted = survey.inverted;
        report.volume_change = survey.growth / model.rest_volume;
        self.fill(model, state, tools, &mut report);
        done(Stage::Check);
        report
    }

    /// Goes one step on, in shorter substeps where one leads to a state that is no result; after the last try the state is that
    /// before the step, or has elements turned inside out.
    fn try_step(
        &mut self,
        model: &Model,
        state: &mut State,
        tools: &[ToolMotion],
        settings: &FrameSettings,
        done: &mut dyn FnMut(Stage),
    ) -> Tried {
        let (mut failures, mut substeps) = (Vec::new(), substeps_for(model, settings, tools));
        for attempt in 0..=RETRIES {
            self.events.clear();
            // What a part of the tissue could not do is tried with all of it.
            let predicted_space = settings.predicted_space && attempt == 0;
            let how = FrameSettings { predicted_space, ..*settings };
            self.attempt(model, state, tools, &how, substeps, done);
            let survey = self.survey_and_untangle(model, state);
            let inverted = match self.judge(model, state, survey.inverted) {
                Verdict::Good => return Tried { survey, failures, substeps },
                Verdict::Inverted(_) if attempt == RETRIES => return Tried { survey, failures, substeps },
                Verdict::Inverted(n) => Some(n),
                _ => None,
            };
            failures.push(Event::RolledBack { substeps, inverted });
            state.copy_from(&self.backup);
            if attempt < RETRIES {
                substeps = substeps.saturating_mul(2).min(MOST_RETRIED);
            }
        }
        self.events.clear();
        come_free(model, state);
        // What the failed solution says of forces and motion is nothing that happened.
        self.couplings.clear();
        self.residual = 0.0;
        failures.push(Event::Held);
        Tried { survey: Survey::default(), failures, substeps }
    }

    /// Measures where an attempt ended, after what it turned inside out was drawn straight where that is possible.
    fn survey_and_untangle(&mut self, model: &Model, state: &mut State) -> Survey {
        let survey = match model.solver {
            Solver::Paper(_) => self.survey(model, &state.positions),
            // It has measured where it ended.
            Solver::Physical(_) => model.volumes.measured(&mut self.growth, &self.pool),
        };
        if survey.inverted == 0 {
            return survey;
        }
        let memory = (&mut self.growth[..], &mut self.crushed);
        untangle((&model.volumes, &model.tets[..]), &mut state.positions, memory, &self.pool)
    }

    /// Draws what stays crushed frame after frame, though nothing acts, to where it is at rest; returns whether there is such a
    /// thing. The state has just been measured.
    fn untie(&mut self, model: &Model, state: &mut State, settings: &FrameSettings) -> bool {
        let at_rest = |(p, rest): (&[f32; 4], &[f32; 4])| rest[3] > 0.0 || p == rest;
        // A ventricle that is drained is meant to be crushed.
        let loaded = settings.csf != Csf::AtRest || settings.gravity_mm_s2 != [0.0; 3];
        if loaded || !self.couplings.is_empty() || !state.positions.iter().zip(&model.rest).all(at_rest) {
            state.knotted = 0;
            return false;
        }
        let crushed = &mut self.crushed.list;
        model.volumes.smaller(CRUSHED, 0..model.volumes.rows(), &self.growth, crushed);
        state.knotted = if crushed.is_empty() { 0 } else { state.knotted.saturating_add(1) };
        let Some(late) = state.knotted.checked_sub(PATIENCE) else { return false };
        unknot(crushed, (&model.tets, &model.rest), state, (0.1 * late as f32).min(1.0));
        true
    }

    /// A tool that moves further in a frame than the finest cut allows has not gone there, it has been put there: it lets
    /// go of the tissue and starts anew from its last pose.
    fn put_elsewhere(&mut self, model: &Model, state: &mut State, tools: &[ToolMotion]) -> Vec<Event> {
        let mut events = Vec::new();
        for (tool, motion) in tools.iter().enumerate() {
            if is_put(motion) {
                if let Some(region) = core::mem::take(&mut state.tools[tool]).inside {
                    let from = model.regions[region as usize].label;
                    events.push(Event::Withdrawn { tool, from, to: None });
                }
                self.backup.tools[tool] = ToolState::default();
            }
        }
        events
    }

    fn attempt(
        &mut self,
        model: &Model,
        state: &mut State,
        tools: &[ToolMotion],
        settings: &FrameSettings,
        substeps: u32,
        done: &mut dyn FnMut(Stage),
    ) {
        let dt = settings.dt_s / f64::from(substeps);
        for i in 0..substeps {
            let share = f64::from(i + 1) / f64::from(substeps);
            self.substep(model, state, tools, settings, (dt, share), done);
        }
    }

    fn substep(
        &mut self,
        model: &Model,
        state: &mut State,
        tools: &[ToolMotion],
        settings: &FrameSettings,
        (dt, share): (f64, f64),
        done: &mut dyn FnMut(Stage),
    ) {
        if !tools.is_empty() {
            model.tree.follow(&mut self.spheres, &state.positions, &self.pool);
        }
        self.touch(model, state, tools, share);
        done(Stage::Collision);
        model.abutments.follow(&state.positions, &model.rest, &mut self.against);
        self.previous.resize(state.positions.len(), [0.0; 4]);
        match &model.solver {
            Solver::Paper(solver) => {
                self.predict(solver, state, settings, dt);
                self.relax(solver, model, state, settings, dt as f32);
            }
            Solver::Physical(solver) => self.descend(&solver.descent, model, state, settings, dt as f32),
        }
        let ways = (&state.positions[..], &self.previous[..]);
        self.nodes.set_velocities(ways, &mut state.velocities, dt as f32, &self.pool);
        model.abutments.slow(&mut state.velocities, dt as f32);
        for (tool, motion) in tools.iter().enumerate() {
            let Some(rod) = pose(model, motion, share) else { continue };
            let memory = &mut state.tools[tool];
            contact::settle(
                model,
                &state.positions,
                (tool, &rod, dt as f32),
                memory,
                &mut self.couplings,
                &mut self.events,
            );
        }
        state.time_s += dt;
        done(Stage::Deformation);
    }

    /// Lists what touches or is held.
    fn touch(&mut self, model: &Model, state: &mut State, tools: &[ToolMotion], share: f64) {
        self.couplings.clear();
        self.rooms.clear();
        for (tool, motion) in tools.iter().enumerate() {
            let Some(rod) = pose(model, motion, share) else {
                if !self.events.contains(&Event::BadPose { tool }) {
                    self.events.push(Event::BadPose { tool });
                }
                continue;
            };
            let way = (motion.to.tip - motion.from.tip).to_array().map(|v| v as f32);
            let mut memory = core::mem::take(&mut state.tools[tool]);
            contact::prepare(
                Scene { model, state, spheres: &self.spheres },
                (tool, &rod, way),
                &mut memory,
                &mut self.found,
                &mut self.couplings,
                &mut self.events,
            );
            if model.forces_are_physical() {
                contact::take_up(model, &rod, &memory.anchors, &mut self.rooms);
            }
            state.tools[tool] = memory;
        }
    }

    /// Physical mode: one implicit Euler step.
    fn descend(&mut self, solver: &Descent, model: &Model, state: &mut State, settings: &FrameSettings, dt: f32) {
        state.csf_kpa = self.fluid.pressure_kpa(model, state, settings.csf, dt.into());
        let fluid = self.fluid.under(state.csf_kpa, settings.gravity_mm_s2);
        self.loads.clear();
        self.fluid.add_weight(model, &state.positions, &fluid, |node, weight| self.loads.push((node, weight)));
        let loads = &mut self.loads;
        self.rooms.iter().for_each(|r| r.add_forces(model, &state.positions, |node, force| loads.push((node, force))));
        let mut body = Body {
            fluid,
            loads: &self.loads,
            positions: &mut state.positions,
            previous: &mut self.previous,
            velocities: &state.velocities,
            pressure: &mut state.pressure,
            growth: &mut self.growth,
            rest: &model.rest,
            volumes: &model.volumes,
            region: &model.region,
            tethers: &model.tethers,
            couplings: &mut self.couplings,
            rooms: &self.rooms,
            against: Against { abutments: &model.abutments, at: &self.against },
        };
        let gravity = settings.gravity_mm_s2.map(|g| g as f32);
        let (iterations, predicted_space) = (settings.iterations, settings.predicted_space);
        let step = Substep { dt, iterations, gravity, predicted_space };
        self.residual = solver.advance(&mut body, &mut self.descent, step, &self.pool);
    }

    /// Paper mode: equations (1) and (2), the latter with the time step multiplied, not added.
    fn predict(&mut self, solver: &PaperModel, state: &mut State, settings: &FrameSettings, dt: f64) {
        let kept = paper::kept_motion(&state.positions, &state.velocities);
        let inertia = Inertia {
            kept: kept.as_ref(),
            damping: (1.0 - (1.0 - solver.damping).powf(dt)) as f32,
            kick: settings.gravity_mm_s2.map(|g| (g * dt) as f32),
            dt: dt as f32,
        };
        let cuts = self.nodes.cuts();
        let mut slots = slabs::split_both((&mut state.velocities, &mut self.previous), cuts);
        self.pool.each_part(&mut state.positions, cuts, &mut slots, &|_, positions, (velocities, previous)| {
            previous.copy_from_slice(positions);
            widest(Predict { inertia, positions, velocities });
        });
    }

    /// Paper mode: constraints in Gauss-Seidel order, as often as asked.
    fn relax(&mut self, solver: &PaperModel, model: &Model, state: &mut State, settings: &FrameSettings, dt: f32) {
        solver.correct(&mut self.paper, settings.iterations);
        self.space = 1.0;
        self.tethers.fill([0.0; 3]);
        let mut k = 0;
        while k < settings.iterations {
            let end = self.run(solver, model, settings, k);
            let of_sweep = |i: usize| extent(settings, k + i as u32);
            let run = ((end - k) as usize, &of_sweep as &(dyn Fn(usize) -> Extent + Sync));
            solver.iterate(&mut state.positions, &mut self.paper, run, &self.pool);
            if settings.predicted_space && extent(settings, end - 1) == Extent::Measured {
                self.space = self.paper.predict_space(k == 0);
            }
            self.pull_tethers(model, &mut state.positions, dt);
            self.put_back_guided(model, &mut state.positions);
            model.abutments.put_back(&self.against, &model.rest, &mut state.positions);
            contact::project(&mut self.couplings, &mut state.positions, dt);
            k = end;
        }
        self.residual = self.paper.residual();
    }

    /// Where the iterations from number `k` on end between which nothing else is done.
    fn run(&self, solver: &PaperModel, model: &Model, settings: &FrameSettings, k: u32) -> u32 {
        let held = model.tethers.len() + model.guides.len() + model.abutments.len();
        let alone = self.couplings.is_empty() && held == 0;
        let ends = |k: &u32| !alone || solver.ends_iterations() || extent(settings, *k) == Extent::Measured;
        (k..settings.iterations).find(ends).map_or(settings.iterations, |last| last + 1)
    }

    /// What does not move of a guided node is where it was at the start of the step.
    fn put_back_guided(&self, model: &Model, positions: &mut [[f32; 4]]) {
        for guide in &model.guides {
            let n = guide.node as usize;
            (0..3).filter(|&a| guide.held[a]).for_each(|a| positions[n][a] = self.previous[n][a]);
        }
    }

    /// Springs to the rest positions, as compliant constraints.
    fn pull_tethers(&mut self, model: &Model, positions: &mut [[f32; 4]], dt: f32) {
        for (tether, force) in model.tethers.iter().zip(&mut self.tethers) {
            let p = &mut positions[tether.node as usize];
            let gap = sub(xyz(model.rest[tether.node as usize]), xyz(*p));
            let denominator = p[3] * dt * dt * tether.stiffness + 1.0;
            if denominator > 1.0 {
                let change = scale(sub(scale(gap, tether.stiffness), *force), 1.0 / denominator);
                crate::vec3::shift(p, p[3] * dt * dt, change);
                *force = crate::vec3::add(*force, change);
            }
        }
    }

    fn fill(&self, model: &Model, state: &State, tools: &[ToolMotion], report: &mut StepReport) {
        report.max_displacement_mm = f64::from(self.farthest);
        report.residual_mm = self.residual.into();
        report.csf_kpa = state.csf_kpa;
        // The state has just been surveyed.
        report.csf_change_ml = self.fluid.grown_ml(&self.growth);
        let free = state.positions.iter().filter(|p| p[3] > 0.0).count();
        report.active_nodes = match model.solver {
            Solver::Paper(_) => (self.space * free as f64).round() as usize,
            Solver::Physical(_) => self.descent.active_nodes().min(free),
        };
        report.contacts =
            self.couplings.iter().filter(|c| matches!(c.rule, Rule::Push { .. }) && norm(c.force) > 0.0).count();
        report.tools = tools.iter().enumerate().map(|(i, m)| self.felt(model, state, i, m)).collect();
    }

    fn survey(&mut self, model: &Model, positions: &[[f32; 4]]) -> Survey {
        model.volumes.survey(positions, &mut self.growth, &self.pool)
    }

    /// Measures a state that is not the one that was judged last.
    fn survey_anew(&mut self, model: &Model, state: &State) -> Survey {
        self.farthest = longest_way(&state.positions, &model.rest);
        self.survey(model, &state.positions)
    }

    /// The one place where a state is accepted.
    fn judge(&mut self, model: &Model, state: &State, inverted: usize) -> Verdict {
        // Tissue thrown across the whole model within a frame is as bad as no number.
        let states = (state, &self.backup, &model.rest[..]);
        let (farthest, sane) = self.nodes.look(states, 3.0 * model.reach, &self.pool);
        self.farthest = farthest;
        if !sane {
            return Verdict::NotFinite;
        }
        // Elements that were turned already are left to the solver to turn back.
        let turned_before =
            |s: &mut Self| model.volumes.survey(&s.backup.positions, &mut s.growth, &s.pool).inverted > 0;
        if inverted > 0 && !turned_before(self) { Verdict::Inverted(inverted) } else { Verdict::Good }
    }

    /// What one tool felt in the last substep.
    fn felt(&self, model: &Model, state: &State, tool: usize, motion: &ToolMotion) -> ToolReport {
        let on_tissue = self.couplings.iter().filter(|c| c.tool as usize == tool);
        let force: V3 = on_tissue.fold([0.0; 3], |s, c| sub(s, c.force));
        let back = Rod::between(motion, model.origin, 1.0).map_or([0.0; 3], |r| r.back);
        let memory = &state.tools[tool];
        let inserted = memory.anchors.last().map_or(0.0, |a| f64::from(a.arc.max(0.0)));
        ToolReport {
            force_mn: Vector::from_array(force.map(f64::from)),
            axial_force_mn: dot(force, back).into(),
            label: memory.inside.filter(|_| !memory.beyond).map(|r| model.regions[r as usize].label),
            inserted_mm: inserted,
            dimpling: memory.press.is_some(),
        }
    }
}

/// Brings tissue that no step can move on to a stop, and a tenth of the way to its rest shape.
fn come_free(model: &Model, state: &mut State) {
    state.velocities.fill([0.0; 4]);
    for (p, rest) in state.positions.iter_mut().zip(&model.rest).filter(|(p, _)| p[3] > 0.0) {
        (0..3).for_each(|a| p[a] += 0.1 * (rest[a] - p[a]));
    }
}

/// What iteration `k` goes through: with a predicted space, every third one all.
fn extent(settings: &FrameSettings, k: u32) -> Extent {
    let last = k + 1 == settings.iterations;
    match settings.predicted_space {
        false if last => Extent::Measured,
        false => Extent::Whole,
        true if last || k.is_multiple_of(WHOLE_EVERY) => Extent::Measured,
        true => Extent::Predicted,
    }
}

fn substeps_for(model: &Model, settings: &FrameSettings, tools: &[ToolMotion]) -> u32 {
    let gone = tools.iter().filter(|m| !is_put(m));
    let cuts = |m: &ToolMotion| strides(m).max(travel(m) / (STRIDE * model.fine_edge)).ceil() as u32;
    gone.map(cuts).max().unwrap_or(1).min(MOST_SUBSTEPS).max(settings.substeps)
}

/// Whether a tool has not gone where it is but has been put there.
fn is_put(motion: &ToolMotion) -> bool {
    strides(motion) > f64::from(MOST_SUBSTEPS)
}

/// Length of a motion in units of the longest stride.
fn strides(motion: &ToolMotion) -> f64 {
    let stride = STRIDE * motion.tool.radius_mm;
    if stride > 0.0 { travel(motion) / stride } else { 0.0 }
}

/// The rod a share of the way through the frame; at once at the end when it has been put there.
fn pose(model: &Model, motion: &ToolMotion, share: f64) -> Option<Rod> {
    Rod::between(motion, model.origin, if is_put(motion) { 1.0 } else { share })
}

/// What came of a step's attempts.
struct Tried {
    survey: Survey,
    /// Attempts that were taken back, and that the tissue was held where none was left.
    failures: Vec<Event>,
    /// Of the last attempt.
    substeps: u32,
}

enum Verdict {
    Good,
    NotFinite,
    Inverted(usize),
}
