//! Separable Gaussian smoothing.

use super::Raster;
use rayon::prelude::*;

/// Gaussian smoothing with standard deviation `sigma` voxels (kernel cut at 3.5 sigma, edge values continued).
pub(crate) fn gaussian(input: &Raster<f32>, sigma: f64) -> Raster<f32> {
    gaussian_along(input, [sigma; 3])
}

/// The same with a standard deviation for each axis, voxels of that axis.
pub(crate) fn gaussian_along(input: &Raster<f32>, sigma: [f64; 3]) -> Raster<f32> {
    if sigma.iter().all(|s| *s <= 0.0) {
        return input.clone();
    }
    let [across, along, over] = sigma.map(kernel);
    let [nx, ny, nz] = input.dims;
    let sheet = nx * ny;
    let mut flat = Raster::filled(input.dims, 0f32);
    flat.data.par_chunks_mut(sheet).zip(input.data.par_chunks(sheet)).for_each(|(out, source)| {
        let mut rows = vec![0f32; sheet];
        for (row, out) in source.chunks(nx).zip(rows.chunks_mut(nx)) {
            smooth_row(row, &across, out);
        }
        for j in 0..ny {
            let out = &mut out[j * nx..(j + 1) * nx];
            sum_rows(out, &along, j, ny, |r| &rows[r * nx..(r + 1) * nx]);
        }
    });
    let mut result = Raster::filled(input.dims, 0f32);
    result.data.par_chunks_mut(sheet).enumerate().for_each(|(k, out)| {
        sum_rows(out, &over, k, nz, |r| &flat.data[r * sheet..(r + 1) * sheet]);
    });
    result
}

/// The kernel's weights from its centre outwards, normalised over both sides.
fn kernel(sigma: f64) -> Vec<f32> {
    if sigma <= 0.0 {
        return vec![1.0];
    }
    let radius = (3.5 * sigma).ceil() as usize;
    let raw: Vec<f64> = (0..=radius).map(|r| (-0.5 * (r as f64 / sigma).powi(2)).exp()).collect();
    let total = raw[0] + 2.0 * raw[1..].iter().sum::<f64>();
    raw.iter().map(|w| (w / total) as f32).collect()
}

fn smooth_row(row: &[f32], half: &[f32], out: &mut [f32]) {
    let last = row.len() - 1;
    let radius = half.len() - 1;
    for (i, out) in out.iter_mut().enumerate() {
        let mut sum = row[i] * half[0];
        if i >= radius && i + radius <= last {
            for (r, w) in half.iter().enumerate().skip(1) {
                sum += (row[i - r] + row[i + r]) * w;
            }
        } else {
            for (r, w) in half.iter().enumerate().skip(1) {
                sum += (row[i.saturating_sub(r)] + row[(i + r).min(last)]) * w;
            }
        }
        *out = sum;
    }
}

fn sum_rows<'a>(out: &mut [f32], half: &[f32], at: usize, count: usize, row: impl Fn(usize) -> &'a [f32]) {
    out.iter_mut().zip(row(at)).for_each(|(o, v)| *o = v * half[0]);
    for (r, &w) in half.iter().enumerate().skip(1) {
        let (before, after) = (row(at.saturating_sub(r)), row((at + r).min(count - 1)));
        for ((o, a), b) in out.iter_mut().zip(before).zip(after) {
            *o += (a + b) * w;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_stays_and_a_point_spreads_with_the_asked_variance() {
        let flat = gaussian(&Raster::filled([9, 8, 7], 5f32), 1.3);
        assert!(flat.data.iter().all(|v| (v - 5.0).abs() < 1e-5));
        let mut point = Raster::filled([31, 31, 31], 0f32);
        let at = point.index(15, 15, 15);
        point.data[at] = 1.0;
        let spread = gaussian(&point, 2.0);
        let total: f32 = spread.data.iter().sum();
        let variance: f32 =
            spread.data.iter().enumerate().map(|(n, v)| v * (spread.voxel(n)[1] as f32 - 15.0).powi(2)).sum();
        assert!((total - 1.0).abs() < 1e-4);
        // Cutting the kernel at 3.5 sigma removes 0.0055 of the variance.
        assert!((variance - 4.0).abs() < 0.05, "{variance}");
        let along = gaussian_along(&point, [1.0, 2.0, 0.0]);
        let spread = |axis: usize| -> f32 {
            along.data.iter().enumerate().map(|(n, v)| v * (along.voxel(n)[axis] as f32 - 15.0).powi(2)).sum()
        };
        for (axis, wanted) in [1.0, 4.0, 0.0].into_iter().enumerate() {
            assert!((spread(axis) - wanted).abs() < 0.05, "{axis}: {}", spread(axis));
        }
    }
}
