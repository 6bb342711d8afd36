//! What the reader must know about a segmentation, and how far each structure can be trusted.

use super::blood::{self, Blood};
use super::cavity::Cavity;
use super::ends::Ends;
use super::model::Pose;
use super::noise::Noise;
use super::size::Size;
use super::ventricles::{LEFT, RIGHT, Ventricles};
use super::working::Working;
use monro_geometry::{Patient, Plane, Point, Structure, Vector, Volume};

/// Ventricles that fit their usual course by less than this, of 1, are doubtful.
const LEAST_SCORE: f64 = 0.4;
/// A midline shift brings this part of a ventricle across the midplane seldom; more is told.
const ACROSS: f64 = 0.4;

/// Slices from this thickness on, mm, are told.
const THICK_MM: f64 = 4.0;
/// Part of the skull's Dice that goes for each mm more than one of a voxel's edges: 0.84 and 0.81 of a 0.9 mm head are left with
/// slices of 7 mm and cubes of 4 mm.
const COARSE: f64 = 0.0155;

/// Less air than this in the ventricles may be noise, mL.
const LEAST_AIR_ML: f64 = 0.05;

/// What the steps found.
#[derive(Debug)]
pub(crate) struct Evidence<'a> {
    pub(crate) working: &'a Working,
    pub(crate) cavity: &'a Cavity,
    pub(crate) size: Size,
    pub(crate) ends: Ends,
    /// Area where bone or brain is the top of the head, mm2.
    pub(crate) bare_top_mm2: f64,
    pub(crate) pose: Pose,
    pub(crate) noise: Noise,
    pub(crate) plane: &'a Plane<Patient>,
    pub(crate) blood: Option<Blood>,
    /// What may be blood between bone and brain, mL.
    pub(crate) layer_ml: Option<f64>,
    /// Air between bone and brain, mL.
    pub(crate) pocket_ml: f64,
    pub(crate) ventricles: &'a Ventricles,
}

/// Findings and confidence.
pub(crate) fn remarks(evidence: &Evidence<'_>, labels: &Volume<u8>) -> (Vec<String>, Vec<(Structure, f64)>) {
    let sizes = volumes_ml(labels);
    let size = |s: Structure| sizes[usize::from(s.label())];
    let across = across(evidence);
    (findings(evidence, across, size), confidence(evidence, across, size))
}

/// Volume of each structure by its number, mL.
pub(crate) fn volumes_ml(labels: &Volume<u8>) -> [f64; 8] {
    let mut counts = [0usize; 256];
    labels.data().iter().for_each(|&l| counts[usize::from(l)] += 1);
    let ml = labels.grid().voxel_volume() / 1000.0;
    core::array::from_fn(|l| counts[l] as f64 * ml)
}

fn findings(evidence: &Evidence<'_>, across: [f64; 2], size: impl Fn(Structure) -> f64) -> Vec<String> {
    let mut out = what_the_scan_shows(evidence);
    out.extend(evidence.noise.finding());
    out.extend(thick_slices(evidence));
    out.extend(sizes(size));
    out.extend(blood_in(evidence));
    out.extend(evidence.layer_ml.map(|ml| {
        format!(
            "hyperdense ({ml:.0} mL in one piece under the skull): a haematoma on the brain? It is counted to the brain; does the \
             path go through it?"
        )
    }));
    out.extend(air(evidence));
    out.extend(shifted_across(across));
    let score = evidence.pose.score;
    out.extend((score < LEAST_SCORE).then(|| {
        format!(
            "the ventricles fit the expected course poorly (score {score:.2} of 1): check left and right, and how the head lies"
        )
    }));
    out
}

/// What is missing of the head.
fn what_the_scan_shows(evidence: &Evidence<'_>) -> Vec<String> {
    let mut out = Vec::new();
    if let Some(value) = evidence.working.masked_with {
        out.push(format!("the image is masked with {value} HU outside the head: no air, so no skin can be found"));
    }
    let open_mm2 = open_top(evidence);
    if open_mm2 > 0.0 {
        out.push(format!("vertex cut: skull and skin are open at the top over {:.0} cm2", open_mm2 / 100.0));
    }
    out.extend(evidence.ends.findings());
    let whole = open_mm2 == 0.0 && evidence.cavity.neck_cut && !evidence.ends.cut();
    out.extend(evidence.size.finding(whole));
    if !evidence.cavity.neck_cut {
        out.push("the scan ends above the foramen magnum: the brain is cut off below".into());
    }
    out
}

/// Slices too thick for what is small.
fn thick_slices(evidence: &Evidence<'_>) -> Option<String> {
    let longest = evidence.working.binned.spacing().into_iter().fold(0.0, f64::max);
    let sides = if is_sagittal(evidence) {
        "; lying from left to right as they do, they part the ventricles badly: one of 10 mL may be a third too large, and the third ventricle is not to be relied on"
    } else {
        ""
    };
    (longest >= THICK_MM).then(|| {
        format!(
            "slices of {longest:.1} mm: bone and small ventricles come out too large (ventricles of 10 mL by about a tenth with \
             5 mm, by up to four tenths with 7 mm){sides}; take a series of 2 mm or less if there is one"
        )
    })
}

/// Ventricles that are missing or unlike each other.
fn sizes(size: impl Fn(Structure) -> f64) -> Vec<String> {
    let third = size(Structure::ThirdVentricle);
    let (left, right) = (size(Structure::LeftLateralVentricle), size(Structure::RightLateralVentricle));
    let missing = (third == 0.0).then(|| "third ventricle not found".into());
    let unlike = (left.max(right) > 2.0 * left.min(right))
        .then(|| format!("lateral ventricles of unlike size: left {left:.1} mL, right {right:.1} mL"));
    missing.into_iter().chain(unlike).collect()
}

