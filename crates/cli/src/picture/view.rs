//! A plane seen by a viewer: where a point of the patient appears on the picture.

use monro_geometry::{Patient, Plane, Point, Vector};

/// A picture plane through the patient. Column and row directions are unit vectors at a right angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SliceView {
    centre: Point<Patient>,
    right: Vector<Patient>,
    down: Vector<Patient>,
    mm_per_pixel: f64,
    pixels: [usize; 2],
}

/// The three standard orientations, in radiological convention: the patient's right is on the viewer's left, and a
/// sagittal picture looks from the patient's left, face to the viewer's left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Orientation {
    /// Seen from the feet.
    Axial,
    /// Seen from the front.
    Coronal,
    /// Seen from the patient's left.
    Sagittal,
}

impl Orientation {
    /// All three.
    pub const ALL: [Self; 3] = [Self::Axial, Self::Coronal, Self::Sagittal];

    /// `Axial`, `Coronal` or `Sagittal`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Axial => "Axial",
            Self::Coronal => "Coronal",
            Self::Sagittal => "Sagittal",
        }
    }

    const fn axes(self) -> [[f64; 3]; 2] {
        match self {
            Self::Axial => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            Self::Coronal => [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0]],
            Self::Sagittal => [[0.0, 1.0, 0.0], [0.0, 0.0, -1.0]],
        }
    }
}

impl SliceView {
    /// A standard slice through a point, `field_mm` wide and high, drawn on `pixels` x `pixels`.
    pub fn standard(orientation: Orientation, centre: Point<Patient>, field_mm: f64, pixels: usize) -> Self {
        let [right, down] = orientation.axes().map(Vector::from_array);
        let pixels = pixels.max(1);
        Self { centre, right, down, mm_per_pixel: field_mm / pixels as f64, pixels: [pixels, pixels] }
    }

    /// The plane that holds a path and comes nearest to `facing`'s plane: the path in full length, upright.
    /// `None` when the path has no length or is at a right angle to that plane.
    pub fn along_path(
        from: Point<Patient>,
        to: Point<Patient>,
        facing: Orientation,
        field_mm: f64,
        pixels: usize,
    ) -> Option<Self> {
        let [right, down] = facing.axes().map(Vector::from_array);
        let direction = (to - from).normalized()?;
        let flat = direction - right.cross(down) * direction.dot(right.cross(down));
        // A path nearly at a right angle to the slice would turn the plane by almost that angle.
        if flat.norm() < 0.3 {
            return None;
        }
        let normal = direction.cross(right.cross(down).cross(direction)).normalized()?;
        let across = (right - normal * right.dot(normal)).normalized()?;
        let pixels = pixels.max(1);
        Some(Self {
            centre: from.lerp(to, 0.5),
            right: across,
            down: normal.cross(across),
            mm_per_pixel: field_mm / pixels as f64,
            pixels: [pixels, pixels],
        })
    }

    /// The plane that holds a path and is as nearly coronal as it can be, or else sagittal or axial, around these points; `None`
    /// when the path has no length.
    pub fn of_path([from, to]: [Point<Patient>; 2], around: &[Point<Patient>], pixels: usize) -> Option<Self> {
        let facing = [Orientation::Coronal, Orientation::Sagittal, Orientation::Axial];
        facing.into_iter().find_map(|o| Self::along_path(from, to, o, 1.0, pixels)).map(|view| view.fitted(around))
    }

    /// The standard plane that this one is turned the least from.
    pub fn nearest(&self) -> Orientation {
        let [x, y, z] = self.right.cross(self.down).to_array().map(f64::abs);
        if z >= x.max(y) {
            Orientation::Axial
        } else if y >= x {
            Orientation::Coronal
        } else {
            Orientation::Sagittal
        }
    }

    /// The same plane and scale around another point of the picture.
    pub fn centred_at(self, p: Point<Patient>) -> Self {
        Self { centre: p, ..self }
    }

    /// The same plane moved and scaled so that all points appear on the picture, with a margin.
    #[must_use]
    pub fn fitted(self, points: &[Point<Patient>]) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for p in points.iter().map(|p| self.project(*p)) {
            (low, high) = (core::array::from_fn(|a| low[a].min(p[a])), core::array::from_fn(|a| high[a].max(p[a])));
        }
        if low[0] > high[0] {
            return self;
        }
        let share = |a: usize| (high[a] - low[a]) / self.pixels[a] as f64;
        let middle = self.unproject(core::array::from_fn(|a| 0.5 * (low[a] + high[a])));
        let scale = (1.1 * share(0).max(share(1))).max(f64::MIN_POSITIVE);
        Self { centre: middle, mm_per_pixel: self.mm_per_pixel * scale, ..self }
    }

    /// Width and height in pixels.
    pub const fn pixels(&self) -> [usize; 2] {
        self.pixels
    }

    /// Size of a pixel, mm.
    pub const fn mm_per_pixel(&self) -> f64 {
        self.mm_per_pixel
    }

    /// The plane, its normal pointing away from the viewer.
    pub fn plane(&self) -> Plane<Patient> {
        Plane { point: self.centre, normal: self.right.cross(self.down) }
    }

    /// Where a point appears, in pixels from the picture's top left corner (pixel centres are at halves).
    pub fn project(&self, p: Point<Patient>) -> [f64; 2] {
        let d = (p - self.centre) / self.mm_per_pixel;
        [d.dot(self.right) + self.pixels[0] as f64 / 2.0, d.dot(self.down) + self.pixels[1] as f64 / 2.0]
    }

    /// The point of the plane at a picture position.
    pub fn unproject(&self, [x, y]: [f64; 2]) -> Point<Patient> {
        let (x, y) = (x - self.pixels[0] as f64 / 2.0, y - self.pixels[1] as f64 / 2.0);
        self.centre + self.right * (x * self.mm_per_pixel) + self.down * (y * self.mm_per_pixel)
    }

    /// Letters for the left, right, upper and lower edge of the picture.
    pub fn letters(&self) -> [String; 4] {
        [-self.right, self.right, -self.down, self.down].map(letters_of)
    }
}

