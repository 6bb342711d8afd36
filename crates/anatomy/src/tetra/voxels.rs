//! The labels as they were given, for what their smooth fields do not keep.

use super::fields::LabelFields;
use crate::surface::even::Extent;
use crate::surface::runs::kept;
use monro_geometry::{Grid, Patient, Point, Volume};
use rayon::prelude::*;
use std::collections::{BTreeSet, VecDeque};

/// Pieces of voxels of more than so many cells are no specks.
pub(super) const SPECK: f64 = 4.0;
/// A label whose pieces have no more voxels than this (three by three by three), nor cells, has no surface that a mesh could follow,
const CRUMBLY: usize = 27;
/// and is looked for among those that have less than this part of all voxels.
const FEW: usize = 20;
/// Fields that hold less of a label by more than this part may have lost pieces of it.
const NOTICED: f64 = 0.01;

/// A volume of labels.
#[derive(Clone, Copy)]
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
        let at = grid.containing(p).map(|[i, j, k]| grid.index(i, j, k));
        let most = self.most_of_piece(step);
        at.is_some_and(|at| of(self.0.data()[at].into()) && self.piece(at, most, of).is_some())
    }

    /// The voxels of the piece of a voxel, of those whose labels `of` accepts, if they are `most` at most.
    fn piece(&self, at: usize, most: usize, of: impl Fn(u16) -> bool) -> Option<BTreeSet<usize>> {
        self.flooded(at, of, |piece, _| piece.len() > most)
    }

    /// The same; `None` where `ends` says so of the voxels found so far and the next one, from the first outwards.
    fn flooded(
        &self,
        first: usize,
        of: impl Fn(u16) -> bool,
        ends: impl Fn(&BTreeSet<usize>, usize) -> bool,
    ) -> Option<BTreeSet<usize>> {
        let grid = self.0.grid();
        let (mut piece, mut edge) = (BTreeSet::from([first]), VecDeque::from([first]));
        while let Some(at) = edge.pop_front() {
            if ends(&piece, at) {
                return None;
            }
            for [i, j, k] in around(grid.voxel(at), grid.dims()) {
                let next = grid.index(i, j, k);
                if of(self.0.data()[next].into()) && piece.insert(next) {
                    edge.push_back(next);
                }
            }
        }
        Some(piece)
    }

    /// Whether the piece of a label that is nearest to a point, within a voxel, is nowhere `there`, by the centres of its voxels;
    /// false where the label has no voxel so near.
    pub(super) fn is_gone(&self, p: Point<Patient>, label: u16, there: impl Fn(Point<Patient>) -> bool) -> bool {
        let grid = self.0.grid();
        let place = |at: usize| Point::from_array(centre(grid, at));
        let voxels = grid.containing(p).map(|v| around(v, grid.dims()).map(|[i, j, k]| grid.index(i, j, k)));
        let own = voxels.into_iter().flatten().filter(|&at| self.0.data()[at].into() == label);
        let nearest = own.min_by(|&a, &b| place(a).distance(p).total_cmp(&place(b).distance(p)));
        nearest.is_some_and(|first| self.flooded(first, |l| l == label, |_, at| there(place(at))).is_some())
    }

    /// Voxels that a small piece has at most.
    pub(super) fn most_of_piece(&self, step: f64) -> usize {
        (SPECK * step.powi(3) / self.0.grid().voxel_volume()) as usize + 1
    }
}

