//! Points and vectors that carry their frame in their type.

use crate::Frame;
use core::marker::PhantomData;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// A position in frame `F` (mm, or voxel for the voxel frame).
pub struct Point<F> {
    /// First coordinate (patient frame: towards the patient's left).
    pub x: f64,
    /// Second coordinate (patient frame: towards the back).
    pub y: f64,
    /// Third coordinate (patient frame: towards the head).
    pub z: f64,
    frame: PhantomData<F>,
}

/// A displacement or direction in frame `F`.
pub struct Vector<F> {
    /// First component.
    pub x: f64,
    /// Second component.
    pub y: f64,
    /// Third component.
    pub z: f64,
    frame: PhantomData<F>,
}

macro_rules! common {
    ($name:ident, $text:literal) => {
        impl<F> $name<F> {
            /// From its three coordinates.
            pub const fn new(x: f64, y: f64, z: f64) -> Self {
                Self { x, y, z, frame: PhantomData }
            }

            /// From an array of three coordinates.
            pub const fn from_array(a: [f64; 3]) -> Self {
                Self::new(a[0], a[1], a[2])
            }

            /// The three coordinates as an array.
            pub const fn to_array(self) -> [f64; 3] {
                [self.x, self.y, self.z]
            }

            /// Whether all coordinates are finite.
            pub const fn is_finite(self) -> bool {
                self.x.is_finite() && self.y.is_finite() && self.z.is_finite()
            }
        }

        // Written out rather than derived: a derive would demand the traits of the frame as well.
        impl<F> Clone for $name<F> {
            fn clone(&self) -> Self {
                *self
            }
        }
        impl<F> Copy for $name<F> {}
        impl<F> PartialEq for $name<F> {
            fn eq(&self, other: &Self) -> bool {
                self.x == other.x && self.y == other.y && self.z == other.z
            }
        }
        impl<F: Frame> core::fmt::Debug for $name<F> {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                write!(f, "{}<{}>({}, {}, {})", $text, F::NAME, self.x, self.y, self.z)
            }
        }
    };
}

common!(Point, "Point");
common!(Vector, "Vector");

impl<F> Point<F> {
    /// The frame's origin.
    pub const ORIGIN: Self = Self::new(0.0, 0.0, 0.0);

    /// Distance to another point of the same frame.
    pub fn distance(self, other: Self) -> f64 {
        (self - other).norm()
    }

    /// The point a fraction `t` of the way to `other` (0 here, 1 there).
    pub fn lerp(self, other: Self, t: f64) -> Self {
        self + (other - self) * t
    }

    /// The point of the segment between two others that is nearest to this one.
    pub fn nearest_on_segment(self, from: Self, to: Self) -> Self {
        let along = to - from;
        let length = along.dot(along);
        from.lerp(to, if length > 0.0 { ((self - from).dot(along) / length).clamp(0.0, 1.0) } else { 0.0 })
    }
}

impl<F> Vector<F> {
    /// The zero vector.
    pub const ZERO: Self = Self::new(0.0, 0.0, 0.0);

