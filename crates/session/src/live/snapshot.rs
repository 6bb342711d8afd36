//! What a display gets: the newest of everything, with its ages.

use super::{Deformed, Freshness, Phase, Session};
use crate::Loads;
use monro_geometry::{Display, Patient, Rigid, Structure};
use monro_guidance::reference::Bump;
use monro_guidance::{Kakarla, NeedlePose, Plan, Reading, TargetReading};
use std::sync::Arc;

/// The numbers a surgeon steers by. Lengths in mm, angles in radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Numbers {
    /// From the tip to where the target was planned.
    pub distance_rigid_mm: f64,
    /// From the planned entry to the needle's line.
    pub entry_offset_mm: f64,
    /// Between needle and plan.
    pub entry_angle_error: f64,
    /// Of the tip under the entry, along the plan; negative above the skin.
    pub depth_mm: f64,
    /// What follows from the soft body; `None` while that has nothing fresh to say.
    pub soft: Option<SoftNumbers>,
}

/// The numbers that need the deformed tissue. Lengths in mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SoftNumbers {
    /// From the tip to where the tissue of the target is now.
    pub distance_mm: f64,
    /// How near the needle's line comes to that.
    pub miss_mm: f64,
    /// What the tip is in; `None` outside of the simulated tissue.
    pub at_tip: Option<Structure>,
    /// How deep the tip was when it first was in a ventricle in this passage, mm.
    pub csf_depth_mm: Option<f64>,
    /// Force of the tissue along the shaft, against the advance, mN.
    pub axial_force_mn: Option<f64>,
    /// Grade, were the catheter left here; `None` outside of the simulated tissue.
    pub kakarla: Option<Kakarla>,
}

impl Numbers {
    fn new(plan: &Plan, needle: &NeedlePose, soft: Option<&Deformed>) -> Self {
        let rigid = Reading::new(plan, needle);
        Self {
            distance_rigid_mm: rigid.target.distance,
            entry_offset_mm: rigid.entry_offset,
            entry_angle_error: rigid.entry_angle,
            depth_mm: rigid.depth,
            soft: soft.map(|d| SoftNumbers::new(plan, needle, d)),
        }
    }
}

