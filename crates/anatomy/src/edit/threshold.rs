//! Voxels by value.

use super::selection::check_grid;
use super::{EditError, Selection};
use crate::livewire::{Axis, Mask};
use monro_geometry::Volume;
use std::ops::RangeInclusive;

/// The voxels with a value (HU) in a range, optionally only inside another selection. Nothing is changed: this is the
/// preview, and painting it is the edit.
///
/// # Errors
/// The range is empty; the grids differ.
pub fn threshold(
    ct: &Volume<i16>,
    range: RangeInclusive<i16>,
    within: Option<&Selection>,
) -> Result<Selection, EditError> {
    check_range(&range)?;
    let Some(within) = within else {
        return Ok(Selection::where_(*ct.grid(), |n| range.contains(&ct.data()[n])));
    };
    check_grid(ct.grid().dims(), within.grid().dims())?;
    let mut out = Selection::empty(*ct.grid());
    within.voxels().filter(|&n| range.contains(&ct.data()[n])).for_each(|n| out.push(n, n + 1));
    Ok(out)
}

/// The same on one slice only, quick enough to follow a slider.
///
/// # Errors
/// The range is empty; there is no such slice.
pub fn threshold_slice(
    ct: &Volume<i16>,
    axis: Axis,
    index: usize,
    range: RangeInclusive<i16>,
) -> Result<Mask, EditError> {
    check_range(&range)?;
    let dims = ct.grid().dims();
    let count = dims[axis.number()];
    let no_slice = EditError::Slice { index, last: count - 1 };
    if index >= count {
        return Err(no_slice);
    }
    let [w, h] = axis.in_plane().map(|a| dims[a]);
    let inside = |n: usize| {
        let [i, j, k] = axis.voxel(index, n % w, n / w);
        range.contains(&ct.at(i, j, k))
    };
    Mask::new(w, h, (0..w * h).map(inside).collect()).map_err(|_| no_slice)
}

fn check_range(range: &RangeInclusive<i16>) -> Result<(), EditError> {
    super::check("lower end of the range", f64::from(*range.start()), !range.is_empty(), "at most the upper end")
}
