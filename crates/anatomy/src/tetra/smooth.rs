//! Smoothing of fields that takes the steps off without shrinking the round.

use monro_geometry::Volume;
use rayon::prelude::*;
use std::ops::Range;

/// Width of the smoothing in cells.
const SIGMA: f64 = 0.85;
/// Cells to either side that count: three times the width.
const REACH: usize = 3;
const TAPS: usize = 2 * REACH + 1;

/// `2 G - G G`: a Gaussian made to keep second moments, so that it takes the steps off without shrinking the round. With
/// `thin`, thin parts stay as the voxels have them. Zero outside.
pub(super) fn smoothed(field: Volume<f32>, thin: bool) -> Volume<f32> {
    let grid = *field.grid();
    let mut data = field.into_data();
    let raw = if thin { data.clone() } else { Vec::new() };
    let mut gauss = Gauss::new(grid.dims());
    gauss.across_planes(&data);
    gauss.along_z(&mut data, |once, _| once);
    gauss.across_planes(&data);
    gauss.along_z(&mut data, |twice, once| 2.0 * once - twice);
    if !raw.is_empty() {
        keep_thin(&raw, &mut data, grid.dims());
    }
    Volume::new(grid, data).unwrap_or_else(|_| Volume::filled(grid, 0.0))
}

/// A Gaussian over a box.
struct Gauss {
    dims: [usize; 3],
    weights: [f32; TAPS],
    /// What came of it along x and y, and which part of each row is not zero.
    flat: Vec<f32>,
    used: Vec<Range<usize>>,
}

impl Gauss {
    fn new(dims: [usize; 3]) -> Self {
        let raw: [f64; TAPS] = std::array::from_fn(|i| (-0.5 * ((i as f64 - REACH as f64) / SIGMA).powi(2)).exp());
        let sum: f64 = raw.iter().sum();
        let weights = raw.map(|w| (w / sum) as f32);
        Self { dims, weights, flat: vec![0.0; dims.iter().product()], used: vec![0..0; dims[1] * dims[2]] }
    }

    /// Along x and y, a plane at a time.
    fn across_planes(&mut self, data: &[f32]) {
        let ([nx, ny, _], w) = (self.dims, &self.weights);
        let planes = data.par_chunks(nx * ny).zip(self.flat.par_chunks_mut(nx * ny)).zip(self.used.par_chunks_mut(ny));
        planes.for_each_init(Vec::new, |rows: &mut Vec<f32>, ((plane, out), used)| {
            rows.clear();
            rows.resize(nx * ny, 0.0);
            let parts: Vec<Range<usize>> =
                plane.chunks(nx).zip(rows.chunks_mut(nx)).map(|(from, to)| along_row(from, w, to)).collect();
            for (j, (to, used)) in out.chunks_mut(nx).zip(used).enumerate() {
                let around = |j: usize| (&rows[j * nx..][..nx], &parts[j]);
                *used = add_up(Around::new(j, ny, around), w, to, |sum, _| sum);
            }
        });
    }

    /// Along z what came of x and y; sets each cell from the result and its value before.
    fn along_z(&self, out: &mut [f32], set: impl Fn(f32, f32) -> f32 + Sync) {
        let [nx, ny, nz] = self.dims;
        out.par_chunks_mut(nx * ny).enumerate().for_each(|(k, out)| {
            for (j, to) in out.chunks_mut(nx).enumerate() {
                let around = |k: usize| (&self.flat[(k * ny + j) * nx..][..nx], &self.used[k * ny + j]);
                add_up(Around::new(k, nz, around), &self.weights, to, &set);
            }
        });
    }
}

/// Rows side by side around one, with the part of each that is not zero; none beyond the ends.
struct Around<'a>([Option<(&'a [f32], &'a Range<usize>)>; TAPS]);

impl<'a> Around<'a> {
    fn new(at: usize, count: usize, row: impl Fn(usize) -> (&'a [f32], &'a Range<usize>)) -> Self {
        Self(std::array::from_fn(|i| (at + i).checked_sub(REACH).filter(|&n| n < count).map(&row)))
    }

    /// The part in which any of them is not zero.
    fn used(&self) -> Range<usize> {
        let parts = self.0.iter().flatten().map(|r| r.1.clone()).filter(|r| !r.is_empty());
        parts.reduce(|a, b| a.start.min(b.start)..a.end.max(b.end)).unwrap_or(0..0)
    }
}

