//! Voxels by value.

use super::selection::check_grid;
use super::{EditError, Selection};
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

fn check_range(range: &RangeInclusive<i16>) -> Result<(), EditError> {
    super::check("lower end of the range", f64::from(*range.start()), !range.is_empty(), "at most the upper end")
}
