//! Vertex block descent with nodal pressures, in single precision.

use super::differences::{DifferenceRows, Differences};
use super::drift::Drift;
use super::elastic::Elastic;
use super::film::FilmsAround;
use super::near::Near;
use super::pressure::{self, Foreign, Pressures, Still, Taken, Tissue, Which};
use super::region;
use super::rhythm::{Press, Substep, calm_beyond};
use super::rings::{self, Part};
use super::streams::{Streams, Visits};
use super::sweep::{Memory, Pace, Substep as Shared, Sweep, Task};
use super::touch::{Touches, Touching, penalty_force};
use super::waves::{WaveScratch, Waves};
use crate::abutments::Against;
use crate::bytes;
use crate::contact::{Coupling, Room};
use crate::csf::FluidPressure;
use crate::fast::{Plans, Pool, Row, Turn, WIDTH, widest};
use crate::model::{Region, Tether};
use crate::nodes::Apart;
use crate::rigid::Rigid;
use crate::slabs::{self, Round, Slabs};
use crate::vec3::{V3, larger, shift, sub, xyz};
use crate::volumes::{Volumes, regular_edge};
use core::ops::Range;

/// Tissue is calm that goes less than this share of an element's edge in the first sweep; else all pressures follow as often
/// as near what moves fast.
const CALM: f64 = 1e-3;
/// Constants of the sweeps.
#[derive(Debug, Clone)]
pub(crate) struct Descent {
    /// Two rounds of parts that can be done at the same time.
    rounds: [(Round, Vec<Part>); 2],
    plans: Plans,
    visits: Visits,
    far: DifferenceRows,
    node_cuts: Vec<usize>,
    pressures: Pressures,
    waves: Waves,
    films: FilmsAround,
    /// Largest coordinate at rest, mm.
    reach: f32,
    /// Mean way of the vertices in a sweep below which the tissue is calm, mm.
    calm_mm: f64,
    /// How many times as far as their minimum vertices go in calm tissue.
    calm_beyond: f32,
    /// Vertices that move.
    free_vertices: usize,
    /// Largest damping time of the regions, s.
    pub(crate) damping_s: f32,
}

/// What a substep needs beside the constants.
#[derive(Debug, Clone, Default)]
pub(crate) struct DescentScratch {
    /// Predicted position, mm.
    target: Vec<[f32; 4]>,
    /// Correction of the shear force by averaging, constant during a substep, mN.
    far: Vec<[f32; 4]>,
    /// Displacement from rest at the start of the substep, mm.
    displacement: Vec<[f32; 4]>,
    /// Derivative of each element by six times its volume at no volume, with the current pressure (kPa/6), and 0 once more.
    slopes: Vec<f32>,
    streams: Streams,
    /// Elements without pressure.
    still: Still,
    /// Pressure of each patch, penalty included, kPa.
    total: Vec<f32>,
    waves: WaveScratch,
    memory: [Vec<Memory>; 2],
    touches: Touches,
    /// What tools take up of the patches around them.
    room: Taken,
    near: Near,
    /// How far sweeps go in tissue that is calm, as found in the first one.
    calm: Option<f32>,
    /// Vertices in the predicted space last chosen.
    active_nodes: usize,
}

/// What a pass is for; one that moves nothing asks for the region of each element.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Purpose<'a> {
    Move,
    Note(&'a [u8]),
    Balance(&'a [u8]),
}

/// Passes one after the other.
struct Passes<'a> {
    purpose: Purpose<'a>,
    count: usize,
    /// Damping time over the time step, and one over the square of the time step.
    damping: f32,
    inertia: f32,
    /// What each of them is like.
    pace: &'a (dyn Fn(usize) -> Pace + Sync),
}

impl<'a> Passes<'a> {
    /// A pass that moves nothing.
    const fn once(purpose: Purpose<'a>, damping: f32) -> Self {
        Self {
            purpose,
            count: 1,
            damping,
            inertia: 0.0,
            pace: &|_| Pace { beyond: 1.0, only_active: false, tells: false },
        }
    }
}

