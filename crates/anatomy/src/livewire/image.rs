//! One slice of a volume as a 2D image.

use super::{LivewireError, check_option};
use monro_geometry::Volume;

/// The index direction that a slice is perpendicular to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Axis {
    /// Slices of constant `i` (sagittal in a standard head CT): columns run along `j`, rows along `k`.
    I,
    /// Slices of constant `j` (coronal): columns run along `i`, rows along `k`.
    J,
    /// Slices of constant `k` (axial): columns run along `i`, rows along `j`.
    K,
}

impl Axis {
    /// All three.
    pub const ALL: [Self; 3] = [Self::I, Self::J, Self::K];

    /// The number of the index: 0, 1 or 2.
    pub const fn number(self) -> usize {
        self as usize
    }

    /// The two indices that span the slice: that of the columns' direction, that of the rows'.
    pub const fn in_plane(self) -> [usize; 2] {
        match self {
            Self::I => [1, 2],
            Self::J => [0, 2],
            Self::K => [0, 1],
        }
    }

    /// The voxel of pixel (`column`, `row`) of slice `index`.
    pub const fn voxel(self, index: usize, column: usize, row: usize) -> [usize; 3] {
        match self {
            Self::I => [index, column, row],
            Self::J => [column, index, row],
            Self::K => [column, row, index],
        }
    }
}

/// A 2D image of finite values; `data[row * width + column]`.
#[derive(Debug, Clone, PartialEq)]
pub struct SliceImage {
    width: usize,
    height: usize,
    spacing: [f64; 2],
    data: Vec<f32>,
}

impl SliceImage {
    /// An image of `width` columns and `height` rows with its pixel spacing (between columns, between rows; mm).
    ///
    /// # Errors
    /// No pixels or a wrong count; a value that is not finite; a spacing that is not positive.
    pub fn new(width: usize, height: usize, spacing: [f64; 2], data: Vec<f32>) -> Result<Self, LivewireError> {
        let pixels = width.checked_mul(height).filter(|&n| n > 0 && n <= u32::MAX as usize / 8);
        if pixels != Some(data.len()) {
            return Err(LivewireError::Size { width, height, values: data.len() });
        }
        for s in spacing {
            check_option("pixel spacing", s, s.is_finite() && s > 0.0, "a positive number of mm")?;
        }
        if let Some(first) = data.iter().position(|v| !v.is_finite()) {
            let count = data.iter().filter(|v| !v.is_finite()).count();
            return Err(LivewireError::NotFinite { count, column: first % width, row: first / width });
        }
        Ok(Self { width, height, spacing, data })
    }

    /// Slice `index` of a volume, perpendicular to `axis`.
    ///
    /// # Errors
    /// There is no such slice.
    pub fn of(volume: &Volume<i16>, axis: Axis, index: usize) -> Result<Self, LivewireError> {
        let dims = volume.grid().dims();
        check_slice(dims, axis, index)?;
        let [c, r] = axis.in_plane();
        let (width, height) = (dims[c], dims[r]);
        let mut data = Vec::with_capacity(width * height);
        for row in 0..height {
            data.extend((0..width).map(|column| {
                let [i, j, k] = axis.voxel(index, column, row);
                f32::from(volume.at(i, j, k))
            }));
        }
        let spacing = volume.grid().spacing();
        Self::new(width, height, [spacing[c], spacing[r]], data)
    }

    /// Columns.
    pub const fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub const fn height(&self) -> usize {
        self.height
    }

    /// Distance between columns and between rows, mm.
    pub const fn spacing(&self) -> [f64; 2] {
        self.spacing
    }

    /// The values, row by row.
    pub fn data(&self) -> &[f32] {
        &self.data
    }
}

fn check_slice(dims: [usize; 3], axis: Axis, index: usize) -> Result<(), LivewireError> {
    let count = dims[axis.number()];
    if index < count { Ok(()) } else { Err(LivewireError::Slice { index, last: count - 1 }) }
}
