//! Automatic segmentation of a head CT, and the check of labels made elsewhere.
//!
//! The way: resample to 1 mm in the patient's axes (`working`); thresholds from the scan's own values (`tissue`); the
//! space inside the skull (`cavity`); its plane of symmetry (`midplane`); the pose of a coarse ventricle model (`model`);
//! a flood of the fluid from the model's seeds (`ventricles`) up to the unbiased half-way surface (`boundary`); and labels painted on the scan's own grid (`paint`).

mod boundary;
mod cavity;
mod confidence;
mod csf;
mod cut;
mod error;
mod given;
mod head;
pub(crate) mod lattice;
mod midplane;
pub(crate) mod model;
mod noise;
mod paint;
mod part;
mod regrid;
mod remarks;
mod tissue;
mod ventricles;
mod working;

pub use confidence::Doubt;
pub use error::SegmentError;
pub use given::{from_labels, outside_head};
pub use part::Part;
pub use regrid::{Geometry, onto_grid};

use crate::image::{Mask, Raster, gaussian};
use cut::{open_columns, open_in_block};
use lattice::Lattice;
use midplane::midplane;
use model::{Axes, Pose};
use monro_geometry::{Patient, Plane, Structure, Volume};
use noise::Noise;
use tissue::{Tissue, brain_mode, quantile};
use ventricles::{Scene, ventricles};
use working::{Working, any_in_block, block_mean, working};

/// Nothing inside the head is this much darker than brain, HU, but by air or fat near it.
const DIMMED_BY_AIR: f32 = 60.0;

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
    let open = open_columns(&cavity.mask, &working.nodata, working.lattice.step);
    let depth = cut::depth(&cavity.mask, open.as_deref());
    let noise = Noise::of(&working.hu, &smooth, &depth);
    let calmed = noise.before().map(|s| gaussian(&working.hu, s));
    let calm = calmed.as_ref().unwrap_or(&working.hu);
    let smooth = if calmed.is_some() { gaussian(calm, 1.0) } else { smooth };
    let (plane, pose, brain) = pose(&working, &smooth, &cavity.mask, open.as_deref())?;
    let ventricles = ventricles(&Scene {
        lattice: working.lattice,
        raw: calm,
        smooth: &smooth,
        cavity: &cavity.mask,
        depth: &depth,
        pose,
        brain,
        noise,
    })?;
    done(Part::Ventricles);
    let csf = csf::csf(calm, &cavity.mask, (ventricles.fluid, ventricles.edge));
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
        noise,
        ventricles: &ventricles,
    };
    let (findings, confidence) = remarks::remarks(&evidence, &labels);
    Ok(Segmentation { labels, midsagittal: plane, findings, confidence, doubts: ventricles.doubts })
}

/// Midplane, pose of the ventricle model and the brain's mode. `open` are the columns that the scan cuts.
fn pose(
    working: &Working,
    smooth: &Raster<f32>,
    cavity: &Mask,
    open: Option<&[bool]>,
) -> Result<(Plane<Patient>, Pose, f32), SegmentError> {
    let coarse = working.lattice.coarser(2);
    let hu = block_mean(smooth, 2);
    let space = any_in_block(cavity, 2);
    let open = open.map(|o| open_in_block(o, cavity.dims, 2));
    let none = || SegmentError::NoCavity { found_ml: cavity.count() as f64 / 1000.0, needed_ml: 300.0 };
    let plane = midplane(&hu, &space, coarse).ok_or_else(none)?;
    let brain = brain_mode(smooth, |n| cavity.data[n]);
    let pose = pose_from(&hu, (&space, open.as_deref()), coarse, (&plane, brain)).ok_or_else(none)?;
    Ok((plane, pose, brain))
}

/// The pose from a coarse scan. Where the vertex is missing, vaults of several heights are tried.
fn pose_from(
    hu: &Raster<f32>,
    (space, open): (&Mask, Option<&[bool]>),
    lattice: Lattice,
    (plane, brain): (&Plane<Patient>, f32),
) -> Option<Pose> {
    // Ventricles and cisterns fill some percent of the deep brain: its darkest percent is fluid.
    // What air dims, at a cut, is darker than any fluid.
    let seen = |(v, s): (&f32, &bool)| (*s && *v > brain - DIMMED_BY_AIR).then_some(*v);
    let mut values: Vec<f32> = hu.data.iter().zip(&space.data).filter_map(seen).collect();
    let fluid = quantile(&mut values, 0.01).clamp(brain - 35.0, brain - 12.0);
    let depth = cut::depth(space, open).map(|d| d * lattice.step as f32);
    let like = model::likeness(space, (&depth, lattice), |n| (brain - hu.data[n]) / (brain - fluid));
    let fits = cut::vaults(space, open, lattice).into_iter().filter_map(|d| Axes::new(&d, lattice, plane));
    fits.map(|axes| model::fit(&like, lattice, axes)).max_by(|a, b| a.score.total_cmp(&b.score))
}
