//! What the threads share: the session, the newest deformation, and news of both.

use crate::bound::Bound;
use crate::calibrate::Calibrating;
use crate::clock::Clock;
use crate::guidance::Guidance;
use crate::lock::lock;
use crate::rate::Rate;
use crate::record::Log;
use crate::snapshot::{Moved, Quantised, digest, encode};
use monro_geometry::{Display, Patient, Point, Rigid, Tool, Tracker};
use monro_guidance::Plan;
use monro_guidance::reference::Bump;
use monro_guidance::registration::Recheck;
use monro_session::Loads;
use monro_session::live::log::Entry;
use monro_session::live::{
    Cue, Deformed, Observation, Phase, PlainEvent, Refusal, Registering, Registration, Session, SessionEvent, Snapshot,
};
use monro_tracking::{Batch, Bodies, tool_name};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock};
use tokio::sync::watch;

/// How fast the loops run.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Rates {
    pub(crate) tracking: Rate,
    pub(crate) snapshot: Rate,
    pub(crate) deformation: Rate,
}

/// The newest deformation, with its bytes for displays: made when the first asks, shared by all.
#[derive(Debug)]
struct Shape {
    deformed: Arc<Deformed>,
    nodes: OnceLock<Quantised>,
    vertices: OnceLock<Quantised>,
}

impl Shape {
    fn new(deformed: Arc<Deformed>) -> Arc<Self> {
        Arc::new(Self { deformed, nodes: OnceLock::new(), vertices: OnceLock::new() })
    }

    fn nodes(&self) -> &Quantised {
        self.nodes.get_or_init(|| Quantised::new(Moved::Nodes, &self.deformed.displacements))
    }

    fn vertices(&self, surfaces: &Bound) -> &Quantised {
        self.vertices.get_or_init(|| {
            let moved: Vec<_> = surfaces.displacements(&self.deformed.displacements).collect();
            Quantised::new(Moved::Vertices, &moved)
        })
    }
}

/// The running session. Locks are held for microseconds: nothing is written to a disk or awaited under them, and nothing computed
/// but registrations and checks of some landmarks. Who holds one may take those below it, never one above: `calibrating`,
/// `registering`, `session`, the others. Held by whoever applies an event, the first two must not be what that event voids.
#[derive(Debug)]
pub(crate) struct Live {
    pub(crate) clock: Clock,
    planned_target: Point<Patient>,
    session: Mutex<Session>,
    /// The catheter's calibration and the patient's registration, as far as they have come.
    pub(crate) calibrating: Mutex<Calibrating>,
    pub(crate) registering: Mutex<Registering>,
    shape: Mutex<Arc<Shape>>,
    /// Vertices of the soft surfaces that displays show.
    surfaces: Bound,
    rates: Mutex<Rates>,
    /// Counts everything new.
    news: watch::Sender<u32>,
    /// Displays connected.
    pub(crate) displays: AtomicU32,
    /// Whether the scripted hand rests and its tracker is dark.
    pub(crate) paused: AtomicBool,
    stopping: AtomicBool,
    /// How the tracker is, and what stands still in it though poses come; for people.
    tracker: Mutex<(String, Option<String>)>,
    /// What the tracker says of its bodies.
    bodies: Mutex<Bodies>,
    /// Tools whose bodies were defined anew, and what to do, for people; until it has been done.
    anew: Mutex<BTreeMap<String, String>>,
    log: Option<Log>,
    /// Snapshots taken for displays.
    taken: AtomicU64,
}

/// An entry's bytes, and the entry as they say it: a replay, which has only the bytes, takes in the same.
fn through_the_log(entry: Entry) -> (Vec<u8>, Entry) {
    let bytes = entry.encode();
    let read = Entry::decode(&bytes).unwrap_or(entry);
    (bytes, read)
}

