//! The patient's reference body: everything is measured relative to it, so it must not move on the patient.
//!
//! A tracker cannot tell a bumped reference from a moved table: both move the body in the tracker's frame. Either is a
//! reason to touch a landmark again, so any motion beyond noise raises the alarm, and it stays raised until that was done.

use monro_geometry::{Point, Rigid, Tool, Tracker, Vector};
use std::collections::VecDeque;

/// When a motion of the reference counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GuardOptions {
    /// Shift, mm.
    pub shift: f64,
    /// Turn, rad.
    pub turn: f64,
    /// Poses in the baseline, and in each average that is compared with it.
    pub average: usize,
    /// How long before it was confirmed the reference counts as in its place, s: a landmark was being touched then.
    pub settled: f64,
    /// Poses that a touch has at least, however slow the tracker: as many are where the reference was then.
    pub touch: usize,
}

impl Default for GuardOptions {
    fn default() -> Self {
        Self { shift: 1.0, turn: 0.5f64.to_radians(), average: 24, settled: 0.5, touch: 10 }
    }
}

impl GuardOptions {
    /// A motion against what is allowed: beyond 1 it is an alarm.
    fn far(&self, shift: f64, turn: f64) -> f64 {
        (shift / self.shift).max(turn / self.turn)
    }
}

/// The reference has moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bump {
    /// How far, where it was farthest, mm.
    pub shift: f64,
    /// By what angle there, rad.
    pub turn: f64,
    /// When it was noticed, s.
    pub time: f64,
}

/// Where a tool is relative to the patient's reference: both poses of the same moment.
pub fn relative_to(
    tracker_from_reference: &Rigid<Tracker, Tool>,
    tracker_from_tool: &Rigid<Tracker, Tool>,
) -> Rigid<Tool, Tool> {
    tracker_from_reference.inverse().after(tracker_from_tool)
}

/// Watches the reference body, from the first time that it was confirmed.
#[derive(Debug, Clone)]
pub struct ReferenceGuard {
    options: GuardOptions,
    watching: bool,
    baseline: Option<Rigid<Tracker, Tool>>,
    /// The last poses and their times, as many as are averaged.
    recent: VecDeque<(f64, Rigid<Tracker, Tool>)>,
    /// How many of them were not compared yet.
    fresh: usize,
    /// Where the reference was at the last touch that a registration is made of.
    touched: Option<Rigid<Tracker, Tool>>,
    bump: Option<Bump>,
    /// How often the alarm was raised, or the reference moved on while it was,
    alarms: u32,
    /// and where the reference was then.
    alarmed_at: Option<Rigid<Tracker, Tool>>,
}

impl ReferenceGuard {
    /// A guard that remembers poses, and watches from the first registration ([`accept`](Self::accept)) on.
    pub const fn new(options: GuardOptions) -> Self {
        Self {
            options,
            watching: false,
            baseline: None,
            recent: VecDeque::new(),
            fresh: 0,
            touched: None,
            bump: None,
            alarms: 0,
            alarmed_at: None,
        }
    }

    /// The alarm, if raised.
    pub const fn bump(&self) -> Option<Bump> {
        self.bump
    }

    /// How often the alarm was raised so far, or the reference moved on while it was: what is touched now is touched after so
    /// many.
    pub const fn alarms(&self) -> u32 {
        self.alarms
    }

    /// While the alarm is raised: touches after fewer alarms than this are from before the reference moved.
    pub fn alarm(&self) -> Option<u32> {
        self.bump.map(|_| self.alarms)
    }

    /// While the alarm is raised: how far a point of the patient, given where it is seen now in the frame of the reference, has
    /// gone in that frame since the baseline, if it was the reference that moved and not the patient with it; mm.
    pub fn motion_of(&self, now: Point<Tool>) -> Option<f64> {
        let moved = self.moved()?;
        self.bump.map(|_| moved.point(now).distance(now))
    }

    /// The reference as it is now in its own frame at the baseline, of the last poses.
    fn moved(&self) -> Option<Rigid<Tool, Tool>> {
        Some(self.baseline?.inverse().after(&self.now()?))
    }

    /// The mean of the last poses.
    fn now(&self) -> Option<Rigid<Tracker, Tool>> {
        mean(self.recent.iter().map(|(_, pose)| pose))
    }