/// A state to be advanced.
pub(crate) struct Body<'a> {
    /// Pressure of the fluid above that at rest.
    pub(crate) fluid: FluidPressure,
    /// Forces on single vertices beside gravity, mN.
    pub(crate) loads: &'a [(u32, V3)],
    pub(crate) positions: &'a mut [[f32; 4]],
    /// Where they were at the start of the substep: set by it.
    pub(crate) previous: &'a mut [[f32; 4]],
    pub(crate) velocities: &'a [[f32; 4]],
    pub(crate) pressure: &'a mut [f32],
    /// Six times the growth of each element, mm3, at the end.
    pub(crate) growth: &'a mut Vec<Row>,
    pub(crate) rest: &'a [[f32; 4]],
    pub(crate) volumes: &'a Volumes,
    /// Region of each element.
    pub(crate) region: &'a [u8],
    pub(crate) tethers: &'a [Tether],
    pub(crate) couplings: &'a mut [Coupling],
    /// What tools take up.
    pub(crate) rooms: &'a [Room],
    pub(crate) against: Against<'a>,
}

impl<'a> Body<'a> {
    fn tissue(&self) -> Tissue<'a> {
        Tissue { volumes: self.volumes, region: self.region }
    }
}

impl Descent {
    pub(crate) fn new(
        elastic: &Elastic,
        rest: &[[f32; 4]],
        mass: &[f32],
        (region, regions): (&[u8], &[Region]),
        slabs: &Slabs,
    ) -> Self {
        let free_vertices = rest.iter().filter(|p| p[3] > 0.0).count();
        let rounds = rings::rounds(elastic, (rest, region), mass, slabs);
        let node_cuts = slabs::even_cuts(rest.len());
        let [even, odd] = rounds.each_ref().map(|r| r.1.iter().map(|p| p.weight.len()).collect::<Vec<_>>());
        Self {
            visits: Visits::new(&rounds, elastic.tets.len()),
            rounds,
            plans: Plans::new([&even, &odd]),
            far: DifferenceRows::new(&elastic.far, &node_cuts),
            node_cuts,
            pressures: Pressures::new(elastic, (region, regions)),
            waves: Waves::new(elastic, &pressure::carried(elastic, (region, regions)), rest, regions),
            films: FilmsAround::new(&elastic.films, rest),
            reach: rest.iter().flat_map(|p| &p[..3]).fold(0f32, |m, v| m.max(v.abs())),
            calm_mm: CALM * mean_edge(&elastic.volume),
            calm_beyond: calm_beyond(free_vertices),
            free_vertices,
            damping_s: region.iter().map(|&r| regions[r as usize].material.damping_s as f32).fold(0.0, f32::max),
        }
    }

    /// Unknowns and elements of a sweep.
    pub(crate) fn counts(&self) -> Vec<(&'static str, usize)> {
        vec![
            ("elements", self.pressures.elements()),
            ("free_vertices", self.free_vertices),
            ("pressures", self.patches()),
        ]
    }

    /// Bytes that they take, by what they are for.
    pub(crate) fn bytes(&self) -> Vec<bytes::Held> {
        vec![
            (
                "elements around vertices",
                self.rounds.iter().flat_map(|r| &r.1).map(Part::bytes).sum::<usize>() + self.visits.bytes(),
            ),
            ("averaged shear", self.far.bytes()),
            ("pressures", self.pressures.bytes() + self.waves.bytes()),
            ("thin membranes", self.films.bytes()),
        ]
    }

    /// Number of nodal pressures.
    pub(crate) fn patches(&self) -> usize {
        self.pressures.len()
    }

    /// Advances the positions by one substep; returns the largest motion of a vertex in the last sweep, mm.
    pub(crate) fn advance(&self, body: &mut Body<'_>, scratch: &mut DescentScratch, step: Substep, pool: &Pool) -> f32 {
        self.begin(body, scratch, step, pool);
        let mut k = 0;
        while k < step.iterations {
            let end = step.run(k, scratch.calm);
            self.sweeps(body, scratch, step, k..end, pool);
            if step.chooses(end - 1, scratch.calm) {
                self.choose(body, scratch, (end == 1, step.predicted_space));
            }
            if let Some(when) = step.press(end - 1, scratch.calm) {
                self.press(body, scratch, (when, step), pool);
            }
            k = end;
        }
        let level = self.waves.asked(step.dt, step.fewest_steps());
        if level {
            let pressures = (&mut *body.pressure, &scratch.total[..]);
            self.waves.level(step.dt, body.positions, pressures, (&mut scratch.waves, pool));
        }
        let alone = body.couplings.is_empty() && body.tethers.is_empty() && !body.against.abutments.any();
        let free = alone && self.free_vertices == body.positions.len();
        if free {
            keep_momentum(body.positions, &scratch.target);
        }
        if level || free {
            body.volumes.measure(body.positions, body.growth, pool);
        }
        for c in body.couplings.iter_mut() {
            c.force = penalty_force(c, c.point(body.positions));
        }
        self.largest_motion(&scratch.memory)
    }

