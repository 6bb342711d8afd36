//! From landmarks to a planned path.

use super::Request;
use anyhow::{Context, Result, bail};
use monro_anatomy::landmarks::{self, Landmarks};
use monro_anatomy::segment::Segmentation;
use monro_case::markups::NamedPoint;
use monro_geometry::{Bvh, Patient, Point, Structure, TriangleMesh, Vector, Volume};
use monro_guidance::{Plan, Side, skull_angle};

/// The path, its angle to the skull, and the landmarks it came from.
#[derive(Debug)]
pub(crate) struct Planned {
    /// The path.
    pub(crate) plan: Plan,
    /// Angle between the path and the surface of the skull where it crosses it, degrees: 90 is perpendicular.
    pub(crate) skull_angle_deg: Option<f64>,
    /// All landmarks found.
    pub(crate) landmarks: Vec<NamedPoint>,
    /// Remarks on the landmarks.
    pub(crate) findings: Vec<String>,
}

/// Plans from the request's own path, or from Kocher's point to the foramen of Monro of the same side.
pub(crate) fn plan(
    ct: &Volume<i16>,
    segmentation: &Segmentation,
    skull: &TriangleMesh,
    request: &Request,
) -> Result<Planned> {
    let found = landmarks::find(ct, segmentation);
    let plan = match (request.path, &found) {
        (Some(path), _) => given(path, segmentation, request)?,
        (None, Ok(marks)) => automatic(marks, request.side.unwrap_or(Side::Right))?,
        (None, Err(_)) => bail!(
            "{}; give the path yourself with --plan FILE.mrk.json (a line from entry to target, drawn in 3D Slicer)",
            found.err().map(|e| e.to_string()).unwrap_or_default()
        ),
    };
    let skull_angle_deg = skull_normal(&plan, skull)
        .and_then(|normal| skull_angle(&plan, normal))
        .map(|from_normal| 90.0 - from_normal.to_degrees());
    let (landmarks, mut findings) = match found {
        Ok(marks) => (named(&marks), marks.findings),
        Err(error) => (Vec::new(), vec![format!("landmarks not found: {error}")]),
    };
    findings.extend(outside_head(&plan, &segmentation.labels));
    Ok(Planned { plan, skull_angle_deg, landmarks, findings })
}

fn automatic(marks: &Landmarks, side: Side) -> Result<Plan> {
    let (entry, target) = match side {
        Side::Left => (marks.kocher_left, marks.monro_left),
        Side::Right => (marks.kocher_right, marks.monro_right),
    };
    Ok(Plan::new(side, entry, target)?)
}

fn given([entry, target]: [Point<Patient>; 2], segmentation: &Segmentation, request: &Request) -> Result<Plan> {
    let is_left = segmentation.midsagittal.signed_distance(entry) >= 0.0;
    let side = if is_left { Side::Left } else { Side::Right };
    if let Some(wanted) = request.side
        && wanted != side
    {
        bail!("--side {} contradicts --plan, whose entry lies on the patient's {}", wanted.name(), side.name());
    }
    let plan = Plan::new(side, entry, target).context("the plan is not usable")?;
    if segmentation.labels.nearest(target).is_none() {
        bail!(
            "the target {:?} (LPS mm) of --plan lies outside the scan; does the file belong to this patient, and is its coordinate system right?",
            target.to_array()
        );
    }
    Ok(plan)
}

fn named(m: &Landmarks) -> Vec<NamedPoint> {
    crate::landmarks::named([m.nasion, m.midline_110mm, m.kocher_left, m.kocher_right, m.monro_left, m.monro_right])
}

/// A remark when the target is not inside the skull.
fn outside_head(plan: &Plan, labels: &Volume<u8>) -> Option<String> {
    let at = labels.nearest(plan.target()).and_then(Structure::from_label)?;
    (!at.is_intracranial()).then(|| format!("the target lies in {}, not inside the skull", at.name()))
}

/// Mean outward normal of the skull's surface within 10 mm of where the path meets it: a single triangle would follow
/// the voxels, a burr hole does not.
fn skull_normal(plan: &Plan, skull: &TriangleMesh) -> Option<Vector<Patient>> {
    const REACH_MM: f64 = 10.0;
    let hit = Bvh::new(skull).ray_all(plan.entry(), plan.direction()).into_iter().find(|h| h.entering)?;
    let at = plan.at_depth(hit.t);
    let near = |t: &usize| skull.corners(*t).iter().any(|c| c.distance(at) < REACH_MM);
    let facing = |n: &Vector<Patient>| n.dot(plan.direction()) < 0.0;
    let sum = (0..skull.triangles.len()).filter(near).map(|t| skull.area_vector(t)).filter(facing);
    sum.fold(Vector::ZERO, |a, b| a + b).normalized()
}
