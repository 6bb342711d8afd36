//! A session: what is known of case, tools and patient, and how far the procedure has come.

use super::{Event, Expiry, Freshness, Observation, Phase, Refusal, Tracking};
use crate::Loads;
use monro_geometry::{Display, Patient, Point, Rigid, Tool, Vector};
use monro_guidance::reference::{Bump, GuardOptions, ReferenceGuard};
use monro_guidance::registration::Recheck;
use monro_guidance::{NeedlePose, Plan};

/// The catheter in the frame of its tracked body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Calibration {
    /// Its tip.
    pub tip: Point<Tool>,
    /// Direction from hub to tip.
    pub axis: Vector<Tool>,
}

/// Where the patient is with respect to the tracked reference body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Registration {
    /// The reference body's frame to the patient's image.
    pub patient_from_reference: Rigid<Patient, Tool>,
    /// Predicted target registration error at the target, mm, where it is known.
    pub predicted_tre_mm: Option<f64>,
}

/// What happens to a session, with what it brings.
#[derive(Debug, Clone, PartialEq)]
pub enum SessionEvent {
    /// A case with this plan was opened.
    CaseOpened(Plan),
    /// The catheter was calibrated.
    Calibrated(Calibration),
    /// The patient was registered.
    Registered(Registration),
    /// Anything that brings nothing but itself.
    Plain(PlainEvent),
}

/// An event without content.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "named as the events of the phases")]
pub enum PlainEvent {
    CaseClosed,
    ToolChanged,
    ReferenceMoved,
    CheckPassed,
    CheckFailed,
    Started,
    Stopped,
    Touched,
}

impl PlainEvent {
    /// All of them; the order is that of their numbers in a log.
    pub const ALL: [Self; 8] = [
        Self::CaseClosed,
        Self::ToolChanged,
        Self::ReferenceMoved,
        Self::CheckPassed,
        Self::CheckFailed,
        Self::Started,
        Self::Stopped,
        Self::Touched,
    ];
}

impl SessionEvent {
    /// Whether landmarks touched before are not where they were touched any more: they were told by the reference and the tip.
    pub const fn voids_touches(&self) -> bool {
        matches!(self, Self::Calibrated(_) | Self::Plain(PlainEvent::ToolChanged | PlainEvent::ReferenceMoved))
    }

    /// Whether what was found of the catheter so far is another's.
    pub const fn is_other_tool(&self) -> bool {
        matches!(self, Self::Plain(PlainEvent::ToolChanged))
    }

    /// Whether the needle follows otherwise from the poses after it.
    const fn moves_needle(&self) -> bool {
        let registered =
            matches!(self, Self::Registered(_) | Self::CaseOpened(_) | Self::Plain(PlainEvent::CaseClosed));
        registered || self.voids_touches()
    }

    const fn event(&self) -> Event {
        match self {
            Self::CaseOpened(_) => Event::CaseOpened,
            Self::Calibrated(_) => Event::Calibrated,
            Self::Registered(_) => Event::Registered,
            Self::Plain(PlainEvent::CaseClosed) => Event::CaseClosed,
            Self::Plain(PlainEvent::ToolChanged) => Event::ToolChanged,
            Self::Plain(PlainEvent::ReferenceMoved) => Event::ReferenceMoved,
            Self::Plain(PlainEvent::CheckPassed) => Event::CheckPassed,
            Self::Plain(PlainEvent::CheckFailed) => Event::CheckFailed,
            Self::Plain(PlainEvent::Started) => Event::Started,
            Self::Plain(PlainEvent::Stopped) => Event::Stopped,
            Self::Plain(PlainEvent::Touched) => Event::Touched,
        }
    }
}

/// Names of the two tools that guidance needs, and of one that it can show more with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ToolNames {
    /// The catheter with its stylet.
    pub catheter: String,
    /// The reference body fixed to the patient.
    pub reference: String,
    /// Smart glasses.
    pub glasses: String,
}

impl Default for ToolNames {
    fn default() -> Self {
        Self { catheter: "Catheter".into(), reference: "Reference".into(), glasses: "Glasses".into() }
    }
}

/// The live session.
#[derive(Debug, Clone)]
pub struct Session {
    phase: Phase,
    plan: Option<Plan>,
    calibration: Option<Calibration>,
    registration: Option<Registration>,
    display_from_glasses: Option<Rigid<Display, Tool>>,
    tracking: Tracking,
    tools: ToolNames,
    expiry: Expiry,
    guard: ReferenceGuard,
    loads: Loads,
    /// Counts changes of how the needle follows from the poses, and how often a tool that it needs was seen again.
    placement: u32,
    sighting: u32,
}

