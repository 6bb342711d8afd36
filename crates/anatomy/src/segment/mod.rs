//! Automatic segmentation of a head CT, and the check of labels made elsewhere.
//!
//! The way: resample to 1 mm in the patient's axes (`working`); thresholds from the scan's own values (`tissue`); the
//! space inside the skull (`cavity`); its plane of symmetry (`midplane`); the pose of a coarse ventricle model (`model`);
//! a flood of the fluid from the model's seeds (`ventricles`) up to the half-way surface (`boundary`), which is then
//! fitted to the scan's own voxels (`samples`, `fit`); and labels painted on the scan's own grid (`paint`).

mod air;
mod bearings;
mod blood;
mod boundary;
mod cavity;
mod confidence;
mod csf;
pub(crate) mod cut;
mod ends;
mod error;
mod fit;
mod given;
mod head;
pub(crate) mod lattice;
mod midplane;
pub(crate) mod model;
mod noise;
mod paint;
mod part;
mod pocket;
mod quarter;
mod regrid;
pub(crate) mod remarks;
mod samples;
mod size;
mod tissue;
mod ventricles;
mod working;

pub use confidence::Doubt;
pub use error::SegmentError;
pub use given::{from_labels, outside_head};
pub use part::Part;
pub use regrid::{Geometry, onto_grid};

use crate::image::gaussian;
use bearings::{Bearings, bearings};
use cut::open_columns;
use ends::Ends;
use monro_geometry::{Patient, Plane, Structure, Volume};
use noise::Noise;
use size::Size;
use tissue::Tissue;
use ventricles::{Scene, ventricles};
use working::working;

/// The labels of a head and what is known about them.
#[derive(Debug, Clone)]
pub struct Segmentation {
    /// A [`Structure`] number per voxel, on the scan's own grid.
    pub labels: Volume<u8>,
    /// The mid-sagittal plane; its normal points to the patient's left.
    pub midsagittal: Plane<Patient>,
    /// Remarks for the reader: what is cut, open, small or not found.
    pub findings: Vec<String>,
    /// How far each structure can be trusted: its expected Dice coefficient, 0 to 1. Nothing is said of
    /// fluid outside the ventricles. Empty for labels made elsewhere.
    pub confidence: Vec<(Structure, f64)>,
    /// Where the borders of the ventricles are guesses, largest first.
    pub doubts: Vec<Doubt>,
}

/// Segments a head CT: scalp, skull, brain, cerebrospinal fluid, lateral and third ventricles.
///
/// # Errors
/// [`SegmentError`] names what is missing.
pub fn segment(ct: &Volume<i16>) -> Result<Segmentation, SegmentError> {
    segment_by_parts(ct, &mut |_| ())
}

/// The same; tells `done` about each [`Part`] when it is done.
///
/// # Errors
/// As [`segment`].
pub fn segment_by_parts(ct: &Volume<i16>, done: &mut dyn FnMut(Part)) -> Result<Segmentation, SegmentError> {
    let working = working(ct);
    let tissue = Tissue::of(&working)?;
    let sharp = gaussian(&working.hu, 0.7);
    done(Part::Resampling);
    let walls = tissue::wall(&working, &sharp, tissue);
    let bone = |n: usize| sharp.data[n] > tissue.bone || sharp.data[n] < 0.0;
    let mut cavity = cavity::cavity(&walls, &working.nodata, bone)?;
    let pocket_ml = pocket::take_in(&sharp, &mut cavity.mask, &working.nodata, tissue.bone);
    let size = Size::of(&cavity.mask, working.lattice.step);
    size.check()?;
    let ends = Ends::of(&working, (&cavity, size), tissue.bone);
    ends.check()?;
    done(Part::Cavity);
    let head = head::head(&working, &sharp, &cavity.mask, tissue);
    done(Part::Head);
    let smooth = gaussian(&working.hu, 1.0);
    let open = open_columns(&cavity.mask, &working.nodata, working.lattice.step);
    let depth = cut::depth(&cavity.mask, open.as_deref());
    let noise = Noise::of(&working.hu, &smooth, &depth);
    let calmed = noise.before().map(|s| gaussian(&working.hu, s));
    let calm = calmed.as_ref().unwrap_or(&working.hu);
    let smooth = if calmed.is_some() { gaussian(calm, 1.0) } else { smooth };
    let Bearings { plane, pose, brain, blood, layer_ml } = bearings(&working, &smooth, &cavity.mask, open.as_deref())?;
    let ventricles = ventricles(&Scene {
        lattice: working.lattice,
        raw: calm,
        binned: &working.binned,
        smooth: &smooth,
        cavity: &cavity.mask,
        depth: &depth,
        pose,
        brain,
        noise,
        blood: blood.is_some_and(|b| b.on_course),
    })?;
    done(Part::Ventricles);
    let csf = csf::csf(calm, &cavity.mask, (ventricles.fluid, ventricles.edge, brain));
    done(Part::Fluid);
    let labels = paint::paint(
        ct.grid(),
        &paint::Layers {
            lattice: working.lattice,
            head: &head,
            cavity: &cavity.mask,
            csf: &csf,
            smooth: &sharp,
            bone: tissue.bone,
            air: tissue.air,
            masked: working.masked_with.is_some(),
            ventricles: &ventricles,
        },
    )?;
    done(Part::Painting);
    let evidence = remarks::Evidence {
        working: &working,
        cavity: &cavity,
        size,
        ends,
        bare_top_mm2: head::bare_top(&head, &cavity.mask, |n| sharp.data[n] > tissue.bone),
        plane: &plane,
        pose,
        noise,
        blood,
        layer_ml,
        pocket_ml,
        ventricles: &ventricles,
    };
    let (findings, confidence) = remarks::remarks(&evidence, &labels);
    Ok(Segmentation { labels, midsagittal: plane, findings, confidence, doubts: ventricles.doubts })
}
