//! The scan's own voxels around the ventricles, and the way from them to the working raster and back.
//!
//! Resampling mixes the noise of neighbouring voxels and blurs edges, here more and there less. The surface is fitted to
//! the voxels as they were measured (fine ones averaged in whole blocks), on any grid: turned, sheared, thick slices.

use super::lattice::Lattice;
use super::working::Binned;
use crate::image::{Raster, gaussian_along};
use rayon::prelude::*;

/// An affine map between continuous indices.
#[derive(Debug, Clone, Copy)]
struct Map {
    origin: [f64; 3],
    /// Where one step along each axis leads.
    steps: [[f64; 3]; 3],
}

impl Map {
    /// The map that does as the affine `f`.
    fn of(f: impl Fn([f64; 3]) -> [f64; 3]) -> Self {
        let origin = f([0.0; 3]);
        let steps = core::array::from_fn(|axis| {
            let end = f(core::array::from_fn(|a| f64::from(u8::from(a == axis))));
            core::array::from_fn(|a| end[a] - origin[a])
        });
        Self { origin, steps }
    }

    fn at(&self, v: [f64; 3]) -> [f64; 3] {
        core::array::from_fn(|a| self.origin[a] + (0..3).map(|axis| self.steps[axis][a] * v[axis]).sum::<f64>())
    }
}

/// A box of the scan's voxels that covers a crop of the working raster (1 mm, so that its indices are mm).
#[derive(Debug)]
pub(super) struct Samples {
    /// HU.
    pub(super) hu: Raster<f32>,
    lattice_dims: [usize; 3],
    to_lattice: Map,
    from_lattice: Map,
}

impl Samples {
    /// The voxels within the box of `dims` on `lattice`; `None` where the scan has none there.
    pub(super) fn new(scan: &Binned, lattice: &Lattice, dims: [usize; 3]) -> Option<Self> {
        let corner =
            |n: usize| scan.index(lattice.point([0, 1, 2].map(|a| (n >> a & 1) as f64 * (dims[a] as f64 - 1.0))));
        let source = scan.raster.dims;
        let (mut low, mut high) = ([0usize; 3], [0usize; 3]);
        for a in 0..3 {
            let along = (0..8).map(|n| corner(n)[a]);
            let (least, most) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
            low[a] = least.floor().clamp(0.0, source[a] as f64) as usize;
            high[a] = (most.ceil() + 1.0).clamp(0.0, source[a] as f64) as usize;
            if high[a] <= low[a] {
                return None;
            }
        }
        let shift = low.map(|l| l as f64);
        let to_lattice = Map::of(|v| lattice.index(scan.point([0, 1, 2].map(|a| v[a] + shift[a]))));
        let from_lattice = Map::of(|v| {
            let at = scan.index(lattice.point(v));
            [0, 1, 2].map(|a| at[a] - shift[a])
        });
        Some(Self { hu: scan.raster.crop(low, high), lattice_dims: dims, to_lattice, from_lattice })
    }

    /// A field of the working raster at the samples.
    pub(super) fn at_samples(&self, field: &Raster<f32>) -> Raster<f32> {
        resampled(field, &self.to_lattice, self.hu.dims)
    }

    /// A field of the samples on the working raster.
    pub(super) fn on_lattice(&self, field: &Raster<f32>) -> Raster<f32> {
        resampled(field, &self.from_lattice, self.lattice_dims)
    }

    /// Gaussian smoothing by `sigma` mm along each axis of the samples.
    pub(super) fn smoothed(&self, field: &Raster<f32>, sigma: f64) -> Raster<f32> {
        gaussian_along(field, self.to_lattice.steps.map(|s| sigma / s.iter().map(|c| c * c).sum::<f64>().sqrt()))
    }

    /// Variance along the unit normal `n` of what a voxel averages, mm2: a box has a twelfth of its square edge.
    pub(super) fn box_variance(&self, n: [f32; 3]) -> f32 {
        let along = |s: [f64; 3]| (0..3).map(|a| s[a] as f32 * n[a]).sum::<f32>();
        self.to_lattice.steps.map(along).iter().map(|v| v * v).sum::<f32>() / 12.0
    }
}

/// Trilinear values of `source` where `map` leads, the outermost continued.
fn resampled(source: &Raster<f32>, map: &Map, dims: [usize; 3]) -> Raster<f32> {
    let mut out = Raster::filled(dims, 0f32);
    out.data.par_chunks_mut(dims[0] * dims[1]).enumerate().for_each(|(k, sheet)| {
        for (n, value) in sheet.iter_mut().enumerate() {
            *value = source.linear(map.at([(n % dims[0]) as f64, (n / dims[0]) as f64, k as f64]));
        }
    });
    out
}