/// Sets each cell of a row from the weighted sum of those around it and its value before; returns the part in which the sum may
/// not be zero.
fn add_up(around: Around<'_>, w: &[f32; TAPS], to: &mut [f32], set: impl Fn(f32, f32) -> f32) -> Range<usize> {
    let used = around.used();
    [0..used.start, used.end..to.len()].into_iter().for_each(|r| to[r].iter_mut().for_each(|o| *o = set(0.0, *o)));
    let Some((some, _)) = around.0.iter().flatten().next() else { return used };
    // A row that is not there has no weight.
    let rows = around.0.map(|row| &row.map_or(*some, |r| r.0)[used.clone()]);
    let weights = std::array::from_fn(|i| if around.0[i].is_some() { w[i] } else { 0.0 });
    weigh(rows, &weights, &mut to[used.clone()], set);
    used
}

/// Sets each entry from the weighted sum of those of the rows, added in their order, and its value before.
fn weigh(rows: [&[f32]; TAPS], w: &[f32; TAPS], to: &mut [f32], set: impl Fn(f32, f32) -> f32) {
    let [a, b, c, d, e, f, g] = rows.map(|r| &r[..to.len()]);
    for (i, o) in to.iter_mut().enumerate() {
        let sum = w[0] * a[i] + w[1] * b[i] + w[2] * c[i] + w[3] * d[i] + w[4] * e[i] + w[5] * f[i] + w[6] * g[i];
        *o = set(sum, *o);
    }
}

/// Along a row whose `to` is zero; returns the part that is not zero any more.
fn along_row(from: &[f32], w: &[f32; TAPS], to: &mut [f32]) -> Range<usize> {
    let n = from.len();
    let used = used(from);
    let wide = used.start.saturating_sub(REACH)..(used.end + REACH).min(n);
    if used.is_empty() {
        return 0..0;
    }
    let at = |i: usize, tap: usize| (i + tap).checked_sub(REACH).and_then(|n| from.get(n)).copied().unwrap_or(0.0);
    let inner = wide.start.max(REACH)..wide.end.min(n.saturating_sub(REACH)).max(wide.start.max(REACH));
    for i in (wide.start..inner.start.min(wide.end)).chain(inner.end.min(wide.end)..wide.end) {
        to[i] = (0..TAPS).fold(0.0, |sum, tap| sum + w[tap] * at(i, tap));
    }
    if !inner.is_empty() {
        let rows = std::array::from_fn(|tap| &from[inner.start + tap - REACH..inner.end + tap - REACH]);
        weigh(rows, w, &mut to[inner], |sum, _| sum);
    }
    wide
}

/// The part of a row from its first value that is not zero to its last; empty at its start if there is none.
fn used(row: &[f32]) -> Range<usize> {
    let Some(first) = row.iter().position(|&v| v != 0.0) else { return 0..0 };
    first..row.iter().rposition(|&v| v != 0.0).map_or(first, |last| last + 1)
}

/// A part is thin where the smoothed field comes no nearer to 0 or 1 than this in a cell and those around it.
const FAINT: f32 = 0.25;

/// Takes the field as the voxels give it, `raw`, in and next to thin parts and thin gaps: smoothing would break them up.
fn keep_thin(raw: &[f32], data: &mut [f32], dims: [usize; 3]) {
    let around = |at: usize| {
        let shift = |n: usize| n % 3 + dims[0] * (n / 3 % 3 + dims[1] * (n / 9));
        (0..27).map(move |n| at + shift(n) - shift(13))
    };
    let (first, last) = (1 + dims[0] * (1 + dims[1]), data.len() - 1 - dims[0] * (1 + dims[1]));
    let thin = |at: &usize| {
        let (v, s) = (raw[*at], data[*at]);
        match v >= 0.5 {
            true => s < 1.0 - FAINT && around(*at).all(|n| data[n] < 1.0 - FAINT),
            false => s > FAINT && around(*at).all(|n| data[n] > FAINT),
        }
    };
    let found: Vec<usize> = (first..last).filter(thin).collect();
    let mut near: Vec<usize> = found.iter().flat_map(|&at| around(at)).collect();
    near.sort_unstable();
    near.dedup();
    near.into_iter().for_each(|at| data[at] = raw[at]);
}