    /// Of the vertices in the last sweep that they had, mm.
    fn largest_motion(&self, memory: &[Vec<Memory>; 2]) -> f32 {
        let batches = self.rounds.iter().flat_map(|r| &r.1).flat_map(|p| &p.batches);
        let motions = batches.zip(memory.iter().flatten().flat_map(|m| &m.motion));
        let most = motions.fold([0f32; WIDTH], |most, (batch, row)| {
            core::array::from_fn(|l| if l < batch.count { larger(most[l], row[l]) } else { most[l] })
        });
        most.into_iter().fold(0.0, larger).sqrt()
    }

    /// Inertial target, lagged terms and the lists of what acts on single vertices.
    fn begin(&self, body: &mut Body<'_>, scratch: &mut DescentScratch, step: Substep, pool: &Pool) {
        for (memory, (_, parts)) in scratch.memory.iter_mut().zip(&self.rounds) {
            memory.resize_with(parts.len(), Memory::default);
        }
        scratch.touches.list(body.couplings, body.tethers, body.positions.len());
        self.pressures.list_room(body.rooms, body.tissue(), &mut scratch.room);
        scratch.target.resize(body.positions.len(), [0.0; 4]);
        scratch.active_nodes = body.positions.len();
        let damping = damping_ratio(self.damping_s, step.dt);
        if self.pressures.still(body.tissue(), damping, &mut scratch.still, pool) {
            self.balance(body, scratch, damping, pool);
        }
        self.average_shear(body, scratch, pool);
        self.note(body, scratch, damping, pool);
        self.predict(body, &mut scratch.target, step, pool);
        self.press(body, scratch, (Press::Begin, step), pool);
    }

    /// Chooses the predicted space, if there is to be one, from the last sweep, and `anew`, at the start of a substep, what
    /// is near.
    fn choose(&self, body: &Body<'_>, scratch: &mut DescentScratch, (anew, predicted_space): (bool, bool)) {
        let DescentScratch { memory, touches, near, calm, active_nodes, .. } = scratch;
        let (couplings, rest) = (&*body.couplings, body.rest);
        let touching = Touching { touches, films: &self.films, against: body.against, couplings, rest, first: 0 };
        let mean = region::mean_way(memory, self.free_vertices);
        if anew {
            *calm = (mean < self.calm_mm).then_some(self.calm_beyond);
            self.choose_near(near, (memory, touching), body.tissue(), calm.map(|_| mean));
        }
        if predicted_space {
            *active_nodes = region::predict(&self.rounds, memory, (touching, near), (anew, mean, self.reach));
        }
    }