impl Live {
    /// A session before its first pose.
    pub(crate) fn new(
        session: Session,
        registering: Registering,
        (first, surfaces): (Arc<Deformed>, Bound),
        log: Option<Log>,
    ) -> Self {
        Self {
            clock: Clock::start(),
            // The tissue may have been shifted from the start.
            planned_target: session.plan().map_or(first.target, Plan::target),
            session: Mutex::new(session),
            calibrating: Mutex::default(),
            registering: Mutex::new(registering),
            shape: Mutex::new(Shape::new(first)),
            surfaces,
            rates: Mutex::new(Rates::default()),
            news: watch::Sender::new(0),
            displays: AtomicU32::new(0),
            paused: AtomicBool::new(false),
            stopping: AtomicBool::new(false),
            tracker: Mutex::default(),
            bodies: Mutex::default(),
            anew: Mutex::default(),
            log,
            taken: AtomicU64::new(0),
        }
    }

    fn tell(&self) {
        self.news.send_modify(|n| *n = n.wrapping_add(1));
    }

    /// News, to wait for.
    pub(crate) fn news(&self) -> watch::Receiver<u32> {
        self.news.subscribe()
    }

    /// Writes an entry of the log. What follows from it must happen under the same lock of the session, so that the log
    /// has the order in which things took effect.
    fn log(&self, entry: &[u8]) {
        self.log.iter().for_each(|log| log.write(entry));
    }

    /// The log, while there is one.
    pub(crate) const fn recording(&self) -> Option<&Log> {
        self.log.as_ref()
    }

    /// Takes what one frame of the tracker showed.
    pub(crate) fn observe(&self, seen: Vec<Observation>) {
        let start = self.clock.now();
        let (bytes, seen) = through_the_log(Entry::Seen(seen));
        let Entry::Seen(seen) = seen else { return };
        let new = {
            let mut session = lock(&self.session);
            self.log(&bytes);
            seen.iter().fold(false, |new, o| session.observe(o) | new)
        };
        if new {
            let now = self.clock.now();
            lock(&self.rates).tracking.tick(now, now - start);
            self.tell();
        }
    }

    /// Takes an event of the procedure; what is on the way and void by it is forgotten.
    pub(crate) fn apply(&self, event: SessionEvent) -> Result<Phase, Refusal> {
        let (bytes, event) = through_the_log(Entry::Event(event));
        let Entry::Event(event) = event else { unreachable!("an event stays an event") };
        // Plain events that void something are taken in any phase, and what they void is gone before: nobody accepts it meanwhile.
        let is_sure = matches!(event, SessionEvent::Plain(_));
        if is_sure {
            self.forget(&event);
        }
        let result = {
            let mut session = lock(&self.session);
            let result = session.apply(event.clone());
            if result.is_ok() {
                self.log(&bytes);
            }
            result
        };
        if result.is_ok() {
            if !is_sure {
                self.forget(&event);
            }
            self.settle(&event);
        }
        self.tell();
        result
    }

    /// Forgets what is on the way and void by an event.
    fn forget(&self, event: &SessionEvent) {
        if event.is_other_tool() {
            lock(&self.calibrating).forget();
        }
        if event.voids_touches() {
            lock(&self.registering).forget_all();
        }
    }

    /// What was to be done about bodies that were defined anew has been done.
    fn settle(&self, event: &SessionEvent) {
        let tools = lock(&self.session).tools().clone();
        match event {
            SessionEvent::Calibrated(_) => drop(lock(&self.anew).remove(&tools.catheter)),
            SessionEvent::Registered(_) => drop(lock(&self.anew).remove(&tools.reference)),
            _ => {}
        }
    }

    /// Takes what the tracker says of its bodies.
    pub(crate) fn take_bodies(&self, batch: &Batch) {
        let anew = lock(&self.bodies).take(batch);
        anew.iter().for_each(|body| self.redefined(tool_name(&body.name), &body.words));
    }

    /// How the catheter's body differs from the one whose markers lay there (mm) when it was calibrated, if it is known to.
    pub(crate) fn calibrated_with(&self, markers_mm: &[[f64; 3]]) -> Option<String> {
        let catheter = lock(&self.session).tools().catheter.clone();
        lock(&self.bodies).calibrated(&catheter, markers_mm)
    }

