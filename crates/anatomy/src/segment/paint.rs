//! Labels on the scan's own grid from smooth fields on the working raster, so that no step of the raster shows.

use super::lattice::Lattice;
use super::ventricles::{LEFT, RIGHT, THIRD, Ventricles};
use crate::image::{Mask, Raster, gaussian};
use monro_geometry::{Grid, GridError, Point, Structure, Volume};
use rayon::prelude::*;

/// Smoothing (voxels) that turns a mask into a field.
const SOFTEN: f64 = 0.8;

/// Everything to paint. The rasters share `lattice`, but the ventricles, which have their own.
#[derive(Debug)]
pub(crate) struct Layers<'a> {
    pub(crate) lattice: Lattice,
    pub(crate) head: &'a Mask,
    pub(crate) cavity: &'a Mask,
    /// Positive in the cerebrospinal fluid outside the ventricles.
    pub(crate) csf: &'a Raster<f32>,
    /// The scan smoothed by less than a voxel, HU.
    pub(crate) smooth: &'a Raster<f32>,
    /// Bone above, HU.
    pub(crate) bone: f32,
    /// Soft tissue above, HU.
    pub(crate) air: f32,
    /// Whether the image was masked: then nothing outside the skull is scalp.
    pub(crate) masked: bool,
    pub(crate) ventricles: &'a Ventricles,
}

/// The fields made from the layers: positive inside.
struct Fields {
    lattice: Lattice,
    head: Raster<f32>,
    cavity: Raster<f32>,
    csf: Raster<f32>,
    bone: Raster<f32>,
    ventricle_lattice: Lattice,
    ventricle: Raster<f32>,
    classes: [Raster<f32>; 3],
    soft_tissue: Structure,
}

/// Paints the labels.
///
/// # Errors
/// Never for a grid that holds a scan.
pub(crate) fn paint(grid: &Grid, layers: &Layers<'_>) -> Result<Volume<u8>, GridError> {
    let fields = Fields::new(layers);
    let mut data = vec![Structure::Outside.label(); grid.len()];
    let [nx, ny, _] = grid.dims();
    data.par_chunks_mut(nx * ny).enumerate().for_each(|(k, sheet)| {
        for (n, out) in sheet.iter_mut().enumerate() {
            let p = grid.patient_from_voxel().point(Point::new((n % nx) as f64, (n / nx) as f64, k as f64));
            *out = fields.structure(p).label();
        }
    });
    Volume::new(*grid, data)
}

fn soften(mask: &Mask) -> Raster<f32> {
    let mut field = gaussian(&mask.map(|v| if v { 1.0 } else { 0.0 }), SOFTEN);
    field.data.iter_mut().for_each(|v| *v -= 0.5);
    field
}

impl Fields {
    fn new(layers: &Layers<'_>) -> Self {
        let v = layers.ventricles;
        let class = |c: u8| gaussian(&v.classes.map(|x| if x == c { 1.0 } else { 0.0 }), SOFTEN);
        Self {
            lattice: layers.lattice,
            head: head_field(layers),
            cavity: soften(layers.cavity),
            csf: layers.csf.clone(),
            bone: layers.smooth.map(|hu| hu - layers.bone),
            ventricle_lattice: v.lattice,
            ventricle: v.field.clone(),
            classes: [class(LEFT), class(RIGHT), class(THIRD)],
            soft_tissue: if layers.masked { Structure::Outside } else { Structure::Scalp },
        }
    }

    fn structure(&self, p: Point<monro_geometry::Patient>) -> Structure {
        let at = self.lattice.index(p);
        let dims = self.head.dims;
        if (0..3).any(|a| at[a] < -0.5 || at[a] > dims[a] as f64 - 0.5) {
            return Structure::Outside;
        }
        if self.cavity.linear(at) > 0.0 {
            return self
                .ventricle_at(p)
                .unwrap_or_else(|| if self.csf.linear(at) > 0.0 { Structure::Csf } else { Structure::Brain });
        }
        if self.head.linear(at) <= 0.0 {
            Structure::Outside
        } else if self.bone.linear(at) > 0.0 {
            Structure::Skull
        } else {
            self.soft_tissue
        }
    }

    fn ventricle_at(&self, p: Point<monro_geometry::Patient>) -> Option<Structure> {
        let at = self.ventricle_lattice.index(p);
        let dims = self.ventricle.dims;
        let inside = (0..3).all(|a| at[a] >= 0.0 && at[a] <= dims[a] as f64 - 1.0);
        if !inside || self.ventricle.linear(at) <= 0.0 {
            return None;
        }
        let [left, right, third] = [0, 1, 2].map(|c| self.classes[c].linear(at));
        Some(if third > left && third > right {
            Structure::ThirdVentricle
        } else if left >= right {
            Structure::LeftLateralVentricle
        } else {
            Structure::RightLateralVentricle
        })
    }
}

/// The skin is where the scan crosses the edge of air within the head's rim; deeper the head is solid.
fn head_field(layers: &Layers<'_>) -> Raster<f32> {
    let soft = soften(layers.head);
    soft.zip(layers.smooth, |inside, hu| {
        let skin = ((hu - layers.air) / 1000.0).clamp(-0.5, 0.5);
        // Half a voxel either side of the mask's own edge the scan decides.
        if inside.abs() < 0.35 { skin } else { inside }
    })
}
