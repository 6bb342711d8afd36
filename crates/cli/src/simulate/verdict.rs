//! Whether an insertion can be believed, and what there is to say against it: the same words in the report, in JSON and on
//! the console.

use super::beyond::Beyond;
use super::crushed::Crushed;
use super::cutting::{self, Cutting};
use super::output::small;
use super::run::Row;
use super::{Run, beside, coarse, crossed, misplaced, restless, walls, withdrawal};
use crate::soft_body;
use monro_cli::report::{Finding, Severity};
use monro_geometry::Structure;
use monro_session::live::MOST_SHIFT_MM;
use monro_session::{Frame, KPA_PER_MMHG, Skull};
use monro_tissue::Csf;
use serde_json::{Value, json};

/// Share of the fluid asked for that may be missing at the end.
const MOST_MISSING: f64 = 0.1;
/// and beyond what is read of it, ml.
const LEAST_MISSING_ML: f64 = 0.05;
/// Share of its volume that tissue may change by before that is told: hardly any really leaves it.
const MOST_SQUEEZED: f64 = 0.02;
/// Share of their volume by which ventricles may change unasked before that is told.
const MOST_EMPTIED: f64 = 0.1;
/// Pressures in the ventricles that do not compress tissue to speak of, mmHg.
const FEW_MMHG: f64 = 10.0;

/// From so many iterations on, more of them are not the first remedy.
const ENOUGH: u32 = 5;

/// Counts of what went wrong.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Trouble {
    /// Frames that no step could finish.
    pub(super) held: usize,
    pub(super) rollbacks: u32,
    /// Turned elements: most in a frame, and in the last one.
    pub(super) inverted: usize,
    pub(super) inverted_at_end: usize,
}

impl Trouble {
    pub(super) fn of(rows: &[Row]) -> Self {
        let inverted = |r: &Row| r.frame.step.inverted;
        Self {
            held: rows.iter().filter(|r| r.frame.held()).count(),
            rollbacks: rows.iter().map(|r| r.frame.step.rollbacks).sum(),
            inverted: rows.iter().map(inverted).max().unwrap_or(0),
            inverted_at_end: rows.last().map_or(0, inverted),
        }
    }

    /// What makes so many frames worthless.
    pub(super) fn broken(self, run: &Run, frames: usize) -> Vec<String> {
        let (elements, helps, mut out) = (run.rest.tets.len(), helps(run), Vec::new());
        if self.inverted_at_end > 0 {
            let n = self.inverted_at_end;
            out.push(format!("{n} of {elements} tetrahedra are turned inside out at the end: not a result. {helps}"));
        }
        if self.held > 0 {
            out.push(format!(
                "In {} of {frames} frames not even the shortest step could be solved; the tissue was taken back and drawn \
                 towards rest, so what follows is not a result. {helps}",
                self.held,
            ));
        }
        out
    }

    /// What makes them worth less; `so` is what follows from trouble that is over at the end.
    pub(super) fn doubts(self, run: &Run, so: &str) -> Vec<String> {
        let mut out = Vec::new();
        if self.rollbacks > 0 {
            let n = self.rollbacks;
            let them = if n == 1 { "a step and repeated it" } else { &format!("{n} steps and repeated them") };
            out.push(format!("The solver took back {them} with smaller ones."));
        }
        if self.inverted > 0 {
            let end = if self.inverted_at_end == 0 { format!("; at the end none was{so}") } else { String::new() };
            let (n, all) = (self.inverted, run.rest.tets.len());
            out.push(format!("On the way up to {n} of {all} tetrahedra were turned inside out in a frame{end}."));
        }
        out
    }
}

impl Run {
    /// Everything to be said, the worst first.
    pub(super) fn findings(&self) -> Vec<Finding> {
        let of = |severity, texts: Vec<String>| texts.into_iter().map(move |text| Finding { severity, text });
        let errors = [broken(self), withdrawal::broken(self)].concat();
        of(Severity::Error, errors)
            .chain(of(Severity::Warning, [doubts(self), withdrawal::doubts(self)].concat()))
            .collect()
    }

    /// Whether the computation went well. It says nothing about the case: whether its plan is a good one, its labels right.
    pub(super) fn reliable(&self) -> bool {
        broken(self).is_empty()
    }
}

/// What may make it better.
fn helps(run: &Run) -> &'static str {
    match run.settings.frame.csf {
        _ if !run.has_units() => {
            "A mesh of another number of elements or another speed may help; physical mode holds together."
        }
        _ if run.settings.frame.iterations < ENOUGH => "More iterations (--iterations) may help.",
        Csf::AtRest => "A slower insertion, less gravity or a finer mesh may help.",
        Csf::Pressure { .. } => "Ask for a smaller change of pressure.",
        Csf::Drained { .. } => {
            "Drain less: walls of a ventricle that meet are not modelled, and suction ends at three times the shear modulus."
        }
    }
}

