//! From landmarks to a planned path.

use crate::{PrepareError, Request};
use monro_anatomy::landmarks::{self, Landmarks};
use monro_anatomy::segment::Segmentation;
use monro_case::markups::NamedPoint;
use monro_geometry::{Bvh, Grid, Patient, Point, Structure, TriangleMesh, Vector, Volume};
use monro_guidance::{Plan, Side, skull_angle};

/// A given entry may lie this far from the skin: markers and thick hair, but not another head.
const ENTRY_OFF_SKIN_MM: f64 = 30.0;
/// A given entry as near to the skin as this is on it, mm.
const ENTRY_ON_SKIN_MM: f64 = 1.0;
/// Beyond this an entry is remarked upon; other burr holes in use (Keen, Dandy, Frazier) are further away than that.
const FAR_FROM_KOCHER_MM: f64 = 40.0;
/// A target this much beside a ventricle is told, beyond half a voxel, mm.
const BESIDE_MM: f64 = 0.25;
/// A target in no ventricle further than this from the foramen is remarked upon: of one nearer, labels and landmark decide.
const FAR_FROM_MONRO_MM: f64 = 8.0;

/// More than this over the skull is not skin alone, mm: three heads have 3 to 5, with dressings of 10 and 12 mm 14 and 16.
const MOST_SCALP_MM: f64 = 11.0;

/// A falx or tentorium of less than this is a scrap of one: both have some 50 cm2.
const LEAST_SEPTUM_CM2: f64 = 20.0;

/// The path, its angle to the skull, and the landmarks it came from.
#[derive(Debug)]
pub(crate) struct Planned {
    /// The path.
    pub(crate) plan: Plan,
    /// Angle between the path and the surface of the skull where it crosses it, degrees: 90 is perpendicular.
    pub(crate) skull_angle_deg: Option<f64>,
    /// All landmarks found.
    pub(crate) landmarks: Vec<NamedPoint>,
    /// Falx and tentorium.
    pub(crate) septa: Option<TriangleMesh>,
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
    let (plan, moved) = match (request.path, &found) {
        (Some(path), _) => given(path, segmentation, skin, request)?,
        (None, Ok(marks)) => (automatic(marks, request.side.unwrap_or(Side::Right))?, None),
        (None, Err(error)) => return Err(PrepareError::Landmarks(error.clone())),
    };
    let skull_angle_deg = skull_normal(&plan, skull)
        .filter(|_| crosses_skull(&plan, &segmentation.labels))
        .and_then(|normal| skull_angle(&plan, normal))
        .map(|from_normal| 90.0 - from_normal.to_degrees());
    let beside = || ends_beside(&plan, &segmentation.labels).filter(|_| request.path.is_none());
    let mut findings: Vec<String> =
        moved.into_iter().chain(doubts(&plan, &segmentation.labels).or_else(beside)).collect();
    if skull_angle_deg.is_none() {
        findings.push(
            "the path crosses no skull, so its angle is unknown: is the head cut open where it goes in (a burr hole, a flap of \
             bone taken out)? Look at the pictures, or give a path with --plan FILE.mrk.json"
                .into(),
        );
    }
    findings.extend(padded(&plan, &segmentation.labels, skull_angle_deg));
    let landmarks = match &found {
        Ok(marks) => {
            findings.extend(far_from_kocher(&plan, marks));
            findings.extend(far_from_monro(&plan, marks, &segmentation.labels));
            findings.extend(marks.findings.iter().cloned());
            named(marks)
        }
        Err(error) => {
            findings.push(format!("landmarks not found: {error}"));
            Vec::new()
        }
    };
    let septa = septa(segmentation, &plan, &mut findings);
    Ok(Planned { plan, skull_angle_deg, landmarks, septa, findings })
}

