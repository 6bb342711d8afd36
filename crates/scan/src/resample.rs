//! From a stack of parallel slices to an even, rectangular grid.
//!
//! Slices of one orientation may be unevenly spaced (missing slices, two thicknesses in one series) and shifted within
//! their plane from one to the next (gantry tilt). The grid keeps the slices' own column and row directions and pixel
//! size, so nothing is blurred within a slice by more than a fraction of a pixel; between slices it is linear.

use crate::error::Problem;
use crate::hu::AIR;
use monro_geometry::{Affine, Grid, Matrix3, Patient, Point, Vector, Volume};

/// A slice may lie this far from its even place, mm; DICOM positions are often rounded to a tenth.
const TOLERANCE_MM: f64 = 0.1;
/// Columns and rows may miss the right angle by this much, degrees.
const TOLERANCE_DEG: f64 = 0.05;
/// Uneven stacks are resampled at least this finely, mm, because interpolating twice across thick slices would blur.
const FINE_MM: f64 = 2.5;

/// A resampled stack has at most this many times the voxels: a gantry tilt of 30 degrees takes less than 2, spacings of
/// 0.5 and 5 mm in one series 6.
const MOST_GROWTH: u64 = 16;

/// Where the slices of a stack lie.
#[derive(Debug, Clone)]
pub(crate) struct Stack {
    /// Columns and rows of a slice.
    pub(crate) size: [usize; 2],
    /// From one column to the next, mm.
    pub(crate) u: Vector<Patient>,
    /// From one row to the next, mm.
    pub(crate) v: Vector<Patient>,
    /// Centre of the first pixel of each slice, in order along the normal `u x v` (all the same way).
    pub(crate) origins: Vec<Point<Patient>>,
}

/// Position of each slice relative to the first: along the normal in mm, within the plane in pixels.
struct Offsets {
    along: Vec<f64>,
    column: Vec<f64>,
    row: Vec<f64>,
}

impl Stack {
    /// The stack of a volume that came with one affine placement.
    pub(crate) fn of_grid(grid: &Grid) -> Self {
        let column = |a| Vector::from_array(grid.patient_from_voxel().linear.column(a));
        let [x, y, z] = grid.dims();
        Self { size: [x, y], u: column(0), v: column(1), origins: (0..z).map(|k| grid.centre(0, 0, k)).collect() }
    }

    /// The unit normal, on the side to which the slices are stacked.
    pub(crate) fn normal(&self) -> Vector<Patient> {
        let n = self.u.cross(self.v).normalized().unwrap_or(Vector::ZERO);
        let towards = self.origins.last().map_or(Vector::ZERO, |&last| last - self.origins[0]);
        if n.dot(towards) < 0.0 { -n } else { n }
    }

    /// Distances of neighbouring slices along the normal, mm.
    pub(crate) fn steps(&self) -> Vec<f64> {
        let n = self.normal();
        self.origins.windows(2).map(|w| (w[1] - w[0]).dot(n)).collect()
    }

    /// Angle between the normal and the direction in which most slices follow one another, degrees: of a single jump
    /// sideways there is none.
    pub(crate) fn tilt_deg(&self) -> f64 {
        self.shear().norm().atan().to_degrees()
    }

    /// How far a slice is shifted within its plane against the one before, for each mm between them; the median.
    fn shear(&self) -> Vector<Patient> {
        let n = self.normal();
        let apart = self.origins.windows(2).map(|w| w[1] - w[0]).filter(|d| d.dot(n) > 0.0);
        let shifts: Vec<[f64; 3]> = apart.map(|d| (d / d.dot(n) - n).to_array()).collect();
        Vector::from_array(core::array::from_fn(|a| median(shifts.iter().map(|s| s[a]).collect())))
    }

    /// How far a slice is shifted at most against the one before beyond what the tilt makes of it, mm.
    fn jump_mm(&self) -> f64 {
        let (n, shear) = (self.normal(), self.shear());
        let jump = |d: Vector<Patient>| (d - (n + shear) * d.dot(n)).norm();
        self.origins.windows(2).map(|w| jump(w[1] - w[0])).fold(0.0, f64::max)
    }