    /// Takes that the body of a tool was defined anew, so that its poses are those of another frame: what was calibrated or
    /// registered in the old one is void.
    fn redefined(&self, tool: &str, what: &str) {
        let tools = lock(&self.session).tools().clone();
        let (event, void) = match tool {
            t if t == tools.catheter => (Some(PlainEvent::ToolChanged), "its calibration is void; calibrate it again"),
            t if t == tools.reference => (Some(PlainEvent::ReferenceMoved), "the registration is void; register again"),
            t if t == tools.glasses => (None, "its calibration is void; calibrate the glasses again"),
            _ => return,
        };
        match event {
            // These are taken in any phase.
            Some(event) => drop(self.apply(SessionEvent::Plain(event))),
            None => self.wear(None),
        }
        let words = format!("'{tool}' was defined anew where it is tracked ({what}): {void}.");
        lock(&self.anew).insert(tool.to_owned(), words);
    }

    /// Takes the calibration of glasses, or that it does not hold any more.
    pub(crate) fn wear(&self, display_from_glasses: Option<Rigid<Display, Tool>>) {
        let (bytes, worn) = through_the_log(Entry::Worn(display_from_glasses));
        let Entry::Worn(display_from_glasses) = worn else { unreachable!("a calibration stays one") };
        {
            let mut session = lock(&self.session);
            self.log(&bytes);
            session.wear(display_from_glasses);
            if display_from_glasses.is_some() {
                lock(&self.anew).remove(&session.tools().glasses);
            }
        }
        self.tell();
    }

    /// What the soft body is to follow, for a step by `dt` (s) that is sure to be taken; `None` where nothing would move.
    pub(crate) fn cue(&self, now: f64, dt: f64, is_settled: impl Fn(&Cue) -> bool) -> Option<Cue> {
        let session = lock(&self.session);
        let cue = Some(session.cue(now)).filter(|cue| !is_settled(cue))?;
        self.log(&Entry::Step { now_s: now, dt_s: dt }.encode());
        Some(cue)
    }

    /// Changes what is done to the patient's fluid, and gravity, from what they are now: nobody else's change is lost meanwhile.
    ///
    /// # Errors
    /// Those of `change`, which checks what it gives; nothing is changed then.
    pub(crate) fn change_loads<E>(&self, change: impl FnOnce(Loads) -> Result<Loads, E>) -> Result<Loads, E> {
        let loads = {
            let mut session = lock(&self.session);
            let (bytes, loaded) = through_the_log(Entry::Loaded(change(session.loads())?));
            let Entry::Loaded(loads) = loaded else { unreachable!("loads stay loads") };
            self.log(&bytes);
            session.load(loads);
            loads
        };
        self.tell();
        Ok(loads)
    }

    /// What is done to the patient's fluid, and gravity.
    pub(crate) fn loads(&self) -> Loads {
        lock(&self.session).loads()
    }

    /// How far the procedure has come.
    pub(crate) fn phase(&self) -> Phase {
        lock(&self.session).phase()
    }

    /// The registration, while it holds.
    pub(crate) fn registration(&self) -> Option<Registration> {
        lock(&self.session).registration().copied()
    }

    /// As [`Session::reference_alarm`](monro_session::live::Session::reference_alarm).
    pub(crate) fn reference_alarm(&self) -> Option<Bump> {
        lock(&self.session).reference_alarm()
    }

    /// As [`Session::alarms`](monro_session::live::Session::alarms).
    pub(crate) fn alarms(&self) -> u32 {
        lock(&self.session).alarms()
    }

    /// As [`Session::alarm`](monro_session::live::Session::alarm).
    pub(crate) fn alarm(&self) -> Option<u32> {
        lock(&self.session).alarm()
    }

    /// As [`Session::hidden_motion`](monro_session::live::Session::hidden_motion).
    pub(crate) fn hidden_motion(&self, touched: Point<Tool>, found: &Recheck) -> Option<f64> {
        lock(&self.session).hidden_motion(touched, found)
    }

    /// When the tip was seen (s), and where, in the frame of the reference.
    pub(crate) fn tip(&self) -> Option<(f64, Point<Tool>)> {
        lock(&self.session).tip_in_reference(self.clock.now())
    }