/// Air within the skull.
fn air(evidence: &Evidence<'_>) -> Vec<String> {
    let (within, on) = (evidence.ventricles.air_ml, evidence.pocket_ml);
    let within = (within > LEAST_AIR_ML).then(|| {
        format!(
            "{within:.1} mL of air in the ventricles, as after an operation: it is counted to them, and their surface beside it is \
             not fitted to the scan"
        )
    });
    let on = (on > 0.0).then(|| {
        format!(
            "{on:.1} mL of air on the brain, under the skull, as after an operation: it is counted to the cerebrospinal fluid"
        )
    });
    within.into_iter().chain(on).collect()
}

/// Lateral ventricles, left and right, a part of which lies across the midplane.
fn shifted_across(across: [f64; 2]) -> impl Iterator<Item = String> {
    let shares = ["left", "right"].into_iter().zip(across).filter(|(_, share)| *share > ACROSS);
    shares.map(|(side, share)| {
        let percent = 100.0 * share;
        format!(
            "{percent:.0} % of the {side} lateral ventricle lies across the midplane: midline shift, or the sides are mistaken"
        )
    })
}

/// Whether the slices lie from left to right: the thickest direction of a voxel is across the midplane.
fn is_sagittal(evidence: &Evidence<'_>) -> bool {
    let grid = &evidence.working.binned.grid;
    let spacing = grid.spacing();
    let thickest = (0..3).fold(0, |a, b| if spacing[b] > spacing[a] { b } else { a });
    let along = Vector::<Patient>::from_array(grid.patient_from_voxel().linear.column(thickest));
    let is_slice = (0..3).all(|a| a == thickest || spacing[a] < 0.7 * spacing[thickest]);
    is_slice && (along.dot(evidence.plane.normal) / along.norm()).abs() > 0.7
}

/// Area over which bone or brain is the top of the head, or of what the scan shows of it, mm2. Thin skin over a bump of the
/// skull leaves some bare voxels in every scan: 0 for those, and for a masked image, which shows no skin.
fn open_top(evidence: &Evidence<'_>) -> f64 {
    let bare = if evidence.bare_top_mm2 > 300.0 { evidence.bare_top_mm2 } else { 0.0 };
    if evidence.working.masked_with.is_some() { 0.0 } else { bare.max(evidence.ends.open_top()) }
}

/// Sentences about blood in the ventricles or beside them.
fn blood_in(evidence: &Evidence<'_>) -> Vec<String> {
    let v = evidence.ventricles;
    let Some(clot) = &v.clot else { return blood::findings(evidence.blood, 0.0, &[]) };
    let both = |class: u8| v.classes.data.iter().zip(&clot.mask.data).filter(|(c, m)| **c == class && **m).count();
    let names = [("left lateral ventricle", 1), ("right lateral ventricle", 2), ("third ventricle", 3)];
    blood::findings(evidence.blood, clot.level, &names.map(|(name, class)| (name, both(class) as f64 / 1000.0)))
}

/// The part of the left and of the right lateral ventricle on the other side of the midplane.
fn across(evidence: &Evidence<'_>) -> [f64; 2] {
    let v = evidence.ventricles;
    [(LEFT, 1.0), (RIGHT, -1.0)].map(|(class, side)| {
        let voxels = (0..v.classes.data.len()).filter(|&n| v.classes.data[n] == class);
        let points = voxels.map(|n| v.lattice.point(v.classes.voxel(n).map(|c| c as f64)));
        share_across(evidence.plane, side, points)
    })
}

/// The part of some points that lies on the other side of the midplane than theirs (1 the left, -1 the right); 0 of none.
pub(crate) fn share_across(plane: &Plane<Patient>, side: f64, points: impl Iterator<Item = Point<Patient>>) -> f64 {
    let (all, wrong) = points.fold((0usize, 0usize), |(all, wrong), p| {
        (all + 1, wrong + usize::from(plane.signed_distance(p) * side < 0.0))
    });
    wrong as f64 / all.max(1) as f64
}

/// Expected Dice: of the ventricles by their borders, less where the model of their course fits badly (then parts may be
/// missing or foreign); of the others a plain statement, less when they are too small to be whole. Nothing is said of
/// cerebrospinal fluid: most of it lies in sulci and under the bone where the scan does not show it.
fn confidence(evidence: &Evidence<'_>, across: [f64; 2], size: impl Fn(Structure) -> f64) -> Vec<(Structure, f64)> {
    let fit = (evidence.pose.score / 0.5).clamp(0.0, 1.0);
    let [left, right, third] = evidence.ventricles.expected.map(|e| e * fit);
    // Mostly on the other side of the midplane it is hardly the ventricle of its name.
    let [left, right] = [0, 1].map(|n| [left, right][n] * (2.0 * (1.0 - across[n])).min(1.0));
    let spacing = evidence.working.binned.spacing();
    let coarse = COARSE * spacing.into_iter().map(|s| (s - 1.0).max(0.0)).sum::<f64>().min(20.0);
    let whole = |expected_ml: f64, s: Structure| (size(s) / expected_ml).clamp(0.0, 1.0);
    let of = |s: Structure| {
        Some(match s {
            Structure::Outside | Structure::Csf => return None,
            Structure::Scalp => {
                if evidence.working.masked_with.is_some() {
                    0.0
                } else {
                    0.95
                }
            }
            Structure::Skull => 0.93 * (1.0 - coarse) * whole(200.0, s),
            Structure::Brain => 0.93 * whole(600.0, s),
            Structure::LeftLateralVentricle => left,
            Structure::RightLateralVentricle => right,
            Structure::ThirdVentricle => third,
        })
    };
    Structure::ALL.into_iter().filter_map(|s| Some((s, of(s)?))).collect()
}