    /// Whether the baseline is complete.
    pub const fn is_armed(&self) -> bool {
        self.baseline.is_some()
    }

    /// Takes the reference's pose at `time` (s) and returns the alarm. Averages over some poses are compared, so that
    /// noise of single ones does not raise it.
    pub fn push(&mut self, tracker_from_reference: &Rigid<Tracker, Tool>, time: f64) -> Option<Bump> {
        let average = self.options.average.max(1);
        self.recent.push_back((time, *tracker_from_reference));
        self.recent.drain(..self.recent.len().saturating_sub(average));
        self.fresh += 1;
        if self.baseline.is_none() {
            self.take_baseline();
        } else if self.fresh >= average {
            self.fresh = 0;
            self.compare(time);
        }
        self.bump
    }

    /// The poses so far, once there are enough, are where the reference should be.
    fn take_baseline(&mut self) {
        if self.watching && self.recent.len() >= self.options.average.max(1) {
            self.baseline = self.now();
            self.fresh = 0;
        }
    }

    fn compare(&mut self, time: f64) {
        let Some(moved) = self.moved() else { return };
        let (shift, turn) = (moved.translation().norm(), moved.angle());
        // An alarm tells the farthest motion since.
        let worst = self.bump.map_or(1.0, |b| self.options.far(b.shift, b.turn));
        if self.options.far(shift, turn) > worst {
            let time = self.bump.map_or(time, |b| b.time);
            self.bump = Some(Bump { shift, turn, time });
        }
        self.count();
    }

    /// Counts an alarm that was just raised, and motions since.
    fn count(&mut self) {
        let Some(now) = self.now().filter(|_| self.bump.is_some()) else { return };
        let since = self.alarmed_at.map(|at| at.inverse().after(&now));
        if since.is_none_or(|m| self.options.far(m.translation().norm(), m.angle()) > 1.0) {
            self.alarms += 1;
            self.alarmed_at = Some(now);
        }
    }

    /// Notes where the reference is: a landmark has just been touched. The next registration builds on that place, whenever it
    /// is accepted.
    pub fn touched(&mut self) {
        self.touched = self.at_touch();
    }

    /// Forgets the last touch: it is void.
    pub const fn forget_touch(&mut self) {
        self.touched = None;
    }

    /// Where the reference was while the tip rested just now.
    fn at_touch(&self) -> Option<Rigid<Tracker, Tool>> {
        let settled = self.recent.back().map_or(0.0, |(last, _)| last - self.options.settled);
        let at_touch = |(i, (time, _)): &(usize, &(f64, _))| *i < self.options.touch || *time >= settled;
        let poses = self.recent.iter().rev().enumerate().take_while(at_touch).map(|(_, (_, pose))| pose);
        mean(poses).filter(|_| self.recent.len() >= self.options.touch)
    }

    /// A registration is accepted: the reference belongs where it was at the last of its touches, and what has happened since
    /// raises the alarm.
    pub fn accept(&mut self) {
        self.confirm_at(self.touched);
    }

    /// A landmark has just been found in its place: the reference belongs where it is, for all touches.
    pub fn check(&mut self) {
        let place = self.at_touch();
        self.touched = place.or(self.touched);
        self.confirm_at(place);
    }

    /// Lowers the alarm and takes a new baseline: the poses of a touch, so that nothing which happens after it is missed; those
    /// before it are not. Without a touch it is those just before now.
    fn confirm_at(&mut self, place: Option<Rigid<Tracker, Tool>>) {
        self.alarmed_at = None;
        if place.is_some() {
            (self.watching, self.baseline, self.bump) = (true, place, None);
            return;
        }
        let settled = self.recent.back().map_or(0.0, |(last, _)| last - self.options.settled);
        self.recent.retain(|(time, _)| *time >= settled);
        (self.watching, self.baseline, self.bump) = (true, None, None);
        self.take_baseline();
    }

    /// Stops watching, as when the registration is void: an alarm stays, poses are still remembered.
    pub const fn rest(&mut self) {
        (self.watching, self.baseline) = (false, None);
    }
}

