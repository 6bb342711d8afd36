//! Exact Euclidean distance transform (Felzenszwalb and Huttenlocher 2012, lower envelope of parabolas).

use super::{Mask, Raster};
use rayon::prelude::*;

/// Larger than any squared distance in a raster, small enough that sums stay finite and ordered in `f32`.
const FAR: f32 = 1e12;

/// For each voxel the distance to the nearest voxel of the set, in voxels (a huge number when the set is empty).
pub(crate) fn distance_to(mask: &Mask) -> Raster<f32> {
    transform(mask, true)
}

/// For each voxel the distance to the nearest voxel outside the set.
pub(crate) fn distance_to_false(mask: &Mask) -> Raster<f32> {
    transform(mask, false)
}

fn transform(mask: &Mask, target: bool) -> Raster<f32> {
    let [nx, ny, nz] = mask.dims;
    let sheet = nx * ny;
    let mut squared = Raster::filled(mask.dims, 0f32);
    squared.data.par_chunks_mut(sheet).zip(mask.data.par_chunks(sheet)).for_each(|(out, source)| {
        for (row, out) in source.chunks(nx).zip(out.chunks_mut(nx)) {
            row_squared(row, target, out);
        }
        let mut envelope = Envelope::new(ny);
        for i in 0..nx {
            envelope.lower(ny, |j| out[j * nx + i]);
            envelope.read(ny, |j, v| out[j * nx + i] = v);
        }
    });
    // The third pass runs along z: each task takes one row of columns and hands its sheet back.
    let sheets: Vec<Vec<f32>> = (0..ny).into_par_iter().map(|j| columns(&squared, j, nz)).collect();
    squared.data.par_chunks_mut(sheet).enumerate().for_each(|(k, out)| {
        for (j, row) in out.chunks_mut(nx).enumerate() {
            row.copy_from_slice(&sheets[j][k * nx..(k + 1) * nx]);
        }
    });
    squared
}

/// Distances (square root taken) of the `x`-`z` sheet at row `j`, `x` fastest.
fn columns(squared: &Raster<f32>, j: usize, nz: usize) -> Vec<f32> {
    let nx = squared.dims[0];
    let mut out = vec![0f32; nx * nz];
    let mut envelope = Envelope::new(nz);
    for i in 0..nx {
        envelope.lower(nz, |k| squared.data[squared.index(i, j, k)]);
        envelope.read(nz, |k, v| out[k * nx + i] = v.sqrt());
    }
    out
}

/// Squared distance along one row by a scan in each direction.
fn row_squared(row: &[bool], target: bool, out: &mut [f32]) {
    let mut run = FAR.sqrt();
    for (v, o) in row.iter().zip(out.iter_mut()) {
        run = if *v == target { 0.0 } else { run + 1.0 };
        *o = run;
    }
    run = FAR.sqrt();
    for (v, o) in row.iter().zip(out.iter_mut()).rev() {
        run = if *v == target { 0.0 } else { run + 1.0 };
        let d = o.min(run);
        *o = if d >= 1e6 { FAR } else { d * d };
    }
}

/// The lower envelope of the parabolas `(q - p)^2 + f(p)`.
struct Envelope {
    apex: Vec<usize>,
    height: Vec<f32>,
    start: Vec<f32>,
    count: usize,
}

impl Envelope {
    fn new(n: usize) -> Self {
        Self { apex: vec![0; n], height: vec![0.0; n], start: vec![0.0; n + 1], count: 0 }
    }

    fn lower(&mut self, n: usize, f: impl Fn(usize) -> f32) {
        self.count = 0;
        for q in 0..n {
            let h = f(q);
            if h >= FAR {
                continue;
            }
            let mut from = f32::NEG_INFINITY;
            while self.count > 0 {
                let top = self.count - 1;
                let p = self.apex[top];
                // Where the parabola of q falls below that of p; written with differences to keep f32 exact enough.
                let s = ((h - self.height[top]) / (q - p) as f32 + (q + p) as f32) * 0.5;
                if s > self.start[top] {
                    from = s;
                    break;
                }
                self.count -= 1;
            }
            self.apex[self.count] = q;
            self.height[self.count] = h;
            self.start[self.count] = from;
            self.count += 1;
        }
    }

    fn read(&self, n: usize, mut put: impl FnMut(usize, f32)) {
        if self.count == 0 {
            (0..n).for_each(|q| put(q, FAR));
            return;
        }
        let mut top = 0;
        for q in 0..n {
            while top + 1 < self.count && self.start[top + 1] < q as f32 {
                top += 1;
            }
            let d = q as f32 - self.apex[top] as f32;
            put(q, d * d + self.height[top]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn equals_brute_force(points in proptest::collection::vec((0usize..9, 0usize..7, 0usize..8), 1..12)) {
            let mut mask = Mask::filled([9, 7, 8], false);
            for &(i, j, k) in &points {
                let at = mask.index(i, j, k);
                mask.data[at] = true;
            }
            let d = distance_to(&mask);
            for (n, found) in d.data.iter().enumerate() {
                let [i, j, k] = mask.voxel(n);
                let best = points.iter().map(|p| p.0.abs_diff(i).pow(2) + p.1.abs_diff(j).pow(2) + p.2.abs_diff(k).pow(2)).min();
                let best = (best.expect("points") as f32).sqrt();
                prop_assert!((found - best).abs() < 1e-4, "{found} {best}");
            }
        }
    }

    #[test]
    fn an_empty_set_is_far_away() {
        assert!(distance_to(&Mask::filled([3, 4, 5], false)).data.iter().all(|&d| d > 1e5));
    }
}
