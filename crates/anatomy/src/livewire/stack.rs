//! Contours on some slices to masks on every slice between them.

use super::contour::side_distance;
use super::{Contour, LivewireError, Mask, check_option, fill};
use crate::surface::distance::squared_distance;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// Contours on the slices of one structure in one direction, and shape-based interpolation between them (Raya and
/// Udupa, "Shape-based interpolation of multidimensional objects", IEEE Trans. Med. Imaging 9, 1990).
///
/// Each contoured slice becomes a signed distance field (mm, negative inside); between two of them the fields are
/// blended linearly and the zero level is the contour, so parts may join, split and vanish.
#[derive(Debug, Clone)]
pub struct ContourStack {
    size: [usize; 2],
    spacing: [f64; 2],
    keys: BTreeMap<usize, Key>,
}

#[derive(Debug, Clone)]
struct Key {
    mask: Mask,
    field: Vec<f32>,
}

impl ContourStack {
    /// An empty stack for slices of `size` pixels (columns, rows) and their spacing in mm.
    ///
    /// # Errors
    /// No pixels, or a spacing that is not positive.
    pub fn new(size: [usize; 2], spacing: [f64; 2]) -> Result<Self, LivewireError> {
        if size.contains(&0) {
            return Err(LivewireError::Size { width: size[0], height: size[1], values: 0 });
        }
        for s in spacing {
            check_option("pixel spacing", s, s.is_finite() && s > 0.0, "a positive number of mm")?;
        }
        Ok(Self { size, spacing, keys: BTreeMap::new() })
    }

    /// Sets the contours of a slice (even-odd: one inside another is a hole) and returns the slices whose mask this
    /// changes: up to the neighbouring contoured slices.
    ///
    /// # Errors
    /// A contour that encloses nothing, or no pixel centre at all.
    pub fn set(&mut self, slice: usize, contours: &[Contour]) -> Result<RangeInclusive<usize>, LivewireError> {
        contours.iter().try_for_each(Contour::check)?;
        let mask = fill(contours, self.size[0], self.size[1]);
        if mask.count() == 0 {
            let area_px = contours.iter().map(|c| c.signed_area().abs()).sum();
            return Err(LivewireError::Degenerate { points: contours.iter().map(|c| c.points.len()).sum(), area_px });
        }
        let mut field = signed_distance(&mask, self.spacing);
        sharpen(&mut field, &mask, contours, self.spacing);
        self.keys.insert(slice, Key { mask, field });
        Ok(self.touched(slice))
    }

    /// Sets the mask of a slice, as after a correction by brush; an empty mask ends the structure there. Returns the
    /// slices whose mask this changes.
    ///
    /// # Errors
    /// The mask has another size.
    pub fn set_mask(&mut self, slice: usize, mask: Mask) -> Result<RangeInclusive<usize>, LivewireError> {
        mask.check_size(self.size)?;
        let field = signed_distance(&mask, self.spacing);
        self.keys.insert(slice, Key { mask, field });
        Ok(self.touched(slice))
    }

    /// Forgets the contours of a slice; the slices whose mask this changes, `None` if there were no contours.
    pub fn remove(&mut self, slice: usize) -> Option<RangeInclusive<usize>> {
        self.keys.remove(&slice).map(|_| self.touched(slice))
    }

    /// The contoured slices.
    pub fn slices(&self) -> impl Iterator<Item = usize> + '_ {
        self.keys.keys().copied()
    }

    /// The mask of any slice: its own, an interpolated one, or empty outside the contoured range.
    pub fn mask(&self, slice: usize) -> Mask {
        if let Some(key) = self.keys.get(&slice) {
            return key.mask.clone();
        }
        let before = self.keys.range(..slice).next_back();
        let after = self.keys.range(slice..).next();
        let (Some((&a, low)), Some((&b, high))) = (before, after) else {
            return Mask::empty(self.size[0], self.size[1]);
        };
        let t = (slice - a) as f32 / (b - a) as f32;
        let inside = low.field.iter().zip(&high.field).map(|(&l, &h)| l + t * (h - l) < 0.0).collect();
        Mask::new(self.size[0], self.size[1], inside).unwrap_or_else(|_| Mask::empty(self.size[0], self.size[1]))
    }

    /// From the contoured slice below to the one above.
    fn touched(&self, slice: usize) -> RangeInclusive<usize> {
        let first = self.keys.range(..slice).next_back().map_or(slice, |(&k, _)| k + 1);
        let last = self.keys.range(slice + 1..).next().map_or(slice, |(&k, _)| k - 1);
        first..=last
    }
}

/// The mask at fraction `t` (0 to 1) between two masks of one size.
///
/// # Errors
/// The masks differ in size; `t` is not in 0..=1.
pub fn interpolate(low: &Mask, high: &Mask, spacing: [f64; 2], t: f64) -> Result<Mask, LivewireError> {
    high.check_size(low.size())?;
    check_option("fraction between the slices", t, (0.0..=1.0).contains(&t), "between 0 and 1")?;
    let (a, b) = (signed_distance(low, spacing), signed_distance(high, spacing));
    let inside = a.iter().zip(&b).map(|(&a, &b)| a + t as f32 * (b - a) < 0.0).collect();
    Mask::new(low.size()[0], low.size()[1], inside)
}

/// Signed distance (mm, negative inside) of each pixel centre to the border of the mask, which runs half a pixel from
/// the outermost centres. An empty or full mask is as far as the slice is large.
fn signed_distance(mask: &Mask, spacing: [f64; 2]) -> Vec<f32> {
    let [w, h] = mask.size();
    let (dims, mm) = ([w, h, 1], [spacing[0], spacing[1], 1.0]);
    let far = (w as f64 * spacing[0]).hypot(h as f64 * spacing[1]) as f32;
    let half = (0.25 * (spacing[0] + spacing[1])) as f32;
    let outside: Vec<bool> = mask.data().iter().map(|&d| !d).collect();
    let to_inside = squared_distance(mask.data(), dims, mm);
    let to_outside = squared_distance(&outside, dims, mm);
    let signed = |(n, &inside): (usize, &bool)| {
        let square = if inside { to_outside[n] } else { to_inside[n] };
        let distance = square.sqrt().min(far) - half;
        if inside { -distance } else { distance }
    };
    mask.data().iter().enumerate().map(signed).collect()
}

/// Replaces distances near the contours by exact ones to the polygons.
fn sharpen(field: &mut [f32], mask: &Mask, contours: &[Contour], spacing: [f64; 2]) {
    const BAND: f64 = 2.0;
    let [w, h] = mask.size();
    let reach = BAND * spacing[0].max(spacing[1]);
    let mut exact: BTreeMap<usize, f64> = BTreeMap::new();
    for (a, b) in contours.iter().flat_map(Contour::sides) {
        let range = |axis: usize, n: usize| {
            let (low, high) = (a[axis].min(b[axis]), a[axis].max(b[axis]));
            let margin = reach / spacing[axis];
            let first = (low - margin).ceil().max(0.0) as usize;
            first..((high + margin).floor() + 1.0).clamp(0.0, n as f64) as usize
        };
        for row in range(1, h) {
            for column in range(0, w) {
                let d = side_distance(a, b, [column as f64, row as f64], spacing);
                if d <= reach {
                    let known = exact.entry(row * w + column).or_insert(d);
                    *known = known.min(d);
                }
            }
        }
    }
    for (n, d) in exact {
        // A centre on the polygon itself belongs to whichever side the filling gave it.
        let d = d.max(1e-6) as f32;
        field[n] = if mask.data()[n] { -d } else { d };
    }
}
