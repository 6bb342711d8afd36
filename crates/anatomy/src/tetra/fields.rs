//! The labels as smooth fields whose level sets are the surfaces to mesh.
//!
//! One field for everything that is kept, and one for each label but the last, which is what remains. Inside, a point
//! carries the label of the largest field, so a septum thinner than a cell survives between two ventricles.

use super::vec3::{V3, sub};
use crate::surface::even::{Even, Extent, even, even_step, extents};
use monro_geometry::{Affine, Patient, Point, Volume, Voxel};
use rayon::prelude::*;

/// Most cells of the common even grid over everything kept.
const MOST_CELLS: usize = 6_000_000;
/// Width of the smoothing in cells.
const SIGMA: f64 = 0.85;
const MARGIN: usize = 5;

/// A field sampled trilinearly in patient mm; 0 outside its box.
#[derive(Debug, Clone)]
pub(super) struct Field {
    volume: Volume<f32>,
    voxel_from_patient: Affine<Voxel, Patient>,
}

impl Field {
    pub(super) fn new(volume: Volume<f32>) -> Self {
        Self { voxel_from_patient: *volume.grid().voxel_from_patient(), volume }
    }

    pub(super) const fn volume(&self) -> &Volume<f32> {
        &self.volume
    }

    pub(super) fn at(&self, p: V3) -> f64 {
        let Some((at, t)) = self.cell(p) else { return 0.0 };
        let d = self.volume.grid().dims();
        let data = self.volume.data();
        let line = |at: usize| f64::from(data[at]) * (1.0 - t[0]) + f64::from(data[at + 1]) * t[0];
        let sheet = |at: usize| line(at) * (1.0 - t[1]) + line(at + d[0]) * t[1];
        sheet(at) * (1.0 - t[2]) + sheet(at + d[0] * d[1]) * t[2]
    }

    /// The value and its gradient per mm inside the cell.
    pub(super) fn with_slope(&self, p: V3) -> (f64, V3) {
        let Some((at, t)) = self.cell(p) else { return (0.0, [0.0; 3]) };
        let d = self.volume.grid().dims();
        let data = self.volume.data();
        let line = |at: usize| {
            let (low, high) = (f64::from(data[at]), f64::from(data[at + 1]));
            (low + (high - low) * t[0], high - low)
        };
        let sheet = |at: usize| {
            let (low, high) = (line(at), line(at + d[0]));
            let mix = |a: f64, b: f64| a + (b - a) * t[1];
            (mix(low.0, high.0), mix(low.1, high.1), high.0 - low.0)
        };
        let (low, high) = (sheet(at), sheet(at + d[0] * d[1]));
        let mix = |a: f64, b: f64| a + (b - a) * t[2];
        let g = [mix(low.1, high.1), mix(low.2, high.2), high.0 - low.0];
        let rows = self.voxel_from_patient.linear.rows;
        let slope = std::array::from_fn(|a| rows[0][a] * g[0] + rows[1][a] * g[1] + rows[2][a] * g[2]);
        (mix(low.0, high.0), slope)
    }

    /// First index of the cell around a point and the fractions inside; `None` outside of the box.
    fn cell(&self, p: V3) -> Option<(usize, V3)> {
        let v = self.voxel_from_patient.point(Point::from_array(p)).to_array();
        let d = self.volume.grid().dims();
        let mut base = [0usize; 3];
        let mut t = [0f64; 3];
        for a in 0..3 {
            if !(v[a] >= 0.0 && v[a] < (d[a] - 1) as f64) {
                return None;
            }
            base[a] = v[a] as usize;
            t[a] = v[a] - base[a] as f64;
        }
        Some(((base[2] * d[1] + base[1]) * d[0] + base[0], t))
    }
}

/// What is to be meshed.
#[derive(Debug, Clone)]
pub(super) struct LabelFields {
    /// Everything kept.
    pub(super) union: Field,
    /// Each label but the last.
    pub(super) parts: Vec<Field>,
    /// All labels, the remainder last; those absent from the volume are left out.
    pub(super) labels: Vec<u16>,
    /// Volume of each label's voxels, mm3.
    pub(super) volumes: Vec<f64>,
    /// Whether something kept reaches the border of the volume.
    pub(super) at_border: bool,
    /// Cell edge, mm.
    pub(super) step: f64,
}

