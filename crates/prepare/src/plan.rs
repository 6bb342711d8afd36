//! From landmarks to a planned path.

use crate::{PrepareError, Request};
use monro_anatomy::landmarks::{self, Landmarks};
use monro_anatomy::segment::Segmentation;
use monro_case::markups::NamedPoint;
use monro_geometry::{Bvh, Patient, Point, Structure, TriangleMesh, Vector, Volume};
use monro_guidance::{Plan, Side, skull_angle};

/// A given entry may lie this far from the skin: markers and thick hair, but not another head.
const ENTRY_OFF_SKIN_MM: f64 = 30.0;
/// Beyond this an entry is remarked upon; other burr holes in use (Keen, Dandy, Frazier) are further away than that.
const FAR_FROM_KOCHER_MM: f64 = 40.0;

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
    [skin, skull]: [&TriangleMesh; 2],
    request: &Request,
) -> Result<Planned, PrepareError> {
    let found = landmarks::find(ct, segmentation);
    let plan = match (request.path, &found) {
        (Some(path), _) => given(path, segmentation, skin, request)?,
        (None, Ok(marks)) => automatic(marks, request.side.unwrap_or(Side::Right))?,
        (None, Err(error)) => return Err(PrepareError::Landmarks(error.clone())),
    };
    let skull_angle_deg = skull_normal(&plan, skull)
        .and_then(|normal| skull_angle(&plan, normal))
        .map(|from_normal| 90.0 - from_normal.to_degrees());
    let mut findings: Vec<String> = doubts(&plan, &segmentation.labels).into_iter().collect();
    if skull_angle_deg.is_none() {
        findings.push(
            "the path crosses no skull, so its angle is unknown: is the head cut open where it goes in? Look at the \
             pictures, or give a path with --plan FILE.mrk.json"
                .into(),
        );
    }
    let landmarks = match &found {
        Ok(marks) => {
            findings.extend(far_from_kocher(&plan, marks));
            findings.extend(marks.findings.iter().cloned());
            named(marks)
        }
        Err(error) => {
            findings.push(format!("landmarks not found: {error}"));
            Vec::new()
        }
    };
    Ok(Planned { plan, skull_angle_deg, landmarks, findings })
}

fn automatic(marks: &Landmarks, side: Side) -> Result<Plan, PrepareError> {
    let (entry, target) = match side {
        Side::Left => (marks.kocher_left, marks.monro_left),
        Side::Right => (marks.kocher_right, marks.monro_right),
    };
    Ok(Plan::new(side, entry, target)?)
}

fn given(
    [entry, target]: [Point<Patient>; 2],
    segmentation: &Segmentation,
    skin: &TriangleMesh,
    request: &Request,
) -> Result<Plan, PrepareError> {
    let is_left = segmentation.midsagittal.signed_distance(entry) >= 0.0;
    let side = if is_left { Side::Left } else { Side::Right };
    if let Some(wanted) = request.side
        && wanted != side
    {
        return Err(PrepareError::Side { wanted: wanted.name(), found: side.name() });
    }
    let plan = Plan::new(side, entry, target)?;
    check_ends(&plan, &segmentation.labels, skin)?;
    Ok(plan)
}

/// Refuses a path that cannot be one of this head: a target that is not inside the skull, an entry far from the skin.
fn check_ends(plan: &Plan, labels: &Volume<u8>, skin: &TriangleMesh) -> Result<(), PrepareError> {
    let inside = |p| labels.nearest(p).and_then(Structure::from_label).is_some_and(Structure::is_intracranial);
    if !inside(plan.target()) {
        return Err(PrepareError::Target(plan.target().to_array()));
    }
    let off = Bvh::new(skin).nearest(plan.entry()).map_or(f64::INFINITY, |n| n.distance);
    if off > ENTRY_OFF_SKIN_MM {
        return Err(PrepareError::Entry { entry: plan.entry().to_array(), off, most: ENTRY_OFF_SKIN_MM });
    }
    Ok(())
}

fn named(m: &Landmarks) -> Vec<NamedPoint> {
    crate::landmarks::named([m.nasion, m.midline_110mm, m.kocher_left, m.kocher_right, m.monro_left, m.monro_right])
}

/// A remark when the path never comes through a ventricle, looked at every half millimetre.
fn doubts(plan: &Plan, labels: &Volume<u8>) -> Option<String> {
    let at = |depth: f64| labels.nearest(plan.at_depth(depth)).and_then(Structure::from_label);
    let steps = (plan.length() / 0.5).ceil() as usize;
    let meets = (0..=steps).any(|i| at((i as f64 * 0.5).min(plan.length())).is_some_and(Structure::is_ventricle));
    let end = at(plan.length()).map_or("no part of the scan".into(), Structure::words);
    (!meets).then(|| format!("the path meets no ventricle; it ends in {end}: look at the pictures before using it"))
}

/// A remark when the entry is not where external ventricular drains go in.
fn far_from_kocher(plan: &Plan, marks: &Landmarks) -> Option<String> {
    let (kocher, side) = match plan.side() {
        Side::Left => (marks.kocher_left, "left"),
        Side::Right => (marks.kocher_right, "right"),
    };
    let off = plan.entry().distance(kocher);
    (off > FAR_FROM_KOCHER_MM).then(|| {
        format!("the entry is {off:.0} mm from the {side} Kocher's point: check its coordinate system (RAS or LPS)")
    })
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
