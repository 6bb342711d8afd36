//! Rigid transforms between two frames: a unit quaternion and a translation.

use crate::{Frame, Matrix3, Point, Vector};
use core::marker::PhantomData;

/// The rigid map `x -> R x + t` from frame `From` to frame `To` (mm). Read a variable `to_from_from`, as `patient_from_tracker`.
pub struct Rigid<To, From> {
    quaternion_wxyz: [f64; 4],
    translation: Vector<To>,
    frames: PhantomData<From>,
}

impl<To, From> Clone for Rigid<To, From> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<To, From> Copy for Rigid<To, From> {}
impl<To, From> PartialEq for Rigid<To, From> {
    fn eq(&self, o: &Self) -> bool {
        self.quaternion_wxyz == o.quaternion_wxyz && self.translation == o.translation
    }
}

impl<To: Frame, From: Frame> core::fmt::Debug for Rigid<To, From> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}_from_{}(q={:?}, t={:?})", To::NAME, From::NAME, self.quaternion_wxyz, self.translation.to_array())
    }
}

impl<To, From> Rigid<To, From> {
    /// The map that leaves coordinates as they are.
    pub const IDENTITY: Self =
        Self { quaternion_wxyz: [1.0, 0.0, 0.0, 0.0], translation: Vector::ZERO, frames: PhantomData };

    /// From a quaternion (w, x, y, z), normalised here, and a translation in mm. `None` when the quaternion's length is
    /// below `1e-9` or anything is not finite.
    pub fn from_quaternion(quaternion_wxyz: [f64; 4], translation: Vector<To>) -> Option<Self> {
        let n = quaternion_wxyz.iter().map(|v| v * v).sum::<f64>().sqrt();
        if !(n.is_finite() && n > 1e-9 && translation.is_finite()) {
            return None;
        }
        Some(Self { quaternion_wxyz: quaternion_wxyz.map(|v| v / n), translation, frames: PhantomData })
    }

    /// From a rotation about `axis` (any length) by `angle` radians, right-handed, and a translation in mm.
    pub fn from_axis_angle(axis: Vector<To>, angle: f64, translation: Vector<To>) -> Option<Self> {
        let a = axis.normalized()?;
        let (s, c) = (angle / 2.0).sin_cos();
        Self::from_quaternion([c, a.x * s, a.y * s, a.z * s], translation)
    }

    /// From a rotation matrix and a translation in mm; `None` unless the matrix is orthonormal and proper within `1e-4`
    /// (as recorded matrices are, rounded to single precision).
    pub fn from_matrix(rotation: &Matrix3, translation: Vector<To>) -> Option<Self> {
        let gram = rotation.times(&rotation.transposed());
        let orthonormal = (0..3).all(|r| (0..3).all(|c| (gram.rows[r][c] - f64::from(u8::from(r == c))).abs() < 1e-4));
        if !orthonormal || rotation.determinant() < 0.0 {
            return None;
        }
        Self::from_quaternion(quaternion_of(&rotation.rows), translation)
    }

    /// The unit quaternion (w, x, y, z).
    pub const fn quaternion_wxyz(&self) -> [f64; 4] {
        self.quaternion_wxyz
    }

    /// The translation in mm: where the origin of `From` lies in `To`.
    pub const fn translation(&self) -> Vector<To> {
        self.translation
    }