    /// When the catheter's tracked body was last seen (s), and where.
    pub(crate) fn catheter(&self) -> Option<(f64, Rigid<Tracker, Tool>)> {
        let session = lock(&self.session);
        session.tracking().latest(&session.tools().catheter)
    }

    /// Publishes a deformation that took `duration` (s).
    pub(crate) fn publish(&self, deformed: Arc<Deformed>, duration: f64) {
        *lock(&self.shape) = Shape::new(deformed);
        lock(&self.rates).deformation.tick(self.clock.now(), duration);
        self.tell();
    }

    /// The newest of everything, now.
    pub(crate) fn snapshot(&self) -> (Snapshot, Guidance) {
        let shape = Arc::clone(&lock(&self.shape));
        let snapshot = lock(&self.session).snapshot(self.clock.now(), &shape.deformed);
        let guidance = Guidance::new(&snapshot, self.planned_target);
        (snapshot, guidance)
    }

    /// The same as bytes for a display, with entries in the log (where it always has the nodes, from which all follows).
    pub(crate) fn snapshot_for_display(&self, wanted: Moved) -> Vec<u8> {
        let start = self.clock.now();
        let id = self.taken.fetch_add(1, Ordering::Relaxed);
        let sequence = *self.news.borrow();
        let shape = Arc::clone(&lock(&self.shape));
        let snapshot = {
            let session = lock(&self.session);
            let snapshot = session.snapshot(self.clock.now(), &shape.deformed);
            let (time_s, step) = (snapshot.time_s, snapshot.deformed.step);
            self.log(&Entry::Taken { id, time_s, step, sequence }.encode());
            snapshot
        };
        let guidance = Guidance::new(&snapshot, self.planned_target);
        let of_nodes = || encode(&snapshot, shape.nodes(), &guidance, sequence);
        let bytes = match wanted {
            Moved::Nodes => of_nodes(),
            Moved::Vertices => encode(&snapshot, shape.vertices(&self.surfaces), &guidance, sequence),
        };
        if self.log.is_some() {
            let digest = if wanted == Moved::Nodes { digest(&bytes) } else { digest(&of_nodes()) };
            self.log(&Entry::Shown { id, digest }.encode());
        }
        let now = self.clock.now();
        lock(&self.rates).snapshot.tick(now, now - start);
        bytes
    }

    /// Notes how the tracker is, and what stands still in it though poses come.
    pub(crate) fn note_tracker(&self, diagnosis: String, frozen: Option<String>) {
        *lock(&self.tracker) = (diagnosis, frozen);
    }

    /// How the tracker is, for people.
    pub(crate) fn tracker_diagnosis(&self) -> String {
        lock(&self.tracker).0.clone()
    }

    /// What is wrong with the tracker though poses come, in sentences for people.
    pub(crate) fn tracker_trouble(&self) -> Option<String> {
        let frozen = lock(&self.tracker).1.as_ref().map(|still| format!("Poses do not change: {still}."));
        let all: Vec<String> = frozen.into_iter().chain(lock(&self.anew).values().cloned()).collect();
        (!all.is_empty()).then(|| all.join(" "))
    }

    /// Whether poses of the catheter or the reference come and do not change.
    pub(crate) fn is_frozen(&self) -> bool {
        lock(&self.tracker).1.is_some()
    }

    /// Names of the tools that guidance needs.
    pub(crate) fn wanted_tools(&self) -> [String; 2] {
        let tools = lock(&self.session).tools().clone();
        [tools.catheter, tools.reference]
    }

    /// Names of the tools that the tracker has shown.
    pub(crate) fn tools(&self) -> Vec<String> {
        lock(&self.session).tracking().names().map(str::to_owned).collect()
    }

    /// How fast the loops run.
    pub(crate) fn rates(&self) -> Rates {
        *lock(&self.rates)
    }

    /// Asks all threads to end.
    pub(crate) fn stop(&self) {
        self.stopping.store(true, Ordering::Relaxed);
    }

    /// Whether they were asked to.
    pub(crate) fn is_stopping(&self) -> bool {
        self.stopping.load(Ordering::Relaxed)
    }
}
