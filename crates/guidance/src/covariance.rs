//! Three-dimensional Gaussian errors of a point.

use crate::linear::{array9, mat3, vec3};
use crate::random::Random;
use core::marker::PhantomData;
use monro_geometry::{Frame, Matrix3, Rigid, Vector};

/// Covariance of a point's error in frame `F`, mm2. Symmetric.
pub struct Covariance<F> {
    matrix: Matrix3,
    frame: PhantomData<F>,
}

impl<F> Clone for Covariance<F> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<F> Copy for Covariance<F> {}
impl<F> PartialEq for Covariance<F> {
    fn eq(&self, o: &Self) -> bool {
        self.matrix == o.matrix
    }
}
impl<F: Frame> core::fmt::Debug for Covariance<F> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Covariance<{}>{:?}", F::NAME, self.matrix.rows)
    }
}

impl<F> Covariance<F> {
    /// From a symmetric matrix in mm2 (the symmetric part is taken).
    pub fn new(matrix: &Matrix3) -> Self {
        let m = mat3(matrix);
        Self::of(&(0.5 * (m + m.transpose())))
    }

    pub(crate) fn of(m: &nalgebra::Matrix3<f64>) -> Self {
        Self { matrix: Matrix3 { rows: array9(m) }, frame: PhantomData }
    }

    /// The same in all directions: `sigma` mm along each axis.
    pub fn isotropic(sigma: f64) -> Self {
        Self::of(&(nalgebra::Matrix3::identity() * (sigma * sigma)))
    }

    /// As of a camera: `across` mm perpendicular to the direction of view and `along` mm in it. Isotropic with `along`
    /// when the direction is zero.
    pub fn of_view(view: Vector<F>, across: f64, along: f64) -> Self {
        let Some(v) = view.normalized() else { return Self::isotropic(along) };
        let v = vec3(v.to_array());
        let spread = along * along - across * across;
        Self::of(&(nalgebra::Matrix3::identity() * (across * across) + spread * v * v.transpose()))
    }

    /// The matrix, mm2.
    pub const fn matrix(&self) -> Matrix3 {
        self.matrix
    }

    pub(crate) fn inner(&self) -> nalgebra::Matrix3<f64> {
        mat3(&self.matrix)
    }

    /// The sum of two independent errors.
    #[must_use]
    pub fn plus(&self, o: &Self) -> Self {
        Self::of(&(self.inner() + o.inner()))
    }

    /// The same error seen from another frame.
    pub fn seen_from<To>(&self, to_from_here: &Rigid<To, F>) -> Covariance<To> {
        let r = mat3(&to_from_here.rotation());
        Covariance::of(&(r * self.inner() * r.transpose()))
    }

    /// Root mean square length of the error, mm.
    pub fn rms(&self) -> f64 {
        self.inner().trace().max(0.0).sqrt()
    }

    /// Standard deviation along a direction of any length, mm; 0 for a zero direction.
    pub fn sigma_along(&self, direction: Vector<F>) -> f64 {
        let Some(d) = direction.normalized() else { return 0.0 };
        let d = vec3(d.to_array());
        d.dot(&(self.inner() * d)).max(0.0).sqrt()
    }

    /// The length (mm) below which the error stays with 95 % probability.
    ///
    /// The squared length is a weighted sum of chi-squares; it is matched by one scaled chi-square of the same mean and
    /// variance (Satterthwaite 1946), whose quantile is taken by Wilson and Hilferty (1931).
    pub fn percentile_95(&self) -> f64 {
        let m = self.inner();
        let (mean, variance) = (m.trace(), 2.0 * (m * m).trace());
        if !(mean > 0.0 && variance > 0.0) {
            return 0.0;
        }
        let spread = 2.0 / (9.0 * (2.0 * mean * mean / variance));
        const Z_95: f64 = 1.644_853_626_951_472_2;
        (mean * (1.0 - spread + Z_95 * spread.sqrt()).powi(3)).sqrt()
    }

    /// A random error of this covariance.
    pub fn sample(&self, random: &mut Random) -> Vector<F> {
        let eigen = self.inner().symmetric_eigen();
        let z = random.normal3();
        let scaled = nalgebra::Vector3::from_fn(|i, _| eigen.eigenvalues[i].max(0.0).sqrt() * z[i]);
        Vector::from_array((eigen.eigenvectors * scaled).into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Tracker;

    type C = Covariance<Tracker>;

    #[test]
    fn a_view_has_its_two_sigmas() {
        let c = C::of_view(Vector::new(0.0, 3.0, 4.0), 0.12, 0.74);
        assert!((c.sigma_along(Vector::new(0.0, 0.6, 0.8)) - 0.74).abs() < 1e-12);
        assert!((c.sigma_along(Vector::new(1.0, 0.0, 0.0)) - 0.12).abs() < 1e-12);
        assert!((c.rms() - (2.0 * 0.12f64.powi(2) + 0.74f64.powi(2)).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn samples_have_the_covariance_and_its_percentile() {
        for c in [C::of_view(Vector::new(1.0, 1.0, 0.0), 0.12, 0.74), C::isotropic(0.5)] {
            let (mut random, n) = (Random::new(3), 20_000);
            let mut lengths: Vec<f64> = (0..n).map(|_| c.sample(&mut random).norm()).collect();
            let rms = (lengths.iter().map(|l| l * l).sum::<f64>() / f64::from(n)).sqrt();
            assert!((rms / c.rms() - 1.0).abs() < 0.03, "{rms}");
            lengths.sort_by(f64::total_cmp);
            let p95 = lengths[(n as usize * 95) / 100];
            // Matching two moments of the squared length is good to a few percent of its 95 % quantile.
            assert!((p95 / c.percentile_95() - 1.0).abs() < 0.06, "{p95} {}", c.percentile_95());
        }
    }

    #[test]
    fn turning_the_frame_keeps_the_length() {
        let turn =
            Rigid::<Tracker, Tracker>::from_axis_angle(Vector::new(1.0, 2.0, 3.0), 1.0, Vector::ZERO).expect("axis");
        let c = C::of_view(Vector::new(0.0, 0.0, 1.0), 0.1, 0.7);
        let seen = c.seen_from(&turn);
        assert!((seen.rms() - c.rms()).abs() < 1e-12);
        assert!((seen.sigma_along(turn.vector(Vector::new(0.0, 0.0, 1.0))) - 0.7).abs() < 1e-12);
    }
}