    /// Chooses what is near, given the mean way of all vertices, mm; nothing is without one.
    fn choose_near(
        &self,
        near: &mut Near,
        (memory, touching): (&[Vec<Memory>; 2], Touching<'_>),
        tissue: Tissue<'_>,
        mean: Option<f64>,
    ) {
        self.pressures.clear_near(near);
        if let Some(mean) = mean {
            near.choose(&self.rounds, memory, touching, (mean, self.pressures.elements()));
            self.pressures.complete_near(tissue, near);
        }
    }

    /// Makes pressures follow the positions.
    fn press(&self, body: &mut Body<'_>, scratch: &mut DescentScratch, (when, step): (Press, Substep), pool: &Pool) {
        let DescentScratch { slopes, streams, still, total, near, room, calm, .. } = scratch;
        let which = match when {
            Press::Near => Which::Near(near),
            _ => Which::All { advance: when != Press::Begin },
        };
        let (tissue, numbers) = (body.tissue(), (&mut *body.pressure, &mut *body.growth));
        let elements = (when != Press::End).then_some((&*still, &mut *slopes));
        let foreign = Foreign { fluid: &body.fluid, room: &room.list };
        let steps = if when == Press::Near { step.iterations / 2 } else { step.steps(*calm) };
        let (share, all) = (self.waves.share(step.dt, steps), (which, foreign, pool));
        self.pressures.update((tissue, body.positions), numbers, elements, total, share, all);
        match when {
            Press::Near => streams.put(&self.visits, near.elements(), slopes),
            Press::End => {}
            Press::Begin | Press::Between => streams.lay_slopes((&self.rounds, &self.visits), slopes, pool),
        }
    }

    /// Moves on by inertia, and sets where loads would take each vertex.
    fn predict(&self, body: &mut Body<'_>, target: &mut [[f32; 4]], step: Substep, pool: &Pool) {
        let (velocities, fall) = (body.velocities, step.gravity.map(|g| step.dt * step.dt * g));
        let cuts = &self.node_cuts;
        let mut slots = slabs::split_both((target, body.previous), cuts);
        pool.each_part(body.positions, cuts, &mut slots, &|i, positions, (targets, previous)| {
            previous.copy_from_slice(positions);
            widest(Drift { positions, velocities: &velocities[cuts[i]..cuts[i + 1]], targets, dt: step.dt, fall });
        });
        for &(vertex, force) in body.loads {
            let (target, inverse_mass) = (&mut target[vertex as usize], body.positions[vertex as usize][3]);
            shift(target, step.dt * step.dt * inverse_mass, force);
        }
    }

    /// Lays out what does not change with the positions, and notes how it is at rest, so that all forces cancel there to the last bit: for each damping anew, as sums are rounded otherwise.
    fn balance(&self, body: &Body<'_>, scratch: &mut DescentScratch, damping: f32, pool: &Pool) {
        let DescentScratch { still, streams, far, .. } = scratch;
        let parts = (&self.rounds, &self.visits);
        streams.lay_slopes(parts, &still.slopes(), pool);
        streams.lay_rises(parts, &self.pressures.rises(body.tissue(), still), pool);
        far.clear();
        far.resize(body.rest.len(), [0.0; 4]);
        self.pass(
            &mut body.rest.to_vec(),
            (body.rest, &[], body.against),
            scratch,
            Passes::once(Purpose::Balance(body.region), damping),
            pool,
        );
    }

    /// Notes what resists motion from the positions on, and all else that stays as it is.
    fn note(&self, body: &mut Body<'_>, scratch: &mut DescentScratch, damping: f32, pool: &Pool) {
        let around = (body.rest, &*body.couplings, body.against);
        self.pass(body.positions, around, scratch, Passes::once(Purpose::Note(body.region), damping), pool);
    }

    /// Sweeps over the free vertices, one after the other.
    fn sweeps(
        &self,
        body: &mut Body<'_>,
        scratch: &mut DescentScratch,
        step: Substep,
        sweeps: Range<u32>,
        pool: &Pool,
    ) {
        let calm = scratch.calm;
        let pace = |i: usize| step.pace(sweeps.start + i as u32, calm);
        let passes = Passes {
            purpose: Purpose::Move,
            count: sweeps.len(),
            damping: damping_ratio(self.damping_s, step.dt),
            inertia: 1.0 / (step.dt * step.dt),
            pace: &pace,
        };
        self.pass(body.positions, (body.rest, body.couplings, body.against), scratch, passes, pool);
    }

    /// Passes over the free vertices, with the vertices at rest, what touches them and what they lie against.
    fn pass(
        &self,
        positions: &mut [[f32; 4]],
        (rest, couplings, against): (&[[f32; 4]], &[Coupling], Against<'_>),
        scratch: &mut DescentScratch,
        Passes { purpose, count, damping, inertia, pace }: Passes<'_>,
        pool: &Pool,
    ) {
        let DescentScratch { target, far, streams, still, memory, touches, .. } = scratch;
        let task = match purpose {
            Purpose::Move => Task::Move,
            Purpose::Note(region) => Task::Note((&still.damped, region)),
            Purpose::Balance(region) => Task::Balance((&still.damped, region)),
        };
        let films = &self.films;
        let [even, odd] = memory;
        let rounds = [&self.rounds[0].0, &self.rounds[1].0];
        let how = (&self.plans, rounds.map(|r| &r.cuts[..]));
        pool.sweeps(how, count, positions, [even, odd], &|Turn { sweep, round, part: i }, vertices, memory| {
            let own = rounds[round].cuts[i]..rounds[round].cuts[i + 1];
            let touching = Touching { touches, films, against, couplings, rest, first: own.start };
            let (target, far) = (&target[own.clone()], &far[own]);
            let stream = streams.part(&self.visits, round * self.rounds[0].1.len() + i);
            let substep = Shared { stream, target, far, damping, inertia, pace: pace(sweep), touching };
            widest(Sweep { part: &self.rounds[round].1[i], substep, vertices, memory, task });
        });
    }

    /// The concave part of the shear energy, linearised at the start of the substep: a bound from above, so descent on it
    /// is descent on the energy.
    fn average_shear(&self, body: &Body<'_>, scratch: &mut DescentScratch, pool: &Pool) {
        scratch.far.resize(body.positions.len(), [0.0; 4]);
        if self.far.is_empty() {
            return;
        }
        scratch.displacement.resize(body.positions.len(), [0.0; 4]);
        widest(Apart { positions: body.positions, from: body.rest, times: 1.0, out: &mut scratch.displacement });
        let displacement = &scratch.displacement;
        pool.each_part(&mut scratch.far, &self.node_cuts, &mut [(); slabs::PIECES], &|i, far, ()| {
            widest(Differences { rows: &self.far, of: displacement, piece: i, first: self.node_cuts[i], out: far });
        });
    }
}

/// Takes off what the sweeps did to the motion of the whole: forces within a body neither push nor turn it, so with nothing
/// else that acts it is where its inertia and its loads took it. Vertex after vertex goes to its minimum, which keeps this
/// only in the limit, and slowly: no elastic force helps.
fn keep_momentum(positions: &mut [[f32; 4]], target: &[[f32; 4]]) {
    if let Some(rigid) = Rigid::of(positions, |i| sub(xyz(target[i]), xyz(positions[i]))) {
        positions.iter_mut().for_each(|p| shift(p, 1.0, rigid.at(xyz(*p))));
    }
}

impl DescentScratch {
    /// Bytes that it takes.
    pub(crate) fn bytes(&self) -> usize {
        let nodes = bytes::of(&self.target) + bytes::of(&self.far) + bytes::of(&self.displacement);
        let elements = bytes::of(&self.slopes)
            + self.streams.bytes()
            + self.still.bytes()
            + bytes::of(&self.total)
            + self.waves.bytes();
        let memory = |m: &Memory| {
            let noted = bytes::of(&m.steady) + bytes::of(&m.rest) + bytes::of(&m.motion) + bytes::of(&m.way);
            noted + m.space.bytes()
        };
        nodes
            + elements
            + self.near.bytes()
            + self.touches.bytes()
            + self.room.bytes()
            + self.memory.iter().flatten().map(memory).sum::<usize>()
    }

    /// Vertices in the predicted space of the last substep.
    pub(crate) fn active_nodes(&self) -> usize {
        self.active_nodes
    }
}

/// Edge of a regular tetrahedron of the mean volume, mm.
fn mean_edge(volumes: &[f64]) -> f64 {
    regular_edge(volumes.iter().sum::<f64>() / volumes.len().max(1) as f64)
}

/// Damping time over time step. Implicit Euler damps like one time step by itself, and that is taken off.
fn damping_ratio(damping_s: f32, dt: f32) -> f32 {
    (damping_s / dt - 1.0).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Solver;
    use crate::model::tests::block;
    use crate::{CollisionResponse, Material, Mode, Model, ModelOptions, PhysicalOptions};
    use std::collections::BTreeMap;

    /// What pressures have come to: of patches, with the penalty, and of elements.
    type Pressed = (Vec<f32>, Vec<f32>, Vec<f32>);

    /// Two regions that meet; those of the second have the further patches, which take steps.
    fn model() -> Model {
        let mut mesh = block([6, 4, 3], 5.0);
        let far = |t: &[u32; 4]| t.iter().all(|&v| mesh.vertices[v as usize].x > 14.0);
        mesh.labels = mesh.tets.iter().map(|t| if far(t) { 5 } else { 4 }).collect();
        let options = ModelOptions {
            mode: Mode::Physical(PhysicalOptions::default()),
            materials: BTreeMap::from([(4, Material::VENTRICLE), (5, Material::BRAIN)]),
            attachments: Vec::new(),
            collision: CollisionResponse::Insertion,
        };
        Model::new(&mesh, &options).expect("model")
    }

    /// Makes pressures follow after a few vertices have moved fast and the others by about `drift`, mm.
    fn followed(model: &Model, few: impl Fn(u32) -> bool, drift: f32, when: Option<Press>) -> Pressed {
        let Solver::Physical(physical) = &model.solver else { panic!("physical mode was asked for") };
        let (descent, pool) = (&physical.descent, Pool::new(2));
        let (mut state, mut scratch, mut growth) = (model.rest_state(), DescentScratch::default(), Vec::new());
        let mut body = Body {
            loads: &[],
            fluid: FluidPressure { kpa: 0.7, rise: [0.0, 0.01, 0.0], ..FluidPressure::default() },
            positions: &mut state.positions,
            previous: &mut model.rest.clone(),
            velocities: &state.velocities,
            pressure: &mut state.pressure,
            growth: &mut growth,
            rest: &model.rest,
            volumes: &model.volumes,
            region: &model.region,
            tethers: &[],
            couplings: &mut [],
            rooms: &[],
            against: Against { abutments: &model.abutments, at: &[] },
        };
        let step = Substep { dt: 0.01, iterations: 10, gravity: [0.0; 3], predicted_space: false };
        descent.begin(&mut body, &mut scratch, step, &pool);
        for (part, memory) in descent.rounds.iter().flat_map(|r| &r.1).zip(scratch.memory.iter_mut().flatten()) {
            let fast = |v: u32| if few(v) { 1.0 } else { 0.0 };
            memory.motion = part.batches.iter().map(|b| b.vertices.map(fast)).collect();
            memory.way = memory.motion.iter().map(|m| m.iter().sum()).collect();
        }
        for v in 0..body.positions.len() {
            let way = if few(v as u32) { 0.4 } else { drift };
            (0..3).for_each(|a| body.positions[v][a] += way * (0.7 + 0.3 * ((v * (a + 2)) as f32).sin()));
        }
        let (films, against) = (&descent.films, body.against);
        let touching =
            Touching { touches: &scratch.touches, films, against, couplings: &[], rest: &model.rest, first: 0 };
        descent.choose_near(&mut scratch.near, (&scratch.memory, touching), body.tissue(), Some(0.1));
        if let Some(when) = when {
            descent.press(&mut body, &mut scratch, (when, step), &pool);
        }
        in_order(descent, &scratch, &descent.pressures.rises(body.tissue(), &scratch.still));
        (state.pressure.clone(), scratch.total, scratch.slopes)
    }

    /// What sweeps come by is what the elements are.
    fn in_order(descent: &Descent, scratch: &DescentScratch, rises: &[f32]) {
        let mut visits = 0;
        for (i, part) in descent.rounds.iter().flat_map(|r| &r.1).enumerate() {
            let stream = scratch.streams.part(&descent.visits, i);
            for batch in &part.batches {
                for (row, lane) in batch.rows().flat_map(|row| (0..batch.count).map(move |lane| (row, lane))) {
                    let t = part.tets.row(row)[0][lane] as usize;
                    let element = (scratch.slopes[t], rises[t]);
                    assert_eq!((stream.slope[row][lane], stream.rise[row][lane]), element, "element {t}");
                    visits += usize::from(t < descent.pressures.elements());
                }
            }
        }
        assert_eq!(visits, 4 * descent.pressures.elements(), "no vertex is held, so each has all of its elements");
    }

    #[test]
    fn pressures_near_all_vertices_are_those_of_all_to_the_last_bit() {
        let model = model();
        let [near, all] = [Press::Near, Press::Between].map(|when| followed(&model, |_| true, 0.0, Some(when)));
        assert_eq!(near, all);
    }

    #[test]
    fn pressures_near_few_vertices_are_as_if_all_followed_and_no_others_take_a_step() {
        let (model, few) = (model(), |v: u32| v % 11 == 4);
        let [near, all, none] =
            [Press::Near, Press::Between, Press::Begin].map(|when| followed(&model, few, 0.0, Some(when)));
        for p in 0..model.rest.len() {
            let from = if few(p as u32) { &all } else { &none };
            assert_eq!((near.0[p], near.1[p]), (from.0[p], from.1[p]), "patch of vertex {p}");
        }
        // Of the second region where both meet: a few of them step.
        let further = model.rest.len()..near.0.len();
        let steps = further.clone().filter(|&p| near.0[p] != none.0[p]).count();
        assert!(steps > 0 && steps < further.len() / 4, "{steps} of {}", further.len());
    }

    #[test]
    fn elements_beside_what_is_near_forgot_how_far_they_had_grown() {
        // They had the same row of sixteen: their growth was measured again, but not that of their patches.
        let (model, few) = (model(), |v: u32| v % 11 == 4);
        let [near, all, before] =
            [Some(Press::Near), Some(Press::Between), None].map(|when| followed(&model, few, 0.1, when));
        for (t, tet) in model.tets.iter().enumerate() {
            if tet.iter().any(|&v| few(v)) {
                assert!(near.2[t] != before.2[t], "element {t}");
            } else {
                assert!(near.2[t] == before.2[t] && all.2[t] != before.2[t], "element {t}");
            }
        }
    }
}
