//! Bearings inside the head: midplane and the pose of the ventricle model, from labels.

use super::LandmarkError;
use crate::image::{Mask, Raster};
use crate::segment::cut;
use crate::segment::lattice::Lattice;
use crate::segment::model::{self, Axes, Pose};
use monro_geometry::{Patient, Plane, Point, Structure, Volume};

/// Voxels of the raster of bearings, mm.
const STEP: f64 = 2.0;

/// Labels with bearings.
pub(crate) struct Surroundings<'a> {
    pub(crate) labels: &'a Volume<u8>,
    pub(crate) midsagittal: Plane<Patient>,
    pub(crate) pose: Pose,
}

impl<'a> Surroundings<'a> {
    /// Takes bearings.
    pub(crate) fn new(labels: &'a Volume<u8>, midsagittal: Plane<Patient>) -> Result<Self, LandmarkError> {
        let (lattice, classes, nodata) = coarse(labels).ok_or(LandmarkError::NoBearings("brain"))?;
        if !classes.data.iter().any(|&l| l == 5 || l == 6) {
            return Err(LandmarkError::NoBearings("lateral ventricle"));
        }
        let inside: Mask = classes.map(|l| is(l, Structure::is_intracranial));
        let fluid = |n: usize| if is(classes.data[n], Structure::is_ventricle) { 1.0 } else { 0.0 };
        // Where the scan ends above the brain there is no skull: as in the segmentation, vaults of several heights are tried.
        let open = cut::open_columns(&inside, &nodata, lattice.step);
        let (depth, vaults) = cut::depths(&inside, open.as_deref(), lattice);
        let like = model::likeness(&inside, (&depth, lattice), fluid);
        let axes = vaults.iter().filter_map(|depth| Axes::new(depth, lattice, &midsagittal));
        let pose = model::best(&like, lattice, axes).ok_or(LandmarkError::NoBearings("brain"))?;
        Ok(Self { labels, midsagittal, pose })
    }

    /// The middle of the foramina in the midplane, from which the skin is looked at.
    pub(crate) fn origin(&self) -> Point<Patient> {
        self.midsagittal.project(self.pose.place([0.0; 3]))
    }

    /// The structure at a position.
    pub(crate) fn structure(&self, p: Point<Patient>) -> Structure {
        self.labels.nearest(p).and_then(Structure::from_label).unwrap_or(Structure::Outside)
    }
}

fn is(label: u8, test: impl Fn(Structure) -> bool) -> bool {
    Structure::from_label(label).is_some_and(test)
}

/// The intracranial labels on a coarse lattice, with a rim of nothing, and where the scan shows nothing; `None` when there
/// are none.
fn coarse(labels: &Volume<u8>) -> Option<(Lattice, Raster<u8>, Mask)> {
    let grid = labels.grid();
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for (n, _) in labels.data().iter().enumerate().filter(|(_, l)| is(**l, Structure::is_intracranial)) {
        let [i, j, k] = grid.voxel(n);
        let p = grid.centre(i, j, k).to_array();
        for a in 0..3 {
            low[a] = low[a].min(p[a]);
            high[a] = high[a].max(p[a]);
        }
    }
    if low[0] > high[0] {
        return None;
    }
    let lattice = Lattice { origin: low.map(|v| v - 2.0 * STEP), step: STEP };
    let dims = core::array::from_fn(|a| ((high[a] - low[a]) / STEP) as usize + 5);
    let (mut out, mut nodata) = (Raster::filled(dims, 0u8), Raster::filled(dims, false));
    for n in 0..out.data.len() {
        match labels.nearest(lattice.point(out.voxel(n).map(|c| c as f64))) {
            Some(label) => out.data[n] = label,
            None => nodata.data[n] = true,
        }
    }
    Some((lattice, out, nodata))
}