impl<T: Copy + Eq + Into<u16> + Sync> Voxels<'_, T> {
    /// Notes which labels are but specks: pieces of less than some voxels each, and less than some cells. A label with much of the volume is
    /// not looked at: it is none, or noise that no mesh is made of.
    pub(super) fn note_specks(&self, fields: &mut LabelFields) {
        let whole: usize = fields.extents.iter().map(|e| e.count).sum();
        let most = CRUMBLY.max((CRUMBLY as f64 * fields.step.powi(3) / fields.voxel) as usize);
        for l in (0..fields.parts.len()).filter(|&l| fields.extents[l].count <= whole / FEW) {
            fields.specks[l] = self.is_crumbly((fields.labels[l], &fields.extents[l]), most);
        }
    }

    /// Whether all pieces of a label have `most` voxels at most.
    fn is_crumbly(&self, (label, extent): (u16, &Extent), most: usize) -> bool {
        let mut seen = BTreeSet::new();
        self.within(extent, |l| l == label, |_| true).into_iter().all(|at| {
            let is_new = !seen.contains(&at);
            !is_new || self.piece(at, most, |l| l == label).map(|piece| seen.extend(piece)).is_some()
        })
    }

    /// Takes pieces and thin parts that the fields have lost from the volumes that labels should have: what is left of a label is not to
    /// be blown up in their stead.
    pub(super) fn leave_out_missing(&self, fields: &mut LabelFields) {
        for (l, found) in fields.found().into_iter().enumerate() {
            if found > (1.0 - NOTICED) * fields.volumes[l] {
                continue;
            }
            let (label, step) = (fields.labels[l], fields.step);
            let absent = self.absent((label, &fields.extents[l]), |p| fields.label_at(p) == Some(l));
            let torn = self.torn(&absent, label, step).map_or(0, |torn| torn.voxels);
            let lost = self.lost(&absent, label, step).voxels + torn;
            if lost < fields.extents[l].count {
                fields.volumes[l] -= lost as f64 * fields.voxel;
            }
        }
    }

    /// The voxels of a label that are not there, by their centres, in what they were smoothed to; and what they are of.
    pub(super) fn missing(
        &self,
        label: (u16, &Extent),
        step: f64,
        is_there: impl Fn([f64; 3]) -> bool + Sync,
    ) -> (Vec<usize>, Missing) {
        let absent = self.absent(label, is_there);
        let missing = self.lost(&absent, label.0, step);
        (absent, missing)
    }

    /// Whether most of some voxels of a label are of no block of two by two by two of it.
    pub(super) fn are_thin(&self, voxels: &[usize], label: u16) -> bool {
        2 * voxels.iter().filter(|&&at| self.is_thin(at, label)).count() > voxels.len()
    }

    /// Whether a voxel is of no block of two by two by two of its label.
    fn is_thin(&self, at: usize, label: u16) -> bool {
        let (grid, v) = (self.0.grid(), self.0.grid().voxel(at));
        let is_own = |[i, j, k]: [usize; 3]| self.0.data()[grid.index(i, j, k)].into() == label;
        let own: Vec<[usize; 3]> = around(v, grid.dims()).filter(|&n| is_own(n)).collect();
        // Of the corners of a block around the voxel each is on the same side of it, or in its plane, along every axis.
        let is_of = |n: &[usize; 3], side: usize| (0..3).all(|a| n[a] == v[a] || (n[a] > v[a]) == (side >> a & 1 == 1));
        (0..8).all(|side| own.iter().filter(|n| is_of(n, side)).count() < 8)
    }

    /// The voxels in a box of none of the labels that `of` accepts that `is_filled` by their centres, where they and all those of
    /// none that share a corner with them are, or where they part those that are not: holes, tunnels and slits. A dent only
    /// becomes shallower, and one beside it is left.
    pub(super) fn filled(
        &self,
        extent: &Extent,
        of: impl Fn(u16) -> bool + Sync,
        is_filled: impl Fn([f64; 3]) -> bool + Sync,
    ) -> Vec<usize> {
        let (grid, data) = (self.0.grid(), self.0.data());
        let filled = self.within(extent, |l| !of(l), |at| is_filled(centre(grid, at)));
        let is_gone = |at: usize| of(data[at].into()) || filled.binary_search(&at).is_ok();
        let is_inside = |at: usize| around(grid.voxel(at), grid.dims()).all(|[i, j, k]| is_gone(grid.index(i, j, k)));
        let mut all = self.passages(&filled, &of);
        all.extend(filled.iter().copied().filter(|&at| is_inside(at)));
        all.sort_unstable();
        all.dedup();
        all
    }

    /// The voxels of a label that are not there.
    fn absent(&self, (label, extent): (u16, &Extent), is_there: impl Fn([f64; 3]) -> bool + Sync) -> Vec<usize> {
        self.within(extent, |l| l == label, |at| !is_there(centre(self.0.grid(), at)))
    }

    /// The voxels in a box that `is` accepts, of those of labels that `of` accepts; in order.
    fn within(
        &self,
        &Extent { low, high, .. }: &Extent,
        of: impl Fn(u16) -> bool + Sync,
        is: impl Fn(usize) -> bool + Sync,
    ) -> Vec<usize> {
        let (grid, data) = (self.0.grid(), self.0.data());
        let of_slice = |k: usize| {
            let mut found = Vec::new();
            for j in low[1]..=high[1] {
                let first = grid.index(low[0], j, k);
                let runs = kept(&data[first..=grid.index(high[0], j, k)], |l| of(l.into()));
                for run in runs {
                    found.extend(run.map(|i| first + i).filter(|&at| is(at)));
                }
            }
            found
        };
        (low[2]..=high[2]).into_par_iter().flat_map_iter(of_slice).collect()
    }

    /// The small pieces of a label all of whose voxels are `absent`.
    fn lost(&self, absent: &[usize], label: u16, step: f64) -> Missing {
        let (mut all, mut seen) = (Missing::default(), BTreeSet::new());
        for &at in absent {
            if seen.contains(&at) {
                continue;
            }
            let Some(piece) = self.piece(at, self.most_of_piece(step), |l| l == label) else { continue };
            if piece.iter().all(|v| absent.binary_search(v).is_ok()) {
                (all.pieces, all.voxels) = (all.pieces + 1, all.voxels + piece.len());
                all.at = centre(self.0.grid(), at);
            }
            seen.extend(piece);
        }
        all
    }
}

