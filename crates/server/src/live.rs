//! What the threads share: the session, the newest deformation, and news of both.

use crate::clock::Clock;
use crate::guidance::Guidance;
use crate::rate::Rate;
use monro_geometry::{Display, Patient, Point, Rigid, Tool};
use monro_guidance::NeedlePose;
use monro_session::live::{Deformed, Observation, Phase, Refusal, Session, SessionEvent, Snapshot};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::watch;

/// How fast the loops run.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Rates {
    pub(crate) tracking: Rate,
    pub(crate) deformation: Rate,
}

/// The running session. Locks are held for microseconds: nothing is computed, written or awaited under them.
#[derive(Debug)]
pub(crate) struct Live {
    pub(crate) clock: Clock,
    planned_target: Point<Patient>,
    session: Mutex<Session>,
    deformed: Mutex<Arc<Deformed>>,
    rates: Mutex<Rates>,
    /// Counts everything new.
    news: watch::Sender<u32>,
    /// Displays connected.
    pub(crate) displays: AtomicU32,
    /// Whether the scripted hand rests and its tracker is dark.
    pub(crate) paused: AtomicBool,
    stopping: AtomicBool,
    /// How the tracker is, for people.
    tracker: Mutex<String>,
}

/// A panic in another thread does not take the session away from this one: values are replaced whole.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Live {
    /// A session before its first pose.
    pub(crate) fn new(session: Session, at_rest: Deformed) -> Self {
        Self {
            clock: Clock::start(),
            planned_target: at_rest.target,
            session: Mutex::new(session),
            deformed: Mutex::new(Arc::new(at_rest)),
            rates: Mutex::new(Rates::default()),
            news: watch::Sender::new(0),
            displays: AtomicU32::new(0),
            paused: AtomicBool::new(false),
            stopping: AtomicBool::new(false),
            tracker: Mutex::default(),
        }
    }

    fn tell(&self) {
        self.news.send_modify(|n| *n = n.wrapping_add(1));
    }

    /// News, to wait for.
    pub(crate) fn news(&self) -> watch::Receiver<u32> {
        self.news.subscribe()
    }

    /// Takes what one frame of the tracker showed.
    pub(crate) fn observe(&self, seen: &[Observation]) {
        let new = {
            let mut session = lock(&self.session);
            seen.iter().fold(false, |new, o| session.observe(o) | new)
        };
        if new {
            lock(&self.rates).tracking.tick(self.clock.now(), 0.0);
            self.tell();
        }
    }

    /// Takes an event of the procedure.
    pub(crate) fn apply(&self, event: SessionEvent) -> Result<Phase, Refusal> {
        let result = lock(&self.session).apply(event);
        self.tell();
        result
    }

    /// Takes the calibration of glasses.
    pub(crate) fn wear(&self, display_from_glasses: Rigid<Display, Tool>) {
        lock(&self.session).wear(display_from_glasses);
        self.tell();
    }

    /// The catheter, and when it was seen.
    pub(crate) fn needle(&self, now: f64) -> Option<(NeedlePose, f64)> {
        let session = lock(&self.session);
        Some((session.needle(now)?, now - session.age(now)?))
    }

    /// How far the procedure has come.
    pub(crate) fn phase(&self) -> Phase {
        lock(&self.session).phase()
    }

    /// When the tip was seen (s), and where, in the frame of the reference.
    pub(crate) fn tip(&self) -> Option<(f64, Point<Tool>)> {
        lock(&self.session).tip_in_reference(self.clock.now())
    }

    /// Publishes a deformation that took `duration` (s).
    pub(crate) fn publish(&self, deformed: Deformed, duration: f64) {
        let deformed = Arc::new(deformed);
        *lock(&self.deformed) = deformed;
        lock(&self.rates).deformation.tick(self.clock.now(), duration);
        self.tell();
    }

    /// The newest of everything, now.
    pub(crate) fn snapshot(&self) -> (Snapshot, Guidance, u32) {
        let sequence = *self.news.borrow();
        let deformed = Arc::clone(&lock(&self.deformed));
        let snapshot = lock(&self.session).snapshot(self.clock.now(), &deformed);
        let guidance = Guidance::new(&snapshot, self.planned_target);
        (snapshot, guidance, sequence)
    }

    /// Notes how the tracker is.
    pub(crate) fn note_tracker(&self, diagnosis: String) {
        *lock(&self.tracker) = diagnosis;
    }

    /// How the tracker is, for people.
    pub(crate) fn tracker_diagnosis(&self) -> String {
        lock(&self.tracker).clone()
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