/// The anatomical direction of a vector: its largest component, and further ones above a half.
pub(crate) fn letters_of(v: Vector<Patient>) -> String {
    let named = [(v.x, ['L', 'R']), (v.y, ['P', 'A']), (v.z, ['S', 'I'])];
    let mut parts: Vec<(f64, char)> =
        named.into_iter().map(|(c, [plus, minus])| (c.abs(), if c > 0.0 { plus } else { minus })).collect();
    parts.sort_by(|a, b| b.0.total_cmp(&a.0));
    parts.iter().enumerate().filter(|(i, p)| *i == 0 || p.0 > 0.5).map(|(_, p)| p.1).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_follow_the_radiological_convention() {
        let letters = |o| SliceView::standard(o, Point::ORIGIN, 200.0, 100).letters().join("");
        assert_eq!(letters(Orientation::Axial), "RLAP");
        assert_eq!(letters(Orientation::Coronal), "RLSI");
        assert_eq!(letters(Orientation::Sagittal), "APSI");
        assert_eq!(letters_of(Vector::new(0.7, -0.6, 0.2)), "LA");
    }

    #[test]
    fn the_plane_of_a_level_path_was_called_coronal() {
        let nearest = |to: [f64; 3], facing| {
            let to = Point::from_array(to);
            SliceView::along_path(Point::ORIGIN, to, facing, 160.0, 400).expect("a plane").nearest()
        };
        assert_eq!(nearest([5.0, 70.0, -30.0], Orientation::Coronal), Orientation::Axial);
        assert_eq!(nearest([10.0, 20.0, -60.0], Orientation::Coronal), Orientation::Coronal);
        assert_eq!(nearest([10.0, 20.0, -60.0], Orientation::Sagittal), Orientation::Sagittal);
    }

    /// The coronal cut of a mesh does not hold the path that it is fine along.
    #[test]
    fn the_plane_of_a_path_holds_it_and_all_that_it_is_drawn_around() {
        let around = [[-70.0, -80.0, -90.0], [70.0, 90.0, 60.0]].map(Point::from_array);
        for to in [[5.0, 70.0, -30.0], [10.0, 20.0, -60.0], [0.0, 9.0, 0.1], [50.0, 0.0, 0.0]] {
            let path = [Point::new(1.0, 2.0, 3.0), Point::from_array(to)];
            let view = SliceView::of_path(path, &around, 400).expect("a plane");
            for p in path {
                assert!(view.unproject(view.project(p)).distance(p) < 1e-9, "{to:?}");
            }
            assert!(around.iter().flat_map(|p| view.project(*p)).all(|v| (0.0..400.0).contains(&v)), "{to:?}");
        }
        assert!(SliceView::of_path([around[0]; 2], &around, 400).is_none());
    }

    #[test]
    fn a_head_was_cut_off_at_the_edge_of_the_picture() {
        let corners = [[-70.0, 0.0, -90.0], [70.0, 9.0, -90.0], [70.0, -9.0, 60.0]].map(Point::from_array);
        let view = SliceView::standard(Orientation::Coronal, Point::new(30.0, 4.0, 5.0), 160.0, 400);
        assert!(corners.iter().any(|p| view.project(*p).iter().any(|v| !(0.0..400.0).contains(v))));
        let fitted = view.fitted(&corners);
        assert!(corners.iter().all(|p| fitted.project(*p).iter().all(|v| (5.0..395.0).contains(v))));
        assert_eq!(fitted.letters(), view.letters());
        assert_eq!(view.fitted(&[]), view);
    }

    #[test]
    fn projecting_and_unprojecting_are_inverse_and_the_left_is_on_the_right() {
        let v = SliceView::standard(Orientation::Coronal, Point::new(3.0, 4.0, 5.0), 200.0, 400);
        assert_eq!(v.project(Point::new(13.0, 4.0, 5.0)), [220.0, 200.0]);
        let p = v.unproject([37.5, 90.25]);
        assert_eq!(v.project(p), [37.5, 90.25]);
        assert!(v.plane().signed_distance(p).abs() < 1e-12);
    }

    #[test]
    fn a_view_along_a_path_holds_both_ends_and_stays_upright() {
        let (a, b) = (Point::new(30.0, -60.0, 60.0), Point::new(4.0, 0.0, 2.0));
        for facing in [Orientation::Coronal, Orientation::Sagittal] {
            let v = SliceView::along_path(a, b, facing, 160.0, 320).unwrap();
            assert!(v.plane().signed_distance(a).abs() < 1e-9 && v.plane().signed_distance(b).abs() < 1e-9);
            assert!(v.right.dot(v.down).abs() < 1e-12 && v.down.z < 0.0);
            let standard = facing.axes().map(Vector::from_array);
            assert!(v.right.dot(standard[0]) > 0.5 && v.down.dot(standard[1]) > 0.2, "{v:?}");
        }
        assert!(SliceView::along_path(a, a, Orientation::Axial, 160.0, 320).is_none());
    }
}
