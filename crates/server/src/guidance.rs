//! A snapshot as JSON: the numbers of `/api/guidance`, and the end of every binary snapshot. Angles in degrees here.

use monro_geometry::{Display, Patient, Point, Rigid, Structure};
use monro_guidance::{Kakarla, TargetEye};
use monro_session::KPA_PER_MMHG;
use monro_session::live::{Deformed, Expiry, Session, Snapshot, ToolNames};
use serde::Serialize;
use std::sync::Arc;

/// A rigid map as JSON.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Placement {
    quaternion_wxyz: [f64; 4],
    translation_mm: [f64; 3],
}

impl From<Rigid<Display, Patient>> for Placement {
    fn from(map: Rigid<Display, Patient>) -> Self {
        Self { quaternion_wxyz: map.quaternion_wxyz(), translation_mm: map.translation().to_array() }
    }
}

/// What `/api/guidance` answers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Guidance {
    /// How far the procedure has come.
    phase: &'static str,
    /// `live`, `stale` or `lost`.
    state: &'static str,
    age_ms: Option<f64>,
    deformation_age_ms: Option<f64>,
    /// To where the target is in the deformed tissue.
    distance_to_target_mm: Option<f64>,
    /// To where the target was planned.
    distance_to_target_rigid_mm: Option<f64>,
    entry_offset_mm: Option<f64>,
    entry_angle_error_deg: Option<f64>,
    depth_mm: Option<f64>,
    miss_mm: Option<f64>,
    in_ventricle: Option<bool>,
    tip_in: Option<&'static str>,
    csf_depth_mm: Option<f64>,
    axial_force_mn: Option<f64>,
    kakarla_grade: Option<u8>,
    predicted_tre_mm: Option<f64>,
    /// Why numbers are missing, with what to do about it; `None` while all are there.
    why_no_numbers: Option<String>,
    tip_lps_mm: Option<[f64; 3]>,
    axis_lps: Option<[f64; 3]>,
    /// Right and up of the view along the catheter.
    eye_right_lps: Option<[f64; 3]>,
    eye_up_lps: Option<[f64; 3]>,
    /// Where the tissue of the target is now.
    target_lps_mm: Option<[f64; 3]>,
    /// How far right of and above the catheter's line it is seen along the catheter.
    target_in_eye_mm: Option<[f64; 2]>,
    /// The patient seen from calibrated, tracked glasses.
    display_from_patient: Option<Placement>,
    /// Age of that: of the older pose of glasses and reference.
    display_age_ms: Option<f64>,
    /// `None` while the tissue is in doubt.
    target_shift_mm: Option<f64>,
    largest_displacement_mm: f64,
    /// Fluid that is to be drained from the ventricles, ml; `None` where that is left to itself.
    drained_asked_ml: Option<f64>,
    /// What the ventricles have lost so far, ml.
    drained_ml: f64,
    csf_pressure_change_mmhg: f64,
    /// Elements of tissue that are crushed.
    crushed_elements: usize,
    /// Why the tissue as it is drawn is no result.
    tissue_doubt: Option<String>,
    solver_fault: bool,
    /// Steps of the soft body so far that had one.
    solver_faults: u64,
    /// How far the patient's reference has moved since registration or the last check; `None` while it has not.
    reference_moved_mm: Option<f64>,
    reference_turned_deg: Option<f64>,
    /// Clock of the server, s.
    time_s: f64,
}

fn why_no_numbers(s: &Snapshot) -> Option<String> {
    if let Some(first) = s.phase.before_navigation() {
        return Some(format!("numbers come with navigation; first {first}"));
    }
    match &s.numbers {
        None => Some(format!("no pose of {} (catheter and patient's reference are needed)", s.missing.join(" and "))),
        Some(n) if n.soft.is_none() => Some(match s.deformed.doubt {
            Some(doubt) => doubt.to_string(),
            None => "the soft body has fallen behind the catheter".to_owned(),
        }),
        Some(_) => None,
    }
}

