//! The scan on an isotropic LPS lattice of 1 mm, cropped to the head: every later step works there, so that spacing,
//! orientation and axis order of the scan do not matter.

use super::lattice::Lattice;
use crate::image::{Mask, Raster, label, largest};
use monro_geometry::{Grid, Patient, Point, Volume};
use rayon::prelude::*;

/// Voxel size of the working raster, mm.
pub(crate) const STEP: f64 = 1.0;
/// HU outside the scan.
const OUTSIDE: f32 = -1024.0;
/// Anything below is air in every scan.
pub(super) const AIR: f32 = -300.0;
/// Tallest part of a scan, from the top of the head down, that can matter here, mm.
const TALLEST: f64 = 260.0;

/// The resampled scan.
#[derive(Debug)]
pub(crate) struct Working {
    pub(crate) lattice: Lattice,
    /// HU, clamped to -1024..3071.
    pub(crate) hu: Raster<f32>,
    /// Outside the scan or padding that is not air (a masked image).
    pub(crate) nodata: Mask,
    /// The scan on its own grid.
    pub(crate) binned: Binned,
    /// Padding above the HU of air, if the scan has it: the image was masked and shows no skin.
    pub(crate) masked_with: Option<i16>,
}

/// Resamples a scan.
pub(crate) fn working(ct: &Volume<i16>) -> Working {
    let binned = Binned::new(ct);
    let masked_with = padding(ct).filter(|&p| f32::from(p) > AIR);
    let (lattice, dims) = head_box(ct, &binned, masked_with);
    let hu = sample(&binned, &lattice, dims);
    let nodata = no_data(ct, &lattice, dims, masked_with);
    Working { lattice, hu, nodata, binned, masked_with }
}

/// The scan averaged over blocks of whole voxels, so that fine scans lose noise instead of samples.
#[derive(Debug)]
pub(crate) struct Binned {
    pub(super) raster: Raster<f32>,
    factor: [usize; 3],
    pub(crate) grid: Grid,
}

impl Binned {
    /// Edges of the scan's own voxels, mm.
    pub(super) fn spacing(&self) -> [f64; 3] {
        self.grid.spacing()
    }

    pub(super) fn new(ct: &Volume<i16>) -> Self {
        let grid = *ct.grid();
        let spacing = grid.spacing();
        let source = grid.dims();
        let factor = [0, 1, 2].map(|a| ((STEP / spacing[a] + 0.05) as usize).clamp(1, 4).min(source[a]));
        let dims = [0, 1, 2].map(|a| source[a] / factor[a]);
        let mut raster = Raster::filled(dims, 0f32);
        let weight = 1.0 / (factor[0] * factor[1] * factor[2]) as f32;
        raster.data.par_chunks_mut(dims[0] * dims[1]).enumerate().for_each(|(k, sheet)| {
            for (dk, dj, j) in
                (0..factor[2]).flat_map(|dk| (0..factor[1]).flat_map(move |dj| (0..dims[1]).map(move |j| (dk, dj, j))))
            {
                let start = grid.index(0, j * factor[1] + dj, k * factor[2] + dk);
                let row = &ct.data()[start..start + dims[0] * factor[0]];
                for (out, block) in sheet[j * dims[0]..(j + 1) * dims[0]].iter_mut().zip(row.chunks(factor[0])) {
                    *out += block.iter().map(|&v| f32::from(v).clamp(OUTSIDE, 3071.0)).sum::<f32>() * weight;
                }
            }
        });
        Self { raster, factor, grid }
    }

    /// Continuous index in the blocks from one in the scan.
    fn block(&self, v: [f64; 3]) -> [f64; 3] {
        core::array::from_fn(|a| (v[a] + 0.5) / self.factor[a] as f64 - 0.5)
    }

    /// Continuous index in the blocks of a patient position.
    pub(super) fn index(&self, p: Point<Patient>) -> [f64; 3] {
        self.block(self.grid.voxel_from_patient().point(p).to_array())
    }

    /// Patient position of a continuous index in the blocks.
    pub(super) fn point(&self, v: [f64; 3]) -> Point<Patient> {
        let scan = core::array::from_fn(|a| (v[a] + 0.5) * self.factor[a] as f64 - 0.5);
        self.grid.patient_from_voxel().point(Point::from_array(scan))
    }
}

/// The commonest value on the faces of the scan, when it fills at least 30 % of them.
fn padding(ct: &Volume<i16>) -> Option<i16> {
    let [nx, ny, nz] = ct.grid().dims();
    let mut counts = vec![0u32; 1 << 16];
    let mut total = 0u32;
    for k in 0..nz {
        for j in 0..ny {
            let whole = j == 0 || k == 0 || j + 1 == ny || k + 1 == nz;
            let step = if whole { 1 } else { (nx - 1).max(1) };
            for i in (0..nx).step_by(step) {
                counts[(i32::from(ct.at(i, j, k)) + 32768) as usize] += 1;
                total += 1;
            }
        }
    }
    let (value, &count) = counts.iter().enumerate().max_by_key(|(_, c)| **c)?;
    (f64::from(count) >= 0.3 * f64::from(total)).then(|| (value as i32 - 32768) as i16)
}