impl Session {
    /// A session in which nothing has happened.
    pub fn new(tools: ToolNames, expiry: Expiry) -> Self {
        let (plan, calibration, registration) = (None, None, None);
        let (display_from_glasses, guard) = (None, ReferenceGuard::new(GuardOptions::default()));
        let (phase, tracking) = (Phase::NoCase, Tracking::default());
        let (loads, placement, sighting) = (Loads::default(), 0, 0);
        Self {
            phase,
            plan,
            calibration,
            registration,
            display_from_glasses,
            tracking,
            tools,
            expiry,
            guard,
            loads,
            placement,
            sighting,
        }
    }

    /// Takes an event of the procedure.
    ///
    /// # Errors
    /// When it does not fit the phase; nothing changes then.
    pub fn apply(&mut self, event: SessionEvent) -> Result<Phase, Refusal> {
        self.phase = self.phase.after(event.event())?;
        self.placement += u32::from(event.moves_needle());
        // A registration, or a landmark found in its place again, is the word that the reference is where it should be.
        match event {
            SessionEvent::Registered(_) => self.guard.accept(),
            SessionEvent::Plain(PlainEvent::CheckPassed) => self.guard.check(),
            SessionEvent::Plain(PlainEvent::Touched) => self.guard.touched(),
            // These void what was touched.
            SessionEvent::Calibrated(_)
            | SessionEvent::Plain(PlainEvent::ReferenceMoved | PlainEvent::ToolChanged | PlainEvent::CaseClosed) => {
                self.guard.forget_touch();
            }
            _ => {}
        }
        match event {
            SessionEvent::CaseOpened(plan) => self.plan = Some(plan),
            SessionEvent::Calibrated(c) => self.calibration = Some(c),
            SessionEvent::Registered(r) => self.registration = Some(r),
            SessionEvent::Plain(_) => {}
        }
        // What the phase does not contain any more is forgotten, so that it cannot be used by mistake.
        self.plan = self.plan.filter(|_| self.phase >= Phase::Case);
        self.calibration = self.calibration.filter(|_| self.phase >= Phase::Calibrated);
        self.registration = self.registration.filter(|_| self.phase >= Phase::Registered);
        if self.registration.is_none() {
            self.guard.rest();
        }
        Ok(self.phase)
    }

    /// Takes a pose; returns whether something new is known.
    pub fn observe(&mut self, seen: &Observation) -> bool {
        let before = self.tracking.latest(&seen.name).map(|(time_s, _)| time_s);
        let new = self.tracking.observe(seen);
        let is_needed = [&self.tools.catheter, &self.tools.reference].contains(&&seen.name);
        let was_lost = before.is_some_and(|t| self.expiry.state(Some(seen.time_s - t)) == Freshness::Lost);
        self.sighting += u32::from(new && is_needed && was_lost);
        if let Some(pose) = seen.tracker_from_tool.filter(|_| new && seen.name == self.tools.reference) {
            self.guard.push(&pose, seen.time_s);
        }
        new
    }

    /// The alarm that the patient's reference has moved since the registration or the last check that passed.
    pub const fn reference_alarm(&self) -> Option<Bump> {
        self.guard.bump()
    }

    /// As [`ReferenceGuard::alarms`].
    pub const fn alarms(&self) -> u32 {
        self.guard.alarms()
    }

    /// As [`ReferenceGuard::alarm`].
    pub fn alarm(&self) -> Option<u32> {
        self.guard.alarm()
    }

    /// How far the patient may have been moved at a landmark (where the tip touches it in the frame of the reference) or at the
    /// target, the farther, without a check of it that holds telling: while the alarm is raised, unless the check rules out
    /// the motion of the landmark or both are back to within noise; mm.
    pub fn hidden_motion(&self, touched: Point<Tool>, found: &Recheck) -> Option<f64> {
        let at_landmark = self.guard.motion_of(touched)?;
        let target =
            self.plan.zip(self.registration).map(|(plan, r)| r.patient_from_reference.inverse().point(plan.target()));
        let motion = target.and_then(|target| self.guard.motion_of(target)).map_or(at_landmark, |t| t.max(at_landmark));
        (motion > GuardOptions::default().shift && !found.excludes(at_landmark)).then_some(motion)
    }

    /// The catheter in the patient, and when it was seen, s.
    pub(super) fn needle_and_time(&self, now: f64) -> Option<(NeedlePose, f64)> {
        Some((self.needle(now)?, now - self.age(now)?))
    }

