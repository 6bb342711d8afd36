//! `monro register`: from touched landmarks and a traced skin to the patient, with the error that is to be expected.

mod marks;

use crate::args::RegisterArgs;
use crate::calibrate::{point, rows};
use crate::columns::short;
use crate::console::Console;
use anyhow::{Context, Result, bail};
use monro_case::Case;
use monro_case::markups::NamedPoint;
use monro_geometry::{Patient, Point, Rigid, Tool};
use monro_guidance::Covariance;
use monro_guidance::registration::{
    Agreement, Ambiguity, Landmark, LandmarkRegistration, LandmarkResidual, RefineOptions, Refined, Surface,
    SurfaceSample, recheck, refine_on_surface, register_landmarks,
};
use serde_json::{Value, json};
use std::path::Path;

/// Part of the traced points that must fit the skin: a careful hand loses one in twenty.
const LEAST_USED: f64 = 0.8;

/// An even offset of the trace is told from so many mm on, when it is also so many times its standard deviation.
const TOLD_OFFSET: (f64, f64) = (0.5, 3.0);

/// A registration by landmarks, and by the surface where it was traced.
struct Found {
    landmarks: LandmarkRegistration<Patient, Tool>,
    surface: Option<OnSkin>,
    /// How far each landmark is off under the pose that is given, mm.
    residuals: Vec<f64>,
}

/// The registration refined on the skin, beside that by landmarks alone.
struct OnSkin {
    refined: Refined<Tool>,
    agreement: Agreement<Tool>,
    /// Part of the traced points that fit the skin.
    used: usize,
}

impl Found {
    fn patient_from_reference(&self) -> Rigid<Patient, Tool> {
        self.surface.as_ref().map_or(self.landmarks.to_from, |s| s.refined.patient_from)
    }

    /// The expected error at a place. Where much of a trace had to be left out, what was kept may be off the skin, too, so that no less
    /// is believed than by the landmarks alone.
    fn tre(&self, at: Point<Patient>) -> Covariance<Patient> {
        let by_landmarks = self.landmarks.tre(at);
        let Some(s) = &self.surface else { return by_landmarks };
        let by_skin = s.agreement.widened(s.refined.tre(at), at);
        if s.lost_many() && by_landmarks.rms() > by_skin.rms() { by_landmarks } else { by_skin }
    }
}

impl OnSkin {
    /// Whether so many traced points had to be left out that those kept may be wrong, too.
    fn lost_many(&self) -> bool {
        (self.used as f64) < LEAST_USED * self.refined.residuals.len() as f64
    }

    /// The even offset of the trace, mm, where it is one.
    fn offset(&self) -> Option<f64> {
        let (r, (least, sigmas)) = (&self.refined, TOLD_OFFSET);
        (r.offset.abs() > least && r.offset.abs() > sigmas * r.offset_sigma).then_some(r.offset)
    }

    fn words(&self) -> String {
        let mut out = format!("Skin: {} of {} traced points used.\n", self.used, self.refined.residuals.len());
        if let Some(offset) = self.offset() {
            let side = if offset > 0.0 { "outside" } else { "inside" };
            out += &format!(
                "The trace lies {:.1} mm {side} the skin evenly (hair, thickness of the tip, tracing in the air?); that is taken into account.\n",
                offset.abs()
            );
        }
        out
    }

    /// What makes it worth less.
    fn remarks(&self, target: Point<Patient>) -> Vec<String> {
        let (used, all) = (self.used, self.refined.residuals.len());
        let lost = self.lost_many().then(|| {
            format!(
                "{} of {all} traced points lie off the skin, so some of the {used} others may, too: the expected error is no less \
                 than by the landmarks alone; trace again",
                all - used
            )
        });
        let disagree =
            || format!("{}; the expected error includes this: touch and trace again", self.disagreement(target));
        lost.into_iter().chain(self.agreement.is_doubtful().then(disagree)).collect()
    }

    fn disagreement(&self, target: Point<Patient>) -> String {
        format!(
            "landmarks and skin disagree: they put the target {:.1} mm apart, {:.1} times what the noise explains \
             (was the reference moved between touching and tracing, or traced over hair?)",
            self.agreement.apart(target).norm(),
            self.agreement.excess
        )
    }