/// What makes the result worthless.
fn broken(run: &Run) -> Vec<String> {
    let helps = helps(run);
    let mut out = Trouble::of(&run.rows).broken(run, run.rows.len());
    let shift = run.largest(|f| f.target_displacement_mm);
    if shift > MOST_SHIFT_MM {
        out.push(format!(
            "The target moved by up to {shift:.1} mm, more than is believed ({MOST_SHIFT_MM} mm): not a result. {helps}"
        ));
    }
    out.extend(restless::broken(run, &run.rows).map(|r| format!("{r} {helps}")));
    out.extend(crossed::at_end(&run.snapshots).map(|c| format!("{c}: not a result. {helps}")));
    out.extend(Crushed::of(run, &run.snapshots).and_then(|c| c.broken(run)).map(|c| format!("{c} {helps}")));
    out.extend(misplaced::at_end(run));
    out.extend(undrained(run));
    out
}

/// What was drained of what was to be, ml, where too much of it is missing in a frame.
fn missing(run: &Run, frame: Option<&Frame>) -> Option<[f64; 2]> {
    let Csf::Drained { ml } = run.settings.frame.csf else { return None };
    let reached = -frame?.step.csf_change_ml;
    ((reached - ml).abs() > MOST_MISSING * ml.abs() + LEAST_MISSING_ML).then_some([ml, reached])
}

fn undrained(run: &Run) -> Option<String> {
    missing(run, run.last()).map(|[ml, reached]| {
        format!("{ml:.1} ml were to be drained, {reached:.1} ml were: not the result asked for. {}", helps(run))
    })
}

/// Fluid that was still to be drained when the catheter set out.
fn drained_late(run: &Run) -> Option<String> {
    let set_out = run.rows.iter().map(|r| &r.frame).take_while(|f| f.time_s <= 0.0).last();
    let [ml, reached] = missing(run, set_out).filter(|_| missing(run, run.last()).is_none())?;
    Some(format!(
        "When the catheter set out, {reached:.1} of {ml:.1} ml were drained; the rest was while it went in. A smaller Poisson's ratio \
         of the brain, or less volume, is drained sooner."
    ))
}

/// What follows from trouble that is over at the end: nothing where the end is not to be relied on for another reason.
pub(super) const fn so(reliable: bool) -> &'static str {
    if reliable { ", so the end can be relied on" } else { "" }
}

/// What makes it worth less.
fn doubts(run: &Run) -> Vec<String> {
    let mut out = Vec::new();
    out.extend(walls::unentered(run));
    if let Some((further, last)) = run.left_ventricle().zip(run.last()) {
        let tissue = last.at_tip.map_or("no simulated tissue".into(), Structure::words);
        let target = small(last.distance_deformed_mm);
        out.push(format!(
            "The tip was in a ventricle on the way but is not at the end: {further}, and ended in {tissue}, {target} mm from the \
             target's tissue. No CSF would drip."
        ));
    }
    if let Some([from, to]) = run.lost_ventricle() {
        let before = if run.left_ventricle().is_some() { "Before that the tip had left" } else { "The tip had left" };
        out.push(format!(
            "{before} the ventricle and come into one again: the last time it was outside from {:.1} to {:.1} mm under the skin \
             ({:.2} to {:.2} s). Look at where the path meets the walls.",
            from.depth_mm, to.depth_mm, from.time_s, to.time_s
        ));
    }
    out.extend(run.beyond.map(Beyond::words));
    out.extend(misplaced::on_the_way(run));
    out.extend(coarse::remark(&run.rest, &run.plan));
    out.extend(beside::coarse(run));
    out.extend(drained_late(run));
    out.extend(walls::hasty(run));
    out.extend(gone_around(run));
    out.extend(cutting::missed(run));
    out.extend(cutting::unlike(run));
    let why = match run.settings.model.skull {
        Skull::Held => "a wall is folded around the tip",
        Skull::Slides { .. } => "a wall is folded around the tip or the brain still slides",
    };
    out.extend(restless::remark(run, &run.rows, why));
    out.extend(Trouble::of(&run.rows).doubts(run, so(run.reliable())));
    out.extend(crossed::on_the_way(&run.snapshots, so(run.reliable())));
    if run.reliable() {
        out.extend(Crushed::of(run, &run.snapshots).into_iter().flat_map(|c| c.doubts(run)));
    }
    out.extend(unparted(run));
    out.extend(through_dura(run));
    out.extend(squeezed(run));
    out.extend(emptied(run));
    out.extend(soft_body::remarks(&run.settings.model));
    out
}

/// A brain that slides and is not parted by falx and tentorium, though it was to be.
fn unparted(run: &Run) -> Option<String> {
    (run.settings.model.skull.wants_septa() && !run.case_has_septa).then(|| {
        "The case has no falx and tentorium, so nothing but tissue keeps one hemisphere from the other and both from the cerebellum: \
         the brain shifts otherwise than it would. \"monro prepare\" makes cases that have them."
            .into()
    })
}

/// Catheters that go through falx or tentorium, which they do not meet.
fn through_dura(run: &Run) -> Option<String> {
    let (number, depth) = *run.through_septa.first()?;
    let which = if number == 0 { "The catheter".to_owned() } else { format!("Catheter {number} beside") };
    Some(format!(
        "{which} goes through falx or tentorium, where an average head has them, {depth:.0} mm under its entry: it does not meet the \
         dura here, whose force is in no number."
    ))
}

