//! Closed polygons on a slice and the pixels inside them.

use super::LivewireError;

/// A closed polygon in continuous pixel indices `[column, row]`; the last point joins the first.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Contour {
    /// The corners.
    pub points: Vec<[f64; 2]>,
}

impl Contour {
    /// Pairs of ends of the sides, the closing one included.
    pub fn sides(&self) -> impl Iterator<Item = ([f64; 2], [f64; 2])> + '_ {
        let next = self.points.iter().cycle().skip(1);
        self.points.iter().copied().zip(next.copied())
    }

    /// Enclosed area in square pixels, positive when column turns towards row along the contour (clockwise on screen).
    pub fn signed_area(&self) -> f64 {
        self.sides().map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum::<f64>() / 2.0
    }

    /// Distance (pixels) of a position to the nearest point of the contour; infinite without points.
    pub fn distance(&self, p: [f64; 2]) -> f64 {
        self.sides().map(|(a, b)| side_distance(a, b, p)).fold(f64::INFINITY, f64::min)
    }

    /// Whether a position is inside by the even-odd rule; sides belong to the region on their right and below.
    pub fn contains(&self, p: [f64; 2]) -> bool {
        self.sides().filter(|&(a, b)| crosses(a, b, p[1]).is_some_and(|x| x <= p[0])).count() % 2 == 1
    }

    /// Refuses a contour that encloses nothing.
    pub(super) fn check(&self) -> Result<(), LivewireError> {
        let area_px = self.signed_area().abs();
        let finite = self.points.iter().flatten().all(|v| v.is_finite());
        if finite && self.points.len() >= 3 && area_px > 0.0 {
            return Ok(());
        }
        Err(LivewireError::Degenerate { points: self.points.len(), area_px })
    }
}

/// Distance of `p` to the side from `a` to `b`, pixels.
fn side_distance(a: [f64; 2], b: [f64; 2], p: [f64; 2]) -> f64 {
    let d = [b[0] - a[0], b[1] - a[1]];
    let v = [p[0] - a[0], p[1] - a[1]];
    let square = d[0] * d[0] + d[1] * d[1];
    let t = if square > 0.0 { ((d[0] * v[0] + d[1] * v[1]) / square).clamp(0.0, 1.0) } else { 0.0 };
    (v[0] - t * d[0]).hypot(v[1] - t * d[1])
}

/// Where a side crosses the line of a row, if it does; the upper end belongs to the side, the lower does not, so a
/// corner on the line counts once.
fn crosses(a: [f64; 2], b: [f64; 2], row: f64) -> Option<f64> {
    if (a[1] <= row) == (b[1] <= row) {
        return None;
    }
    // From the upper end always, so that a side shared by two polygons gives both the same crossing.
    let (top, low) = if a[1] < b[1] { (a, b) } else { (b, a) };
    Some(top[0] + (row - top[1]) / (low[1] - top[1]) * (low[0] - top[0]))
}

/// A set of pixels of a slice.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mask {
    width: usize,
    height: usize,
    data: Vec<bool>,
}

impl Mask {
    /// No pixel of a `width` x `height` slice.
    pub fn empty(width: usize, height: usize) -> Self {
        Self { width, height, data: vec![false; width * height] }
    }

    /// From one flag per pixel, row by row.
    ///
    /// # Errors
    /// The count is not that of the pixels, or there are none.
    pub fn new(width: usize, height: usize, data: Vec<bool>) -> Result<Self, LivewireError> {
        if data.is_empty() || width.checked_mul(height) != Some(data.len()) {
            return Err(LivewireError::Size { width, height, values: data.len() });
        }
        Ok(Self { width, height, data })
    }

    /// Columns and rows.
    pub const fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// One flag per pixel, row by row.
    pub fn data(&self) -> &[bool] {
        &self.data
    }

    /// Whether a pixel is set; false outside.
    pub fn at(&self, column: usize, row: usize) -> bool {
        column < self.width && row < self.height && self.data[row * self.width + column]
    }

    /// Number of pixels set.
    pub fn count(&self) -> usize {
        self.data.iter().filter(|&&d| d).count()
    }

    /// The pixels set, as (column, row), row by row.
    pub fn pixels(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let set = self.data.iter().enumerate().filter(|&(_, &d)| d);
        set.map(|(n, _)| (n % self.width, n / self.width))
    }

    pub(super) fn check_size(&self, expected: [usize; 2]) -> Result<(), LivewireError> {
        let found = self.size();
        if found == expected { Ok(()) } else { Err(LivewireError::MaskSize { expected, found }) }
    }
}

