//! `monro register`: from touched landmarks and a traced skin to the patient, with the error that is to be expected.

use crate::args::RegisterArgs;
use crate::calibrate::{named_points, point, rows};
use crate::columns::short;
use crate::console::Console;
use anyhow::{Context, Result, bail};
use monro_case::{Case, markups};
use monro_geometry::{Patient, Point, Rigid, Tool};
use monro_guidance::Covariance;
use monro_guidance::registration::{
    Landmark, LandmarkRegistration, LandmarkResidual, RefineOptions, Refined, Surface, SurfaceSample, recheck,
    refine_on_surface, register_landmarks,
};
use serde_json::{Value, json};

/// Part of the traced points that must fit the skin: a careful hand loses one in twenty.
const LEAST_USED: f64 = 0.8;

/// A registration by landmarks, and by the surface where it was traced.
struct Found {
    landmarks: LandmarkRegistration<Patient, Tool>,
    surface: Option<Refined<Tool>>,
}

impl Found {
    fn patient_from_reference(&self) -> Rigid<Patient, Tool> {
        self.surface.as_ref().map_or(self.landmarks.to_from, |s| s.patient_from)
    }

    fn tre(&self, at: Point<Patient>) -> Covariance<Patient> {
        self.surface.as_ref().map_or_else(|| self.landmarks.tre(at), |s| s.tre(at))
    }
}

