//! Masks on some slices to masks on every slice between them.

use super::{LivewireError, Mask, check_option};
use crate::surface::distance::squared_distance;
use std::collections::BTreeMap;

/// Masks on the slices of one structure in one direction, and shape-based interpolation between them (Raya and
/// Udupa, "Shape-based interpolation of multidimensional objects", IEEE Trans. Med. Imaging 9, 1990).
///
/// Each drawn slice becomes a signed distance field (mm, negative inside); between two of them the fields are
/// blended linearly and the zero level is the border, so parts may join, split and vanish.
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

    /// Sets the mask of a slice; an empty mask ends the structure there.
    ///
    /// # Errors
    /// The mask has another size.
    pub fn set_mask(&mut self, slice: usize, mask: Mask) -> Result<(), LivewireError> {
        mask.check_size(self.size)?;
        let field = signed_distance(&mask, self.spacing);
        self.keys.insert(slice, Key { mask, field });
        Ok(())
    }

    /// The mask of any slice: its own, an interpolated one, or empty outside the drawn range.
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

#[cfg(test)]
mod tests {
    use super::super::{Contour, fill};
    use super::*;

    /// Discs, with those inside others as holes.
    fn discs(circles: &[[f64; 3]]) -> Mask {
        let contours: Vec<_> = circles.iter().map(|&[x, y, r]| circle(x, y, r)).collect();
        fill(&contours, 80, 64)
    }

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
        s.set_mask(10, discs(&[[40.2, 31.7, 24.0]])).expect("low");
        s.set_mask(20, discs(&[[40.2, 31.7, 12.0]])).expect("high");
        for slice in 11..20 {
            let radius = 24.0 - 1.2 * (slice - 10) as f64;
            let exact = discs(&[[40.2, 31.7, radius]]);
            let found = s.mask(slice);
            let wrong = found.data().iter().zip(exact.data()).filter(|(a, b)| a != b).count();
            // Distances come from the masks and are good to half a pixel.
            assert!(wrong as f64 <= 0.5 * core::f64::consts::TAU * radius, "slice {slice}: {wrong}");
            let area = found.count() as f64 / exact.count() as f64;
            assert!((area - 1.0).abs() < 0.04, "slice {slice}: {area}");
        }
        assert_eq!((s.mask(9).count(), s.mask(21).count()), (0, 0));
    }

    fn parts(mask: &Mask) -> usize {
        let grid =
            monro_geometry::Grid::axis_aligned([mask.size()[0], mask.size()[1], 1], [1.0; 3], [0.0; 3]).expect("grid");
        crate::edit::islands(&crate::edit::Selection::where_(grid, |n| mask.data()[n])).len()
    }

    #[test]
    fn one_part_splits_into_two_and_a_hole_closes() {
        let mut s = stack();
        s.set_mask(0, discs(&[[40.0, 32.0, 26.0]])).expect("one");
        s.set_mask(10, discs(&[[24.0, 32.0, 11.0], [56.0, 32.0, 11.0]])).expect("two");
        assert_eq!((0..=10).map(|k| parts(&s.mask(k))).collect::<std::collections::BTreeSet<_>>(), [1, 2].into());
        let counts: Vec<usize> = (0..=10).map(|k| s.mask(k).count()).collect();
        assert!(counts.windows(2).all(|w| w[0] >= w[1]), "{counts:?}");
        s.set_mask(0, discs(&[[40.0, 32.0, 20.0], [40.0, 32.0, 6.0]])).expect("ring");
        s.set_mask(10, discs(&[[40.0, 32.0, 20.0]])).expect("disc");
        assert!(!s.mask(1).at(40, 32) && s.mask(9).at(40, 32));
    }

    #[test]
    fn misfits_are_refused() {
        let mut s = stack();
        assert!(matches!(s.set_mask(0, Mask::empty(3, 3)), Err(LivewireError::MaskSize { .. })));
        assert!(ContourStack::new([0, 4], [1.0; 2]).is_err() && ContourStack::new([4, 4], [1.0, f64::NAN]).is_err());
    }
}