/// The pixels whose centre is inside the contours by the even-odd rule (a contour inside another is a hole). Parts
/// outside the image are cut off. Contours that share a side never share a pixel, nor leave one out between them.
pub fn fill(contours: &[Contour], width: usize, height: usize) -> Mask {
    let mut mask = Mask::empty(width, height);
    let mut crossings: Vec<Vec<f64>> = vec![Vec::new(); height];
    for (a, b) in contours.iter().flat_map(Contour::sides) {
        let (top, low) = (a[1].min(b[1]), a[1].max(b[1]));
        let first = top.ceil().max(0.0) as usize;
        let end = (low.ceil().max(0.0) as usize).min(height);
        for (row, found) in crossings.iter_mut().enumerate().take(end).skip(first) {
            found.extend(crosses(a, b, row as f64));
        }
    }
    for (row, found) in crossings.iter_mut().enumerate() {
        found.sort_by(f64::total_cmp);
        for pair in found.chunks_exact(2) {
            let column = |x: f64| (x.ceil().max(0.0) as usize).min(width);
            let (from, to) = (column(pair[0]), column(pair[1]));
            mask.data[row * width + from..row * width + to.max(from)].fill(true);
        }
    }
    mask
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn polygon() -> impl Strategy<Value = Contour> {
        let corner =
            prop_oneof![(-3.0..15.0f64, -3.0..15.0f64), (-3i32..15, -3i32..15).prop_map(|(x, y)| (x.into(), y.into()))];
        proptest::collection::vec(corner.prop_map(|(x, y)| [x, y]), 0..12).prop_map(|points| Contour { points })
    }

    proptest! {
        #[test]
        fn filling_is_the_point_in_polygon_test_at_every_centre(a in polygon(), b in polygon()) {
            let both = [a, b];
            let mask = fill(&both, 12, 11);
            for row in 0..11 {
                for column in 0..12 {
                    let p = [column as f64, row as f64];
                    let inside = both[0].contains(p) != both[1].contains(p);
                    prop_assert_eq!(mask.at(column, row), inside, "{:?}", p);
                }
            }
        }
    }

    proptest! {
        #[test]
        fn a_convex_polygon_fills_its_area(
            (cx, cy) in (14.0..26.0f64, 14.0..26.0f64), (a, b) in (2.0..12.0f64, 2.0..12.0f64), sides in 16usize..64,
        ) {
            let points = (0..sides).map(|n| {
                let (sin, cos) = (n as f64 * core::f64::consts::TAU / sides as f64).sin_cos();
                [cx + a * cos, cy + b * sin]
            });
            let contour = Contour { points: points.collect() };
            // Each row's chord is counted to within one pixel: |count - area| is below one per row, plus the error of
            // the midpoint rule over rows, below half a chord at each of the two ends.
            let bound = (2.0 * b + 1.0) + 2.0 * a;
            let count = fill(core::slice::from_ref(&contour), 40, 40).count() as f64;
            prop_assert!((count - contour.signed_area()).abs() < bound);
        }
    }

    #[test]
    fn integer_squares_tile_without_gap_or_overlap() {
        let square = |x: f64, y: f64, s: f64| Contour { points: vec![[x, y], [x + s, y], [x + s, y + s], [x, y + s]] };
        assert_eq!(fill(&[square(0.0, 0.0, 4.0)], 9, 9).count(), 16);
        assert_eq!(fill(&[square(0.0, 0.0, 4.0), square(4.0, 0.0, 4.0)], 9, 9).count(), 32);
        assert_eq!(fill(&[square(-0.5, -0.5, 9.0)], 9, 9).count(), 81);
        assert_eq!(fill(&[square(0.0, 0.0, 8.0), square(2.0, 2.0, 4.0)], 9, 9).count(), 64 - 16);
        assert!((square(1.0, 1.0, 3.0).distance([2.5, 2.0]) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn nothing_encloses_nothing() {
        assert_eq!(fill(&[], 3, 3).count(), 0);
        assert_eq!(fill(&[Contour::default()], 3, 3).count(), 0);
        let line = Contour { points: vec![[0.0, 0.0], [5.0, 5.0], [2.0, 2.0]] };
        assert!(matches!(line.check(), Err(LivewireError::Degenerate { points: 3, .. })));
        assert!(matches!(Mask::new(2, 2, vec![true; 3]), Err(LivewireError::Size { .. })));
    }
}