impl SoftNumbers {
    fn new(plan: &Plan, needle: &NeedlePose, deformed: &Deformed) -> Self {
        let target = TargetReading::new(needle, deformed.target);
        Self {
            distance_mm: target.distance,
            miss_mm: target.miss,
            at_tip: deformed.at_tip,
            csf_depth_mm: deformed.csf_depth_mm,
            axial_force_mn: deformed.axial_force_mn,
            kakarla: deformed.at_tip.map(|s| Kakarla::predict(plan.side(), s.into())),
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
    pub signal: Freshness,
    /// Age of the older of the two poses used, s; `None` when there is none.
    pub age_s: Option<f64>,
    /// Age of the deformation, s: how old the pose is for which it was computed. `None` before the first.
    pub deformation_age_s: Option<f64>,
    /// Names of the tools that guidance needs and that are lost.
    pub missing: Vec<String>,
    /// The catheter, unless it is lost or the patient not registered.
    pub needle: Option<NeedlePose>,
    /// Only while navigating, never when lost.
    pub numbers: Option<Numbers>,
    /// Predicted target registration error, mm, while there is a registration that knows it.
    pub predicted_tre_mm: Option<f64>,
    /// The patient as the wearer of calibrated glasses sees them, and the age (s) of the older of the two poses used.
    pub display_from_patient: Option<(f64, Rigid<Display, Patient>)>,
    /// The alarm that the patient's reference has moved.
    pub reference_alarm: Option<Bump>,
    /// What is done to the patient's fluid, and gravity.
    pub loads: Loads,
    /// The soft body.
    pub deformed: Arc<Deformed>,
}

impl Session {
    /// The display loop's half: what may be shown at `now`, with the newest deformation.
    pub fn snapshot(&self, now: f64, deformed: &Arc<Deformed>) -> Snapshot {
        let needle = self.needle(now);
        let deformation_age_s = deformed.pose_time_s.map(|t| now - t);
        // A soft body that has fallen behind as far as a lost tool would say where the tissue was, not where it is.
        let fresh = deformation_age_s.is_some_and(|age| self.expiry().state(Some(age)) != Freshness::Lost);
        // Nor does one that has followed a needle that was not there, or is none.
        let fresh = fresh && deformed.placement == self.placement() && deformed.doubt.is_none();
        let numbers = match (self.plan(), &needle) {
            (Some(plan), Some(needle)) if self.phase() == Phase::Navigating => {
                Some(Numbers::new(plan, needle, fresh.then_some(&**deformed)))
            }
            _ => None,
        };
        Snapshot {
            time_s: now,
            phase: self.phase(),
            signal: self.signal(now),
            age_s: self.age(now),
            deformation_age_s,
            missing: self.missing(now),
            needle,
            numbers,
            predicted_tre_mm: self.registration().and_then(|r| r.predicted_tre_mm),
            display_from_patient: self.display_from_patient(now),
            reference_alarm: self.reference_alarm(),
            loads: self.loads(),
            deformed: Arc::clone(deformed),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::Doubt;
    use crate::live::session::PlainEvent;
    use crate::live::session::tests::{navigating, plan};
    use crate::live::{Script, SessionEvent};
    use monro_geometry::Vector;

    /// The soft body's answer to a pose seen at `time_s`.
    fn answer(time_s: f64) -> Deformed {
        // A case, a calibration, a registration.
        Deformed { placement: 3, pose_time_s: Some(time_s), ..Deformed::at_rest(plan().target(), 0) }
    }

    #[test]
    fn numbers_vanish_when_lost_and_come_back() {
        let script = Script::new(plan());
        let mut s = navigating(&script);
        for round in 0..3 {
            let t = 10.0 * f64::from(round);
            let deformed = Arc::new(answer(t));
            script.observations(t).iter().for_each(|o| assert!(s.observe(o)));
            let shown = |dt: f64| s.snapshot(t + dt, &deformed);
            assert!(shown(0.0).numbers.is_some() && shown(0.3).numbers.is_some());
            assert_eq!((shown(0.3).signal, shown(0.6).signal), (Freshness::Stale, Freshness::Lost));
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
        let shown = s.snapshot(0.0, &Arc::new(answer(0.0)));
        assert!(shown.numbers.is_none() && shown.needle.is_some());
    }

    #[test]
    fn the_deformed_distance_follows_the_displaced_target_and_the_rigid_one_does_not() {
        let script = Script::new(plan());
        let mut s = navigating(&script);
        script.observations(0.0).iter().for_each(|o| assert!(s.observe(o)));
        let along = plan().direction();
        let aside = along.any_perpendicular().unwrap_or(Vector::ZERO);
        for (shift, nearer) in [(along * 3.0, 3.0), (aside * 3.0, 0.0)] {
            let moved = Arc::new(Deformed { target: plan().target() + shift, ..answer(0.0) });
            let n = s.snapshot(0.0, &moved).numbers.expect("navigating");
            let soft = n.soft.expect("fresh");
            assert!((n.distance_rigid_mm - plan().length() - 40.0).abs() < 1e-9);
            assert!((soft.distance_mm - n.distance_rigid_mm - nearer).abs() < 0.2, "{shift:?}");
        }
    }

    #[test]
    fn a_soft_body_that_has_fallen_behind_says_nothing() {
        let script = Script::new(plan());
        let mut s = navigating(&script);
        script.observations(2.0).iter().for_each(|o| assert!(s.observe(o)));
        let soft = |d: Deformed| s.snapshot(2.0, &Arc::new(d)).numbers.expect("navigating").soft;
        assert!(soft(answer(1.6)).is_some());
        assert!(soft(answer(1.4)).is_none() && soft(Deformed::at_rest(plan().target(), 0)).is_none());
        assert!(soft(Deformed { placement: 2, ..answer(2.0) }).is_none(), "registered anew since");
        assert!(soft(Deformed { doubt: Some(Doubt::Inverted(7)), ..answer(2.0) }).is_none());
    }

    #[test]
    fn in_ventricle_and_grade_come_from_what_the_tip_is_in() {
        let script = Script::new(plan());
        let mut s = navigating(&script);
        script.observations(0.0).iter().for_each(|o| assert!(s.observe(o)));
        let read = |at_tip| {
            let d = Arc::new(Deformed { at_tip, ..answer(0.0) });
            let n = s.snapshot(0.0, &d).numbers.and_then(|n| n.soft).expect("fresh");
            (n.in_ventricle(), n.kakarla.map(Kakarla::number))
        };
        assert_eq!(read(Some(Structure::RightLateralVentricle)), (true, Some(1)));
        assert_eq!(read(Some(Structure::LeftLateralVentricle)), (true, Some(2)));
        assert_eq!(read(Some(Structure::Brain)), (false, Some(3)));
        assert_eq!(read(None), (false, None));
    }
}