/// Runs the command.
pub(crate) fn run(args: &RegisterArgs, console: &Console) -> Result<()> {
    let case = Case::open(&args.case)?;
    let landmarks = landmarks(args, &case)?;
    let by_landmarks = register_landmarks(&landmarks)?;
    // Before the skin is looked at: a pose that is mirrored fits no skin, and that would be all that is said.
    if let Some(contradiction) = by_landmarks.contradiction(&landmarks) {
        bail!("{}: {contradiction}\n{}", args.landmarks.display(), residual_lines(&by_landmarks));
    }
    let found = refine(args, &case, &landmarks, by_landmarks)?;
    let check = args.check.as_deref().map(|c| check(c, args, &landmarks, &found)).transpose()?;
    let pose = found.patient_from_reference();
    let (target, entry) = (case.plan.target(), case.plan.entry());
    let result = json!({
        "event": "registered", "quaternion_wxyz": pose.quaternion_wxyz(), "translation_mm": pose.translation().to_array(),
        "predicted_tre_mm": found.tre(target).rms(), "predicted_tre_95_mm": found.tre(target).percentile_95(),
        "predicted_tre_entry_mm": found.tre(entry).rms(),
        "landmarks": residuals(&found), "surface": found.surface.as_ref().map(surface_json), "check": check,
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
    out += "Landmark: residual, and how far it lies from where the others put it (expected), mm. Neither is the accuracy.\n";
    out += &residual_lines(&found.landmarks);
    if let Some(r) = found.landmarks.outlier.and_then(|i| found.landmarks.residuals.get(i)) {
        let kept = if found.surface.is_some() { "; it was left out beside the skin" } else { "" };
        out += &format!("'{}' does not fit: touch it again or leave it out{kept}.\n", r.name);
    }
    if let Some(surface) = &found.surface {
        out += &format!("Skin: {} of {} traced points used.\n", used(surface), surface.residuals.len());
        if is_doubtful(surface) {
            out += "Many traced points lie off the skin: trace again, for the error may be larger than said.\n";
        }
    }
    if let (Some(name), Some(distance)) = (result["check"]["name"].as_str(), result["check"]["distance_mm"].as_f64()) {
        let limit = result["check"]["limit_mm"].as_f64().unwrap_or(f64::NAN);
        let verdict = if result["check"]["holds"] == true { "holds" } else { "does not hold: register again" };
        out += &format!("Check: '{name}' touched again is {distance:.2} mm off (limit {limit:.2}): {verdict}.\n");
    }
    out + &format!(
        "Pose of the reference body in the patient: quaternion (w, x, y, z) {}, translation {} mm.\n\
         With --json: what a live session takes at /api/session.",
        short(&result["quaternion_wxyz"]),
        short(&result["translation_mm"])
    )
}

fn residual_lines(landmarks: &LandmarkRegistration<Patient, Tool>) -> String {
    let line = |r: &LandmarkResidual| {
        let others = r.left_out.zip(r.expected).map_or_else(String::new, |(d, e)| format!(", {d:.2} ({e:.2})"));
        format!("  {}: {:.2}{others}\n", r.name, r.distance)
    };
    landmarks.residuals.iter().map(line).collect()
}

/// The touched points beside their marks of the same name.
fn landmarks(args: &RegisterArgs, case: &Case) -> Result<Vec<Landmark<Patient, Tool>>> {
    let marked = match &args.marked {
        Some(path) => {
            let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
            markups::decode(&text).with_context(|| path.display().to_string())?
        }
        None => case.landmarks.clone(),
    };
    let noise = Covariance::isotropic(args.touch_sigma);
    let pair = |(name, touched): (String, Point<Tool>)| {
        let mark = marked.iter().find(|m| m.label.eq_ignore_ascii_case(&name));
        let names = || marked.iter().map(|m| m.label.as_str()).collect::<Vec<_>>().join(", ");
        let mark = mark.with_context(|| format!("no landmark is marked as '{name}' (marked: {})", names()))?;
        Ok(Landmark { name, touched, marked: mark.position, noise })
    };
    let touched = named_points(&args.landmarks)?;
    let twice =
        touched.iter().enumerate().find(|(i, (n, _))| touched[..*i].iter().any(|(m, _)| m.eq_ignore_ascii_case(n)));
    if let Some((_, (name, _))) = twice {
        bail!("{}: '{name}' is given twice; keep the touch that counts", args.landmarks.display());
    }
    touched.into_iter().map(pair).collect()
}

/// The registration by landmarks refined on the traced skin, where it was traced.
fn refine(
    args: &RegisterArgs,
    case: &Case,
    landmarks: &[Landmark<Patient, Tool>],
    by_landmarks: LandmarkRegistration<Patient, Tool>,
) -> Result<Found> {
    let Some(path) = &args.surface else { return Ok(Found { landmarks: by_landmarks, surface: None }) };
    let noise = Covariance::isotropic(args.trace_sigma);
    let sample = |p| SurfaceSample { point: Point::from_array(p), noise };
    let samples: Vec<_> = rows::<3>(path, "x y z")?.into_iter().map(sample).collect();
    let skin = Surface::new(&case.skin)?;
    // A landmark that the others contradict would pull the surface along, and is not in the noise that is predicted from.
    let kept: Vec<_> =
        (0..landmarks.len()).filter(|&i| by_landmarks.outlier != Some(i)).map(|i| landmarks[i].clone()).collect();
    let start = if kept.len() < landmarks.len() { register_landmarks(&kept)?.to_from } else { by_landmarks.to_from };
    let refined = refine_on_surface(&start, &samples, &kept, &skin, &RefineOptions::default())?;
    Ok(Found { landmarks: by_landmarks, surface: Some(refined) })
}

/// `NAME,X,Y,Z`: a landmark touched again.
fn check(text: &str, args: &RegisterArgs, landmarks: &[Landmark<Patient, Tool>], found: &Found) -> Result<Value> {
    let (name, place) = text.split_once(',').with_context(|| format!("--check {text} is not NAME,X,Y,Z"))?;
    let known = landmarks.iter().find(|l| l.name.eq_ignore_ascii_case(name.trim()));
    let Some(mark) = known else { bail!("--check {name}: no landmark of this name was touched") };
    let touched = found.patient_from_reference().point(point(place)?);
    let noise = Covariance::isotropic(args.touch_sigma);
    let checked = recheck(mark.marked, touched, &found.tre(mark.marked), &noise);
    Ok(
        json!({ "name": mark.name, "distance_mm": checked.distance, "limit_mm": checked.limit, "holds": checked.holds() }),
    )
}

/// The residuals say which landmark is doubtful, never how accurate the registration is.
fn residuals(found: &Found) -> Value {
    let one = |(i, r): (usize, &LandmarkResidual)| {
        json!({
            "name": r.name, "residual_mm": r.distance, "left_out_mm": r.left_out, "expected_mm": r.expected,
            "outlier": found.landmarks.outlier == Some(i),
        })
    };
    found.landmarks.residuals.iter().enumerate().map(one).collect()
}

/// Traced points that fit the skin.
fn used(surface: &Refined<Tool>) -> usize {
    surface.residuals.iter().filter(|r| r.used).count()
}

/// Whether so many traced points had to be left out that those kept may be wrong, too.
fn is_doubtful(surface: &Refined<Tool>) -> bool {
    (used(surface) as f64) < LEAST_USED * surface.residuals.len() as f64
}

fn surface_json(refined: &Refined<Tool>) -> Value {
    let used: Vec<_> = refined.residuals.iter().filter(|r| r.used).collect();
    let squares: f64 = used.iter().map(|r| r.distance * r.distance).sum();
    json!({
        "points": refined.residuals.len(), "used": used.len(), "doubtful": is_doubtful(refined), "iterations": refined.iterations,
        "residual_mm": (squares / used.len().max(1) as f64).sqrt(), "variance_ratio": refined.variance_ratio,
    })
}