    /// Counts changes of how the needle follows from the poses.
    pub(super) const fn placement(&self) -> u32 {
        self.placement
    }

    /// Counts how often a tool that the needle follows from was seen again after it was lost.
    pub(super) const fn sighting(&self) -> u32 {
        self.sighting
    }

    /// How far the procedure has come.
    pub const fn phase(&self) -> Phase {
        self.phase
    }

    /// The plan, once a case is open.
    pub const fn plan(&self) -> Option<&Plan> {
        self.plan.as_ref()
    }

    /// The registration, while it holds.
    pub const fn registration(&self) -> Option<&Registration> {
        self.registration.as_ref()
    }

    /// Names of the tools that guidance needs.
    pub const fn tools(&self) -> &ToolNames {
        &self.tools
    }

    /// When poses expire.
    pub const fn expiry(&self) -> &Expiry {
        &self.expiry
    }

    /// The tracker's poses.
    pub const fn tracking(&self) -> &Tracking {
        &self.tracking
    }

    /// Age at `now` of the older of the two poses that guidance needs, s; `None` when one was never seen.
    pub fn age(&self, now: f64) -> Option<f64> {
        let catheter = self.tracking.latest(&self.tools.catheter)?;
        let reference = self.tracking.latest(&self.tools.reference)?;
        Some(now - catheter.0.min(reference.0))
    }

    /// Names of those of the two tools that guidance needs that are lost at `now`.
    pub fn missing(&self, now: f64) -> Vec<String> {
        let is_lost = |name: &&String| {
            let age = self.tracking.latest(name).map_or(f64::INFINITY, |(seen_s, _)| now - seen_s);
            self.expiry.state(Some(age)) == Freshness::Lost
        };
        [&self.tools.catheter, &self.tools.reference].into_iter().filter(is_lost).cloned().collect()
    }

    /// How fresh that is.
    pub fn signal(&self, now: f64) -> Freshness {
        self.expiry.state(self.age(now))
    }

    /// Takes the calibration of the glasses: from their tracked body to the eye. It belongs to the wearer, not to the case.
    /// `None` where it does not hold any more.
    pub const fn wear(&mut self, display_from_glasses: Option<Rigid<Display, Tool>>) {
        self.display_from_glasses = display_from_glasses;
    }

    /// Takes what is done to the patient's fluid, and gravity.
    pub const fn load(&mut self, loads: Loads) {
        self.loads = loads;
    }

    /// What is done to the patient's fluid, and gravity.
    pub const fn loads(&self) -> Loads {
        self.loads
    }

    /// The patient as the wearer of calibrated glasses sees them, by the poses of glasses and reference, and the age (s) of
    /// the older of these; `None` without calibration or registration, or when either is lost.
    pub fn display_from_patient(&self, now: f64) -> Option<(f64, Rigid<Display, Patient>)> {
        let (glasses_s, tracker_from_glasses) = self.tracking.latest(&self.tools.glasses)?;
        let (reference_s, tracker_from_reference) = self.tracking.latest(&self.tools.reference)?;
        let age = now - glasses_s.min(reference_s);
        if self.expiry.state(Some(age)) == Freshness::Lost {
            return None;
        }
        let reference_from_patient = self.registration?.patient_from_reference.inverse();
        let glasses_from_reference = tracker_from_glasses.inverse().after(&tracker_from_reference);
        Some((age, self.display_from_glasses?.after(&glasses_from_reference.after(&reference_from_patient))))
    }

    /// When the calibrated tip was seen (s), and where, in the frame of the reference body; `None` unless it is live.
    pub fn tip_in_reference(&self, now: f64) -> Option<(f64, Point<Tool>)> {
        if self.signal(now) != Freshness::Live {
            return None;
        }
        let (seen_s, tracker_from_catheter) = self.tracking.latest(&self.tools.catheter)?;
        let (_, tracker_from_reference) = self.tracking.latest(&self.tools.reference)?;
        let reference_from_tracker = tracker_from_reference.inverse();
        Some((seen_s, reference_from_tracker.point(tracker_from_catheter.point(self.calibration?.tip))))
    }

