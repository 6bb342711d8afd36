//! A set of voxels as a field on an even grid: 1 inside, 0 outside, partial in between.
//!
//! CT voxels are often flat (0.4 x 0.4 x 2 mm). In the fine directions they are averaged; along a thick axis the shape
//! is interpolated through the signed distances of the slices (Raya and Udupa 1990), so that a sloping wall becomes a
//! slope and not a flight of stairs.

use super::runs::{kept, runs};
use super::slices::Slices;
use monro_geometry::{Affine, Grid, Matrix3, Point, Volume};
use rayon::prelude::*;
use std::ops::Range;

/// A field cropped to the set, with a margin of zeros.
#[derive(Debug, Clone)]
pub(crate) struct Even {
    pub(crate) field: Volume<f32>,
    /// Volume of the voxels of the set, mm3.
    pub(crate) volume: f64,
    /// Whether the set reaches the outermost voxels of the volume.
    pub(crate) at_border: bool,
}

/// First and last index of the kept voxels along each axis, and their number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Extent {
    pub(crate) low: [usize; 3],
    pub(crate) high: [usize; 3],
    pub(crate) count: usize,
}

/// The extent of the voxels that `keep` accepts; `None` when there are none.
pub(crate) fn extent<T: Copy + Sync>(labels: &Volume<T>, keep: &(impl Fn(T) -> bool + Sync)) -> Option<Extent> {
    let [nx, ny, _] = labels.grid().dims();
    let slices = labels.data().par_chunks(nx * ny).enumerate();
    let parts: Vec<Extent> = slices.filter_map(|(k, slice)| slice_extent(slice, nx, k, keep)).collect();
    parts.into_iter().reduce(Extent::joined)
}

impl Extent {
    /// The extent of two sets together.
    pub(crate) fn joined(self, other: Self) -> Self {
        Self {
            low: [0, 1, 2].map(|i| self.low[i].min(other.low[i])),
            high: [0, 1, 2].map(|i| self.high[i].max(other.high[i])),
            count: self.count + other.count,
        }
    }
}

/// The extents of several labels in one pass: `index` holds for each label its number among them plus one, or 0.
pub(crate) fn extents<T: Copy + Eq + Into<u16> + Sync>(
    labels: &Volume<T>,
    index: &[u8],
    count: usize,
) -> Vec<Option<Extent>> {
    let [nx, ny, _] = labels.grid().dims();
    let slices = labels.data().par_chunks(nx * ny).enumerate();
    let parts: Vec<Vec<Option<Extent>>> = slices.map(|(k, slice)| slice_extents(slice, nx, k, index, count)).collect();
    let join = |a: Option<Extent>, b: Option<Extent>| match (a, b) {
        (Some(a), Some(b)) => Some(a.joined(b)),
        _ => a.or(b),
    };
    (0..count).map(|l| parts.iter().fold(None, |sum, part| join(sum, part[l]))).collect()
}

fn slice_extents<T: Copy + Eq + Into<u16>>(
    slice: &[T],
    nx: usize,
    k: usize,
    index: &[u8],
    count: usize,
) -> Vec<Option<Extent>> {
    let mut all = vec![None; count];
    for (j, row) in slice.chunks(nx).enumerate() {
        for (run, label) in runs(row) {
            if let Some(l) = index[usize::from(label.into())].checked_sub(1) {
                let here = Extent { low: [run.start, j, k], high: [run.end - 1, j, k], count: run.len() };
                let sum: &mut Option<Extent> = &mut all[usize::from(l)];
                *sum = Some(sum.map_or(here, |s| s.joined(here)));
            }
        }
    }
    all
}

fn slice_extent<T: Copy>(slice: &[T], nx: usize, k: usize, keep: &impl Fn(T) -> bool) -> Option<Extent> {
    let mut e = Extent { low: [usize::MAX, usize::MAX, k], high: [0, 0, k], count: 0 };
    for (j, row) in slice.chunks(nx).enumerate() {
        let Some(first) = row.iter().position(|&v| keep(v)) else { continue };
        let last = row.iter().rposition(|&v| keep(v)).unwrap_or(first);
        e.low = [e.low[0].min(first), e.low[1].min(j), k];
        e.high = [e.high[0].max(last), e.high[1].max(j), k];
        e.count += row[first..=last].iter().filter(|&&v| keep(v)).count();
    }
    (e.count > 0).then_some(e)
}

