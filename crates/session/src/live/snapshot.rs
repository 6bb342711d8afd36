//! What a display gets: the newest of everything, with its ages.

use super::{Deformed, Phase, Session, Signal};
use monro_geometry::Structure;
use monro_guidance::{Kakarla, NeedlePose, Plan, Reading, TargetReading, TipSite};
use std::sync::Arc;

/// The numbers a surgeon steers by. Lengths in mm, angles in radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Numbers {
    /// From the tip to where the tissue of the target is now.
    pub distance_deformed_mm: f64,
    /// From the tip to where the target was planned.
    pub distance_rigid_mm: f64,
    /// From the planned entry to the needle's line.
    pub entry_offset_mm: f64,
    /// Between needle and plan.
    pub entry_angle_error: f64,
    /// Of the tip under the entry, along the plan; negative above the skin.
    pub depth_mm: f64,
    /// How near the needle's line comes to the deformed target.
    pub miss_mm: f64,
    /// What the tip is in, as the soft body says; `None` outside of the simulated tissue.
    pub at_tip: Option<Structure>,
    /// Grade, were the catheter left here.
    pub kakarla: Kakarla,
}

impl Numbers {
    fn new(plan: &Plan, needle: &NeedlePose, deformed: &Deformed) -> Self {
        let rigid = Reading::new(plan, needle);
        let target = TargetReading::new(needle, deformed.target);
        let site = deformed.at_tip.map_or(TipSite::OutsideBrain, TipSite::from);
        Self {
            distance_deformed_mm: target.distance,
            distance_rigid_mm: rigid.target.distance,
            entry_offset_mm: rigid.entry_offset,
            entry_angle_error: rigid.entry_angle,
            depth_mm: rigid.depth,
            miss_mm: target.miss,
            at_tip: deformed.at_tip,
            kakarla: Kakarla::predict(plan.side(), site),
        }
    }

    /// Whether the tip is in a ventricle.
    pub fn in_ventricle(&self) -> bool {
        self.at_tip.is_some_and(Structure::is_ventricle)
    }
}

/// The newest of everything at one time.
#[derive(Debug, Clone)]
pub struct Snapshot {
    /// When it was taken, s on the session's clock.
    pub time_s: f64,
    /// How far the procedure has come.
    pub phase: Phase,
    /// How fresh the poses are.
    pub signal: Signal,
    /// Age of the older of the two poses used, s; `None` when there is none.
    pub age_s: Option<f64>,
    /// Age of the deformation, s: how old the pose is for which it was computed. `None` before the first.
    pub deformation_age_s: Option<f64>,
    /// The catheter, unless it is lost or the patient not registered.
    pub needle: Option<NeedlePose>,
    /// Only while navigating, never when lost.
    pub numbers: Option<Numbers>,
    /// Predicted target registration error, mm, while there is a registration that knows it.
    pub predicted_tre_mm: Option<f64>,
    /// The soft body.
    pub deformed: Arc<Deformed>,
}

impl Session {
    /// The display loop's half: what may be shown at `now`, with the newest deformation.
    pub fn snapshot(&self, now: f64, deformed: &Arc<Deformed>) -> Snapshot {
        let needle = self.needle(now);
        let numbers = match (self.plan(), &needle) {
            (Some(plan), Some(needle)) if self.phase() == Phase::Navigating => {
                Some(Numbers::new(plan, needle, deformed))
            }
            _ => None,
        };
        Snapshot {
            time_s: now,
            phase: self.phase(),
            signal: self.signal(now),
            age_s: self.age(now),
            deformation_age_s: deformed.pose_time_s.map(|t| now - t),
            needle,
            numbers,
            predicted_tre_mm: self.registration().and_then(|r| r.predicted_tre_mm),
            deformed: Arc::clone(deformed),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::session::PlainEvent;
    use crate::live::session::tests::{navigating, plan};
    use crate::live::{Script, SessionEvent};
    use monro_geometry::Vector;

    fn rest() -> Arc<Deformed> {
        Arc::new(Deformed::at_rest(plan().target(), 0))
    }

    #[test]
    fn numbers_vanish_when_lost_and_come_back() {
        let script = Script::new(plan());
        let mut s = navigating(&script);
        let deformed = rest();
        for round in 0..3 {
            let t = 10.0 * f64::from(round);
            script.observations(t).iter().for_each(|o| assert!(s.observe(o)));
            let shown = |dt: f64| s.snapshot(t + dt, &deformed);
            assert!(shown(0.0).numbers.is_some() && shown(0.3).numbers.is_some());
            assert_eq!((shown(0.3).signal, shown(0.6).signal), (Signal::Stale, Signal::Lost));
            assert!(shown(0.6).numbers.is_none() && shown(0.6).needle.is_none());
            assert!(shown(0.6).age_s.is_some_and(|a| (a - 0.6).abs() < 1e-9));
        }
    }

    #[test]
    fn outside_of_navigation_the_needle_is_shown_but_no_number() {
        let script = Script::new(plan());
        let mut s = navigating(&script);
        script.observations(0.0).iter().for_each(|o| assert!(s.observe(o)));
        s.apply(SessionEvent::Plain(PlainEvent::Stopped)).expect("stop");
        let shown = s.snapshot(0.0, &rest());
        assert!(shown.numbers.is_none() && shown.needle.is_some());
    }

    #[test]
    fn the_deformed_distance_follows_the_displaced_target_and_the_rigid_one_does_not() {
        let script = Script::new(plan());
        let mut s = navigating(&script);
        script.observations(0.0).iter().for_each(|o| assert!(s.observe(o)));
        let shift = plan().direction() * 3.0;
        let moved = Arc::new(Deformed { target: plan().target() + shift, ..Deformed::at_rest(plan().target(), 0) });
        let n = s.snapshot(0.0, &moved).numbers.expect("navigating");
        assert!((n.distance_deformed_mm - n.distance_rigid_mm - 3.0).abs() < 0.2);
        let sideways = plan().direction().any_perpendicular().unwrap_or(Vector::ZERO) * 3.0;
        let aside = Arc::new(Deformed { target: plan().target() + sideways, ..Deformed::at_rest(plan().target(), 0) });
        assert_eq!(s.snapshot(0.0, &aside).numbers.map(|n| n.distance_rigid_mm), Some(n.distance_rigid_mm));
    }

    #[test]
    fn in_ventricle_and_grade_come_from_what_the_tip_is_in() {
        let script = Script::new(plan());
        let mut s = navigating(&script);
        script.observations(0.0).iter().for_each(|o| assert!(s.observe(o)));
        let read = |at_tip| {
            let d = Arc::new(Deformed { at_tip, ..Deformed::at_rest(plan().target(), 0) });
            let n = s.snapshot(0.0, &d).numbers.expect("navigating");
            (n.in_ventricle(), n.kakarla.number())
        };
        assert_eq!(read(Some(Structure::RightLateralVentricle)), (true, 1));
        assert_eq!(read(Some(Structure::LeftLateralVentricle)), (true, 2));
        assert_eq!(read(Some(Structure::Brain)), (false, 3));
        assert_eq!(read(None), (false, 3));
    }
}
