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

#[cfg(test)]
mod tests {
    use super::*;

    fn circle(x: f64, y: f64, r: f64) -> Contour {
        let at = |n: i32| {
            let (sin, cos) = (f64::from(n) * core::f64::consts::TAU / 720.0).sin_cos();
            [x + r * cos, y + r * sin]
        };
        Contour { points: (0..720).map(at).collect() }
    }

    fn stack() -> ContourStack {
        ContourStack::new([80, 64], [0.5, 0.5]).expect("stack")
    }

    /// Two discs of one centre: distance to a circle is linear along rays, so the disc between is exact.
    #[test]
    fn a_cone_is_interpolated_exactly() {
        let mut s = stack();
        s.set(10, &[circle(40.2, 31.7, 24.0)]).expect("low");
        s.set(20, &[circle(40.2, 31.7, 12.0)]).expect("high");
        for slice in 11..20 {
            let radius = 24.0 - 1.2 * (slice - 10) as f64;
            let exact = fill(&[circle(40.2, 31.7, radius)], 80, 64);
            let found = s.mask(slice);
            let wrong = found.data().iter().zip(exact.data()).filter(|(a, b)| a != b).count();
            // Away from both contours distances come from the masks and are good to half a pixel.
            assert!(wrong as f64 <= 0.5 * core::f64::consts::TAU * radius, "slice {slice}: {wrong}");
            let area = found.count() as f64 / exact.count() as f64;
            assert!((area - 1.0).abs() < 0.04, "slice {slice}: {area}");
        }
        assert_eq!((s.mask(9).count(), s.mask(21).count()), (0, 0));
        assert_eq!(s.slices().collect::<Vec<_>>(), [10, 20]);
    }

    fn parts(mask: &Mask) -> usize {
        let grid =
            monro_geometry::Grid::axis_aligned([mask.size()[0], mask.size()[1], 1], [1.0; 3], [0.0; 3]).expect("grid");
        crate::edit::islands(&crate::edit::Selection::where_(grid, |n| mask.data()[n])).len()
    }

    #[test]
    fn one_part_splits_into_two_and_a_hole_closes() {
        let mut s = stack();
        s.set(0, &[circle(40.0, 32.0, 26.0)]).expect("one");
        s.set(10, &[circle(24.0, 32.0, 11.0), circle(56.0, 32.0, 11.0)]).expect("two");
        assert_eq!((0..=10).map(|k| parts(&s.mask(k))).collect::<std::collections::BTreeSet<_>>(), [1, 2].into());
        let counts: Vec<usize> = (0..=10).map(|k| s.mask(k).count()).collect();
        assert!(counts.windows(2).all(|w| w[0] >= w[1]), "{counts:?}");
        s.set(0, &[circle(40.0, 32.0, 20.0), circle(40.0, 32.0, 6.0)]).expect("ring");
        s.set(10, &[circle(40.0, 32.0, 20.0)]).expect("disc");
        assert!(!s.mask(1).at(40, 32) && s.mask(9).at(40, 32));
    }

    #[test]
    fn a_correction_changes_the_slices_up_to_its_neighbours_only() {
        let mut s = stack();
        for (slice, radius) in [(0, 10.0), (10, 14.0), (20, 10.0), (30, 6.0)] {
            s.set(slice, &[circle(40.0, 32.0, radius)]).expect("key");
        }
        let before: Vec<Mask> = (0..=30).map(|k| s.mask(k)).collect();
        let touched = s.set(14, &[circle(44.0, 30.0, 16.0)]).expect("correction");
        assert_eq!(touched, 11..=19);
        for (k, was) in before.iter().enumerate() {
            assert_eq!(s.mask(k) != *was, touched.contains(&k), "{k}");
        }
        assert_eq!(s.remove(14), Some(11..=19));
        assert!((0..=30).all(|k| s.mask(k) == before[k]));
        assert_eq!((s.remove(14), s.remove(0)), (None, Some(0..=9)));
        let brushed = before[3].clone();
        assert_eq!(s.set_mask(25, brushed.clone()).expect("mask"), 21..=29);
        assert_eq!(s.mask(25), brushed);
    }

    #[test]
    fn misfits_are_refused() {
        let mut s = stack();
        assert!(matches!(s.set(0, &[circle(-50.0, -50.0, 3.0)]), Err(LivewireError::Degenerate { .. })));
        assert!(matches!(s.set(0, &[Contour::default()]), Err(LivewireError::Degenerate { points: 0, .. })));
        assert!(matches!(s.set_mask(0, Mask::empty(3, 3)), Err(LivewireError::MaskSize { .. })));
        assert!(ContourStack::new([0, 4], [1.0; 2]).is_err() && ContourStack::new([4, 4], [1.0, f64::NAN]).is_err());
        let (a, b) = (fill(&[circle(9.0, 9.0, 5.0)], 20, 20), Mask::empty(20, 20));
        assert_eq!(interpolate(&a, &b, [1.0; 2], 0.0).expect("low"), a);
        assert!(interpolate(&a, &b, [1.0; 2], 0.5).expect("between").count() < a.count());
        assert!(interpolate(&a, &b, [1.0; 2], 1.5).is_err());
    }
}
