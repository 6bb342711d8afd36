//! What the reader must know about a segmentation, and how far each structure can be trusted.

use super::cavity::Cavity;
use super::model::Pose;
use super::noise::Noise;
use super::ventricles::Ventricles;
use super::working::Working;
use monro_geometry::{Structure, Volume};

/// What the steps found.
#[derive(Debug)]
pub(crate) struct Evidence<'a> {
    pub(crate) working: &'a Working,
    pub(crate) cavity: &'a Cavity,
    /// Area where bone or brain is the top of the head, mm2.
    pub(crate) bare_top_mm2: f64,
    pub(crate) pose: Pose,
    pub(crate) noise: Noise,
    pub(crate) ventricles: &'a Ventricles,
}

/// Findings and confidence.
pub(crate) fn remarks(evidence: &Evidence<'_>, labels: &Volume<u8>) -> (Vec<String>, Vec<(Structure, f64)>) {
    let sizes = volumes_ml(labels);
    let size = |s: Structure| sizes[usize::from(s.label())];
    (findings(evidence, size), confidence(evidence, size))
}

/// Volume of each structure by its number, mL.
pub(crate) fn volumes_ml(labels: &Volume<u8>) -> [f64; 8] {
    let mut counts = [0usize; 256];
    labels.data().iter().for_each(|&l| counts[usize::from(l)] += 1);
    let ml = labels.grid().voxel_volume() / 1000.0;
    core::array::from_fn(|l| counts[l] as f64 * ml)
}

fn findings(evidence: &Evidence<'_>, size: impl Fn(Structure) -> f64) -> Vec<String> {
    let mut out = Vec::new();
    if let Some(value) = evidence.working.masked_with {
        out.push(format!("the image is masked with {value} HU outside the head: no air, so no skin can be found"));
    }
    // Thin skin over a bump of the skull leaves some bare voxels in every scan.
    if evidence.bare_top_mm2 > 300.0 && evidence.working.masked_with.is_none() {
        let area = evidence.bare_top_mm2 / 100.0;
        out.push(format!("vertex cut: skull and skin are open at the top over {area:.0} cm2"));
    }
    if !evidence.cavity.neck_cut {
        out.push("the scan ends above the foramen magnum: the brain is cut off below".into());
    }
    out.extend(evidence.noise.finding());
    let third = size(Structure::ThirdVentricle);
    if third == 0.0 {
        out.push("third ventricle not found".into());
    }
    let (left, right) = (size(Structure::LeftLateralVentricle), size(Structure::RightLateralVentricle));
    if left.max(right) > 2.0 * left.min(right) {
        out.push(format!("lateral ventricles of unlike size: left {left:.1} mL, right {right:.1} mL"));
    }
    if evidence.pose.score < 0.4 {
        let score = evidence.pose.score;
        out.push(format!(
            "the ventricles fit the expected course poorly (score {score:.2} of 1): check left and right"
        ));
    }
    out
}

/// Expected Dice: of the ventricles by their borders, less where the model of their course fits badly (then parts may be
/// missing or foreign); of the others a plain statement, less when they are too small to be whole. Nothing is said of
/// cerebrospinal fluid: most of it lies in sulci and under the bone where the scan does not show it.
fn confidence(evidence: &Evidence<'_>, size: impl Fn(Structure) -> f64) -> Vec<(Structure, f64)> {
    let fit = (evidence.pose.score / 0.5).clamp(0.0, 1.0);
    let [left, right, third] = evidence.ventricles.expected.map(|e| e * fit);
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
            Structure::Skull => 0.93 * whole(200.0, s),
            Structure::Brain => 0.93 * whole(600.0, s),
            Structure::LeftLateralVentricle => left,
            Structure::RightLateralVentricle => right,
            Structure::ThirdVentricle => third,
        })
    };
    Structure::ALL.into_iter().filter_map(|s| Some((s, of(s)?))).collect()
}
