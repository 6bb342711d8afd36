//! Where thin parts of labels, and thin gaps between them, are not kept by the smooth fields although what is around is.
//!
//! A check against the smooth fields' own surfaces cannot see it: they have lost the same. It is seen where voxels that have
//! changed sides join what then lies apart, or reach far out from what is left.

use super::place;
use super::voxels::{Voxels, around, centre};
use std::fmt;

/// Lost voxels that reach so many voxels out from what is kept are a spike or a sheet, fewer a rough edge.
const SPIKE: usize = 3;

// Marks of voxels: those that have not changed sides, those that have, those of a cluster, those of it that have been reached
// from what is kept, and those kept whose parts are counted.
const FREE: u8 = 0;
const CHANGED: u8 = 1;
const FOUND: u8 = 2;
const DONE: u8 = 3;
const WAITS: u8 = 4;

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
        // Nothing is written where nothing is changed: most of the volume.
        let mut marks = vec![FREE; self.0.grid().len()];
        some.iter().for_each(|&at| marks[at] = CHANGED);
        let mut all = Vec::new();
        for &first in some {
            if marks[first] == CHANGED {
                let mut voxels = self.flood(first, [CHANGED, FOUND], &mut marks);
                voxels.sort_unstable();
                all.push(self.cluster(voxels, &of, &mut marks));
            }
        }
        all
    }

    /// What is to be known of a cluster that has been found.
    fn cluster(&self, voxels: Vec<usize>, of: &impl Fn(u16) -> bool, marks: &mut [u8]) -> Cluster {
        let kept = |some: &[usize], marks: &[u8]| {
            let mut all = self.around(some, FREE, marks);
            all.retain(|&at| of(self.0.data()[at].into()));
            all
        };
        let touched = kept(&voxels, marks);
        // What is joined a voxel further out are steps of a surface.
        let parts = self.parts(&touched, &touched, marks) > 1 && {
            let further = kept(&touched, marks);
            self.parts(&touched, &[&touched[..], &further].concat(), marks) > 1
        };
        let (mut layer, mut reach) = (self.around(&touched, FOUND, marks), 0);
        while !layer.is_empty() {
            reach += 1;
            layer.iter().for_each(|&at| marks[at] = DONE);
            layer = self.around(&layer, FOUND, marks);
        }
        Cluster { voxels, reach, parts }
    }

    /// The voxels of a mark that share a corner with any of some; in order.
    fn around(&self, some: &[usize], mark: u8, marks: &[u8]) -> Vec<usize> {
        let mut all = Vec::new();
        for &at in some {
            all.extend(self.beside(at).filter(|&n| marks[n] == mark));
        }
        all.sort_unstable();
        all.dedup();
        all
    }

    /// In how many parts some voxels are that are kept, given all by which they may hang together, themselves among them.
    fn parts(&self, some: &[usize], by: &[usize], marks: &mut [u8]) -> usize {
        by.iter().for_each(|&at| marks[at] = WAITS);
        let mut count = 0;
        for &first in some {
            if marks[first] == WAITS {
                count += 1;
                self.flood(first, [WAITS, FREE], marks);
            }
        }
        // Those that hang together with none.
        by.iter().for_each(|&at| marks[at] = FREE);
        count
    }

    /// The voxels of one mark that hang together with one, which get another.
    fn flood(&self, first: usize, [from, to]: [u8; 2], marks: &mut [u8]) -> Vec<usize> {
        marks[first] = to;
        let (mut all, mut next) = (vec![first], 0);
        while next < all.len() {
            for at in self.beside(all[next]) {
                if marks[at] == from {
                    marks[at] = to;
                    all.push(at);
                }
            }
            next += 1;
        }
        all
    }

    /// The voxels that share a corner with one.
    fn beside(&self, at: usize) -> impl Iterator<Item = usize> {
        let grid = *self.0.grid();
        around(grid.voxel(at), grid.dims()).map(move |[i, j, k]| grid.index(i, j, k))
    }
}
