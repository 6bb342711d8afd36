//! Where a viewer stands, and how space falls on the picture.

use super::view::letters_of;
use monro_geometry::{Patient, Point, Vector};

/// A camera that looks at a point. Parallel projection: lengths across the line of sight keep their scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    target: Point<Patient>,
    right: Vector<Patient>,
    down: Vector<Patient>,
    away: Vector<Patient>,
    field_mm: f64,
}

impl Camera {
    /// A camera looking along `away` at `target`, head up; `field_mm` is the picture's width at the target.
    /// A direction straight up or down puts the face up; `None` for a zero or non-finite direction.
    pub fn new(target: Point<Patient>, away: Vector<Patient>, field_mm: f64) -> Option<Self> {
        let away = away.normalized()?;
        let up = if away.z.abs() > 0.99 { Vector::new(0.0, -1.0, 0.0) } else { Vector::new(0.0, 0.0, 1.0) };
        let right = away.cross(up).normalized()?;
        Some(Self { target, right, down: away.cross(right), away, field_mm })
    }

    /// Pixel position and distance behind the target (mm) of a point, on a picture `pixels` wide and high.
    pub(crate) fn project(&self, p: Point<Patient>, pixels: usize) -> [f64; 3] {
        let d = p - self.target;
        let scale = pixels as f64 / self.field_mm;
        let half = pixels as f64 / 2.0;
        [half + d.dot(self.right) * scale, half + d.dot(self.down) * scale, d.dot(self.away)]
    }

    /// Letters for the left, right, upper and lower edge of the picture.
    pub(crate) fn letters(&self) -> [String; 4] {
        [-self.right, self.right, -self.down, self.down].map(letters_of)
    }

    /// A direction in the viewer's axes: right, down, away.
    pub(crate) fn turned(&self, v: Vector<Patient>) -> [f64; 3] {
        [v.dot(self.right), v.dot(self.down), v.dot(self.away)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn from_the_front_the_patients_left_is_on_the_right_and_the_head_is_up() {
        let c = Camera::new(Point::ORIGIN, Vector::new(0.0, 1.0, 0.0), 100.0).unwrap();
        let [x, y, depth] = c.project(Point::new(10.0, 5.0, 20.0), 200);
        assert_eq!([x, y, depth], [120.0, 60.0, 5.0]);
        assert!(Camera::new(Point::ORIGIN, Vector::ZERO, 100.0).is_none());
        assert_eq!(c.letters().join(""), "RLSI");
        // From above the patient's right is on the right, unlike in an axial slice, which is seen from the feet.
        let above = Camera::new(Point::ORIGIN, Vector::new(0.0, 0.0, -1.0), 100.0).unwrap();
        assert_eq!(above.letters().join(""), "LRAP");
    }
}