    fn json(&self, target: Point<Patient>) -> Value {
        let used = self.refined.residuals.iter().filter(|r| r.used);
        let squares: f64 = used.map(|r| r.distance * r.distance).sum();
        json!({
            "points": self.refined.residuals.len(), "used": self.used,
            "doubtful": self.lost_many() || self.agreement.is_doubtful(), "iterations": self.refined.iterations,
            "residual_mm": (squares / self.used.max(1) as f64).sqrt(), "variance_ratio": self.refined.variance_ratio,
            "offset_mm": self.refined.offset, "offset_sigma_mm": self.refined.offset_sigma,
            "disagreement": self.agreement.excess, "disagreement_at_target_mm": self.agreement.apart(target).norm(),
        })
    }
}

/// Traced points that span so many times as much as the landmarks, or as little, are in another unit.
const OTHER_UNIT: f64 = 50.0;

/// Runs the command.
pub(crate) fn run(args: &RegisterArgs, console: &Console) -> Result<()> {
    let case = Case::open(&args.case)?;
    let marked = marks::marked(args, &case)?;
    let landmarks = marks::landmarks(args, &marked)?;
    if let Some(off_skin) = marks::off_skin(args, &case, &landmarks)? {
        console.warn(&off_skin);
    }
    let by_landmarks = register_landmarks(&landmarks)?;
    // Before the skin is looked at: a pose that is mirrored fits no skin, and that would be all that is said.
    if let Some(contradiction) = by_landmarks.contradiction(&landmarks) {
        bail!("{}: {contradiction}\n{}", args.landmarks.display(), residual_lines(&by_landmarks, None));
    }
    let found = refine(args, &case, &landmarks, by_landmarks)?;
    let (target, entry) = (case.plan.target(), case.plan.entry());
    // Traced skin tells left from right.
    let namings = || found.landmarks.ambiguities(&landmarks, target);
    let exchanged = if found.surface.is_none() { namings() } else { Vec::new() };
    let check = args.check.as_deref().map(|c| check(c, args, &marked, (&found, &exchanged))).transpose()?;
    let pose = found.patient_from_reference();
    let remarks = remarks(&found, exchanged.first(), target);
    remarks.iter().for_each(|remark| console.warn(remark));
    // All that a live session takes, and nothing else: it refuses what it does not know.
    let session_event = json!({
        "event": "registered", "quaternion_wxyz": pose.quaternion_wxyz(), "translation_mm": pose.translation().to_array(),
        "predicted_tre_mm": found.tre(target).rms(),
    });
    let result = json!({
        // A pose that its own check refutes is none to go on with.
        "session_event": check.as_ref().filter(|c| c["holds"] == false).map_or(session_event, |_| Value::Null),
        "quaternion_wxyz": pose.quaternion_wxyz(), "translation_mm": pose.translation().to_array(),
        "predicted_tre_mm": found.tre(target).rms(), "predicted_tre_95_mm": found.tre(target).percentile_95(),
        "predicted_tre_entry_mm": found.tre(entry).rms(),
        "landmarks": residuals(&found), "remarks": remarks, "surface": found.surface.as_ref().map(|s| s.json(target)), "check": check,
    });
    console.result(&result, &words(&result, &found));
    match result["check"]["holds"] == false {
        true => bail!("the check does not hold: register again"),
        false => Ok(()),
    }
}