/// The mean of nearby poses: mean translation, normalised mean quaternion. `None` for none.
pub fn mean<'a>(poses: impl Iterator<Item = &'a Rigid<Tracker, Tool>> + Clone) -> Option<Rigid<Tracker, Tool>> {
    let first = poses.clone().next()?.quaternion_wxyz();
    let (mut q, mut t, mut count) = ([0.0; 4], Vector::ZERO, 0.0);
    for p in poses {
        count += 1.0;
        let own = p.quaternion_wxyz();
        // q and -q are one rotation: all are brought to the side of the first.
        let side = if own.iter().zip(&first).map(|(a, b)| a * b).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
        q = core::array::from_fn(|i| q[i] + side * own[i]);
        t += p.translation();
    }
    Rigid::from_quaternion(q, t / count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::MarkerTool;
    use crate::{Covariance, Random};

    fn pose(x: f64, angle: f64) -> Rigid<Tracker, Tool> {
        Rigid::from_axis_angle(Vector::new(0.0, 1.0, 1.0), 1.0 + angle, Vector::new(x, 20.0, 900.0)).expect("axis")
    }

    /// Feeds `n` noisy poses.
    fn feed(guard: &mut ReferenceGuard, truth: &Rigid<Tracker, Tool>, n: usize, random: &mut Random) -> Option<Bump> {
        let tool = MarkerTool::stylus(Point::ORIGIN);
        let noise = Covariance::of_view(Vector::new(0.0, 0.0, 1.0), 0.12, 0.74);
        (0..n).map(|i| guard.push(&tool.see(truth, &noise, random), i as f64 / 120.0)).last().flatten()
    }

    fn watching(options: GuardOptions) -> ReferenceGuard {
        let mut guard = ReferenceGuard::new(options);
        guard.accept();
        guard
    }

    #[test]
    fn noise_alone_is_quiet_and_a_small_bump_is_not() {
        let (mut guard, mut random) = (watching(GuardOptions::default()), Random::new(1));
        assert_eq!(feed(&mut guard, &pose(0.0, 0.0), 5000, &mut random), None);
        assert!(guard.is_armed());
        let bump = feed(&mut guard, &pose(2.0, 0.0), 48, &mut random).expect("2 mm");
        assert!((1.0..3.0).contains(&bump.shift), "{bump:?}");
        let still = feed(&mut guard, &pose(0.0, 0.0), 480, &mut random);
        assert_eq!(still, Some(bump), "the alarm stays until it is confirmed");
        guard.check();
        assert!(guard.bump().is_none() && guard.is_armed(), "the poses before are where it should be");
    }

    /// A reference that was bumped within 24 poses after a landmark was found in its place raised no alarm at all: those
    /// poses were the baseline.
    #[test]
    fn a_bump_right_after_a_check_is_noticed() {
        let (mut guard, mut random) = (ReferenceGuard::new(GuardOptions::default()), Random::new(3));
        assert_eq!(feed(&mut guard, &pose(0.0, 0.0), 60, &mut random), None);
        assert_eq!(feed(&mut guard, &pose(9.0, 0.0), 60, &mut random), None, "nobody watches before a registration");
        guard.check();
        let bump = feed(&mut guard, &pose(13.0, 0.0), 25, &mut random).expect("4 mm");
        assert!((3.0..5.0).contains(&bump.shift), "{bump:?}");
        guard.rest();
        assert!(guard.bump().is_some() && !guard.is_armed());
    }

    /// At 5 Hz the 24 poses of a baseline took five seconds, and swallowed what happened in them: 8 mm were told as 1.3.
    #[test]
    fn a_bump_soon_after_a_touch_is_told_whole_however_slow_the_tracker() {
        for hz in [4.0, 5.0, 10.0, 20.0, 120.0] {
            let mut guard = ReferenceGuard::new(GuardOptions::default());
            (0..30).for_each(|i| _ = guard.push(&pose(0.0, 0.0), f64::from(i) / hz));
            guard.touched();
            // Moved before it was confirmed, too.
            (30..33).for_each(|i| _ = guard.push(&pose(8.0, 0.0), f64::from(i) / hz));
            guard.accept();
            (33..90).for_each(|i| _ = guard.push(&pose(8.0, 0.0), f64::from(i) / hz));
            let bump = guard.bump().expect("8 mm");
            assert!((bump.shift - 8.0).abs() < 1e-9, "{bump:?} at {hz} Hz");
        }
    }

    #[test]
    fn poses_from_before_the_touch_are_no_baseline() {
        let mut guard = ReferenceGuard::new(GuardOptions::default());
        (0..30).for_each(|i| assert_eq!(guard.push(&pose(0.0, 0.0), f64::from(i) / 20.0), None));
        // Put back in its place 0.3 s before the touch is over.
        (0..6).for_each(|i| assert_eq!(guard.push(&pose(5.0, 0.0), 10.0 + f64::from(i) / 20.0), None));
        guard.accept();
        assert!(!guard.is_armed());
        (6..200).for_each(|i| assert_eq!(guard.push(&pose(5.0, 0.0), 10.0 + f64::from(i) / 20.0), None));
        assert!(guard.is_armed());
    }

    /// The alarm used to tell the motion at which it was raised, a small part of what followed.
    #[test]
    fn an_alarm_tells_the_whole_motion_not_its_beginning() {
        let mut guard = watching(GuardOptions { average: 4, ..GuardOptions::default() });
        for i in 0..40 {
            guard.push(&pose(f64::from(i - 8).clamp(0.0, 20.0) * 0.4, 0.0), f64::from(i) / 120.0);
        }
        let bump = guard.bump().expect("8 mm");
        assert!((bump.shift - 8.0).abs() < 1e-6 && bump.time < 0.15, "{bump:?}");
    }

    #[test]
    fn motions_are_counted_as_long_as_the_alarm_is_raised() {
        let mut guard = watching(GuardOptions { average: 4, ..GuardOptions::default() });
        let see = |guard: &mut ReferenceGuard, x: f64| (0..8).for_each(|_| _ = guard.push(&pose(x, 0.0), 0.0));
        see(&mut guard, 0.0);
        assert_eq!((guard.alarms(), guard.alarm()), (0, None));
        see(&mut guard, 3.0);
        see(&mut guard, 3.5);
        assert_eq!((guard.alarms(), guard.alarm()), (1, Some(1)), "noise is no second motion");
        // Back in its place is another motion, not another alarm.
        see(&mut guard, 0.0);
        assert_eq!(guard.alarm(), Some(2));
        guard.check();
        see(&mut guard, 0.0);
        assert_eq!((guard.alarms(), guard.alarm()), (2, None));
        see(&mut guard, -2.0);
        assert_eq!(guard.alarm(), Some(3));
    }

    #[test]
    fn a_point_of_a_patient_who_stays_goes_as_far_as_the_reference_there() {
        let mut guard = watching(GuardOptions { average: 4, ..GuardOptions::default() });
        let (before, after) = (pose(0.0, 0.0), pose(3.0, 0.02));
        (0..8).for_each(|i| _ = guard.push(&before, f64::from(i) / 120.0));
        assert_eq!(guard.motion_of(Point::ORIGIN), None, "no alarm");
        (8..16).for_each(|i| _ = guard.push(&after, f64::from(i) / 120.0));
        let [was, now] = [before, after].map(|p| p.inverse().point(Point::new(100.0, -40.0, 950.0)));
        let motion = guard.motion_of(now).expect("an alarm");
        assert!((motion - was.distance(now)).abs() < 1e-9 && motion > 3.5, "{motion}");
    }

    #[test]
    fn a_turn_alone_raises_the_alarm() {
        let (mut guard, mut random) = (watching(GuardOptions::default()), Random::new(2));
        feed(&mut guard, &pose(0.0, 0.0), 48, &mut random);
        let bump = feed(&mut guard, &pose(0.0, 0.02), 48, &mut random).expect("1.1 degrees");
        assert!((bump.turn - 0.02).abs() < 0.008, "{bump:?}");
    }

    #[test]
    fn a_tool_relative_to_the_reference_does_not_see_the_table_move() {
        let (reference, tool) = (pose(0.0, 0.0), pose(50.0, 0.4));
        let table =
            Rigid::<Tracker, Tracker>::from_axis_angle(Vector::new(1.0, 0.0, 0.0), 0.3, Vector::new(5.0, 6.0, 7.0))
                .expect("axis");
        let before = relative_to(&reference, &tool);
        let after = relative_to(&table.after(&reference), &table.after(&tool));
        let p = Point::new(1.0, 2.0, 3.0);
        assert!(before.point(p).distance(after.point(p)) < 1e-9);
        assert!(mean([].iter()).is_none());
    }
}
