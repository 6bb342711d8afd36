//! A dense box of values without placement.

/// A dense box of values, `i` fastest; isotropic, its voxel is the unit of length.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Raster<T> {
    pub(crate) dims: [usize; 3],
    pub(crate) data: Vec<T>,
}

/// A set of voxels.
pub(crate) type Mask = Raster<bool>;

impl<T: Copy> Raster<T> {
    /// One value everywhere.
    pub(crate) fn filled(dims: [usize; 3], value: T) -> Self {
        Self { dims, data: vec![value; dims[0] * dims[1] * dims[2]] }
    }

    /// Flat offset of a voxel.
    pub(crate) const fn index(&self, i: usize, j: usize, k: usize) -> usize {
        (k * self.dims[1] + j) * self.dims[0] + i
    }

    /// Voxel of a flat offset.
    pub(crate) const fn voxel(&self, index: usize) -> [usize; 3] {
        [index % self.dims[0], index / self.dims[0] % self.dims[1], index / (self.dims[0] * self.dims[1])]
    }

    /// Each value mapped.
    pub(crate) fn map<U>(&self, f: impl FnMut(T) -> U) -> Raster<U> {
        Raster { dims: self.dims, data: self.data.iter().copied().map(f).collect() }
    }

    /// Two rasters of the same dimensions combined voxel by voxel.
    pub(crate) fn zip<U: Copy, V>(&self, other: &Raster<U>, mut f: impl FnMut(T, U) -> V) -> Raster<V> {
        debug_assert_eq!(self.dims, other.dims);
        Raster { dims: self.dims, data: self.data.iter().zip(&other.data).map(|(&a, &b)| f(a, b)).collect() }
    }

    /// The part `low..high` (high exclusive) as a raster of its own.
    pub(crate) fn crop(&self, low: [usize; 3], high: [usize; 3]) -> Self {
        let dims = [0, 1, 2].map(|a| high[a] - low[a]);
        let mut data = Vec::with_capacity(dims[0] * dims[1] * dims[2]);
        for k in low[2]..high[2] {
            for j in low[1]..high[1] {
                let start = self.index(low[0], j, k);
                data.extend_from_slice(&self.data[start..start + dims[0]]);
            }
        }
        Self { dims, data }
    }

    /// Offsets of the face neighbours of a voxel.
    pub(crate) fn neighbours(&self, index: usize) -> impl Iterator<Item = usize> + use<T> {
        let [i, j, k] = self.voxel(index);
        let [nx, ny, nz] = self.dims;
        let (row, sheet) = (nx, nx * ny);
        [
            (i > 0).then(|| index - 1),
            (i + 1 < nx).then(|| index + 1),
            (j > 0).then(|| index - row),
            (j + 1 < ny).then(|| index + row),
            (k > 0).then(|| index - sheet),
            (k + 1 < nz).then(|| index + sheet),
        ]
        .into_iter()
        .flatten()
    }
}

impl Raster<f32> {
    /// Trilinear value at a continuous index, clamped to the box.
    pub(crate) fn linear(&self, v: [f64; 3]) -> f32 {
        let mut base = [0usize; 3];
        let mut step = [0usize; 3];
        let mut t = [0f32; 3];
        let strides = [1, self.dims[0], self.dims[0] * self.dims[1]];
        for a in 0..3 {
            let last = self.dims[a] - 1;
            let c = v[a].clamp(0.0, last as f64);
            base[a] = c as usize;
            step[a] = if base[a] < last { strides[a] } else { 0 };
            t[a] = (c - base[a] as f64) as f32;
        }
        let at = self.index(base[0], base[1], base[2]);
        let line = |o: usize| self.data[o] * (1.0 - t[0]) + self.data[o + step[0]] * t[0];
        let sheet = |o: usize| line(o) * (1.0 - t[1]) + line(o + step[1]) * t[1];
        sheet(at) * (1.0 - t[2]) + sheet(at + step[2]) * t[2]
    }
}

impl Mask {
    /// Number of voxels in the set.
    pub(crate) fn count(&self) -> usize {
        self.data.iter().filter(|&&v| v).count()
    }

    /// The complement.
    pub(crate) fn not(&self) -> Self {
        self.map(|v| !v)
    }

    /// Intersection.
    pub(crate) fn and(&self, o: &Self) -> Self {
        self.zip(o, |a, b| a && b)
    }

    /// Union.
    pub(crate) fn or(&self, o: &Self) -> Self {
        self.zip(o, |a, b| a || b)
    }

    /// This set without the other.
    pub(crate) fn minus(&self, o: &Self) -> Self {
        self.zip(o, |a, b| a && !b)
    }

    /// Lowest and highest (exclusive) index of the set widened by `margin` within the box; `None` when empty.
    pub(crate) fn bounds(&self, margin: usize) -> Option<([usize; 3], [usize; 3])> {
        let mut low = self.dims;
        let mut high = [0usize; 3];
        for (index, _) in self.data.iter().enumerate().filter(|(_, v)| **v) {
            let v = self.voxel(index);
            for a in 0..3 {
                low[a] = low[a].min(v[a]);
                high[a] = high[a].max(v[a] + 1);
            }
        }
        (high[0] > 0).then(|| {
            ([0, 1, 2].map(|a| low[a].saturating_sub(margin)), [0, 1, 2].map(|a| (high[a] + margin).min(self.dims[a])))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_is_exact_on_a_ramp_and_clamped_outside() {
        let mut r = Raster::filled([4, 5, 6], 0f32);
        for n in 0..r.data.len() {
            let [i, j, k] = r.voxel(n);
            r.data[n] = i as f32 + 10.0 * j as f32 + 100.0 * k as f32;
        }
        assert!((r.linear([1.5, 2.25, 3.75]) - (1.5 + 22.5 + 375.0)).abs() < 1e-3);
        assert!((r.linear([-4.0, 9.0, 5.0]) - 540.0).abs() < 1e-3);
    }

    #[test]
    fn crop_and_bounds_agree() {
        let mut m = Mask::filled([7, 8, 9], false);
        for v in [[2, 3, 4], [4, 3, 6]] {
            let at = m.index(v[0], v[1], v[2]);
            m.data[at] = true;
        }
        let (low, high) = m.bounds(0).expect("not empty");
        assert_eq!((low, high), ([2, 3, 4], [5, 4, 7]));
        assert_eq!(m.crop(low, high).count(), 2);
        assert_eq!(Mask::filled([3, 3, 3], false).bounds(1), None);
    }
}