/// Falx and tentorium as one surface, as far as the labels show where they are; with what is to be said of them.
fn septa(segmentation: &Segmentation, plan: &Plan, findings: &mut Vec<String>) -> Option<TriangleMesh> {
    let found = landmarks::septa(segmentation).unwrap_or_default();
    let mut all = TriangleMesh::default();
    for (name, sheet) in ["falx", "tentorium"].into_iter().zip(found) {
        let cm2 = sheet.area() / 100.0;
        if cm2 < LEAST_SEPTUM_CM2 {
            findings.push(format!(
                "the labels show too little of the inside of the skull to say where the {name} is ({cm2:.0} cm2 of some 50): the \
                 case has none"
            ));
            continue;
        }
        if let Some(depth) = plan.first_through(&Bvh::new(&sheet)) {
            findings.push(format!(
                "the path goes through the {name}, where an average head has it, {depth:.0} mm deep: that is dura, and no simulation \
                 here meets it; look at the pictures"
            ));
        }
        all.append(&sheet);
    }
    (!all.triangles.is_empty()).then_some(all)
}

fn automatic(marks: &Landmarks, side: Side) -> Result<Plan, PrepareError> {
    let (_, entry, target) = of_side(side, marks);
    Ok(Plan::new(side, entry, target)?)
}

fn given(
    [entry, target]: [Point<Patient>; 2],
    segmentation: &Segmentation,
    skin: &TriangleMesh,
    request: &Request,
) -> Result<(Plan, Option<String>), PrepareError> {
    let is_left = segmentation.midsagittal.signed_distance(entry) >= 0.0;
    let side = if is_left { Side::Left } else { Side::Right };
    if let Some(wanted) = request.side
        && wanted != side
    {
        return Err(PrepareError::Side { wanted: wanted.name(), found: side.name() });
    }
    let plan = Plan::new(side, entry, target)?;
    let skin = Bvh::new(skin);
    check_ends(&plan, &segmentation.labels, &skin)?;
    from_skin(plan, &skin, segmentation.labels.grid())
}

/// The same path from where it goes through the skin: depths count from there. Markers lie above it, and entries on the skull
/// below. With what to tell of it.
fn from_skin(plan: Plan, skin: &Bvh, grid: &Grid) -> Result<(Plan, Option<String>), PrepareError> {
    let out = skin.ray_all(plan.target(), -plan.direction()).into_iter().filter(|h| !h.entering);
    let off = out.map(|h| h.t - plan.length()).min_by(|a, b| a.abs().total_cmp(&b.abs()));
    let Some(off) = off.filter(|off| off.abs() <= ENTRY_OFF_SKIN_MM) else {
        let told = "the path goes through the skin nowhere near its entry: depths count from the entry as given";
        return Ok((plan, Some(told.into())));
    };
    if off.abs() <= ENTRY_ON_SKIN_MM {
        return Ok((plan, None));
    }
    let entry = plan.at_depth(-off);
    if is_at_border(grid, entry) {
        let told = "the scan ends before the skin where the path goes in: depths count from the entry as given";
        return Ok((plan, Some(told.into())));
    }
    let [x, y, z] = entry.to_array();
    let told = format!(
        "the entry given lies {:.1} mm {} the skin along the path: the path begins at ({x:.1}, {y:.1}, {z:.1}) mm, where it goes \
         through it, and depths count from there",
        off.abs(),
        if off > 0.0 { "under" } else { "above" }
    );
    Ok((Plan::new(plan.side(), entry, plan.target())?, Some(told)))
}

/// Whether a point is within a voxel of the scan's border, where surfaces are capped.
fn is_at_border(grid: &Grid, p: Point<Patient>) -> bool {
    let (voxel, dims) = (grid.voxel_from_patient().point(p).to_array(), grid.dims());
    (0..3).any(|a| voxel[a] < 1.0 || voxel[a] > dims[a] as f64 - 2.0)
}

