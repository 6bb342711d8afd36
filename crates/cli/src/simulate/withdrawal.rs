//! What comes of drawing the catheter out again.

use super::crushed::Crushed;
use super::output::{largest_that_lasts, small};
use super::run::{Row, Run, Stretch};
use super::verdict::{Trouble, so};
use super::{crossed, restless};
use monro_geometry::Structure;
use monro_session::Frame;
use serde_json::{Value, json};

/// What all that is said of it begins with.
const OF_IT: &str = "Withdrawal: ";

/// What makes it worthless. The insertion before it may be a result all the same.
pub(super) fn broken(run: &Run) -> Vec<String> {
    let Some(out) = &run.withdrawal else { return Vec::new() };
    let mut said = Trouble::of(&out.rows).broken(run, out.rows.len());
    said.extend(restless::broken(run, &out.rows));
    said.extend(crossed::at_end(&out.snapshots).map(|c| format!("{c}: not a result.")));
    said.extend(Crushed::of(run, &out.snapshots).and_then(|c| c.broken(run)));
    said.into_iter().map(|text| format!("{OF_IT}{text}")).collect()
}

/// What makes it worth less.
pub(super) fn doubts(run: &Run) -> Vec<String> {
    let Some(out) = &run.withdrawal else { return Vec::new() };
    let sound = broken(run).is_empty();
    let so = so(sound);
    let mut said = Vec::new();
    if let Some(tissue) = out.rows.last().and_then(|r| r.frame.at_tip) {
        said.push(format!(
            "at the end the tip is still in {}: what it was drawn out of has not let it go. {HELPS}",
            tissue.words()
        ));
    }
    said.extend(restless::remark(run, &out.rows, "a wall does not draw back"));
    said.extend(Trouble::of(&out.rows).doubts(run, so));
    said.extend(crossed::on_the_way(&out.snapshots, so));
    said.extend(Crushed::of(run, &out.snapshots).filter(|_| sound).into_iter().flat_map(|c| c.doubts(run)));
    said.into_iter().map(|text| format!("{OF_IT}{text}")).collect()
}

/// What may help a catheter that does not come out.
const HELPS: &str = "A slower withdrawal (--speed) or a finer mesh may help.";

/// The largest force that lasts with which the tissue held the catheter back, mN.
pub(super) fn pull(out: &Stretch) -> f64 {
    let back: Vec<f64> = out.rows.iter().map(|r| -r.frame.axial_force_mn().unwrap_or(0.0)).collect();
    largest_that_lasts(&back)
}

/// How deep the tip was when it was last within what `within` says, mm; `None` where it never was, or still is.
fn left_at(rows: &[Row], within: impl Fn(&Frame) -> bool) -> Option<f64> {
    let last = rows.iter().rposition(|r| within(&r.frame))?;
    rows.get(last + 1).map(|r| r.frame.depth_mm)
}

/// In words, for people.
pub(super) fn text(run: &Run) -> Option<String> {
    let out = run.withdrawal.as_ref()?;
    let last = out.rows.last()?;
    let force = if run.has_units() { format!(", held back by up to {:.0} mN", pull(out)) } else { String::new() };
    let csf = left_at(&out.rows, Frame::in_ventricle)
        .map_or_else(String::new, |d| format!("; CSF stopped at a depth of {d:.1} mm"));
    Some(format!(
        "Drawn out{force}{csf}. The target ended {} mm from its place, the ventricles' wall up to {} mm{}",
        small(last.frame.target_displacement_mm),
        small(last.wall_mm),
        if broken(run).is_empty() { "" } else { ": NOT TO BE RELIED ON, see the warnings above and in the report" }
    ))
}

/// For programs; null where the catheter stayed.
pub(super) fn json(run: &Run) -> Value {
    let Some(out) = &run.withdrawal else { return Value::Null };
    let (trouble, last) = (Trouble::of(&out.rows), out.rows.last());
    json!({
        "reliable": broken(run).is_empty(),
        format!("max_pull_{}", run.force_unit()): pull(out),
        "left_ventricle_depth_mm": left_at(&out.rows, Frame::in_ventricle),
        "left_brain_depth_mm": left_at(&out.rows, |f| f.at_tip.is_some()),
        "at_tip": last.and_then(|r| r.frame.at_tip).map(Structure::name),
        "target_shift_mm": last.map(|r| r.frame.target_displacement_mm),
        "wall_shift_mm": last.map(|r| r.wall_mm),
        "inverted_most": trouble.inverted,
        "inverted_at_end": trouble.inverted_at_end,
        "rollbacks": trouble.rollbacks,
        "frames_held": trouble.held,
        "self_crossing": crossed::json(&out.snapshots),
        "crushed": Crushed::of(run, &out.snapshots).map(Crushed::json),
    })
}
