//! Between our types and those of the linear algebra library, which stays inside this crate.

use monro_geometry::{Matrix3, Point, Rigid, Vector};
use nalgebra::{Matrix3 as M3, Vector3 as V3};

pub(crate) fn vec3(a: [f64; 3]) -> V3<f64> {
    V3::new(a[0], a[1], a[2])
}

pub(crate) fn mat3(m: &Matrix3) -> M3<f64> {
    M3::from_fn(|r, c| m.rows[r][c])
}

pub(crate) fn array9(m: &M3<f64>) -> [[f64; 3]; 3] {
    core::array::from_fn(|r| core::array::from_fn(|c| m[(r, c)]))
}

pub(crate) fn point<F>(v: &V3<f64>) -> Point<F> {
    Point::from_array((*v).into())
}

/// The matrix of the vector product with `v`.
pub(crate) fn cross_matrix(v: &V3<f64>) -> M3<f64> {
    M3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}

/// A rotation from a (nearly) orthonormal matrix, made exactly so by its singular vectors; `None` when not finite.
pub(crate) fn rigid_of<To, From>(rotation: &M3<f64>, translation: &V3<f64>) -> Option<Rigid<To, From>> {
    let svd = rotation.try_svd(true, true, 1e-14, 200)?;
    let (u, v_t) = (svd.u?, svd.v_t?);
    let sign = (u * v_t).determinant().signum();
    let r = u * M3::from_diagonal(&V3::new(1.0, 1.0, sign)) * v_t;
    Rigid::from_matrix(&Matrix3 { rows: array9(&r) }, Vector::from_array((*translation).into()))
}

/// The small motion `y -> c + exp(omega) (y - c) + shift` as a rigid map.
pub(crate) fn small_motion<F>(centre: &V3<f64>, omega: &V3<f64>, shift: &V3<f64>) -> Option<Rigid<F, F>> {
    let turn = match omega.norm() {
        angle if angle > 0.0 => Rigid::from_axis_angle(Vector::<F>::from_array((*omega).into()), angle, Vector::ZERO)?,
        _ => Rigid::IDENTITY,
    };
    let turned = vec3(turn.vector(Vector::<F>::from_array((*centre).into())).to_array());
    Rigid::from_quaternion(turn.quaternion_wxyz(), Vector::from_array((centre + shift - turned).into()))
}
