//! Smoothing of fields that takes the steps off without shrinking the round.

use monro_geometry::Volume;
use rayon::prelude::*;
use std::collections::VecDeque;
use std::ops::Range;

/// Width of the smoothing in cells.
const SIGMA: f64 = 0.85;
/// Cells to either side that count: three times the width.
const REACH: usize = 3;
const TAPS: usize = 2 * REACH + 1;
/// Planes of a slab at least: those beyond its ends are gone through twice.
const LEAST_SLAB: usize = 4 * REACH;

/// `2 G - G G`: a Gaussian made to keep second moments, so that it takes the steps off without shrinking the round. With
/// `thin`, thin parts stay as the voxels have them. Zero outside.
pub(super) fn smoothed(field: Volume<f32>, thin: bool) -> Volume<f32> {
    let grid = *field.grid();
    let mut data = field.into_data();
    let raw = if thin { data.clone() } else { Vec::new() };
    let gauss = Gauss::new(grid.dims());
    gauss.over(&mut data, |once, _| once);
    gauss.over(&mut data, |twice, once| 2.0 * once - twice);
    if !raw.is_empty() {
        keep_thin(&raw, &mut data, grid.dims());
    }
    Volume::new(grid, data).expect("as many values as before")
}

/// A Gaussian over a box.
struct Gauss {
    dims: [usize; 3],
    weights: [f32; TAPS],
}

/// What came of a plane along x and y, and which part of each row is not zero.
#[derive(Debug, Clone, Default)]
struct Flat {
    values: Vec<f32>,
    used: Vec<Range<usize>>,
}

impl Flat {
    fn row(&self, j: usize, nx: usize) -> (&[f32], &Range<usize>) {
        (&self.values[j * nx..][..nx], &self.used[j])
    }
}

impl Gauss {
    fn new(dims: [usize; 3]) -> Self {
        let raw: [f64; TAPS] = std::array::from_fn(|i| (-0.5 * ((i as f64 - REACH as f64) / SIGMA).powi(2)).exp());
        let sum: f64 = raw.iter().sum();
        Self { dims, weights: raw.map(|w| (w / sum) as f32) }
    }

    /// Sets each cell from what the Gaussian makes of it and its value before.
    ///
    /// Threads go through slabs of planes, each with what came of the planes around the one that is set: those do not leave
    /// the caches, and nothing of the size of the box is written in between.
    fn over(&self, data: &mut [f32], set: impl Fn(f32, f32) -> f32 + Sync) {
        let ([nx, ny, nz], threads) = (self.dims, rayon::current_num_threads());
        let (size, thick) = (nx * ny, nz.div_ceil(threads).max(LEAST_SLAB));
        // Of planes beyond the ends of slabs, before any is set.
        let beyond = |planes: Range<usize>| -> Vec<Flat> {
            planes.map(|k| self.flat(&data[k * size..][..size], Flat::default(), &mut Vec::new())).collect()
        };
        let ends = |first: usize| {
            let end = (first + thick).min(nz);
            (beyond(first.saturating_sub(REACH)..first), beyond(end..(end + REACH).min(nz)))
        };
        let ends: Vec<(Vec<Flat>, Vec<Flat>)> = (0..nz).into_par_iter().step_by(thick).map(ends).collect();
        let slabs = data.par_chunks_mut(size * thick).zip(ends);
        slabs.for_each(|(slab, (before, after))| self.over_slab(slab, (before, after), &set));
    }

    /// Over a slab, given what came of the planes before its first one and behind its last, as far as they count.
    fn over_slab(&self, slab: &mut [f32], (before, after): (Vec<Flat>, Vec<Flat>), set: &impl Fn(f32, f32) -> f32) {
        let [nx, ny, _] = self.dims;
        let (size, own) = (nx * ny, slab.len() / (nx * ny));
        let mut after = after.into_iter();
        // Around the plane to be set, which is in the middle.
        let mut window: VecDeque<Option<Flat>> = (before.len()..REACH).map(|_| None).collect();
        window.extend(before.into_iter().map(Some));
        let (mut spare, mut rows) = (Flat::default(), Vec::new());
        for k in 0..own + REACH {
            window.push_back(match k < own {
                true => Some(self.flat(&slab[k * size..][..size], std::mem::take(&mut spare), &mut rows)),
                false => after.next(),
            });
            let Some(plane) = k.checked_sub(REACH) else { continue };
            for (j, to) in slab[plane * size..][..size].chunks_mut(nx).enumerate() {
                add_up(
                    Around(std::array::from_fn(|i| window[i].as_ref().map(|flat| flat.row(j, nx)))),
                    &self.weights,
                    to,
                    set,
                );
            }
            spare = window.pop_front().flatten().unwrap_or_default();
        }
    }

    /// Along x and y over a plane, into `out`, whatever that was; `rows` is room for what comes in between.
    fn flat(&self, plane: &[f32], mut out: Flat, rows: &mut Vec<f32>) -> Flat {
        let ([nx, ny, _], w) = (self.dims, &self.weights);
        rows.clear();
        rows.resize(nx * ny, 0.0);
        let parts: Vec<Range<usize>> =
            plane.chunks(nx).zip(rows.chunks_mut(nx)).map(|(from, to)| along_row(from, w, to)).collect();
        out.values.resize(nx * ny, 0.0);
        out.used.clear();
        for (j, to) in out.values.chunks_mut(nx).enumerate() {
            let around = |j: usize| (&rows[j * nx..][..nx], &parts[j]);
            out.used.push(add_up(Around::new(j, ny, around), w, to, |sum, _| sum));
        }
        out
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