    /// The catheter in the patient, relative to the tracked reference: `None` before registration or when lost.
    pub fn needle(&self, now: f64) -> Option<NeedlePose> {
        if self.signal(now) == Freshness::Lost {
            return None;
        }
        let (calibration, registration) = (self.calibration?, self.registration?);
        let (_, tracker_from_catheter) = self.tracking.latest(&self.tools.catheter)?;
        let (_, tracker_from_reference) = self.tracking.latest(&self.tools.reference)?;
        let reference_from_catheter = tracker_from_reference.inverse().after(&tracker_from_catheter);
        let patient_from_catheter = registration.patient_from_reference.after(&reference_from_catheter);
        NeedlePose::of_tool(&patient_from_catheter, calibration.tip, calibration.axis).ok()
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::live::{Script, ScriptTruth};
    use monro_guidance::Side;

    pub(crate) fn plan() -> Plan {
        Plan::new(Side::Right, Point::new(-30.0, -40.0, 110.0), Point::new(-4.0, -2.0, 55.0)).expect("plan")
    }

    /// A session that navigates by the scripted tracker.
    pub(crate) fn navigating(script: &Script) -> Session {
        let mut s = Session::new(ToolNames::default(), Expiry::default());
        let ScriptTruth { calibration, registration, display_from_glasses } = script.truth();
        s.wear(Some(display_from_glasses));
        for event in [
            SessionEvent::CaseOpened(plan()),
            SessionEvent::Calibrated(calibration),
            SessionEvent::Registered(registration),
            SessionEvent::Plain(PlainEvent::CheckPassed),
            SessionEvent::Plain(PlainEvent::Started),
        ] {
            s.apply(event).expect("in order");
        }
        s
    }

    #[test]
    fn a_needle_needs_everything_and_goes_when_lost() {
        let script = Script::new(plan());
        let mut s = navigating(&script);
        assert_eq!((s.signal(0.0), s.needle(0.0)), (Freshness::Lost, None));
        script.observations(1.0).iter().for_each(|o| assert!(s.observe(o)));
        assert_eq!(s.signal(1.05), Freshness::Live);
        assert!(s.needle(1.05).is_some());
        assert_eq!(s.signal(1.2), Freshness::Stale);
        assert!(s.needle(1.2).is_some());
        assert_eq!((s.signal(1.5), s.needle(1.5)), (Freshness::Lost, None));
    }

    #[test]
    fn the_older_of_catheter_and_reference_counts() {
        let script = Script::new(plan());
        let mut s = navigating(&script);
        script.observations(1.0).iter().for_each(|o| assert!(s.observe(o)));
        let newer = script.observations(1.4);
        newer.iter().filter(|o| o.name == "Catheter").for_each(|o| assert!(s.observe(o)));
        assert_eq!(s.signal(1.4), Freshness::Stale);
    }

    /// A hundred frames from frame `from` on, with the reference moved in its own frame; what the alarm says then.
    fn see(s: &mut Session, script: &Script, from: u32, moved: &Rigid<Tool, Tool>) -> Option<f64> {
        for i in from..from + 100 {
            let t = f64::from(i) / 120.0;
            let [mut reference, catheter, _] = script.observations(t);
            reference.tracker_from_tool = reference.tracker_from_tool.map(|p| p.after(moved));
            assert!(s.observe(&reference) && s.observe(&catheter));
        }
        s.reference_alarm().map(|b| b.shift)
    }

    fn shifted(mm: f64) -> Rigid<Tool, Tool> {
        Rigid::from_quaternion([1.0, 0.0, 0.0, 0.0], Vector::new(mm, 0.0, 0.0)).expect("a pose")
    }

    /// The alarm comes by itself, stays although the reference is put back, and goes with the check.
    #[test]
    fn a_reference_that_moves_raises_the_alarm_until_the_next_check() {
        let script = Script::new(plan());
        let mut s = navigating(&script);
        assert_eq!(see(&mut s, &script, 0, &shifted(0.0)), None);
        assert!(see(&mut s, &script, 100, &shifted(3.0)).is_some_and(|shift| (1.0..=3.5).contains(&shift)));
        assert!(see(&mut s, &script, 200, &shifted(0.0)).is_some());
        s.apply(SessionEvent::Plain(PlainEvent::CheckPassed)).expect("check");
        assert_eq!(see(&mut s, &script, 300, &shifted(0.0)), None);
    }

    /// The reference had moved by 3 mm, a check with a limit of 3.7 mm passed, and the alarm was gone with the tip 2.9 mm off.
    #[test]
    fn a_check_too_coarse_to_see_the_reference_s_motion_does_not_rule_it_out() {
        let script = Script::new(plan());
        let mut s = navigating(&script);
        let at = Point::new(40.0, -60.0, 80.0);
        let check = |distance, limit| Recheck { distance, limit };
        see(&mut s, &script, 0, &shifted(0.0));
        assert_eq!(s.hidden_motion(at, &check(0.5, 9.0)), None, "nothing has moved");
        see(&mut s, &script, 100, &shifted(3.0));
        let hidden = s.hidden_motion(at, &check(0.5, 3.7)).expect("hidden");
        assert!((hidden - 3.0).abs() < 0.3, "{hidden}");
        assert_eq!(s.hidden_motion(at, &check(0.5, 2.0)), None, "a motion of 3 mm would have shown");
        see(&mut s, &script, 200, &shifted(25.0));
        assert_eq!(s.hidden_motion(at, &check(0.5, 3.7)), None);
        assert!(s.hidden_motion(at, &check(13.0, 14.0)).is_some());
        see(&mut s, &script, 300, &shifted(0.0));
        assert_eq!(s.hidden_motion(at, &check(0.5, 3.7)), None, "back in its place");
        // Turned about the landmark, which shows nothing of it; the target has gone.
        let turn =
            Rigid::<Tool, Tool>::from_axis_angle(Vector::new(0.0, 0.0, 1.0), 0.06, Vector::ZERO).expect("an axis");
        let stays = at - turn.point(at);
        let about = Rigid::from_quaternion(turn.quaternion_wxyz(), stays).expect("a pose");
        assert!(about.point(at).distance(at) < 1e-9);
        see(&mut s, &script, 400, &about);
        let hidden = s.hidden_motion(at, &check(0.5, 2.0)).expect("hidden");
        assert!(hidden > 1.5, "{hidden}");
    }

    #[test]
    fn the_wearer_sees_the_patient_while_glasses_and_reference_are_seen() {
        let script = Script::new(plan());
        let mut s = navigating(&script);
        assert_eq!(s.display_from_patient(0.0), None);
        script.observations(1.0).iter().for_each(|o| assert!(s.observe(o)));
        // Its age is its own: the catheter may be out of sight meanwhile.
        let catheter = s.tools().catheter.clone();
        script.observations(1.1).iter().filter(|o| o.name != catheter).for_each(|o| assert!(s.observe(o)));
        let (age, seen) = s.display_from_patient(1.2).expect("seen");
        assert!((age - 0.1).abs() < 1e-12 && (s.age(1.2).expect("seen") - 0.2).abs() < 1e-12, "{age}");
        // The script's wearer looks along the path, half a metre from the entry.
        assert!(seen.point(plan().entry()).distance(Point::new(0.0, 0.0, -500.0)) < 1e-9);
        assert!((seen.vector(plan().direction()) - Vector::new(0.0, 0.0, -1.0)).norm() < 1e-9);
        assert_eq!(s.display_from_patient(1.6), None);
        s.apply(SessionEvent::Plain(PlainEvent::ReferenceMoved)).expect("moved");
        assert_eq!(s.display_from_patient(1.2), None);
    }

    /// Whatever happened between the last touch and "accept" was taken for the place of the reference: 3 to 4 mm, and no alarm.
    #[test]
    fn a_bump_between_the_last_touch_and_its_acceptance_raises_the_alarm() {
        let script = Script::new(plan());
        let mut s = navigating(&script);
        let accept = |s: &mut Session| {
            s.apply(SessionEvent::Plain(PlainEvent::Stopped)).expect("stop");
            s.apply(SessionEvent::Registered(script.truth().registration)).expect("accepted");
        };
        see(&mut s, &script, 0, &shifted(0.0));
        s.apply(SessionEvent::Plain(PlainEvent::Touched)).expect("touched");
        see(&mut s, &script, 100, &shifted(4.0));
        accept(&mut s);
        assert_eq!(s.reference_alarm(), None, "not yet looked at");
        assert!(see(&mut s, &script, 200, &shifted(4.0)).is_some_and(|mm| (3.5..=4.5).contains(&mm)));
        // The next touch finds it where it is now.
        s.apply(SessionEvent::Plain(PlainEvent::Touched)).expect("touched");
        accept(&mut s);
        assert_eq!(see(&mut s, &script, 300, &shifted(4.0)), None);
    }

    #[test]
    fn a_bumped_reference_takes_the_registration_with_it() {
        let script = Script::new(plan());
        let mut s = navigating(&script);
        script.observations(1.0).iter().for_each(|o| assert!(s.observe(o)));
        assert_eq!(s.apply(SessionEvent::Plain(PlainEvent::ReferenceMoved)), Ok(Phase::Calibrated));
        assert!(s.needle(1.0).is_none() && s.registration().is_none());
        assert!(s.apply(SessionEvent::Plain(PlainEvent::Started)).is_err());
        assert_eq!(s.phase(), Phase::Calibrated);
    }
}
