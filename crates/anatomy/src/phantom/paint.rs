//! From signed distances to voxels: layers with partial volume, and scanner noise.

use super::Head;
use super::random::{Random, nearly_normal};
use super::shapes::At;
use monro_geometry::{Affine, Grid, GridError, Patient, Point, Structure, Volume};
use rayon::prelude::*;

const AIR: f64 = -1000.0;

/// One sample, built up by painting layers over each other, each blended at its edge over the blur width.
#[derive(Debug, Clone, Copy)]
pub(super) struct Painter {
    pub(super) hounsfield: f64,
    pub(super) structure: Structure,
    blur: f64,
}

impl Painter {
    pub(super) const fn new(blur: f64) -> Self {
        Self { hounsfield: AIR, structure: Structure::Outside, blur }
    }

    pub(super) const fn blur(&self) -> f64 {
        self.blur
    }

    /// Paints the inside of a shape (signed distance `d`) with a density and a label.
    pub(super) fn layer(&mut self, d: f64, hounsfield: f64, structure: Structure) {
        if d < 0.0 {
            self.structure = structure;
        }
        self.tint(d, hounsfield);
    }

    /// Changes the density inside a shape and leaves the label.
    pub(super) fn tint(&mut self, d: f64, hounsfield: f64) {
        let t = (0.5 - d / self.blur).clamp(0.0, 1.0);
        let cover = t * t * (3.0 - 2.0 * t);
        self.hounsfield += cover * (hounsfield - self.hounsfield);
    }
}

/// Something that can be scanned.
pub(super) trait Model: Sync {
    /// Patient to the model's own frame.
    fn to_model(&self) -> &Affine<Head, Patient>;
    /// Millimetres of the model's frame per millimetre.
    fn blur_scale(&self) -> f64;
    /// The sample at a point of the model's frame, and a distance around it in which all is air (0 if unknown).
    fn sample(&self, p: At, blur: f64) -> (Painter, f64);
}

/// Scans a model on a grid: densities with noise (HU), and labels at the voxel centres.
pub(super) fn scan(model: &impl Model, grid: Grid, noise: (u64, f64)) -> Result<(Volume<i16>, Volume<u8>), GridError> {
    let [nx, ny, _] = grid.dims();
    let mut ct = vec![0i16; grid.len()];
    let mut labels = vec![0u8; grid.len()];
    ct.par_chunks_mut(nx * ny).zip(labels.par_chunks_mut(nx * ny)).enumerate().for_each(|(k, (ct, labels))| {
        let noise = slice_noise([nx, ny], noise.0.wrapping_add(k as u64 + 1), noise.1);
        for j in 0..ny {
            let row = j * nx..(j + 1) * nx;
            scan_row(model, &grid, [j, k], &mut ct[row.clone()], &mut labels[row.clone()]);
            for (value, n) in ct[row.clone()].iter_mut().zip(&noise[row]) {
                *value = (f64::from(*value) + n).round().clamp(-1024.0, 3071.0) as i16;
            }
        }
    });
    Ok((Volume::new(grid, ct)?, Volume::new(grid, labels)?))
}

fn scan_row(model: &impl Model, grid: &Grid, [j, k]: [usize; 2], ct: &mut [i16], labels: &mut [u8]) {
    let model_from_voxel = model.to_model().after(grid.patient_from_voxel());
    let spacing = grid.spacing();
    let scale = model.blur_scale();
    let blur = (1.6 * spacing[0].max(spacing[1])).max(1.0) * scale;
    // Thick slices average what lies in them.
    let layers = (spacing[2] / 1.3).ceil().max(1.0) as usize;
    let point = |i: usize, layer: usize| {
        let dz = (layer as f64 + 0.5) / layers as f64 - 0.5;
        model_from_voxel.point(Point::new(i as f64, j as f64, k as f64 + dz))
    };
    let thickness = spacing[2] * scale;
    let mut clear_until = 0usize;
    for i in 0..ct.len() {
        if i < clear_until {
            ct[i] = AIR as i16;
            continue;
        }
        let (centre, clear) = model.sample(model_from_voxel.point(Point::new(i as f64, j as f64, k as f64)), blur);
        labels[i] = centre.structure.label();
        let hounsfield = if layers == 1 || clear > thickness {
            centre.hounsfield
        } else {
            (0..layers).map(|l| model.sample(point(i, l), blur).0.hounsfield).sum::<f64>() / layers as f64
        };
        ct[i] = hounsfield.round() as i16;
        // Far from the head a shape's function may overstate its distance; half of it is safe.
        clear_until = i + 1 + ((0.5 * clear - thickness).max(0.0) / (spacing[0] * scale)) as usize;
    }
}

/// Noise of one slice, correlated over neighbouring pixels as after a reconstruction filter; standard deviation in HU.
fn slice_noise([nx, ny]: [usize; 2], seed: u64, deviation: f64) -> Vec<f64> {
    let mut random = Random::new(seed.wrapping_mul(0x2545_f491_4f6c_dd1d));
    let (wide, high) = (nx + 2, ny + 2);
    let white: Vec<f64> = (0..wide * high).map(|_| nearly_normal(&mut random)).collect();
    let across: Vec<f64> =
        (0..nx * high).map(|n| n / nx * wide + n % nx).map(|n| white[n] + 2.0 * white[n + 1] + white[n + 2]).collect();
    // The binomial kernel (1 2 1) x (1 2 1) has the norm 6.
    let scale = deviation / 6.0;
    (0..nx * ny).map(|n| scale * (across[n] + 2.0 * across[n + nx] + across[n + 2 * nx])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_is_half_covered_on_the_surface_and_labels_follow_the_sign() {
        let mut p = Painter::new(2.0);
        p.layer(0.0, 1000.0, Structure::Skull);
        assert_eq!((p.hounsfield, p.structure), (0.0, Structure::Outside));
        p.layer(-1.0, 30.0, Structure::Brain);
        assert_eq!((p.hounsfield, p.structure), (30.0, Structure::Brain));
    }

    #[test]
    fn noise_has_the_deviation_asked_for() {
        let noise = slice_noise([300, 300], 3, 8.0);
        let variance = noise.iter().map(|v| v * v).sum::<f64>() / noise.len() as f64;
        assert!((variance.sqrt() - 8.0).abs() < 0.15, "{}", variance.sqrt());
    }
}