impl Guidance {
    /// Reads a snapshot; `planned` is the target at rest.
    pub(crate) fn new(s: &Snapshot, planned: Point<Patient>) -> Self {
        let ms = |t: Option<f64>| t.map(|t| t * 1e3);
        let rigid = s.numbers.as_ref();
        let soft = rigid.and_then(|n| n.soft);
        let eye = s.needle.as_ref().map(TargetEye::new);
        Self {
            phase: s.phase.name(),
            state: s.signal.name(),
            age_ms: ms(s.age_s),
            deformation_age_ms: ms(s.deformation_age_s),
            distance_to_target_mm: soft.map(|n| n.distance_mm),
            distance_to_target_rigid_mm: rigid.map(|n| n.distance_rigid_mm),
            entry_offset_mm: rigid.map(|n| n.entry_offset_mm),
            entry_angle_error_deg: rigid.map(|n| n.entry_angle_error.to_degrees()),
            depth_mm: rigid.map(|n| n.depth_mm),
            miss_mm: soft.map(|n| n.miss_mm),
            in_ventricle: soft.map(|n| n.in_ventricle()),
            csf_depth_mm: soft.and_then(|n| n.csf_depth_mm),
            axial_force_mn: soft.and_then(|n| n.axial_force_mn),
            tip_in: soft.and_then(|n| n.at_tip).map(Structure::name),
            kakarla_grade: soft.and_then(|n| n.kakarla).map(Kakarla::number),
            predicted_tre_mm: s.predicted_tre_mm,
            why_no_numbers: why_no_numbers(s),
            tip_lps_mm: s.needle.map(|n| n.tip().to_array()),
            axis_lps: s.needle.map(|n| n.axis().to_array()),
            eye_right_lps: eye.map(|e| e.right().to_array()),
            eye_up_lps: eye.map(|e| e.up().to_array()),
            target_lps_mm: soft.map(|_| s.deformed.target.to_array()),
            target_in_eye_mm: soft.and(eye).map(|e| e.see(s.deformed.target)),
            display_from_patient: s.display_from_patient.map(|(_, map)| map.into()),
            display_age_ms: ms(s.display_from_patient.map(|(age, _)| age)),
            target_shift_mm: s.deformed.doubt.is_none().then(|| s.deformed.target.distance(planned)),
            largest_displacement_mm: s.deformed.largest_mm,
            drained_asked_ml: s.loads.drained_ml(),
            drained_ml: -s.deformed.csf_change_ml,
            csf_pressure_change_mmhg: s.deformed.csf_change_kpa / KPA_PER_MMHG,
            crushed_elements: s.deformed.crushed,
            tissue_doubt: s.deformed.doubt.map(|doubt| doubt.to_string()),
            solver_fault: s.deformed.fault,
            solver_faults: s.deformed.faults,
            reference_moved_mm: s.reference_alarm.map(|b| b.shift),
            reference_turned_deg: s.reference_alarm.map(|b| b.turn.to_degrees()),
            time_s: s.time_s,
        }
    }

    /// What there is to say before there is a case.
    pub(crate) fn without_case() -> Self {
        let (session, nowhere) = (Session::new(ToolNames::default(), Expiry::default()), Point::ORIGIN);
        Self::new(&session.snapshot(0.0, &Arc::new(Deformed::at_rest(nowhere, 0))), nowhere)
    }

    /// The alarm that the reference has moved, with a way out. Its shift and its turn: either raises it.
    fn moved_reference(&self) -> Option<String> {
        let (mm, deg) = self.reference_moved_mm.zip(self.reference_turned_deg)?;
        Some(format!("REFERENCE MOVED {mm:.1} mm AND TURNED {deg:.1} deg: check a landmark or register again"))
    }

    /// The numbers as a line for people; those that there are.
    pub(crate) fn in_words(&self) -> String {
        let mm = |name: &str, v: Option<f64>| v.map(|v| format!("{name} {v:.1} mm"));
        let mut words = vec![format!("{}, {}", self.state, self.phase)];
        words.extend(mm("to target", self.distance_to_target_mm));
        words.extend(mm("rigid", self.distance_to_target_rigid_mm));
        words.extend(self.entry_angle_error_deg.map(|a| format!("angle {a:.1} deg")));
        words.extend(mm("depth", self.depth_mm));
        words.extend(self.tip_in.map(|t| format!("tip in {t}")));
        words.extend(self.kakarla_grade.map(|g| format!("grade {g}")));
        words.extend(self.drained_asked_ml.map(|ml| format!("drained {:.1} of {ml:.1} ml", self.drained_ml)));
        words.extend(mm("predicted error", self.predicted_tre_mm));
        words.extend(self.moved_reference());
        words.extend(self.tissue_doubt.clone());
        words.extend(self.solver_fault.then(|| "solver fault".to_owned()));
        words.join("; ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_guidance::reference::Bump;
    use monro_session::live::Doubt;

    fn snapshot(deformed: Deformed) -> Snapshot {
        Session::new(ToolNames::default(), Expiry::default()).snapshot(0.0, &Arc::new(deformed))
    }

    #[test]
    fn an_alarm_by_a_turn_tells_the_turn() {
        let still = snapshot(Deformed::at_rest(Point::ORIGIN, 0));
        let said = |s: &Snapshot| Guidance::new(s, Point::ORIGIN).in_words();
        assert!(!said(&still).contains("REFERENCE"), "{}", said(&still));
        let bump = Bump { shift: 0.1, turn: 1.5f64.to_radians(), time: 0.0 };
        let turned = said(&Snapshot { reference_alarm: Some(bump), ..still });
        assert!(turned.contains("REFERENCE MOVED 0.1 mm AND TURNED 1.5 deg: check a landmark"), "{turned}");
    }

    #[test]
    fn nothing_is_read_off_tissue_in_doubt() {
        let far = Deformed::at_rest(Point::new(0.0, 21.0, 0.0), 0);
        let shift = |d: &Deformed| Guidance::new(&snapshot(d.clone()), Point::ORIGIN).target_shift_mm;
        assert_eq!(shift(&far), Some(21.0));
        assert_eq!(shift(&Deformed { doubt: Some(Doubt::Far(21.0)), ..far }), None);
    }
}
