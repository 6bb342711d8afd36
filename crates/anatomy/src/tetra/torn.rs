//! Where thin parts of labels, and thin gaps between them, are not kept by the smooth fields although what is around is.
//!
//! A check against the smooth fields' own surfaces cannot see it: they have lost the same. It is seen where voxels that have
//! changed sides join what then lies apart, or reach far out from what is left.

use super::place;
use super::voxels::{Voxels, around, centre};
use std::collections::BTreeSet;
use std::fmt;

/// Lost voxels that reach so many voxels out from what is kept are a spike or a sheet, fewer a rough edge.
const SPIKE: usize = 3;

/// Parts that are lost of a label that is there.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Torn {
    /// Necks, handles, spikes and sheets.
    pub places: usize,
    /// Their voxels.
    pub voxels: usize,
    /// The centre of a voxel of the largest, LPS mm.
    pub at: [f64; 3],
}

impl fmt::Display for Torn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { places, voxels, at } = *self;
        write!(
            f,
            "{places} thin part(s) of {voxels} voxel(s) in all, the largest at {}, are not kept by the smooth fields (necks, handles, spikes, sheets of a voxel or so): what they join is apart, and what they reach is not reached, at any number of elements; thicken them by a voxel, or resample the labels to voxels of half the size",
            place(at)
        )
    }
}

/// Voxels that hang together, and how they lie to others of their kind, which are kept.
struct Cluster {
    voxels: Vec<usize>,
    /// Voxels that the way from what is kept leads through at most; 0 where nothing is.
    reach: usize,
    /// Whether what is kept around it is in two parts or more there.
    parts: bool,
}

impl<T: Copy + Into<u16>> Voxels<'_, T> {
    /// The parts of a label that are lost, given those of its voxels that are (`gone`, in order). Small separate pieces are none.
    pub(super) fn torn(&self, gone: &[usize], label: u16, step: f64) -> Option<Torn> {
        let (mut all, mut largest) = (Torn::default(), 0);
        for cluster in self.clusters(gone, |l| l == label) {
            let count = cluster.voxels.len();
            let whole = cluster.reach == 0 && count > self.most_of_piece(step);
            if !(cluster.parts || whole || cluster.reach >= SPIKE) {
                continue;
            }
            (all.places, all.voxels) = (all.places + 1, all.voxels + count);
            if count > largest {
                (largest, all.at) = (count, centre(self.0.grid(), cluster.voxels[count / 2]));
            }
        }
        (all.places > 0).then_some(all)
    }

    /// The voxels, of those of none of the labels that `of` accepts that are `filled` (in order), through which what is open on
    /// one side of them hangs together with what is on another; in order.
    pub(super) fn passages(&self, filled: &[usize], of: impl Fn(u16) -> bool) -> Vec<usize> {
        let clusters = self.clusters(filled, |l| !of(l));
        let mut all: Vec<usize> = clusters.into_iter().filter(|c| c.parts).flat_map(|c| c.voxels).collect();
        all.sort_unstable();
        all
    }

    /// Some voxels of those that `of` accepts, by what hangs together by faces, edges and corners.
    fn clusters(&self, some: &[usize], of: impl Fn(u16) -> bool) -> Vec<Cluster> {
        let (mut changed, mut waits) = (vec![false; self.0.grid().len()], vec![false; self.0.grid().len()]);
        for &at in some {
            (changed[at], waits[at]) = (true, true);
        }
        let kept = |at: &usize| !changed[*at] && of(self.0.data()[*at].into());
        let mut all = Vec::new();
        for &first in some {
            if !std::mem::take(&mut waits[first]) {
                continue;
            }
            let (mut voxels, mut next) = (vec![first], 0);
            while next < voxels.len() {
                let found = self.beside(voxels[next]).filter(|&at| std::mem::take(&mut waits[at]));
                voxels.extend(found.collect::<Vec<_>>());
                next += 1;
            }
            voxels.sort_unstable();
            all.push(self.cluster(voxels, kept));
        }
        all
    }

    fn cluster(&self, voxels: Vec<usize>, kept: impl Fn(&usize) -> bool) -> Cluster {
        let around = |some: &BTreeSet<usize>| -> BTreeSet<usize> {
            some.iter().flat_map(|&at| self.beside(at)).filter(&kept).collect()
        };
        let mut left: BTreeSet<usize> = voxels.iter().copied().collect();
        let touched = around(&left);
        // What is joined a voxel further out are steps of a surface.
        let parts = self.parts(&touched, &touched) > 1
            && self.parts(&touched, &around(&touched).union(&touched).copied().collect()) > 1;
        let (mut layer, mut reach): (Vec<usize>, usize) = (touched.into_iter().collect(), 0);
        loop {
            layer = layer.iter().flat_map(|&at| self.beside(at)).filter(|at| left.remove(at)).collect();
            if layer.is_empty() {
                return Cluster { voxels, reach, parts };
            }
            reach += 1;
        }
    }

    /// In how many parts some voxels are that may hang together by others.
    fn parts(&self, some: &BTreeSet<usize>, by: &BTreeSet<usize>) -> usize {
        let (mut left, mut count) = (by.clone(), 0);
        for &first in some {
            if !left.remove(&first) {
                continue;
            }
            count += 1;
            let mut edge = vec![first];
            while let Some(at) = edge.pop() {
                edge.extend(self.beside(at).filter(|n| left.remove(n)));
            }
        }
        count
    }

    /// The voxels that share a corner with one.
    fn beside(&self, at: usize) -> impl Iterator<Item = usize> {
        let grid = *self.0.grid();
        around(grid.voxel(at), grid.dims()).map(move |[i, j, k]| grid.index(i, j, k))
    }
}
