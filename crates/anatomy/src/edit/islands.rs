//! Connected parts of a selection (over faces).

use super::selection::Run;
use super::{EditError, Selection};
use monro_geometry::DisjointSets;

/// The parts of a selection that do not touch each other by a face, largest first (equal ones by their first voxel).
pub fn islands(selection: &Selection) -> Vec<Selection> {
    let runs = selection.runs();
    let mut parts = DisjointSets::new(runs.len());
    let [nx, ny, _] = selection.grid().dims();
    let rows = row_starts(runs, nx);
    for pair in rows.windows(2) {
        let row = runs[pair[0]].start / nx;
        let mut neighbours = Vec::with_capacity(2);
        if !row.is_multiple_of(ny) {
            neighbours.push((row - 1, nx));
        }
        if row >= ny {
            neighbours.push((row - ny, nx * ny));
        }
        for (other, shift) in neighbours {
            if let Ok(found) = rows[..rows.len() - 1].binary_search_by_key(&other, |&r| runs[r].start / nx) {
                join_overlaps(runs, pair[0]..pair[1], rows[found]..rows[found + 1], shift, &mut parts);
            }
        }
    }
    collect(selection, &mut parts)
}

/// Index of the first run of each row that has runs, and the number of runs at the end.
fn row_starts(runs: &[Run], nx: usize) -> Vec<usize> {
    let first = |&n: &usize| n == 0 || runs[n - 1].start / nx != runs[n].start / nx;
    (0..runs.len()).filter(first).chain([runs.len()]).collect()
}

/// Joins runs of one row with those of a neighbouring row (`shift` voxels before) that they overlap.
fn join_overlaps(
    runs: &[Run],
    row: std::ops::Range<usize>,
    before: std::ops::Range<usize>,
    shift: usize,
    parts: &mut DisjointSets,
) {
    let (mut a, mut b) = (row.start, before.start);
    while a < row.end && b < before.end {
        let (low, high) = (runs[b].start + shift, runs[b].end + shift);
        if low < runs[a].end && runs[a].start < high {
            parts.join(a as u32, b as u32);
        }
        if high < runs[a].end { b += 1 } else { a += 1 }
    }
}

fn collect(selection: &Selection, parts: &mut DisjointSets) -> Vec<Selection> {
    let mut place = std::collections::BTreeMap::new();
    let mut out: Vec<Selection> = Vec::new();
    for (n, run) in selection.runs().iter().enumerate() {
        let root = parts.root(n as u32);
        let at = *place.entry(root).or_insert_with(|| {
            out.push(Selection::empty(*selection.grid()));
            out.len() - 1
        });
        out[at].push(run.start, run.end);
    }
    // A stable sort keeps the order of first voxels among equals.
    out.sort_by_key(|s| core::cmp::Reverse(s.count()));
    out
}

/// The largest part of a selection.
///
/// # Errors
/// The selection is empty.
pub fn largest_island(selection: &Selection) -> Result<Selection, EditError> {
    islands(selection).into_iter().next().ok_or(EditError::Empty { what: "the selection", verb: "keep" })
}

/// The selection without its parts of less than `least_mm3`.
///
/// # Errors
/// The volume is negative or not a number.
pub fn without_small_islands(selection: &Selection, least_mm3: f64) -> Result<Selection, EditError> {
    super::check("least volume", least_mm3, least_mm3 >= 0.0, "zero or positive, in mm3")?;
    let voxels: Vec<usize> =
        islands(selection).iter().filter(|s| s.volume_mm3() >= least_mm3).flat_map(Selection::voxels).collect();
    Ok(Selection::from_voxels(*selection.grid(), voxels))
}