/// Walls that the tip was found behind without having pressed on them as much as they bear.
fn gone_around(run: &Run) -> Option<String> {
    if !run.has_units() {
        return None;
    }
    let materials = &run.settings.model.materials;
    let most =
        |to: Structure| if to.is_ventricle() { &materials.ventricles.insertion } else { &materials.brain.insertion };
    let around =
        run.rows.iter().flat_map(|r| r.frame.punctures().map(|p| (r.frame.depth_mm, p))).find_map(|(at, p)| {
            let (depth, force, to) = p;
            let to = Structure::from_label(to)?;
            let bears = most(to).puncture_force_mn > 0.0 && depth < most(to).puncture_depth_mm;
            (force == 0.0 && bears).then_some((at, depth, to))
        });
    around.map(|(at, depth, to)| {
        format!(
            "At {at:.1} mm under the skin the tip got past the wall of {} beside it, after a dimple of {depth:.1} mm, without the {} mN or \
             {} mm at which it yields: elements give way there that are larger than the tip. More elements come nearer to it.",
            to.words(), most(to).puncture_force_mn, most(to).puncture_depth_mm
        )
    })
}

/// Ventricles that lost or gained fluid though nobody asked for that: nothing but `--drain-ml` keeps it.
fn emptied(run: &Run) -> Option<String> {
    if run.settings.frame.csf != Csf::AtRest {
        return None;
    }
    let (change, rest) = (run.last()?.step.csf_change_ml, run.volumes.ventricles_ml());
    (change.abs() > MOST_EMPTIED * rest).then(|| {
        format!(
            "The ventricles changed by {change:.1} of {rest:.1} ml, which nobody asked for: their pressure is kept, not their volume. \
             With --drain-ml 0 it is their volume."
        )
    })
}

/// A skull that holds the brain gives nothing, so what a ventricle gains the tissue loses, by being compressed.
fn squeezed(run: &Run) -> Option<String> {
    let brain = run.volumes.structures().iter().position(|s| *s == Structure::Brain)?;
    let change = run.rows.last()?.change_ml[brain];
    let share = change / run.volumes.rest_ml()[brain];
    let why = if run.has_units() {
        let pressure = run.last().map_or(0.0, |f| f.step.csf_kpa / KPA_PER_MMHG);
        let poisson = run.settings.model.materials.brain.poisson;
        let heavy = run.settings.frame.gravity_mm_s2 != [0.0; 3];
        if heavy && pressure.abs() < FEW_MMHG {
            return told(
                share,
                change,
                &format!(
                    ": with a Poisson's ratio of {poisson} its own weight compresses it, real tissue hardly; 0.499 does less."
                ),
            );
        }
        format!(
            " at {pressure:.1} mmHg: with a Poisson's ratio of {poisson} it gives way to pressure, real tissue hardly does. Measured \
             differences of pressure between ventricles and the surface of the brain are a few mmHg."
        )
    } else {
        ": paper mode keeps volumes by constraints, as well as its iterations come.".into()
    };
    told(share, change, &why)
}

fn told(share: f64, change: f64, why: &str) -> Option<String> {
    (share.abs() > MOST_SQUEEZED).then(|| {
        format!(
            "The brain's own tissue (with the CSF around it, which is simulated as brain) changed by {change:.1} ml ({:.1} %){why}",
            share * 100.0
        )
    })
}

/// The counts, the volumes and the remarks, for `summary.json`.
pub(super) fn json(run: &Run) -> Value {
    let trouble = Trouble::of(&run.rows);
    let asked = if let Csf::Drained { ml } = run.settings.frame.csf { Some(ml) } else { None };
    let volumes = run.volumes.structures().iter().enumerate().map(|(i, s)| {
        let most = run.rows.iter().map(|r| r.change_ml[i]).fold(0.0, |m: f64, v| if v.abs() > m.abs() { v } else { m });
        let at_end = run.rows.last().map(|r| r.change_ml[i]);
        let mut own = json!({ "rest_ml": run.volumes.rest_ml()[i], "change_ml": at_end, "largest_change_ml": most });
        if *s == Structure::Brain {
            own["of"] = "brain and the CSF around it, which is simulated as brain".into();
        }
        (s.name().to_owned(), own)
    });
    json!({
        "reliable": run.reliable(),
        "remarks": run.findings().into_iter().map(|f| f.text).collect::<Vec<_>>(),
        "case_remarks": run.of_case,
        "inverted_most": trouble.inverted,
        "inverted_at_end": trouble.inverted_at_end,
        "rollbacks": trouble.rollbacks,
        "frames_held": trouble.held,
        "self_crossing": crossed::json(&run.snapshots),
        "cutting": Cutting::of(run).map(Cutting::json),
        "withdrawal": withdrawal::json(run),
        "beside": beside::json(run),
        "drained_ml": asked.map(|ml| json!({ "asked": ml, "reached": run.last().map(|f| -f.step.csf_change_ml) })),
        "volumes": volumes.collect::<serde_json::Map<_, _>>(),
    })
}