    fn offsets(&self) -> Offsets {
        let n = self.normal();
        let from_first: Vec<_> = self.origins.iter().map(|&o| o - self.origins[0]).collect();
        let within = |axis: Vector<Patient>| from_first.iter().map(|d| d.dot(axis) / axis.norm_squared()).collect();
        Offsets { along: from_first.iter().map(|d| d.dot(n)).collect(), column: within(self.u), row: within(self.v) }
    }

    /// Whether one rectangular grid passes through all slices; then its step, mm.
    pub(crate) fn even_step(&self) -> Option<f64> {
        let o = self.offsets();
        let last = *o.along.last()?;
        let step = last / (o.along.len().max(2) - 1) as f64;
        let even = o.along.iter().enumerate().all(|(k, s)| (s - k as f64 * step).abs() <= TOLERANCE_MM);
        let (du, dv) = (self.u.norm(), self.v.norm());
        let straight = o.column.iter().all(|c| (c * du).abs() <= TOLERANCE_MM)
            && o.row.iter().all(|r| (r * dv).abs() <= TOLERANCE_MM);
        (even && straight).then_some(step)
    }

    /// Refuses columns and rows that are not perpendicular.
    pub(crate) fn check_right_angle(&self) -> Result<(), Problem> {
        let degrees = self.u.angle(self.v).to_degrees();
        if (degrees - 90.0).abs() <= TOLERANCE_DEG { Ok(()) } else { Err(Problem::Sheared { degrees }) }
    }

    /// The grid through all slices of an even stack.
    pub(crate) fn grid(&self, step: f64) -> Result<Grid, Problem> {
        let linear = Matrix3::from_columns(self.u, self.v, self.normal() * step);
        let dims = [self.size[0], self.size[1], self.origins.len()];
        Ok(Grid::new(dims, Affine::new(linear, self.origins[0].to_array()))?)
    }
}

/// The middle one, 0 of none.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Whether [`onto_even_grid`] would refuse, without the voxels.
pub(crate) fn foresee(stack: &Stack) -> Result<(), Problem> {
    stack.check_right_angle()?;
    if stack.origins.len() < 2 || stack.even_step().is_some() {
        return Ok(());
    }
    Target::of(stack).grid(stack).map(|_| ())
}

/// Keeps an even stack as it is; otherwise resamples it and says so. `data` holds the slices in the stack's order.
pub(crate) fn onto_even_grid(stack: &Stack, data: Vec<i16>) -> Result<(Volume<i16>, Option<String>), Problem> {
    stack.check_right_angle()?;
    if let Some(step) = stack.even_step() {
        return Ok((Volume::new(stack.grid(step)?, data)?, None));
    }
    let target = Target::of(stack);
    let grid = target.grid(stack)?;
    let mut out = Vec::with_capacity(grid.len());
    let mut planes = Planes::new(stack, &target, &data);
    for k in 0..target.count {
        planes.blend_into(&mut out, k as f64 * target.step);
    }
    let sentence = target.sentence(stack, &grid);
    Ok((Volume::new(grid, out)?, Some(sentence)))
}

/// The even grid for an uneven stack.
struct Target {
    offsets: Offsets,
    step: f64,
    count: usize,
    /// Whole columns and rows by which the grid begins before the first slice.
    before: [f64; 2],
    size: [usize; 2],
}

