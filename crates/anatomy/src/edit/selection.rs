//! Sets of voxels as runs along rows.

use super::EditError;
use monro_geometry::{Grid, Volume};

/// Consecutive voxels of one row: flat offsets `start..end`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Run {
    pub(super) start: usize,
    pub(super) end: usize,
}

/// A set of voxels of a grid, as sorted runs that neither overlap, touch nor cross the end of a row; so equal sets are
/// equal values, and a stroke of the brush takes a few hundred bytes.
#[derive(Debug, Clone, PartialEq)]
pub struct Selection {
    grid: Grid,
    runs: Vec<Run>,
}

impl Selection {
    /// No voxel.
    pub const fn empty(grid: Grid) -> Self {
        Self { grid, runs: Vec::new() }
    }

    /// Every voxel whose flat offset passes a test.
    pub fn where_(grid: Grid, mut test: impl FnMut(usize) -> bool) -> Self {
        let mut out = Self::empty(grid);
        (0..grid.len()).filter(|&n| test(n)).for_each(|n| out.push(n, n + 1));
        out
    }

    /// The voxels with a label.
    pub fn of_label(labels: &Volume<u8>, label: u8) -> Self {
        Self::where_(*labels.grid(), |n| labels.data()[n] == label)
    }

    /// From flat offsets in any order.
    pub fn from_voxels(grid: Grid, mut voxels: Vec<usize>) -> Self {
        voxels.sort_unstable();
        voxels.dedup();
        let mut out = Self::empty(grid);
        voxels.into_iter().filter(|&n| n < grid.len()).for_each(|n| out.push(n, n + 1));
        out
    }

    /// Adds a range at the end: `start` must not lie before the last run's end.
    pub(super) fn push(&mut self, mut start: usize, end: usize) {
        let row = self.grid.dims()[0];
        while start < end {
            let stop = end.min((start / row + 1) * row);
            match self.runs.last_mut() {
                Some(last) if last.end == start && !start.is_multiple_of(row) => last.end = stop,
                _ => self.runs.push(Run { start, end: stop }),
            }
            start = stop;
        }
    }

    /// The grid that the voxels belong to.
    pub const fn grid(&self) -> &Grid {
        &self.grid
    }

    pub(super) fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// Flat offsets, ascending.
    pub fn voxels(&self) -> impl Iterator<Item = usize> + '_ {
        self.runs.iter().flat_map(|r| r.start..r.end)
    }

    /// Number of voxels.
    pub fn count(&self) -> usize {
        self.runs.iter().map(|r| r.end - r.start).sum()
    }

    /// Whether there is no voxel.
    pub const fn is_empty(&self) -> bool {
        self.runs.is_empty()
    }

    /// Volume in mm3.
    pub fn volume_mm3(&self) -> f64 {
        self.count() as f64 * self.grid.voxel_volume()
    }

    /// Whether a voxel (flat offset) is in the set.
    pub fn contains(&self, voxel: usize) -> bool {
        let after = self.runs.partition_point(|r| r.start <= voxel);
        after > 0 && self.runs[after - 1].end > voxel
    }

    /// One flag per voxel of the grid.
    pub fn to_flags(&self) -> Vec<bool> {
        let mut out = vec![false; self.grid.len()];
        self.runs.iter().for_each(|r| out[r.start..r.end].fill(true));
        out
    }

    /// First and last voxel of the box around the set; `None` when empty.
    pub fn bounds(&self) -> Option<[[usize; 3]; 2]> {
        let mut found: Option<[[usize; 3]; 2]> = None;
        for run in &self.runs {
            let (a, b) = (self.grid.voxel(run.start), self.grid.voxel(run.end - 1));
            let [low, high] = found.unwrap_or([a, b]);
            found = Some([core::array::from_fn(|n| low[n].min(a[n])), core::array::from_fn(|n| high[n].max(b[n]))]);
        }
        found
    }

    /// Voxels of either set.
    ///
    /// # Errors
    /// The sets belong to grids of different dimensions.
    pub fn union(&self, other: &Self) -> Result<Self, EditError> {
        self.combine(other, |a, b| a || b)
    }

    /// Voxels of both sets.
    ///
    /// # Errors
    /// As [`Selection::union`].
    pub fn intersection(&self, other: &Self) -> Result<Self, EditError> {
        self.combine(other, |a, b| a && b)
    }

    /// Voxels of this set and not of the other.
    ///
    /// # Errors
    /// As [`Selection::union`].
    pub fn difference(&self, other: &Self) -> Result<Self, EditError> {
        self.combine(other, |a, b| a && !b)
    }

    /// Voxels of exactly one of the sets.
    ///
    /// # Errors
    /// As [`Selection::union`].
    pub fn symmetric_difference(&self, other: &Self) -> Result<Self, EditError> {
        self.combine(other, |a, b| a != b)
    }

    /// All other voxels of the grid.
    pub fn complement(&self) -> Self {
        let mut out = Self::empty(self.grid);
        let mut from = 0;
        for run in &self.runs {
            out.push(from, run.start);
            from = run.end;
        }
        out.push(from, self.grid.len());
        out
    }

    /// Sweeps over the ends of both sets' runs; between two neighbouring ends membership does not change.
    fn combine(&self, other: &Self, keep: impl Fn(bool, bool) -> bool) -> Result<Self, EditError> {
        check_grid(self.grid.dims(), other.grid.dims())?;
        let mut out = Self::empty(self.grid);
        let (mut a, mut b, mut at) = (Ends::new(&self.runs), Ends::new(&other.runs), 0);
        while let Some(next) = [a.next, b.next].into_iter().flatten().min() {
            if keep(a.inside, b.inside) {
                out.push(at, next);
            }
            at = next;
            a.pass(next);
            b.pass(next);
        }
        Ok(out)
    }
}

/// The ends of runs one after the other.
struct Ends<'a> {
    runs: &'a [Run],
    inside: bool,
    next: Option<usize>,
}

impl<'a> Ends<'a> {
    fn new(runs: &'a [Run]) -> Self {
        Self { runs, inside: false, next: runs.first().map(|r| r.start) }
    }

    /// Crosses the end at `at`, if it is this set's; two runs may meet at the end of a row.
    fn pass(&mut self, at: usize) {
        while self.next == Some(at) {
            if self.inside {
                self.runs = &self.runs[1..];
            }
            self.inside = !self.inside;
            self.next = self.runs.first().map(|r| if self.inside { r.end } else { r.start });
        }
    }
}

pub(super) fn check_grid(expected: [usize; 3], found: [usize; 3]) -> Result<(), EditError> {
    if expected == found { Ok(()) } else { Err(EditError::Grid { expected, found }) }
}
