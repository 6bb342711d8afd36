//! The labels as they were given, for what their smooth fields do not keep.

use monro_geometry::{Grid, Patient, Point, Volume};
use std::collections::BTreeSet;

/// Pieces of voxels of more than so many cells are no specks.
const CELLS: f64 = 4.0;

/// A volume of labels.
pub(super) struct Voxels<'a, T>(pub(super) &'a Volume<T>);

impl<T: Copy + Into<u16>> Voxels<'_, T> {
    /// All labels but 0, in order.
    pub(super) fn present(&self) -> Vec<u16> {
        let mut found = vec![false; 1 << 16];
        self.0.data().iter().for_each(|&l| found[usize::from(l.into())] = true);
        (1..=u16::MAX).filter(|&l| found[usize::from(l)]).collect()
    }

    /// The centre of the middle one, in the order of the volume, of the voxels whose labels `of` accepts, LPS mm; the
    /// origin where there is none.
    pub(super) fn one(&self, of: impl Fn(u16) -> bool) -> [f64; 3] {
        let accepted = |l: &T| of((*l).into());
        let count = self.0.data().iter().filter(|l| accepted(l)).count();
        let place = self.0.data().iter().enumerate().filter(|(_, l)| accepted(l)).nth(count / 2);
        place.map_or([0.0; 3], |(at, _)| centre(self.0.grid(), at))
    }

    /// Whether the voxel at a point is of a small separate piece, less than some cells of edge `step` (mm) in all, of the
    /// voxels whose labels `of` accepts. Voxels that share an edge or a corner are not separate.
    pub(super) fn is_separate(&self, p: Point<Patient>, step: f64, of: impl Fn(u16) -> bool) -> bool {
        let grid = self.0.grid();
        let is_in = |at: usize| of(self.0.data()[at].into());
        let Some([i, j, k]) = grid.containing(p).filter(|&[i, j, k]| is_in(grid.index(i, j, k))) else { return false };
        let most = (CELLS * step.powi(3) / grid.voxel_volume()) as usize + 1;
        let mut piece = BTreeSet::from([grid.index(i, j, k)]);
        let mut edge: Vec<[usize; 3]> = vec![[i, j, k]];
        while let Some(v) = edge.pop() {
            for [i, j, k] in around(v, grid.dims()) {
                let at = grid.index(i, j, k);
                if is_in(at) && piece.insert(at) {
                    edge.push([i, j, k]);
                }
            }
            if piece.len() > most {
                return false;
            }
        }
        true
    }
}

fn centre(grid: &Grid, at: usize) -> [f64; 3] {
    let [i, j, k] = grid.voxel(at);
    grid.centre(i, j, k).to_array()
}

/// The voxels that share a corner with one.
fn around(v: [usize; 3], dims: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    let shift = |n: usize| [n % 3, n / 3 % 3, n / 9];
    (0..27).filter_map(move |n| {
        let other = [0, 1, 2].map(|a| (v[a] + shift(n)[a]).wrapping_sub(1));
        (0..3).all(|a| other[a] < dims[a]).then_some(other)
    })
}
