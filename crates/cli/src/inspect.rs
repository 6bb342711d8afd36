//! `monro inspect`: what a scan is, and which series would be taken.

use crate::args::InspectArgs;
use crate::console::Console;
use anyhow::{Result, bail};
use monro_scan::{Inspection, SeriesSummary};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::Path;

/// Runs the command.
pub(crate) fn run(args: &InspectArgs, console: &Console) -> Result<()> {
    not_a_case(&args.path)?;
    let found = console.stage("inspect", || monro_scan::inspect(&args.path))?;
    console.result(&as_json(&found), &as_text(&found));
    Ok(())
}

/// A case instead of a scan holds a volume and more, of which nobody could tell which one is meant.
pub(crate) fn not_a_case(path: &Path) -> Result<()> {
    if path.join("case.toml").is_file() {
        let ct = path.join("ct.nii.gz");
        let its = if ct.is_file() { format!("; its scan is {}", ct.display()) } else { String::new() };
        bail!("{0} is a case already: \"monro simulate {0} --out DIR\", \"monro edit {0}\"{its}", path.display());
    }
    Ok(())
}

fn as_json(found: &Inspection) -> Value {
    let chosen = found.chosen.and_then(|i| found.series.get(i));
    json!({
        "dims": chosen.map(|s| s.source.native_dims),
        "spacing_mm": chosen.map(|s| s.source.native_spacing_mm),
        "chosen": found.chosen,
        "reason": found.reason,
        "series": found.series.iter().map(series_json).collect::<Vec<_>>(),
        "warnings": found.warnings,
    })
}

fn series_json(s: &SeriesSummary) -> Value {
    let source = &s.source;
    json!({
        "id": source.series,
        "format": source.format.name(),
        "description": source.description,
        "modality": source.modality,
        "scanner": source.scanner,
        "kernel": source.kernel,
        "kvp": source.kvp,
        "dims": source.native_dims,
        "spacing_mm": source.native_spacing_mm,
        "step_mm": s.step_mm,
        "slice_thickness_mm": source.slice_thickness_mm,
        "tilt_deg": source.tilt_deg,
        "orientation": source.orientation,
        "images": s.images,
        "refusal": s.refusal,
    })
}

fn as_text(found: &Inspection) -> String {
    let mut out = String::new();
    for (i, s) in found.series.iter().enumerate() {
        let mark = if found.chosen == Some(i) { "*" } else { " " };
        // Writing to a String cannot fail.
        let _ = writeln!(out, "{mark} {}", series_line(s));
        if let Some(refusal) = &s.refusal {
            let _ = writeln!(out, "    cannot be taken: {refusal}");
        }
    }
    let _ = writeln!(out, "{}", found.reason);
    for warning in &found.warnings {
        let _ = writeln!(out, "warning: {warning}");
    }
    out.trim_end().to_owned()
}

fn series_line(s: &SeriesSummary) -> String {
    let source = &s.source;
    let ([c, r, n], [x, y, z]) = (source.native_dims, source.native_spacing_mm);
    let mut line = source.format.name().to_owned();
    for part in [Some(&source.series), source.description.as_ref(), source.modality.as_ref(), source.kernel.as_ref()] {
        if let Some(part) = part.filter(|p| !p.is_empty()) {
            line += &format!(" {part}");
        }
    }
    line += &format!(", {} {c} x {r} x {n}, spacing {x:.3} x {y:.3}", source.orientation);
    // Of what is no CT the slices are not looked at.
    line += &if z > 0.0 { format!(" x {z:.3} mm") } else { " mm in a slice".to_owned() };
    if s.step_mm[1] - s.step_mm[0] > 0.01 {
        line += &format!(" (slices {:.2} to {:.2} mm apart)", s.step_mm[0], s.step_mm[1]);
    }
    if source.tilt_deg > 0.1 {
        line += &format!(", gantry tilt {:.1} degrees", source.tilt_deg);
    }
    line
}