impl Target {
    fn of(stack: &Stack) -> Self {
        let offsets = stack.offsets();
        let length = offsets.along.last().copied().unwrap_or(0.0);
        let mut steps = stack.steps();
        steps.sort_by(f64::total_cmp);
        let (least, most) = (steps[0], steps[steps.len() - 1]);
        // The lower quartile is a spacing that really occurs often, not a chance overlap of two slices.
        let typical = steps[steps.len() / 4].max(TOLERANCE_MM);
        let even = most - least <= 2.0 * TOLERANCE_MM;
        let wanted = if even { length / steps.len() as f64 } else { typical / (typical / FINE_MM).ceil() };
        let intervals = (length / wanted).round().max(1.0);
        let span = |shift: &[f64]| {
            let low = shift.iter().fold(0.0, |a: f64, &b| a.min(b)).floor();
            (low, (shift.iter().fold(0.0, |a: f64, &b| a.max(b)) - low).ceil() as usize)
        };
        let ((left, wider), (top, taller)) = (span(&offsets.column), span(&offsets.row));
        // Saturating: a damaged header may put slices anywhere; `grid` refuses what is too large.
        let size = [stack.size[0].saturating_add(wider), stack.size[1].saturating_add(taller)];
        Self {
            step: length / intervals,
            count: (intervals as usize).saturating_add(1),
            before: [left, top],
            size,
            offsets,
        }
    }

    fn grid(&self, stack: &Stack) -> Result<Grid, Problem> {
        let origin = stack.origins[0] + stack.u * self.before[0] + stack.v * self.before[1];
        let linear = Matrix3::from_columns(stack.u, stack.v, stack.normal() * self.step);
        let dims = [self.size[0], self.size[1], self.count].map(|d| d as u64);
        let source = (stack.size[0] * stack.size[1] * stack.origins.len()) as u64;
        let limit = source.saturating_mul(MOST_GROWTH);
        if dims.iter().try_fold(1u64, |n, &d| n.checked_mul(d)).is_none_or(|n| n > limit) {
            return Err(Problem::TooUneven { dims, limit });
        }
        crate::raster::grid(dims, Affine::new(linear, origin.to_array()))
    }

    fn sentence(&self, stack: &Stack, grid: &Grid) -> String {
        let steps = stack.steps();
        let (least, most) = steps.iter().fold((f64::MAX, f64::MIN), |(a, b), &s| (a.min(s), b.max(s)));
        let [x, y, z] = grid.dims();
        let (n, tilt) = (stack.origins.len(), stack.tilt_deg());
        let [least, most] = [least, most].map(|step| format!("{step:.3}"));
        let steps = if least == most { least } else { format!("{least} to {most}") };
        let off = if tilt < 0.005 { String::new() } else { format!(" and stacked {tilt:.2} degrees off it") };
        let jump = stack.jump_mm();
        let jump = if jump <= TOLERANCE_MM { String::new() } else { format!(" and shifted by up to {jump:.2} mm") };
        format!(
            "resampled: {n} slices with steps of {steps} mm along their normal{off}{jump}, onto an even rectangular grid of {x} x {y} x {z} voxels with a step of {:.3} mm (linear interpolation)",
            self.step
        )
    }
}

/// The two slices around the current position, shifted onto the target's columns and rows.
struct Planes<'a> {
    stack: &'a Stack,
    target: &'a Target,
    data: &'a [i16],
    lower: usize,
    /// Shifted slices `lower` and `lower + 1`; NaN outside the slice.
    pair: [Vec<f32>; 2],
}

impl<'a> Planes<'a> {
    fn new(stack: &'a Stack, target: &'a Target, data: &'a [i16]) -> Self {
        let mut planes = Self { stack, target, data, lower: 0, pair: [Vec::new(), Vec::new()] };
        planes.pair = [planes.shifted(0), planes.shifted(1)];
        planes
    }

    /// Appends the slice at `along` mm from the first.
    fn blend_into(&mut self, out: &mut Vec<i16>, along: f64) {
        let places = &self.target.offsets.along;
        while self.lower + 2 < places.len() && along > places[self.lower + 1] {
            self.lower += 1;
            self.pair.swap(0, 1);
            self.pair[1] = self.shifted(self.lower + 1);
        }
        let (a, b) = (places[self.lower], places[self.lower + 1]);
        let t = ((along - a) / (b - a)).clamp(0.0, 1.0) as f32;
        out.extend(self.pair[0].iter().zip(&self.pair[1]).map(|(&p, &q)| blend(p, q, t)));
    }

