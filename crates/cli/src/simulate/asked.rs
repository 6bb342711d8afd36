//! What was asked of an insertion, so that no two results can be taken for each other: the same on stdout, in the report
//! and in `summary.json`.

use super::output::{small, tenths};
use super::{Run, beside};
use crate::materials;
use monro_session::{InsertionSettings, KPA_PER_MMHG};
use monro_tissue::{Csf, FrameSettings, TipShape};
use serde_json::{Value, json};

/// Standard gravity and the like to a thousandth.
fn gravity_m_s2(run: &Run) -> [f64; 3] {
    run.settings.frame.gravity_mm_s2.map(|g| g * 1e-3)
}

/// Angle between side and axis of a conical tip, degrees; `None` for a round one.
fn tip_degrees(settings: &InsertionSettings) -> Option<f64> {
    if let TipShape::Cone { half_angle } = settings.tip { Some(half_angle.to_degrees()) } else { None }
}

/// What is asked of every insertion, in one line.
pub(super) fn headline(run: &Run) -> String {
    let settings = &run.settings;
    let mode = if run.has_units() {
        "physical soft body (kPa, Poisson's ratio)"
    } else {
        "the paper's position-based dynamics (normalised coefficients)"
    };
    format!(
        "{mode}; {} tetrahedra; catheter of {} mm{} at {} mm/s",
        run.rest.tets.len(),
        settings.diameter_mm,
        tip_degrees(settings).map_or_else(String::new, |d| format!(" with a cone of {d:.0} degrees")),
        settings.speed_mm_s
    )
}

/// What was asked beyond that, and what came of it.
pub(super) fn extras(run: &Run) -> Vec<String> {
    let mut out: Vec<String> = beside::words(run).collect();
    let last = run.last().map(|f| &f.step);
    let (mmhg, ml) = last.map_or((0.0, 0.0), |s| (s.csf_kpa / KPA_PER_MMHG, s.csf_change_ml));
    match run.settings.frame.csf {
        Csf::AtRest => {}
        Csf::Drained { ml: asked } if asked < 0.0 => {
            out.push(format!("infused {ml:.1} of {:.1} ml, {mmhg:+.1} mmHg", -asked));
        }
        Csf::Drained { ml: asked } => {
            out.push(format!("drained {} of {asked:.1} ml, {mmhg:+.1} mmHg", tenths(-ml)));
        }
        Csf::Pressure { kpa } => out.push(format!(
            "pressure of the CSF {:+.1} mmHg, with which the ventricles changed by {ml:+.1} ml",
            kpa / KPA_PER_MMHG
        )),
    }
    let gravity = gravity_m_s2(run);
    if gravity != [0.0; 3] {
        out.push(format!("gravity {} m/s2 (LPS)", gravity.map(|g| format!("{g}")).join(", ")));
    }
    if run.settings.model.skull.slides() {
        out.push(format!(
            "the brain slides along the skull{}; its surface moved by up to {} mm and left {} ml under the skull: {}",
            if run.has_septa() { ", falx and tentorium" } else { "" },
            small(run.cortex_mm),
            tenths(run.gap_ml()),
            run.losses().join(", ")
        ));
    }
    if let Some(file) = &run.materials_file {
        let brain = run.settings.model.materials.brain;
        out.push(format!("materials of {file} (brain {} kPa, Poisson's ratio {})", brain.young_kpa, brain.poisson));
    }
    let frame = run.settings.frame;
    if frame.iterations != FrameSettings::default().iterations {
        out.push(format!("{} iterations in each step", frame.iterations));
    }
    if frame.predicted_space {
        out.push("with the predicted deformation space".into());
    }
    out
}

/// All of it for `summary.json`.
pub(super) fn json(run: &Run) -> Value {
    let (settings, plan) = (&run.settings, &run.plan);
    let pressure = if let Csf::Pressure { kpa } = settings.frame.csf { Some(kpa / KPA_PER_MMHG) } else { None };
    json!({
        "mode": if run.has_units() { "physical" } else { "paper" },
        "speed_mm_s": settings.speed_mm_s,
        "diameter_mm": settings.diameter_mm,
        "tip_cone_deg": tip_degrees(settings),
        "gravity_m_s2": gravity_m_s2(run),
        "skull": if settings.model.skull.slides() { "slides" } else { "held" },
        "septa": run.has_septa(),
        "iterations": settings.frame.iterations,
        "predicted_space": settings.frame.predicted_space,
        "csf_pressure_mmhg": pressure,
        "materials": run.has_units().then(|| materials::json(&settings.model.materials)),
        "materials_file": run.materials_file,
        "case": run.pseudonym,
        "plan": {
            "side": plan.side().name(),
            "entry_lps_mm": plan.entry().to_array(),
            "target_lps_mm": plan.target().to_array(),
        },
    })
}