/// The step of an even grid for this placement: the geometric mean of the spacings, raised until the box of the extent
/// has no more than `most` cells.
pub(crate) fn even_step(grid: &Grid, extent: &Extent, most: usize) -> f64 {
    let spacing = grid.spacing();
    let mean = spacing.iter().product::<f64>().cbrt();
    let size: f64 = (0..3).map(|a| (extent.high[a] - extent.low[a] + 1) as f64 * spacing[a]).product();
    mean.max((size / most as f64).cbrt())
}

/// How one output cell is made of input cells: the first one and the weights from there on.
pub(super) struct Tap {
    pub(super) first: isize,
    pub(super) weights: Vec<f32>,
}

/// One axis of the resampling: output cell `i` covers the input from `(start + i) * ratio - 0.5`, `ratio` wide.
struct Axis {
    start: isize,
    ratio: f64,
    taps: Vec<Tap>,
}

impl Axis {
    fn new(low: usize, high: usize, ratio: f64, margin: isize) -> Self {
        let start = ((low as f64) / ratio).floor() as isize - margin;
        let end = ((high as f64 + 1.0) / ratio).ceil() as isize + margin;
        let taps = (start..end).map(|i| if ratio >= 1.0 { covered(i, ratio) } else { between(i, ratio) }).collect();
        Self { start, ratio, taps }
    }

    /// Adds a run of ones to a row of output cells, given the sum of the weights of each cell; the row of the input begins at
    /// `low`.
    fn spread(&self, run: &Range<usize>, row: &mut [f32], (whole, low): (&[f32], usize)) {
        let (start, end) = ((run.start + low) as isize, (run.end + low) as isize);
        let last = |tap: &Tap| tap.first + tap.weights.len() as isize;
        let cells =
            self.taps.partition_point(|tap| last(tap) <= start)..self.taps.partition_point(|tap| tap.first < end);
        let full =
            self.taps.partition_point(|tap| tap.first < start)..self.taps.partition_point(|tap| last(tap) <= end);
        let full = full.start.clamp(cells.start, cells.end)..full.end.clamp(cells.start, cells.end);
        let full = full.start..full.end.max(full.start);
        row[full.clone()].copy_from_slice(&whole[full.clone()]);
        for o in (cells.start..full.start).chain(full.end..cells.end) {
            let tap = &self.taps[o];
            let inside = |i: usize| (start..end).contains(&(tap.first + i as isize));
            row[o] += tap.weights.iter().enumerate().filter(|(i, _)| inside(*i)).map(|(_, &w)| w).sum::<f32>();
        }
    }

    /// Input index (continuous) of the centre of the first output cell.
    fn origin(&self) -> f64 {
        (self.start as f64 + 0.5) * self.ratio - 0.5
    }
}

/// Weights of the input cells that a wide output cell covers.
fn covered(i: isize, ratio: f64) -> Tap {
    let (from, to) = (i as f64 * ratio, (i + 1) as f64 * ratio);
    let first = from.floor() as isize;
    let last = (to.ceil() as isize).max(first + 1);
    let part = |c: isize| ((c + 1) as f64).min(to) - (c as f64).max(from);
    Tap { first, weights: (first..last).map(|c| (part(c) / ratio).max(0.0) as f32).collect() }
}

/// Linear interpolation between two input centres.
fn between(i: isize, ratio: f64) -> Tap {
    let x = (i as f64 + 0.5) * ratio - 0.5;
    let t = (x - x.floor()) as f32;
    Tap { first: x.floor() as isize, weights: vec![1.0 - t, t] }
}

/// The one axis along which slices are thick for this step, if there is one: between them the field is that of the shape, and
/// those of several labels do not add up to that of all.
pub(crate) fn thick_axis(grid: &Grid, step: f64) -> Option<usize> {
    let mut thick = (0..3).filter(|&a| grid.spacing()[a] > 1.5 * step);
    thick.next().filter(|_| thick.next().is_none())
}

/// Resamples the voxels that `keep` accepts to cells of edge `step` (mm) along the index axes, on a lattice that
/// depends only on the grid and the step (fields of several labels line up), with `margin` cells around.
pub(crate) fn even<T: Copy + Eq + Sync>(
    labels: &Volume<T>,
    keep: &(impl Fn(T) -> bool + Sync),
    extent: &Extent,
    step: f64,
    margin: usize,
) -> Option<Even> {
    resampled(labels, keep, extent, (step, margin), thick_axis(labels.grid(), step))
}

