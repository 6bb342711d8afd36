//! The direct linear transform (Abdel-Aziz and Karara 1971), with normalised coordinates (Hartley and Zisserman,
//! algorithm 7.1): the 3 x 4 matrix that maps points of space to places in a picture.

use nalgebra::{Matrix3, Matrix4, SMatrix, SVector, Vector3, Vector4};

pub(super) type Projection = SMatrix<f64, 3, 4>;

/// A point (mm) and its pixel.
pub(super) type Pair = (Vector3<f64>, [f64; 2]);

/// The matrix that best explains the pairs of point (mm) and pixel, of unit norm; `None` when they do not determine it.
pub(super) fn projection(pairs: &[Pair]) -> Option<Projection> {
    let (t, u) = (normalise2(pairs)?, normalise3(pairs)?);
    let mut normal = SMatrix::<f64, 12, 12>::zeros();
    for (x, pixel) in pairs {
        let x = u * x.push(1.0);
        let m = t * Vector3::new(pixel[0], pixel[1], 1.0);
        for row in [row(&x, m.x, 0), row(&x, m.y, 1)] {
            normal += row * row.transpose();
        }
    }
    let eigen = normal.try_symmetric_eigen(1e-15, 10_000)?;
    let least = eigen.eigenvalues.imin();
    let mut values: Vec<f64> = eigen.eigenvalues.iter().copied().collect();
    values.sort_by(f64::total_cmp);
    // Eleven numbers must be determined: the second smallest eigenvalue is zero for points on a plane.
    if values[1] <= 1e-9 * values[11] {
        return None;
    }
    let v = eigen.eigenvectors.column(least);
    let p = Projection::from_fn(|r, c| v[4 * r + c]);
    let p = t.try_inverse()? * p * u;
    let norm = p.norm();
    (norm.is_finite() && norm > 0.0).then(|| p / norm)
}

/// One equation: `P_axis x - m (P_3 x) = 0`.
fn row(x: &Vector4<f64>, m: f64, axis: usize) -> SVector<f64, 12> {
    let mut row = SVector::<f64, 12>::zeros();
    row.fixed_rows_mut::<4>(4 * axis).copy_from(x);
    row.fixed_rows_mut::<4>(8).copy_from(&(-m * x));
    row
}

fn normalise2(pairs: &[Pair]) -> Option<Matrix3<f64>> {
    let n = pairs.len() as f64;
    let mean = |a: usize| pairs.iter().map(|(_, m)| m[a]).sum::<f64>() / n;
    let (cx, cy) = (mean(0), mean(1));
    let size = pairs.iter().map(|(_, m)| (m[0] - cx).hypot(m[1] - cy)).sum::<f64>() / n;
    let s = core::f64::consts::SQRT_2 / size;
    s.is_finite().then(|| Matrix3::new(s, 0.0, -s * cx, 0.0, s, -s * cy, 0.0, 0.0, 1.0))
}

/// Thinnest extent of the points over their widest, below which they count as a plane: tracked corners of one flat board
/// are never exactly flat.
const FLAT: f64 = 0.03;

fn normalise3(pairs: &[Pair]) -> Option<Matrix4<f64>> {
    let n = pairs.len() as f64;
    let centre = pairs.iter().map(|(x, _)| x).sum::<Vector3<f64>>() / n;
    let spread: Matrix3<f64> = pairs.iter().map(|(x, _)| (x - centre) * (x - centre).transpose()).sum();
    let extents = spread.symmetric_eigenvalues();
    if extents.min() <= FLAT * FLAT * extents.max() {
        return None;
    }
    let s = 3f64.sqrt() / (pairs.iter().map(|(x, _)| (x - centre).norm()).sum::<f64>() / n);
    let mut m = Matrix4::identity() * s;
    m.fixed_view_mut::<3, 1>(0, 3).copy_from(&(-s * centre));
    m[(3, 3)] = 1.0;
    s.is_finite().then_some(m)
}

/// Splits `P = K [R | t]` with positive focal lengths (RQ decomposition); `None` for a camera at infinity.
pub(super) fn split(p: &Projection) -> Option<(Matrix3<f64>, Matrix3<f64>, Vector3<f64>)> {
    let m = p.fixed_view::<3, 3>(0, 0).into_owned();
    // The sign of P is free: a proper rotation with positive focal lengths has a positive determinant.
    let p = p * m.determinant().signum();
    let m = p.fixed_view::<3, 3>(0, 0).into_owned();
    let flip = Matrix3::new(0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0);
    let qr = (flip * m).transpose().qr();
    let mut k = flip * qr.r().transpose() * flip;
    let mut r = flip * qr.q().transpose();
    let signs = Matrix3::from_diagonal(&k.diagonal().map(f64::signum));
    (k, r) = (k * signs, signs * r);
    let t = k.try_inverse()? * p.column(3);
    let scale = k[(2, 2)];
    (scale.is_finite() && scale > 0.0).then(|| (k / scale, r, t))
}

/// The pixel of a point; `None` at infinity.
pub(super) fn apply(p: &Projection, x: &Vector3<f64>) -> Option<[f64; 2]> {
    let v = p * x.push(1.0);
    (v.z.abs() > 1e-12 * v.norm()).then(|| [v.x / v.z, v.y / v.z])
}