/// The box of the head: bounds of the largest body at 4 mm, at most [`TALLEST`] from its top down.
fn head_box(ct: &Volume<i16>, binned: &Binned, masked_with: Option<i16>) -> (Lattice, [usize; 3]) {
    const COARSE: f64 = 4.0;
    let [low, high] = ct.grid().bounds();
    let dims: [usize; 3] = core::array::from_fn(|a| (((high[a] - low[a]) / COARSE).ceil() as usize).max(1));
    let coarse = Lattice { origin: low.map(|v| v + COARSE / 2.0), step: COARSE };
    let hu = sample(binned, &coarse, dims);
    let blank = no_data(ct, &coarse, dims, masked_with);
    let body = largest(&hu.zip(&blank, |v, n| v > AIR && !n));
    let Some((first, last)) = body.bounds(2) else {
        return (Lattice { origin: low.map(|v| v + STEP / 2.0), step: STEP }, dims.map(|n| n * 4));
    };
    let top = coarse.origin[2] + (last[2] as f64 - 0.5) * COARSE;
    let mut origin: [f64; 3] =
        core::array::from_fn(|a| coarse.origin[a] + (first[a] as f64 - 0.5) * COARSE + STEP / 2.0);
    origin[2] = origin[2].max(top - TALLEST);
    let end: [f64; 3] = core::array::from_fn(|a| coarse.origin[a] + (last[a] as f64 - 0.5) * COARSE);
    let dims = core::array::from_fn(|a| (((end[a] - origin[a]) / STEP).ceil() as usize).max(1));
    (Lattice { origin, step: STEP }, dims)
}

/// Trilinear samples of the blocks; [`OUTSIDE`] beyond the scan.
fn sample(binned: &Binned, lattice: &Lattice, dims: [usize; 3]) -> Raster<f32> {
    let map = binned.grid.voxel_from_patient();
    let source = binned.raster.dims;
    let mut out = Raster::filled(dims, OUTSIDE);
    out.data.par_chunks_mut(dims[0] * dims[1]).enumerate().for_each(|(k, sheet)| {
        for (n, value) in sheet.iter_mut().enumerate() {
            let p = lattice.point([(n % dims[0]) as f64, (n / dims[0]) as f64, k as f64]);
            let v = binned.block(map.point(p).to_array());
            if (0..3).all(|a| v[a] >= -0.5 && v[a] <= source[a] as f64 - 0.5) {
                *value = binned.raster.linear(v);
            }
        }
    });
    out
}

/// Voxels outside the scan, and padding of a masked scan that reaches the faces of the box.
fn no_data(ct: &Volume<i16>, lattice: &Lattice, dims: [usize; 3], masked_with: Option<i16>) -> Mask {
    let map = ct.grid().voxel_from_patient();
    let source = ct.grid().dims();
    let mut outside = Mask::filled(dims, false);
    let mut blank = Mask::filled(dims, false);
    let sheet = dims[0] * dims[1];
    outside.data.par_chunks_mut(sheet).zip(blank.data.par_chunks_mut(sheet)).enumerate().for_each(|(k, (out, pad))| {
        for n in 0..sheet {
            let p = lattice.point([(n % dims[0]) as f64, (n / dims[0]) as f64, k as f64]);
            let v = map.point(p).to_array().map(f64::round);
            out[n] = (0..3).any(|a| !(v[a] >= 0.0 && v[a] < source[a] as f64));
            pad[n] = out[n] || masked_with == Some(ct.at(v[0] as usize, v[1] as usize, v[2] as usize));
        }
    });
    if masked_with.is_none() {
        return outside;
    }
    label(&blank).touching(&faces(dims)).or(&outside)
}

/// The outermost layer of a box.
fn faces(dims: [usize; 3]) -> Mask {
    let mut mask = Mask::filled(dims, false);
    for n in 0..mask.data.len() {
        mask.data[n] = mask.voxel(n).iter().zip(dims).any(|(&c, d)| c == 0 || c + 1 == d);
    }
    mask
}

/// A mask of blocks of `factor` voxels: true where any voxel of the block is.
pub(crate) fn any_in_block(mask: &Mask, factor: usize) -> Mask {
    let dims = mask.dims.map(|d| d.div_ceil(factor));
    let mut out = Mask::filled(dims, false);
    for (n, _) in mask.data.iter().enumerate().filter(|(_, v)| **v) {
        let [i, j, k] = mask.voxel(n).map(|c| c / factor);
        let at = out.index(i, j, k);
        out.data[at] = true;
    }
    out
}

/// Every `factor`-th block's mean.
pub(crate) fn block_mean(raster: &Raster<f32>, factor: usize) -> Raster<f32> {
    let dims = raster.dims.map(|d| d.div_ceil(factor));
    let mut out = Raster::filled(dims, 0f32);
    let [nx, ny, nz] = raster.dims;
    out.data.par_chunks_mut(dims[0] * dims[1]).enumerate().for_each(|(k, sheet)| {
        for (n, value) in sheet.iter_mut().enumerate() {
            let (i, j) = (n % dims[0] * factor, n / dims[0] * factor);
            let (mut sum, mut count) = (0f32, 0f32);
            for z in k * factor..((k + 1) * factor).min(nz) {
                for y in j..(j + factor).min(ny) {
                    let start = raster.index(i, y, z);
                    let row = &raster.data[start..start + factor.min(nx - i)];
                    sum += row.iter().sum::<f32>();
                    count += row.len() as f32;
                }
            }
            *value = sum / count;
        }
    });
    out
}