/// As [`even`], along the axis `thick` by shapes, along all others linearly: without one the fields of several labels add up to
/// that of all.
pub(crate) fn resampled<T: Copy + Eq + Sync>(
    labels: &Volume<T>,
    keep: &(impl Fn(T) -> bool + Sync),
    extent: &Extent,
    (step, margin): (f64, usize),
    thick: Option<usize>,
) -> Option<Even> {
    let grid = labels.grid();
    let spacing = grid.spacing();
    let ratio = spacing.map(|s| if (step / s - 1.0).abs() < 1e-6 { 1.0 } else { step / s });
    let axes = [0, 1, 2].map(|a| Axis::new(extent.low[a], extent.high[a], ratio[a], margin as isize));
    let mut part = Part::crop(labels, keep, extent, (thick != Some(0)).then_some(&axes[0]));
    for a in (1..3).filter(|&a| thick != Some(a)) {
        part.resample(a, &axes[a], extent.low[a]);
    }
    if let Some(axis) = thick {
        part.interpolate_shape(axis, &axes[axis], extent.low[axis], step, spacing[axis]);
    }
    let field = Volume::new(placed(grid, &axes)?, part.data).ok()?;
    let dims = grid.dims();
    let at_border = (0..3).any(|a| extent.low[a] == 0 || extent.high[a] + 1 == dims[a]);
    Some(Even { field, volume: extent.count as f64 * grid.voxel_volume(), at_border })
}

fn placed(grid: &Grid, axes: &[Axis; 3]) -> Option<Grid> {
    let from = grid.patient_from_voxel();
    let rows = from.linear.rows.map(|r| [0, 1, 2].map(|a| r[a] * axes[a].ratio));
    let origin = from.point(Point::new(axes[0].origin(), axes[1].origin(), axes[2].origin()));
    Grid::new([0, 1, 2].map(|a| axes[a].taps.len()), Affine::new(Matrix3 { rows }, origin.to_array())).ok()
}

/// A box of values under way from the input to the output lattice, axis by axis.
struct Part {
    data: Vec<f32>,
    dims: [usize; 3],
}

impl Part {
    /// The voxels of a box that `keep` accepts, resampled along the first axis if `along` is given.
    fn crop<T: Copy + Eq + Sync>(
        labels: &Volume<T>,
        keep: &(impl Fn(T) -> bool + Sync),
        e: &Extent,
        along: Option<&Axis>,
    ) -> Self {
        let [nx, ny, nz] = [0, 1, 2].map(|a| e.high[a] - e.low[a] + 1);
        let width = along.map_or(nx, |axis| axis.taps.len());
        let mut data = vec![0f32; width * ny * nz];
        let whole: Vec<f32> =
            along.map_or(Vec::new(), |axis| axis.taps.iter().map(|t| t.weights.iter().sum()).collect());
        data.par_chunks_mut(width * ny).enumerate().for_each(|(k, slice)| {
            for (j, row) in slice.chunks_mut(width).enumerate() {
                let from = labels.grid().index(e.low[0], e.low[1] + j, e.low[2] + k);
                let voxels = &labels.data()[from..from + nx];
                for run in kept(voxels, keep) {
                    match along {
                        Some(axis) => axis.spread(&run, row, (&whole, e.low[0])),
                        None => row[run].fill(1.0),
                    }
                }
            }
        });
        Self { data, dims: [width, ny, nz] }
    }

    /// Applies the taps along an axis but the first; input cells outside the box are zero.
    fn resample(&mut self, axis: usize, along: &Axis, low: usize) {
        let inner: usize = self.dims[..axis].iter().product();
        let (n, m) = (self.dims[axis], along.taps.len());
        let mut out = vec![0f32; self.data.len() / n * m];
        out.par_chunks_mut(inner).enumerate().for_each(|(row, to)| {
            let (from, tap) = (&self.data[row / m * inner * n..], &along.taps[row % m]);
            let inside = |i: usize| usize::try_from(tap.first + i as isize - low as isize).ok().filter(|&at| at < n);
            let taps = tap.weights.iter().enumerate().filter_map(|(i, &w)| Some((inside(i)?, w)));
            for (k, (at, w)) in taps.enumerate() {
                let cells = to.iter_mut().zip(&from[at * inner..]);
                // The first finds nothing to add to.
                if k == 0 { cells.for_each(|(o, &v)| *o = w * v) } else { cells.for_each(|(o, &v)| *o += w * v) }
            }
        });
        self.data = out;
        self.dims[axis] = m;
    }

    /// Signed distances in the planes across `axis`, interpolated along it, back to a field of about one cell's width.
    fn interpolate_shape(&mut self, axis: usize, along: &Axis, low: usize, step: f64, thickness: f64) {
        let dims = self.dims;
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let cut: Vec<Vec<f32>> = (0..dims[axis]).into_par_iter().map(|k| self.plane(axis, k)).collect();
        let slices = Slices::new(cut, [dims[u], dims[v]], step, thickness);
        self.dims[axis] = along.taps.len();
        let size = dims[u] * dims[v];
        let mut planes = vec![0.0; size * along.taps.len()];
        let made = planes.par_chunks_mut(size).zip(&along.taps);
        made.for_each(|(plane, tap)| slices.between(tap, low, plane));
        self.data = if axis == 2 { planes } else { self.joined(axis, &planes) };
    }

