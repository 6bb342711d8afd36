//! A bare 3 x 3 matrix, row-major, for the linear parts of transforms.

use crate::Vector;

/// A 3 x 3 matrix, `rows[r][c]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Matrix3 {
    /// The rows of the matrix.
    pub rows: [[f64; 3]; 3],
}

impl Matrix3 {
    /// The identity.
    pub const IDENTITY: Self = Self { rows: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] };

    /// From three columns.
    pub fn from_columns<F>(a: Vector<F>, b: Vector<F>, c: Vector<F>) -> Self {
        Self { rows: [[a.x, b.x, c.x], [a.y, b.y, c.y], [a.z, b.z, c.z]] }
    }

    /// Column `i` as an array.
    pub fn column(&self, i: usize) -> [f64; 3] {
        [self.rows[0][i], self.rows[1][i], self.rows[2][i]]
    }

    /// Matrix times column vector.
    pub fn apply(&self, v: [f64; 3]) -> [f64; 3] {
        self.rows.map(|r| r[0] * v[0] + r[1] * v[1] + r[2] * v[2])
    }

    /// Matrix product `self * o`.
    pub fn times(&self, o: &Self) -> Self {
        let mut rows = [[0.0; 3]; 3];
        for (row, out) in self.rows.iter().zip(&mut rows) {
            for (c, value) in out.iter_mut().enumerate() {
                *value = (0..3).map(|k| row[k] * o.rows[k][c]).sum();
            }
        }
        Self { rows }
    }

    /// The transposed matrix.
    pub fn transposed(&self) -> Self {
        Self { rows: [self.column(0), self.column(1), self.column(2)] }
    }

    /// Determinant.
    pub fn determinant(&self) -> f64 {
        let [a, b, c] = self.rows;
        a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    }

    /// Inverse by cofactors; `None` when the determinant is below `1e-12` of the product of the row lengths.
    pub fn inverse(&self) -> Option<Self> {
        let [a, b, c] = self.rows;
        let det = self.determinant();
        let scale: f64 = self.rows.iter().map(|r| r.iter().map(|v| v * v).sum::<f64>().sqrt()).product();
        if !det.is_finite() || det.abs() <= 1e-12 * scale {
            return None;
        }
        let cof = |p: [f64; 3], q: [f64; 3]| {
            [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]
        };
        let columns = [cof(b, c), cof(c, a), cof(a, b)].map(|v| v.map(|x| x / det));
        Some(Self { rows: columns }.transposed())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn inverse_times_matrix_is_identity(values in proptest::array::uniform9(-10.0..10.0f64)) {
            let m = Matrix3 { rows: [[values[0], values[1], values[2]], [values[3], values[4], values[5]], [values[6], values[7], values[8]]] };
            prop_assume!(m.determinant().abs() > 1e-2);
            let product = m.times(&m.inverse().expect("regular"));
            for r in 0..3 {
                for c in 0..3 {
                    prop_assert!((product.rows[r][c] - f64::from(u8::from(r == c))).abs() < 1e-8);
                }
            }
        }
    }

    #[test]
    fn singular_has_no_inverse() {
        assert!(Matrix3 { rows: [[1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [0.0, 0.0, 1.0]] }.inverse().is_none());
    }
}