/// The small pieces of a label that are lost.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Missing {
    pub(super) pieces: usize,
    /// Voxels of those pieces.
    pub(super) voxels: usize,
    /// The centre of a voxel of one of them, LPS mm.
    pub(super) at: [f64; 3],
}

pub(super) fn centre(grid: &Grid, at: usize) -> [f64; 3] {
    let [i, j, k] = grid.voxel(at);
    grid.centre(i, j, k).to_array()
}

/// The voxels that share a corner with one.
pub(super) fn around(v: [usize; 3], dims: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    let shift = |n: usize| [n % 3, n / 3 % 3, n / 9];
    (0..27).filter_map(move |n| {
        let other = [0, 1, 2].map(|a| (v[a] + shift(n)[a]).wrapping_sub(1));
        (0..3).all(|a| other[a] < dims[a]).then_some(other)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Elements cut off from a piece were told as a piece that is lost.
    #[test]
    fn a_piece_is_gone_where_none_of_it_is_there() {
        let grid = Grid::axis_aligned([12, 5, 5], [2.0; 3], [0.0; 3]).expect("grid");
        let is_bar = |[i, j, k]: [usize; 3]| (j, k) == (2, 2) && (1..7).contains(&i);
        let label = |v| 7 * u8::from(is_bar(v) || v == [9, 2, 2]);
        let volume = Volume::new(grid, (0..grid.len()).map(|at| label(grid.voxel(at))).collect()).expect("count");
        let voxels = Voxels(&volume);
        let end_is_there = |p: Point<Patient>| p.x < 3.0;
        let at = |x| Point::from_array([x, 4.5, 3.5]);
        assert!(!voxels.is_gone(at(12.0), 7, end_is_there), "the other end of the bar is there");
        assert!(voxels.is_gone(at(18.5), 7, end_is_there), "the single voxel is not");
        assert!(voxels.is_gone(at(16.5), 7, end_is_there), "beside it, too, and far enough from the bar");
        assert!(!voxels.is_gone(at(22.5), 7, end_is_there), "nothing of the label is near");
        assert!(!voxels.is_gone(at(99.0), 7, end_is_there), "outside");
    }
}