/// Refuses a path that cannot be one of this head: a target that is not inside the skull, an entry far from the skin.
fn check_ends(plan: &Plan, labels: &Volume<u8>, skin: &Bvh) -> Result<(), PrepareError> {
    let inside = |p| labels.nearest(p).and_then(Structure::from_label).is_some_and(Structure::is_intracranial);
    if !inside(plan.target()) {
        return Err(PrepareError::Target(plan.target().to_array()));
    }
    let off = skin.nearest(plan.entry()).map_or(f64::INFINITY, |n| n.distance);
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

/// Depths (mm) along the path, every quarter of a millimetre, and what the labels have there.
fn along(plan: &Plan, labels: &Volume<u8>) -> impl Iterator<Item = (f64, Option<Structure>)> {
    plan.every(0.25).map(|(depth, at)| (depth, labels.nearest(at).and_then(Structure::from_label)))
}

/// Whether there is skull on the path before it is inside. The surface of the skull
/// and of all within it also closes holes in it.
fn crosses_skull(plan: &Plan, labels: &Volume<u8>) -> bool {
    let structures = along(plan, labels).filter_map(|(_, structure)| structure);
    structures.take_while(|s| !s.is_intracranial()).any(|s| s == Structure::Skull)
}

/// A remark when a path that was found by itself goes through a ventricle but ends beside it.
fn ends_beside(plan: &Plan, labels: &Volume<u8>) -> Option<String> {
    let (target, grid) = (plan.target(), labels.grid());
    let end = labels.nearest(target).and_then(Structure::from_label).filter(|s| !s.is_ventricle())?;
    let is_ventricle = |at: usize| Structure::from_label(labels.data()[at]).is_some_and(Structure::is_ventricle);
    let distance = |at: usize| {
        let [i, j, k] = grid.voxel(at);
        grid.centre(i, j, k).distance(target)
    };
    let nearest = (0..grid.len()).filter(|&at| is_ventricle(at)).map(distance).fold(f64::INFINITY, f64::min);
    let half = 0.5 * grid.spacing().into_iter().fold(0.0, f64::max);
    (nearest - half > BESIDE_MM).then(|| {
        format!(
            "the path goes through a ventricle, but ends in {}, {nearest:.1} mm from the nearest place in one: no fluid would drip \
             there; look at the pictures, or give a path with --plan FILE.mrk.json",
            end.words()
        )
    })
}

/// The name of a side, Kocher's point and the foramen of Monro there.
fn of_side(side: Side, marks: &Landmarks) -> (&'static str, Point<Patient>, Point<Patient>) {
    match side {
        Side::Left => ("left", marks.kocher_left, marks.monro_left),
        Side::Right => ("right", marks.kocher_right, marks.monro_right),
    }
}

/// A remark when the entry is not where external ventricular drains go in.
fn far_from_kocher(plan: &Plan, marks: &Landmarks) -> Option<String> {
    let (side, kocher, _) = of_side(plan.side(), marks);
    let off = plan.entry().distance(kocher);
    (off > FAR_FROM_KOCHER_MM).then(|| {
        format!("the entry is {off:.0} mm from the {side} Kocher's point: check its coordinate system (RAS or LPS)")
    })
}

/// A remark when the target is not where external ventricular drains end.
fn far_from_monro(plan: &Plan, marks: &Landmarks, labels: &Volume<u8>) -> Option<String> {
    let (side, _, monro) = of_side(plan.side(), marks);
    let off = plan.target().distance(monro);
    let within = labels.nearest(plan.target()).and_then(Structure::from_label).filter(|s| !s.is_ventricle())?;
    (off > FAR_FROM_MONRO_MM).then(|| {
        format!(
            "the target lies in no ventricle but in {}, {off:.0} mm from the {side} foramen of Monro: is it meant, or its \
             coordinate system (RAS or LPS) wrong?",
            within.words()
        )
    })
}

/// A remark where more lies over the skull than skin, at right angles to it, by the path's angle to the skull.
fn padded(plan: &Plan, labels: &Volume<u8>, skull_angle_deg: Option<f64>) -> Option<String> {
    let (depth, _) = along(plan, labels).find(|(_, structure)| *structure == Some(Structure::Skull))?;
    let mm = depth * skull_angle_deg?.to_radians().sin();
    (mm > MOST_SCALP_MM).then(|| {
        format!(
            "{mm:.0} mm of soft tissue lie over the skull where the path goes in (3 to 8 mm are usual): a dressing, a swelling or blood \
             under the skin? The entry is on its surface, and Kocher's point was measured over it: look at the pictures, or give a path \
             with --plan FILE.mrk.json"
        )
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Brain all over, but for a ventricle at x of 40 mm and more.
    fn labels() -> Volume<u8> {
        let grid = Grid::axis_aligned([100, 20, 20], [1.0; 3], [0.0; 3]).expect("a grid");
        let label = |n: usize| {
            let s = if grid.voxel(n)[0] < 40 { Structure::Brain } else { Structure::LeftLateralVentricle };
            s.label()
        };
        Volume::new(grid, (0..grid.len()).map(label).collect()).expect("values")
    }

    fn marks(monro_left: Point<Patient>) -> Landmarks {
        let far = Point::new(90.0, 10.0, 10.0);
        Landmarks {
            nasion: far,
            midline_110mm: far,
            kocher_left: far,
            kocher_right: far,
            monro_left,
            monro_right: far,
            findings: Vec::new(),
        }
    }

    #[test]
    fn a_target_in_brain_beyond_the_ventricle_drew_no_remark() {
        let (labels, marks) = (labels(), marks(Point::new(42.0, 10.0, 10.0)));
        let told = |x: f64| {
            let plan = Plan::new(Side::Left, Point::new(99.0, 10.0, 10.0), Point::new(x, 10.0, 10.0)).expect("a plan");
            far_from_monro(&plan, &marks, &labels)
        };
        let said = told(2.0).expect("a remark");
        assert!(said.contains("in no ventricle but in brain, 40 mm from the left foramen"), "{said}");
        // Deep in the ventricle, and beside the foramen.
        assert_eq!((told(80.0), told(36.0)), (None, None));
    }

    #[test]
    fn a_path_through_the_ventricle_into_brain_and_one_through_a_hole_in_the_skull_drew_no_remark() {
        let mut labels = labels();
        let told = |x: f64, labels: &Volume<u8>| {
            let plan = Plan::new(Side::Left, Point::new(99.0, 10.0, 10.0), Point::new(x, 10.0, 10.0)).expect("a plan");
            (ends_beside(&plan, labels), crosses_skull(&plan, labels))
        };
        let (said, _) = told(37.0, &labels);
        assert!(said.is_some_and(|s| s.contains("ends in brain, 3.0 mm from the nearest")));
        assert_eq!((told(39.4, &labels).0, told(41.0, &labels).0), (None, None));
        // Skin up to 95 mm, then skull; and a hole in that.
        let grid = *labels.grid();
        for at in 0..grid.len() {
            let [i, j, k] = grid.voxel(at);
            let label = if i > 95 {
                Structure::Scalp
            } else if i > 90 {
                Structure::Skull
            } else {
                continue;
            };
            let is_hole = label == Structure::Skull && j.abs_diff(10) + k.abs_diff(10) < 4;
            labels.data_mut()[at] = if is_hole { Structure::Scalp.label() } else { label.label() };
        }
        assert!(!told(41.0, &labels).1);
        labels
            .data_mut()
            .iter_mut()
            .for_each(|l| *l = if *l == Structure::Scalp.label() { Structure::Skull.label() } else { *l });
        assert!(told(41.0, &labels).1);
    }

    #[test]
    fn a_dressing_was_taken_for_scalp_without_a_word() {
        let told = |scalp: f64, angle: f64| {
            let grid = Grid::axis_aligned([100, 20, 20], [1.0; 3], [0.0; 3]).expect("a grid");
            let label = |n: usize| match 99.0 - grid.voxel(n)[0] as f64 {
                d if d < scalp => Structure::Scalp.label(),
                d if d < scalp + 6.0 => Structure::Skull.label(),
                _ => Structure::Brain.label(),
            };
            let labels = Volume::new(grid, (0..grid.len()).map(label).collect()).expect("values");
            let plan =
                Plan::new(Side::Left, Point::new(99.4, 10.0, 10.0), Point::new(2.0, 10.0, 10.0)).expect("a plan");
            padded(&plan, &labels, Some(angle))
        };
        assert_eq!((told(6.0, 90.0), told(15.0, 30.0)), (None, None));
        let said = told(16.0, 90.0).expect("told");
        assert!(said.starts_with("16 mm of soft tissue"), "{said}");
    }

    #[test]
    fn an_entry_too_far_off_was_said_to_be_as_far_as_is_taken() {
        let said = PrepareError::Entry { entry: [0.0; 3], off: 30.2, most: ENTRY_OFF_SKIN_MM }.to_string();
        assert!(said.contains("30.2 mm from the skin, at most 30.0 mm"), "{said}");
    }
}