    /// One slice moved by its offset, bilinear.
    fn shifted(&self, slice: usize) -> Vec<f32> {
        let [columns, rows] = self.stack.size;
        let source = &self.data[slice * columns * rows..(slice + 1) * columns * rows];
        let [wide, tall] = self.target.size;
        let across = taps(wide, columns, self.target.offsets.column[slice] - self.target.before[0]);
        let down = taps(tall, rows, self.target.offsets.row[slice] - self.target.before[1]);
        let mut out = Vec::with_capacity(wide * tall);
        for tap in &down {
            let Some((j0, j1, s)) = *tap else {
                out.extend(core::iter::repeat_n(f32::NAN, wide));
                continue;
            };
            let (upper, lower) = (&source[j0 * columns..][..columns], &source[j1 * columns..][..columns]);
            out.extend(across.iter().map(|tap| {
                let Some((i0, i1, t)) = *tap else { return f32::NAN };
                let line = |row: &[i16]| f32::from(row[i0]) * (1.0 - t) + f32::from(row[i1]) * t;
                line(upper) * (1.0 - s) + line(lower) * s
            }));
        }
        out
    }
}

/// For each target index the two source indices and the weight of the second; `None` outside the source.
fn taps(target: usize, source: usize, shift: f64) -> Vec<Option<(usize, usize, f32)>> {
    let last = source as f64 - 1.0;
    let tap = |i: usize| {
        let at = i as f64 - shift;
        let c = at.clamp(0.0, last);
        let base = c as usize;
        (at >= -0.5 && at <= last + 0.5).then(|| (base, (base + 1).min(source - 1), (c - base as f64) as f32))
    };
    (0..target).map(tap).collect()
}

/// Mixes two slices; where only one of them has data, the nearer one decides.
fn blend(p: f32, q: f32, t: f32) -> i16 {
    let value = if p.is_nan() || q.is_nan() { if t < 0.5 { p } else { q } } else { p * (1.0 - t) + q * t };
    if value.is_nan() { AIR } else { value.round() as i16 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Forty slices 2 mm apart along z, each shifted along y as told.
    fn stack(shift: impl Fn(f64) -> f64) -> Stack {
        let at = |k: u32| Point::new(0.0, shift(f64::from(k)), 2.0 * f64::from(k));
        Stack {
            size: [8, 8],
            u: Vector::new(1.0, 0.0, 0.0),
            v: Vector::new(0.0, 1.0, 0.0),
            origins: (0..40).map(at).collect(),
        }
    }

    fn told(stack: &Stack) -> String {
        let target = Target::of(stack);
        target.sentence(stack, &target.grid(stack).expect("a grid"))
    }

    /// A field of view that moves by 25 mm halfway up was told as a gantry tilt of 18 degrees.
    #[test]
    fn a_jump_of_the_field_of_view_is_no_gantry_tilt() {
        let jumps = stack(|k| if k < 20.0 { 0.0 } else { 25.0 });
        assert_eq!(jumps.tilt_deg(), 0.0);
        assert!(told(&jumps).contains("along their normal and shifted by up to 25.00 mm, onto"), "{}", told(&jumps));
    }

    #[test]
    fn a_tilt_is_told_with_a_jump_and_without() {
        let slope = 18f64.to_radians().tan();
        let tilted = stack(|k| 2.0 * k * slope);
        assert!((tilted.tilt_deg() - 18.0).abs() < 1e-9 && tilted.jump_mm() < 1e-9);
        let both = stack(|k| 2.0 * k * slope + if k < 7.0 { 0.0 } else { -3.0 });
        assert!((both.tilt_deg() - 18.0).abs() < 1e-9 && (both.jump_mm() - 3.0).abs() < 1e-9);
        assert!(
            told(&both).contains("and stacked 18.00 degrees off it and shifted by up to 3.00 mm"),
            "{}",
            told(&both)
        );
    }
}
