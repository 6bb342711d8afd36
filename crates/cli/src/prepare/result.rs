//! What `prepare` prints.

use crate::NOTICE;
use crate::console::seconds_json;
use monro_prepare::Prepared;
use serde_json::{Map, Value, json};
use std::fmt::Write as _;
use std::path::Path;

/// The result as one JSON object.
pub(crate) fn summary_json(prepared: &Prepared, out: &Path, stages: &[(String, f64)]) -> Value {
    let case = &prepared.case;
    let volumes: Map<String, Value> =
        prepared.volumes_ml.iter().map(|(s, ml)| (s.name().into(), json!((ml * 100.0).round() / 100.0))).collect();
    json!({
        "notice": NOTICE,
        "case": out.display().to_string(),
        "elements": case.tets.tets.len(),
        "vertices": case.tets.vertices.len(),
        "volumes_ml": volumes,
        "plan": {
            "side": case.plan.side().name(),
            "entry_lps_mm": case.plan.entry().to_array(),
            "target_lps_mm": case.plan.target().to_array(),
            "length_mm": case.plan.length(),
            "skull_angle_deg": case.manifest.skull_angle_deg,
        },
        "landmarks_lps_mm": landmarks(prepared),
        "findings": case.manifest.findings,
        "seconds": seconds_json(stages),
    })
}

fn landmarks(prepared: &Prepared) -> Value {
    let entry = |p: &monro_case::markups::NamedPoint| (p.label.clone(), json!(p.position.to_array()));
    Value::Object(prepared.case.landmarks.iter().map(entry).collect())
}

/// The result for people.
pub(crate) fn summary_text(prepared: &Prepared, out: &Path, stages: &[(String, f64)]) -> String {
    let case = &prepared.case;
    let mut text = format!(
        "Case {}: {} tetrahedra, {} vertices, in {:.1} s\n",
        out.display(),
        case.tets.tets.len(),
        case.tets.vertices.len(),
        stages.iter().map(|(_, s)| s).sum::<f64>()
    );
    for (structure, ml) in &prepared.volumes_ml {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "  {:<26}{ml:>9.1} ml", structure.words());
    }
    let angle = case.manifest.skull_angle_deg.map_or("unknown".into(), |a| format!("{a:.0} degrees"));
    let _ = write!(
        text,
        "Plan: {} side, {:.1} mm from skin to target, angle to the skull {angle}\nReport: {}",
        case.plan.side().name(),
        case.plan.length(),
        out.join("report.html").display()
    );
    text
}
