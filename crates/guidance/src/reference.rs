//! The patient's reference body: everything is measured relative to it, so it must not move on the patient.
//!
//! A tracker cannot tell a bumped reference from a moved table: both move the body in the tracker's frame. Either is a
//! reason to touch a landmark again, so any motion beyond noise raises the alarm, and it stays raised until that was done.

use monro_geometry::{Rigid, Tool, Tracker, Vector};

/// When a motion of the reference counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GuardOptions {
    /// Shift, mm.
    pub shift: f64,
    /// Turn, rad.
    pub turn: f64,
    /// Poses in the baseline, and in each average that is compared with it.
    pub average: usize,
}

impl Default for GuardOptions {
    fn default() -> Self {
        Self { shift: 1.0, turn: 0.5f64.to_radians(), average: 24 }
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

/// Watches the reference body.
#[derive(Debug, Clone)]
pub struct ReferenceGuard {
    options: GuardOptions,
    baseline: Option<Rigid<Tracker, Tool>>,
    recent: Vec<Rigid<Tracker, Tool>>,
    bump: Option<Bump>,
}

impl ReferenceGuard {
    /// A guard that takes its baseline from the first poses.
    pub const fn new(options: GuardOptions) -> Self {
        Self { options, baseline: None, recent: Vec::new(), bump: None }
    }

    /// The alarm, if raised.
    pub const fn bump(&self) -> Option<Bump> {
        self.bump
    }

    /// Whether the baseline is complete.
    pub const fn is_armed(&self) -> bool {
        self.baseline.is_some()
    }

    /// Takes the reference's pose at `time` (s) and returns the alarm. Averages over some poses are compared, so that
    /// noise of single ones does not raise it.
    pub fn push(&mut self, tracker_from_reference: &Rigid<Tracker, Tool>, time: f64) -> Option<Bump> {
        self.recent.push(*tracker_from_reference);
        if self.recent.len() < self.options.average.max(1) {
            return self.bump;
        }
        let mean = mean(&self.recent);
        self.recent.clear();
        let Some(baseline) = self.baseline else {
            self.baseline = mean;
            return self.bump;
        };
        let Some(now) = mean else { return self.bump };
        let moved = baseline.inverse().after(&now);
        let (shift, turn) = (moved.translation().norm(), moved.angle());
        // Against what is allowed: from 1 on it is an alarm, which tells the farthest motion since.
        let far = |shift: f64, turn: f64| (shift / self.options.shift).max(turn / self.options.turn);
        let worst = self.bump.map_or(1.0, |b| far(b.shift, b.turn));
        if far(shift, turn) > worst {
            let time = self.bump.map_or(time, |b| b.time);
            self.bump = Some(Bump { shift, turn, time });
        }
        self.bump
    }

    /// Lowers the alarm and takes a new baseline: after a landmark was touched again and found in its place.
    pub fn confirm(&mut self) {
        *self = Self::new(self.options);
    }
}

/// The mean of nearby poses: mean translation, normalised mean quaternion. `None` for none.
pub fn mean(poses: &[Rigid<Tracker, Tool>]) -> Option<Rigid<Tracker, Tool>> {
    let first = poses.first()?.quaternion_wxyz();
    let (mut q, mut t) = ([0.0; 4], Vector::ZERO);
    for p in poses {
        let own = p.quaternion_wxyz();
        // q and -q are one rotation: all are brought to the side of the first.
        let side = if own.iter().zip(&first).map(|(a, b)| a * b).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
        q = core::array::from_fn(|i| q[i] + side * own[i]);
        t += p.translation();
    }
    Rigid::from_quaternion(q, t / poses.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::MarkerTool;
    use crate::{Covariance, Random};
    use monro_geometry::Point;

    fn pose(x: f64, angle: f64) -> Rigid<Tracker, Tool> {
        Rigid::from_axis_angle(Vector::new(0.0, 1.0, 1.0), 1.0 + angle, Vector::new(x, 20.0, 900.0)).expect("axis")
    }

    /// Feeds `n` noisy poses.
    fn feed(guard: &mut ReferenceGuard, truth: &Rigid<Tracker, Tool>, n: usize, random: &mut Random) -> Option<Bump> {
        let tool = MarkerTool::stylus(Point::ORIGIN);
        let noise = Covariance::of_view(Vector::new(0.0, 0.0, 1.0), 0.12, 0.74);
        (0..n).map(|i| guard.push(&tool.see(truth, &noise, random), i as f64 / 120.0)).last().flatten()
    }

    #[test]
    fn noise_alone_is_quiet_and_a_small_bump_is_not() {
        let (mut guard, mut random) = (ReferenceGuard::new(GuardOptions::default()), Random::new(1));
        assert_eq!(feed(&mut guard, &pose(0.0, 0.0), 5000, &mut random), None);
        assert!(guard.is_armed());
        let bump = feed(&mut guard, &pose(2.0, 0.0), 48, &mut random).expect("2 mm");
        assert!((1.0..3.0).contains(&bump.shift), "{bump:?}");
        let still = feed(&mut guard, &pose(0.0, 0.0), 480, &mut random);
        assert_eq!(still, Some(bump), "the alarm stays until it is confirmed");
        guard.confirm();
        assert!(guard.bump().is_none() && !guard.is_armed());
    }

    /// The alarm used to tell the motion at which it was raised, a small part of what followed.
    #[test]
    fn an_alarm_tells_the_whole_motion_not_its_beginning() {
        let mut guard = ReferenceGuard::new(GuardOptions { average: 4, ..GuardOptions::default() });
        for i in 0..40 {
            guard.push(&pose(f64::from(i - 8).clamp(0.0, 20.0) * 0.4, 0.0), f64::from(i) / 120.0);
        }
        let bump = guard.bump().expect("8 mm");
        assert!((bump.shift - 8.0).abs() < 1e-6 && bump.time < 0.15, "{bump:?}");
    }

    #[test]
    fn a_turn_alone_raises_the_alarm() {
        let (mut guard, mut random) = (ReferenceGuard::new(GuardOptions::default()), Random::new(2));
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
        assert!(mean(&[]).is_none());
    }
}