/// What is expected at the target, what does not fit, and the pose.
fn words(result: &Value, found: &Found) -> String {
    let number = |key: &str| result[key].as_f64().unwrap_or(f64::NAN);
    let mut out = format!(
        "Expected error (RMS): {:.2} mm at the target (95 % below {:.2} mm), {:.2} mm at the entry.\n",
        number("predicted_tre_mm"),
        number("predicted_tre_95_mm"),
        number("predicted_tre_entry_mm")
    );
    let alone = if found.surface.is_some() { "by landmarks and skin, by the landmarks alone" } else { "by this pose" };
    out += &format!(
        "Landmark: residual {alone}, and how far it lies from where the others put it (expected), mm. None is the accuracy.\n"
    );
    out += &residual_lines(&found.landmarks, found.surface.as_ref().map(|_| found.residuals.as_slice()));
    if let Some(r) = found.landmarks.outlier.and_then(|i| found.landmarks.residuals.get(i)) {
        let kept = if found.surface.is_some() { "; it was left out beside the skin" } else { "" };
        out += &format!("'{}' does not fit: touch it again or leave it out{kept}.\n", r.name);
    }
    out += &found.surface.as_ref().map_or_else(String::new, OnSkin::words);
    if let (Some(name), Some(distance)) = (result["check"]["name"].as_str(), result["check"]["distance_mm"].as_f64()) {
        let limit = result["check"]["limit_mm"].as_f64().unwrap_or(f64::NAN);
        let verdict = if result["check"]["holds"] == true { "holds" } else { "does not hold: register again" };
        out += &format!("Check: '{name}' touched now is {distance:.2} mm off (limit {limit:.2}): {verdict}.\n");
    }
    out + &format!(
        "Pose of the reference body in the patient: quaternion (w, x, y, z) {}, translation {} mm.\n\
         With --json: all digits, and \"session_event\", what a live session takes at /api/session.",
        short(&result["quaternion_wxyz"]),
        short(&result["translation_mm"])
    )
}

/// A naming of the landmarks that fits about as well.
type Exchanged = Ambiguity<Patient, Tool>;

/// What of the trace is doubtful, or of the landmarks where no skin was traced, which tells.
fn remarks(found: &Found, exchanged: Option<&Exchanged>, target: Point<Patient>) -> Vec<String> {
    let is_few = found.landmarks.residuals.len() == 3 && found.surface.is_none() && exchanged.is_none();
    let exchanged = exchanged.map(|a| format!("{a} (--check)"));
    let few = is_few.then(|| {
        "three landmarks nearly always fit, mirrored ones and those of another frame too: touch a fourth, or check at another one (--check)".to_owned()
    });
    let of_skin = found.surface.iter().flat_map(|s| s.remarks(target));
    exchanged.into_iter().chain(few).chain(of_skin).collect()
}

/// A line for each landmark, that under the final pose first where that is another.
fn residual_lines(landmarks: &LandmarkRegistration<Patient, Tool>, last: Option<&[f64]>) -> String {
    let line = |(i, r): (usize, &LandmarkResidual)| {
        let others = r.left_out.zip(r.expected).map_or_else(String::new, |(d, e)| format!(", {d:.2} ({e:.2})"));
        let last = last.map_or_else(String::new, |l| format!("{:.2}, ", l[i]));
        format!("  {}: {last}{:.2}{others}\n", r.name, r.distance)
    };
    landmarks.residuals.iter().enumerate().map(line).collect()
}

/// The registration by landmarks refined on the traced skin, where it was traced.
fn refine(
    args: &RegisterArgs,
    case: &Case,
    landmarks: &[Landmark<Patient, Tool>],
    by_landmarks: LandmarkRegistration<Patient, Tool>,
) -> Result<Found> {
    let surface = args.surface.as_deref().map(|p| on_skin(p, args, case, landmarks, &by_landmarks)).transpose()?;
    let mut found = Found { landmarks: by_landmarks, surface, residuals: Vec::new() };
    let pose = found.patient_from_reference();
    found.residuals = landmarks.iter().map(|l| pose.point(l.touched).distance(l.marked)).collect();
    match &found.surface {
        Some(s) if s.agreement.is_contradiction() => bail!(refusal(s, &found, case.plan.target())),
        _ => Ok(found),
    }
}

/// The skin contradicts the landmarks: what is known, and the ways out.
fn refusal(on_skin: &OnSkin, found: &Found, target: Point<Patient>) -> String {
    format!(
        "{}. Touch and trace again, or leave out --surface (expected error by the landmarks alone {:.2} mm).\n\
         Landmark: residual by landmarks and skin, by the landmarks alone, mm.\n{}",
        on_skin.disagreement(target),
        found.landmarks.tre(target).rms(),
        residual_lines(&found.landmarks, Some(&found.residuals)).trim_end()
    )
}