    /// The rotation matrix.
    pub fn rotation(&self) -> Matrix3 {
        let [w, x, y, z] = self.quaternion_wxyz;
        Matrix3 {
            rows: [
                [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
                [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
                [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
            ],
        }
    }

    /// Rotation angle in radians, in `0..=pi`.
    pub fn angle(&self) -> f64 {
        let [w, x, y, z] = self.quaternion_wxyz;
        2.0 * (x * x + y * y + z * z).sqrt().atan2(w.abs())
    }

    /// Maps a direction.
    pub fn vector(&self, v: Vector<From>) -> Vector<To> {
        Vector::from_array(self.rotation().apply(v.to_array()))
    }

    /// Maps a point.
    pub fn point(&self, p: Point<From>) -> Point<To> {
        Point::from_array(self.rotation().apply(p.to_array())) + self.translation
    }

    /// The inverse map.
    pub fn inverse(&self) -> Rigid<From, To> {
        let [w, x, y, z] = self.quaternion_wxyz;
        let turned =
            Rigid::<From, To> { quaternion_wxyz: [w, -x, -y, -z], translation: Vector::ZERO, frames: PhantomData };
        Rigid { translation: -turned.vector(self.translation), ..turned }
    }

    /// The map that does `first`, then this one.
    pub fn after<Start>(&self, first: &Rigid<From, Start>) -> Rigid<To, Start> {
        let [a, b, c, d] = self.quaternion_wxyz;
        let [e, f, g, h] = first.quaternion_wxyz;
        let q = [
            a * e - b * f - c * g - d * h,
            a * f + b * e + c * h - d * g,
            a * g - b * h + c * e + d * f,
            a * h + b * g - c * f + d * e,
        ];
        let n = q.iter().map(|v| v * v).sum::<f64>().sqrt();
        let translation = self.point(Point::from_array(first.translation.to_array())) - Point::ORIGIN;
        Rigid { quaternion_wxyz: q.map(|v| v / n), translation, frames: PhantomData }
    }
}

/// Quaternion of an orthonormal matrix by the largest of the four components (Shepperd 1978), stable at every angle.
fn quaternion_of(m: &[[f64; 3]; 3]) -> [f64; 4] {
    let trace = m[0][0] + m[1][1] + m[2][2];
    let squared = [trace, m[0][0], m[1][1], m[2][2]];
    let largest = (0..4).fold(0, |best, i| if squared[i] > squared[best] { i } else { best });
    if largest == 0 {
        return [1.0 + trace, m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]];
    }
    let i = largest - 1;
    let (j, k) = ((i + 1) % 3, (i + 2) % 3);
    let mut q = [0.0; 4];
    q[0] = m[k][j] - m[j][k];
    q[1 + i] = 1.0 + 2.0 * m[i][i] - trace;
    q[1 + j] = m[i][j] + m[j][i];
    q[1 + k] = m[i][k] + m[k][i];
    q
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Patient, Tool, Tracker};
    use proptest::prelude::*;

    type Pose = Rigid<Patient, Tracker>;

    fn pose(q: [f64; 4], t: [f64; 3]) -> Option<Pose> {
        Pose::from_quaternion(q, Vector::from_array(t))
    }

    proptest! {
        #[test]
        fn inverse_undoes(q in proptest::array::uniform4(-1.0..1.0f64), t in proptest::array::uniform3(-500.0..500.0f64), p in proptest::array::uniform3(-500.0..500.0f64)) {
            prop_assume!(q.iter().map(|v| v * v).sum::<f64>() > 1e-3);
            let m = pose(q, t).expect("regular");
            let p = Point::<Tracker>::from_array(p);
            prop_assert!(m.inverse().point(m.point(p)).distance(p) < 1e-9);
        }

        #[test]
        fn composition_is_application_in_turn(q in proptest::array::uniform4(-1.0..1.0f64), r in proptest::array::uniform4(-1.0..1.0f64), p in proptest::array::uniform3(-500.0..500.0f64)) {
            prop_assume!(q.iter().map(|v| v * v).sum::<f64>() > 1e-3 && r.iter().map(|v| v * v).sum::<f64>() > 1e-3);
            let a = pose(q, [1.0, 2.0, 3.0]).expect("regular");
            let b = Rigid::<Tracker, Tool>::from_quaternion(r, Vector::new(-4.0, 5.0, 6.0)).expect("regular");
            let p = Point::<Tool>::from_array(p);
            prop_assert!(a.after(&b).point(p).distance(a.point(b.point(p))) < 1e-9);
        }

        #[test]
        fn matrix_round_trip(q in proptest::array::uniform4(-1.0..1.0f64)) {
            prop_assume!(q.iter().map(|v| v * v).sum::<f64>() > 1e-3);
            let m = pose(q, [0.0; 3]).expect("regular");
            let back = Pose::from_matrix(&m.rotation(), Vector::ZERO).expect("rotation");
            prop_assert!(back.after(&Rigid::<Tracker, Patient>::from_matrix(&m.rotation().transposed(), Vector::ZERO).expect("rotation")).angle() < 1e-7);
        }
    }

    #[test]
    fn a_mirror_and_a_shear_are_refused() {
        let mirror = Matrix3 { rows: [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] };
        assert!(Pose::from_matrix(&mirror, Vector::ZERO).is_none());
        let shear = Matrix3 { rows: [[1.0, 0.3, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] };
        assert!(Pose::from_matrix(&shear, Vector::ZERO).is_none());
        assert!(pose([0.0; 4], [0.0; 3]).is_none());
        assert!(pose([1.0, 0.0, f64::NAN, 0.0], [0.0; 3]).is_none());
    }

    #[test]
    fn a_quarter_turn_about_z_turns_x_into_y() {
        let m = Pose::from_axis_angle(Vector::new(0.0, 0.0, 5.0), core::f64::consts::FRAC_PI_2, Vector::ZERO)
            .expect("axis");
        assert!(m.point(Point::new(1.0, 0.0, 0.0)).distance(Point::new(0.0, 1.0, 0.0)) < 1e-12);
        assert!((m.angle() - core::f64::consts::FRAC_PI_2).abs() < 1e-12);
    }
}