    /// Scalar product.
    pub fn dot(self, o: Self) -> f64 {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    /// Vector product (right-handed).
    pub fn cross(self, o: Self) -> Self {
        Self::new(self.y * o.z - self.z * o.y, self.z * o.x - self.x * o.z, self.x * o.y - self.y * o.x)
    }

    /// Euclidean length.
    pub fn norm(self) -> f64 {
        self.norm_squared().sqrt()
    }

    /// Squared Euclidean length.
    pub fn norm_squared(self) -> f64 {
        self.dot(self)
    }

    /// The unit vector of the same direction; `None` for a zero or non-finite vector.
    pub fn normalized(self) -> Option<Self> {
        let n = self.norm();
        (n.is_finite() && n > 0.0).then(|| self / n)
    }

    /// Angle to another vector in radians, in `0..=pi`; exact also for nearly parallel vectors.
    pub fn angle(self, o: Self) -> f64 {
        self.cross(o).norm().atan2(self.dot(o))
    }

    /// Some unit vector perpendicular to this one; `None` for a zero or non-finite vector.
    pub fn any_perpendicular(self) -> Option<Self> {
        let (ax, ay, az) = (self.x.abs(), self.y.abs(), self.z.abs());
        let axis = if ax <= ay && ax <= az {
            Self::new(1.0, 0.0, 0.0)
        } else if ay <= az {
            Self::new(0.0, 1.0, 0.0)
        } else {
            Self::new(0.0, 0.0, 1.0)
        };
        self.cross(axis).normalized()
    }
}

impl<F> Sub for Point<F> {
    type Output = Vector<F>;
    fn sub(self, o: Self) -> Vector<F> {
        Vector::new(self.x - o.x, self.y - o.y, self.z - o.z)
    }
}

impl<F> Add<Vector<F>> for Point<F> {
    type Output = Self;
    fn add(self, v: Vector<F>) -> Self {
        Self::new(self.x + v.x, self.y + v.y, self.z + v.z)
    }
}

impl<F> Sub<Vector<F>> for Point<F> {
    type Output = Self;
    fn sub(self, v: Vector<F>) -> Self {
        Self::new(self.x - v.x, self.y - v.y, self.z - v.z)
    }
}

impl<F> AddAssign<Vector<F>> for Point<F> {
    fn add_assign(&mut self, v: Vector<F>) {
        *self = *self + v;
    }
}

impl<F> Add for Vector<F> {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self::new(self.x + o.x, self.y + o.y, self.z + o.z)
    }
}

impl<F> Sub for Vector<F> {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        Self::new(self.x - o.x, self.y - o.y, self.z - o.z)
    }
}

impl<F> AddAssign for Vector<F> {
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl<F> SubAssign for Vector<F> {
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}

impl<F> Neg for Vector<F> {
    type Output = Self;
    fn neg(self) -> Self {
        Self::new(-self.x, -self.y, -self.z)
    }
}

impl<F> Mul<f64> for Vector<F> {
    type Output = Self;
    fn mul(self, s: f64) -> Self {
        Self::new(self.x * s, self.y * s, self.z * s)
    }
}

impl<F> Div<f64> for Vector<F> {
    type Output = Self;
    fn div(self, s: f64) -> Self {
        Self::new(self.x / s, self.y / s, self.z / s)
    }
}

/// The lowest and highest coordinates of some points; `None` where there is none.
pub fn bounds(points: impl IntoIterator<Item = [f64; 3]>) -> Option<[[f64; 3]; 2]> {
    let mut all = points.into_iter();
    let first = all.next()?;
    Some(all.fold([first; 2], |[low, high], p| {
        [core::array::from_fn(|a| low[a].min(p[a])), core::array::from_fn(|a| high[a].max(p[a]))]
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Patient;
    use proptest::prelude::*;

    type V = Vector<Patient>;

    proptest! {
        #[test]
        fn cross_is_perpendicular_to_both(a in proptest::array::uniform3(-1e3..1e3f64), b in proptest::array::uniform3(-1e3..1e3f64)) {
            let (a, b) = (V::from_array(a), V::from_array(b));
            let c = a.cross(b);
            let scale = a.norm() * b.norm() * (a.norm() + b.norm()) + 1e-9;
            prop_assert!(c.dot(a).abs() <= 1e-12 * scale && c.dot(b).abs() <= 1e-12 * scale);
        }

        #[test]
        fn any_perpendicular_is_a_unit_and_perpendicular(a in proptest::array::uniform3(-1e3..1e3f64)) {
            let a = V::from_array(a);
            prop_assume!(a.norm() > 1e-6);
            let p = a.any_perpendicular().expect("a is not zero");
            prop_assert!((p.norm() - 1.0).abs() < 1e-12 && p.dot(a).abs() < 1e-9 * a.norm());
        }
    }

    #[test]
    fn zero_has_no_direction() {
        assert!(V::ZERO.normalized().is_none());
        assert!(V::ZERO.any_perpendicular().is_none());
        assert!(V::new(f64::NAN, 0.0, 0.0).normalized().is_none());
    }

    #[test]
    fn angle_is_exact_for_nearly_parallel_vectors() {
        // acos of the dot product would give 0 here: cos(1e-9) rounds to 1.
        let angle = V::new(1.0, 0.0, 0.0).angle(V::new(1.0, 1e-9, 0.0));
        assert!((angle - 1e-9).abs() < 1e-20, "{angle}");
    }
}
