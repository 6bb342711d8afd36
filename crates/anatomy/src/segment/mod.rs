//! Automatic segmentation of a head CT, and the check of labels made elsewhere.
//!
//! The way: resample to 1 mm in the patient's axes (`working`); thresholds from the scan's own values (`tissue`); the
//! space inside the skull (`cavity`); its plane of symmetry (`midplane`); the pose of a coarse ventricle model (`model`);
//! a flood of the fluid from the model's seeds (`ventricles`) up to the half-way surface (`boundary`), which is then
//! fitted to the scan's own voxels (`samples`, `fit`); and labels painted on the scan's own grid (`paint`).

mod boundary;
mod cavity;
mod confidence;
mod csf;
mod error;
mod fit;
mod given;
mod head;
pub(crate) mod lattice;
mod midplane;
pub(crate) mod model;
mod paint;
mod part;
mod regrid;
mod remarks;
mod samples;
mod tissue;
mod ventricles;
mod working;

pub use confidence::Doubt;
pub use error::SegmentError;
pub use given::{from_labels, outside_head};
pub use part::Part;
pub use regrid::{Geometry, onto_grid};

use crate::image::{Mask, Raster, gaussian};
use lattice::Lattice;
use midplane::midplane;
use model::{Axes, Pose};
use monro_geometry::{Patient, Plane, Structure, Volume};
use tissue::{Tissue, brain_mode, quantile};
use ventricles::{Scene, ventricles};
use working::{Working, any_in_block, block_mean, working};

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
    let cavity = cavity::cavity(&walls, &working.nodata, bone)?;
    done(Part::Cavity);
    let head = head::head(&working, &sharp, &cavity.mask, tissue);
    done(Part::Head);
    let smooth = gaussian(&working.hu, 1.0);
    let (plane, pose, brain) = pose(&working, &smooth, &cavity.mask)?;
    let scene = Scene {
        lattice: working.lattice,
        raw: &working.hu,
        binned: &working.binned,
        smooth: &smooth,
        cavity: &cavity.mask,
        pose,
        brain,
    };
    let ventricles = ventricles(&scene)?;
    done(Part::Ventricles);
    let csf = csf::csf(&working.hu, &cavity.mask, (ventricles.fluid, ventricles.edge));
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
        bare_top_mm2: head::bare_top(&head, &cavity.mask, |n| sharp.data[n] > tissue.bone),
        pose,
        ventricles: &ventricles,
    };
    let (findings, confidence) = remarks::remarks(&evidence, &labels);
    Ok(Segmentation { labels, midsagittal: plane, findings, confidence, doubts: ventricles.doubts })
}

/// Midplane, pose of the ventricle model and the brain's mode.
fn pose(working: &Working, smooth: &Raster<f32>, cavity: &Mask) -> Result<(Plane<Patient>, Pose, f32), SegmentError> {
    let coarse = working.lattice.coarser(2);
    let hu = block_mean(smooth, 2);
    let space = any_in_block(cavity, 2);
    let none = || SegmentError::NoCavity { found_ml: cavity.count() as f64 / 1000.0, needed_ml: 300.0 };
    let plane = midplane(&hu, &space, coarse).ok_or_else(none)?;
    let brain = brain_mode(smooth, |n| cavity.data[n]);
    let (pose, _) = pose_from(&hu, &space, coarse, (&plane, brain)).ok_or_else(none)?;
    Ok((plane, pose, brain))
}

/// The pose from a coarse scan; also the depth below the skull.
fn pose_from(
    hu: &Raster<f32>,
    space: &Mask,
    lattice: Lattice,
    (plane, brain): (&Plane<Patient>, f32),
) -> Option<(Pose, Raster<f32>)> {
    // Ventricles and cisterns fill some percent of the deep brain: its darkest percent is fluid.
    let mut values: Vec<f32> = hu.data.iter().zip(&space.data).filter(|(_, s)| **s).map(|(v, _)| *v).collect();
    let fluid = quantile(&mut values, 0.01).clamp(brain - 35.0, brain - 12.0);
    let (like, depth) = model::likeness(space, lattice, |n| (brain - hu.data[n]) / (brain - fluid));
    let axes = Axes::new(&depth, lattice, plane)?;
    Some((model::fit(&like, lattice, axes), depth))
}