impl LabelFields {
    /// Fields of the labels in `keep` that occur; `None` when none does. The label with most voxels is the remainder.
    pub(super) fn new<T: Copy + Into<u16> + Sync>(labels: &Volume<T>, keep: &[u16]) -> Option<Self> {
        let mut index = vec![0u8; 1 << 16];
        keep.iter().zip(1..).for_each(|(&k, i)| index[usize::from(k)] = i);
        let all = |l: T| index[usize::from(l.into())] != 0;
        let found = extents(labels, &index, keep.len());
        let whole = found.iter().flatten().copied().reduce(Extent::joined)?;
        let step = even_step(labels.grid(), &whole, MOST_CELLS);
        let mut present: Vec<(u16, Extent)> = keep.iter().zip(found).filter_map(|(&k, e)| Some((k, e?))).collect();
        let largest = (0..present.len()).max_by_key(|&i| (present[i].1.count, std::cmp::Reverse(i)))?;
        let rest = present.remove(largest);
        present.push(rest);
        let union = even(labels, &all, &whole, step, MARGIN)?;
        let (at_border, union) = (union.at_border, smoothed(union));
        let parts = present[..present.len() - 1].iter();
        let parts = parts.map(|(k, e)| even(labels, &|l: T| l.into() == *k, e, step, MARGIN).map(smoothed));
        Some(Self {
            union,
            parts: parts.collect::<Option<_>>()?,
            labels: present.iter().map(|p| p.0).collect(),
            volumes: present.iter().map(|p| p.1.count as f64 * labels.grid().voxel_volume()).collect(),
            at_border,
            step,
        })
    }

    /// Number of surfaces to cut: the outer one, then one for each label but the last.
    pub(super) fn surfaces(&self) -> usize {
        self.parts.len() + 1
    }

    /// Positive on the inner side of surface `s`: 0 is the outer one, `s` > 0 parts label `s - 1` from the labels after.
    pub(super) fn side(&self, s: usize, p: [f64; 3]) -> f64 {
        let union = self.union.at(p);
        if s == 0 {
            return union - 0.5;
        }
        let (mut own, mut rest, mut other) = (0.0, union, f64::NEG_INFINITY);
        for (i, part) in self.parts.iter().enumerate() {
            let value = part.at(p);
            rest -= value;
            match i.cmp(&(s - 1)) {
                std::cmp::Ordering::Equal => own = value,
                std::cmp::Ordering::Greater => other = other.max(value),
                std::cmp::Ordering::Less => {}
            }
        }
        own - other.max(rest)
    }

    /// Positive on the side of label `a`, zero on its surface with label `b` (`None`: with the outside); and the gradient
    /// per mm.
    pub(super) fn between(&self, a: u8, b: Option<u8>, p: V3) -> (f64, V3) {
        let Some(b) = b else {
            let (value, slope) = self.union.with_slope(p);
            return (value - 0.5, slope);
        };
        let (one, two) = (self.value(usize::from(a), p), self.value(usize::from(b), p));
        (one.0 - two.0, sub(one.1, two.1))
    }

    fn value(&self, l: usize, p: V3) -> (f64, V3) {
        let rest = |sum: (f64, V3), part: &Field| {
            let (value, slope) = part.with_slope(p);
            (sum.0 - value, sub(sum.1, slope))
        };
        match self.parts.get(l) {
            Some(part) => part.with_slope(p),
            None => self.parts.iter().fold(self.union.with_slope(p), rest),
        }
    }

    /// Positive inside label `l`, the distance in field values to the next label or to the outside.
    pub(super) fn margin(&self, l: usize, p: [f64; 3]) -> f64 {
        let union = self.union.at(p);
        let (mut own, mut rest, mut other) = (0.0, union, f64::NEG_INFINITY);
        for (i, part) in self.parts.iter().enumerate() {
            let value = part.at(p);
            rest -= value;
            if i == l { own = value } else { other = other.max(value) }
        }
        if l == self.parts.len() {
            own = rest;
        } else {
            other = other.max(rest);
        }
        (own - other).min(union - 0.5)
    }

    /// Index of the label at a point; `None` outside of all.
    pub(super) fn label_at(&self, p: [f64; 3]) -> Option<usize> {
        let mut rest = self.union.at(p);
        if rest < 0.5 {
            return None;
        }
        let mut best = (self.parts.len(), f64::NEG_INFINITY);
        for (i, part) in self.parts.iter().enumerate() {
            let value = part.at(p);
            rest -= value;
            if value > best.1 {
                best = (i, value);
            }
        }
        Some(if rest >= best.1 { self.parts.len() } else { best.0 })
    }
}

/// `2 G - G G`: a Gaussian made to keep second moments, so that it takes the steps off without shrinking the round.
fn smoothed(even: Even) -> Field {
    let dims = even.field.grid().dims();
    let grid = *even.field.grid();
    let mut data = even.field.into_data();
    gauss(&mut data, dims);
    let once = data.clone();
    gauss(&mut data, dims);
    data.par_iter_mut().zip(&once).for_each(|(two, one)| *two = 2.0 * one - *two);
    Field::new(Volume::new(grid, data).unwrap_or_else(|_| Volume::filled(grid, 0.0)))
}