    /// The plane `k` across an axis, along the next axis first.
    fn plane(&self, axis: usize, k: usize) -> Vec<f32> {
        let size = self.dims[0] * self.dims[1];
        if axis == 2 {
            return self.data[k * size..][..size].to_vec();
        }
        self.cells_of_plane(axis, k).map(|at| self.data[at]).collect()
    }

    /// What was made plane by plane across an axis, in its place.
    fn joined(&self, axis: usize, planes: &[f32]) -> Vec<f32> {
        let mut data = vec![0.0; planes.len()];
        let size = planes.len() / self.dims[axis];
        for (k, plane) in planes.chunks(size).enumerate() {
            self.cells_of_plane(axis, k).zip(plane).for_each(|(at, &x)| data[at] = x);
        }
        data
    }

    fn cells_of_plane(&self, axis: usize, k: usize) -> impl Iterator<Item = usize> + use<> {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let (dims, strides) = (self.dims, [1, self.dims[0], self.dims[0] * self.dims[1]]);
        (0..dims[v]).flat_map(move |j| (0..dims[u]).map(move |i| k * strides[axis] + i * strides[u] + j * strides[v]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(
        dims: [usize; 3],
        spacing: [f64; 3],
        inside: impl Fn(Point<monro_geometry::Patient>) -> bool,
    ) -> Volume<u8> {
        let origin = [0, 1, 2].map(|a| -(dims[a] as f64 - 1.0) / 2.0 * spacing[a]);
        let grid = Grid::axis_aligned(dims, spacing, origin).expect("grid");
        let value = |at| {
            let [i, j, k] = grid.voxel(at);
            u8::from(inside(grid.centre(i, j, k)))
        };
        Volume::new(grid, (0..grid.len()).map(value).collect()).expect("count")
    }

    #[test]
    fn averaging_keeps_the_volume_exactly() {
        let v = mask([40; 3], [0.4; 3], |p| (p - Point::ORIGIN).norm() < 5.0);
        let keep = |l: u8| l == 1;
        let e = extent(&v, &keep).expect("not empty");
        let out = even(&v, &keep, &e, 0.9, 2).expect("field");
        let sum: f64 = out.field.data().iter().map(|&x| f64::from(x)).sum();
        assert!((sum * 0.9f64.powi(3) / out.volume - 1.0).abs() < 1e-5);
        assert!(!out.at_border);
    }

    #[test]
    fn the_lattice_does_not_depend_on_the_set() {
        let v = mask([40; 3], [0.4, 0.4, 1.0], |p| (p - Point::ORIGIN).norm() < 7.0);
        let inner = mask([40; 3], [0.4, 0.4, 1.0], |p| p.x > 1.0 && (p - Point::ORIGIN).norm() < 7.0);
        let keep = |l: u8| l == 1;
        let origin = |v: &Volume<u8>| {
            let f = even(v, &keep, &extent(v, &keep).expect("some"), 0.7, 1).expect("field").field;
            f.grid().centre(0, 0, 0).to_array()
        };
        for (a, b) in origin(&v).into_iter().zip(origin(&inner)) {
            let cells = (a - b) / 0.7;
            assert!((cells - cells.round()).abs() < 1e-9);
        }
    }

    #[test]
    fn a_slope_through_thick_slices_becomes_a_slope() {
        // A wedge z < x / 4, slices 4 mm apart: linear interpolation of the mask would leave steps of 4 mm.
        let v = mask([161, 9, 9], [0.5, 0.5, 4.0], |p| p.z < p.x / 4.0);
        let keep = |l: u8| l == 1;
        let f = even(&v, &keep, &extent(&v, &keep).expect("some"), 0.8, 0).expect("field").field;
        let mut worst = 0f64;
        for n in -10..=10 {
            let x = f64::from(n);
            let height =
                (-80..80).map(|i| f64::from(i) * 0.1).filter(|&z| f.trilinear(Point::new(x, 0.0, z)) > Some(0.5));
            worst = worst.max((height.fold(f64::NEG_INFINITY, f64::max) - x / 4.0).abs());
        }
        // In-plane distances are exact to half a cell.
        assert!(worst <= 0.5, "{worst}");
    }
}
