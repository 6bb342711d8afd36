//! Bearings inside the head: its plane of symmetry, the brain's HU and the pose of the ventricle model.

use super::blood::{self, Blood};
use super::cut::{self, open_in_block};
use super::error::SegmentError;
use super::lattice::Lattice;
use super::midplane::midplane;
use super::model::{self, Axes, Pose, Turned};
use super::quarter::by_quarters;
use super::tissue::{brain_mode, quantile};
use super::working::{Working, any_in_block, block_mean};
use crate::image::{Mask, Raster};
use monro_geometry::{Patient, Plane};

/// Nothing inside the head is this much darker than brain, HU, but by air or fat near it.
const DIMMED_BY_AIR: f32 = 60.0;

/// The model turned about is believed when it fits better by this much, and well: sound heads fit worse by 0.2 and more,
/// turned ones better by 0.2 to 0.5, at 0.7. A sick brain may fit neither way.
const TURNED: f64 = 0.15;
const WELL: f64 = 0.55;
/// Where it fits worse than this as told, it is tried turned by quarters, too: so turned, heads fit by up to 0.53, upright ones
/// by 0.72 and more. And the fit from which such a turn is believed: of twenty ways the wrong ones fit by up to 0.55.
const POOR: f64 = 0.6;
const WELL_BY_QUARTERS: f64 = 0.65;

/// What is known of the head before its ventricles are found.
#[derive(Debug)]
pub(crate) struct Bearings {
    pub(crate) plane: Plane<Patient>,
    pub(crate) pose: Pose,
    /// The brain's mode, HU.
    pub(crate) brain: f32,
    pub(crate) blood: Option<Blood>,
    /// What may be blood between bone and brain, mL.
    pub(crate) layer_ml: Option<f64>,
}

/// Takes bearings. `open` are the columns of the working raster that the scan cuts.
///
/// # Errors
/// [`SegmentError::NoCavity`], [`SegmentError::Turned`] for a head that lies otherwise than the scan's axes say.
pub(crate) fn bearings(
    working: &Working,
    smooth: &Raster<f32>,
    cavity: &Mask,
    open: Option<&[bool]>,
) -> Result<Bearings, SegmentError> {
    let lattice = working.lattice.coarser(2);
    let hu = block_mean(smooth, 2);
    let space = any_in_block(cavity, 2);
    let open = open.map(|o| open_in_block(o, cavity.dims, 2));
    let none = || SegmentError::NoCavity { found_ml: cavity.count() as f64 / 1000.0, needed_ml: 300.0 };
    let plane = midplane(&hu, &space, lattice).ok_or_else(none)?;
    let brain = brain_mode(smooth, |n| cavity.data[n]);
    let coarse = Coarse { hu: &hu, space: &space, lattice, brain };
    let longest = working.binned.spacing().into_iter().fold(0.0, f64::max);
    let depths = cut::depths(&space, open.as_deref(), lattice);
    let layer_ml = blood::layer(&hu, &depths.0, (lattice, longest), brain);
    let (pose, blood, turned) = coarse.pose(&plane, &depths).ok_or_else(none)?;
    upright(pose, turned, WELL)?;
    if pose.score < POOR {
        upright(pose, coarse.by_quarters(&plane), WELL_BY_QUARTERS)?;
    }
    Ok(Bearings { plane, pose, brain, blood, layer_ml })
}

/// The scan on a coarse raster.
struct Coarse<'a> {
    hu: &'a Raster<f32>,
    space: &'a Mask,
    lattice: Lattice,
    brain: f32,
}

impl Coarse<'_> {
    /// The pose by the fluid; with much blood deep in the brain by fluid and blood, where the model fits better so. With it,
    /// how the head lies if the fluid lies as in one turned about. Given depths as [`cut::depths`] gives them.
    fn pose(
        &self,
        plane: &Plane<Patient>,
        (depth, vaults): &(Raster<f32>, Vec<Raster<f32>>),
    ) -> Option<(Pose, Option<Blood>, Option<Turned>)> {
        let brain = self.brain;
        let axes: Vec<Axes> = vaults.iter().filter_map(|d| Axes::new(d, self.lattice, plane)).collect();
        let like = |of: &dyn Fn(usize) -> f32| model::likeness(self.space, (depth, self.lattice), of);
        let fit = |like: &Raster<f32>| model::best(like, self.lattice, axes.iter().copied());
        let fluidlike = self.fluidlike();
        let as_fluid = like(&fluidlike);
        let by_fluid = fit(&as_fluid)?;
        let (mut pose, mut blood) = (by_fluid, None);
        if let Some(deep_ml) = blood::deep(self.hu, depth, self.lattice, brain) {
            let by_both = fit(&like(&|n| fluidlike(n).max(blood::like(self.hu.data[n], brain))))?;
            let on_course = blood::better(by_both.score, by_fluid.score);
            pose = if on_course { by_both } else { by_fluid };
            blood = Some(Blood { deep_ml, on_course });
        }
        Some((pose, blood, pose.turned(&as_fluid, self.lattice)))
    }

    /// How the head lies if it is turned by quarters.
    fn by_quarters(&self, plane: &Plane<Patient>) -> Option<Turned> {
        let (depth, _) = cut::depths(self.space, None, self.lattice);
        let like = model::likeness(self.space, (&depth, self.lattice), self.fluidlike());
        by_quarters((self.hu, self.space), (&like, &depth), self.lattice, plane)
    }

    /// How much a voxel is like fluid, from 0, brain, to 1.
    fn fluidlike(&self) -> impl Fn(usize) -> f32 {
        let (brain, fluid) = (self.brain, self.darkest());
        move |n| (brain - self.hu.data[n]) / (brain - fluid)
    }

    /// Ventricles and cisterns fill some percent of the deep brain: its darkest percent is fluid. What air dims, at a cut,
    /// is darker than any fluid.
    fn darkest(&self) -> f32 {
        let seen = |(v, s): (&f32, &bool)| (*s && *v > self.brain - DIMMED_BY_AIR).then_some(*v);
        let mut values: Vec<f32> = self.hu.data.iter().zip(&self.space.data).filter_map(seen).collect();
        quantile(&mut values, 0.01).clamp(self.brain - 35.0, self.brain - 12.0)
    }
}

/// Refuses a head that lies otherwise than the scan's axes say, if it fits `well` so.
fn upright(pose: Pose, turned: Option<Turned>, well: f64) -> Result<(), SegmentError> {
    match turned.filter(|t| t.score > well && t.score > pose.score + TURNED) {
        Some(Turned { way, score }) => Err(SegmentError::Turned { way, score, as_told: pose.score }),
        None => Ok(()),
    }
}