fn on_skin(
    path: &Path,
    args: &RegisterArgs,
    case: &Case,
    landmarks: &[Landmark<Patient, Tool>],
    by_landmarks: &LandmarkRegistration<Patient, Tool>,
) -> Result<OnSkin> {
    let noise = Covariance::isotropic(args.trace_sigma);
    let sample = |p| SurfaceSample { point: Point::from_array(p), noise };
    let mut traced = rows::<3>(path, "x y z")?;
    let (wide, touched) = (span(&traced), span(&landmarks.iter().map(|l| l.touched.to_array()).collect::<Vec<_>>()));
    if wide > 0.0 && !(1.0 / OTHER_UNIT..OTHER_UNIT).contains(&(wide / touched)) {
        bail!(
            "{}: the traced points span {wide:.3}, the touched landmarks {touched:.3}: both must be in mm",
            path.display()
        );
    }
    // A point that came again, as from a server that repeats its last pose, says nothing new.
    traced.dedup();
    let samples: Vec<_> = traced.into_iter().map(sample).collect();
    let skin = Surface::new(&case.skin)?;
    // A landmark that the others contradict would pull the surface along, and is not in the noise that is predicted from.
    let kept: Vec<_> =
        (0..landmarks.len()).filter(|&i| by_landmarks.outlier != Some(i)).map(|i| landmarks[i].clone()).collect();
    let start = register_landmarks(&kept)?;
    let options = RefineOptions::default();
    let refined = refine_on_surface(&start.to_from, &samples, &kept, &skin, &options)?;
    // A patch that slides by itself has no pose of its own to tell anything by.
    let by_skin = refine_on_surface(&refined.patient_from, &samples, &[], &skin, &options).ok();
    let agreement = Agreement::new(&kept, &start, &refined, by_skin.as_ref());
    let used = refined.residuals.iter().filter(|r| r.used).count();
    Ok(OnSkin { refined, agreement, used })
}

/// The longest edge of the box around some points.
fn span(points: &[[f64; 3]]) -> f64 {
    let along = |a: usize| {
        let ends =
            points.iter().map(|p| p[a]).fold([f64::INFINITY, f64::NEG_INFINITY], |e, v| [e[0].min(v), e[1].max(v)]);
        ends[1] - ends[0]
    };
    (0..3).map(along).fold(0.0, f64::max)
}

/// `NAME,X,Y,Z`: a landmark touched again, or one that was marked and not touched yet.
fn check(
    text: &str,
    args: &RegisterArgs,
    marked: &[NamedPoint],
    (found, exchanged): (&Found, &[Exchanged]),
) -> Result<Value> {
    let (name, place) = text.split_once(',').with_context(|| format!("--check {text} is not NAME,X,Y,Z"))?;
    let known = marked.iter().find(|l| l.label.eq_ignore_ascii_case(name.trim()));
    let listed = || marked.iter().map(|m| m.label.as_str()).collect::<Vec<_>>().join(", ");
    let Some(mark) = known else { bail!("--check {name}: no landmark of this name is marked (marked: {})", listed()) };
    let place: Point<Tool> = point(place)?;
    let touched = found.patient_from_reference().point(place);
    let noise = Covariance::isotropic(args.touch_sigma);
    let checked = recheck(mark.position, touched, &found.tre(mark.position), &noise);
    let is_used = found.landmarks.residuals.iter().any(|r| r.name.eq_ignore_ascii_case(&mark.label));
    let fits = |other: &&Exchanged| is_used || other.holds_too(place, mark.position, &checked);
    if let Some(other) = exchanged.iter().find(fits) {
        bail!("--check at '{}' proves nothing: {other}", mark.label);
    }
    Ok(
        json!({ "name": mark.label, "distance_mm": checked.distance, "limit_mm": checked.limit, "holds": checked.holds() }),
    )
}

/// The residuals say which landmark is doubtful, never how accurate the registration is.
fn residuals(found: &Found) -> Value {
    let one = |(i, r): (usize, &LandmarkResidual)| {
        json!({
            "name": r.name, "residual_mm": found.residuals[i], "residual_by_landmarks_mm": r.distance, "left_out_mm": r.left_out, "expected_mm": r.expected,
            "outlier": found.landmarks.outlier == Some(i),
        })
    };
    found.landmarks.residuals.iter().enumerate().map(one).collect()
}