fn kernel() -> Vec<f32> {
    let reach = (3.0 * SIGMA).ceil() as i32;
    let raw: Vec<f64> = (-reach..=reach).map(|i| (-0.5 * (f64::from(i) / SIGMA).powi(2)).exp()).collect();
    let sum: f64 = raw.iter().sum();
    raw.into_iter().map(|w| (w / sum) as f32).collect()
}

/// Separable Gaussian; zero outside (the fields have a margin of zeros).
fn gauss(data: &mut [f32], dims: [usize; 3]) {
    let w = kernel();
    let plane = dims[0] * dims[1];
    data.par_chunks_mut(plane).for_each(|p| {
        let mut line = vec![0f32; dims[0]];
        for row in p.chunks_mut(dims[0]) {
            convolve(row, 1, &w, &mut line);
        }
        let mut out = vec![0f32; plane];
        convolve(p, dims[0], &w, &mut out);
    });
    // Along z over bands of rows: the same loop with a stride of one plane.
    let mut out = vec![0f32; data.len()];
    let reach = w.len() / 2;
    out.par_chunks_mut(plane).enumerate().for_each(|(k, to)| {
        for (i, &weight) in w.iter().enumerate() {
            let Some(from) = (k + i).checked_sub(reach).filter(|&f| f < dims[2]) else { continue };
            to.iter_mut().zip(&data[from * plane..]).for_each(|(o, &v)| *o += weight * v);
        }
    });
    data.copy_from_slice(&out);
}

/// Convolves along an axis with the given stride; `out` is scratch of the same length.
fn convolve(data: &mut [f32], stride: usize, w: &[f32], out: &mut [f32]) {
    let n = data.len();
    let reach = w.len() / 2;
    out.fill(0.0);
    for (i, &weight) in w.iter().enumerate() {
        if i >= reach {
            let shift = (i - reach) * stride;
            if shift < n {
                out[..n - shift].iter_mut().zip(&data[shift..]).for_each(|(o, &v)| *o += weight * v);
            }
        } else {
            let shift = (reach - i) * stride;
            if shift < n {
                out[shift..].iter_mut().zip(&data[..n - shift]).for_each(|(o, &v)| *o += weight * v);
            }
        }
    }
    data.copy_from_slice(out);
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Grid;

    #[test]
    fn smoothing_keeps_a_ball_of_four_cells_at_its_size() {
        let grid = Grid::axis_aligned([24; 3], [1.0; 3], [-11.3, -11.6, -11.5]).expect("grid");
        let data = (0..grid.len()).map(|at| {
            let [i, j, k] = grid.voxel(at);
            u16::from((grid.centre(i, j, k) - Point::ORIGIN).norm() < 4.0)
        });
        let labels = Volume::new(grid, data.collect()).expect("count");
        let f = LabelFields::new(&labels, &[1]).expect("fields");
        // Where the field falls through the level along many directions.
        let mut sum = 0.0;
        let n = 400;
        for i in 0..n {
            let z = (f64::from(i) + 0.5) / f64::from(n) * 2.0 - 1.0;
            let a = f64::from(i) * 2.399_963;
            let s = (1.0 - z * z).sqrt();
            let at = |r: f64| f.side(0, [r * s * a.cos(), r * s * a.sin(), r * z]);
            sum += (0..600).map(|r| f64::from(r) * 0.01).find(|&r| at(r) < 0.0).expect("ends");
        }
        let radius = sum / f64::from(n);
        // A plain Gaussian of this width would take sigma^2 / r = 0.18 cells.
        assert!((radius - 4.0).abs() < 0.09, "{radius}");
    }

    #[test]
    fn a_one_voxel_septum_keeps_its_label() {
        let grid = Grid::axis_aligned([30; 3], [0.9; 3], [0.0; 3]).expect("grid");
        let data = (0..grid.len()).map(|at| {
            let [i, j, k] = grid.voxel(at);
            let core = (5..25).contains(&j) && (5..25).contains(&k);
            match i {
                5..=14 if core => 5u16,
                16..=24 if core => 6,
                _ => 4,
            }
        });
        let f = LabelFields::new(&Volume::new(grid, data.collect()).expect("count"), &[4, 5, 6]).expect("fields");
        let at = |x: f64| f.label_at([x * 0.9, 13.5, 13.5]).map(|l| f.labels[l]);
        assert_eq!([at(13.0), at(15.0), at(17.0)], [Some(5), Some(4), Some(6)]);
        assert!(f.at_border);
    }
}
