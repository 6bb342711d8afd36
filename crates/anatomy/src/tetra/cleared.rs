//! A cut lattice without what is merged at any rate, so that it is known how many elements are left for the count.

use super::coarse;
use super::fields::LabelFields;
use super::improve::{Coarse, Work};
use super::repair::{self, Crumb};
use super::size::SizeField;
use super::start::{Start, to_count};
use monro_geometry::d3::D3;

/// Elements below this quality are bad;
const BAD: f64 = 0.3;
/// more than this part of them is many, as where many labels meet. Heads and phantoms have 1 to 3 in a hundred.
const MANY: f64 = 0.04;
/// Bettering a mesh takes this part of its elements where bad ones are many,
const LATER_OF_MANY: f64 = 0.02;
/// or where its surfaces were coarsened.
const LATER: f64 = 0.011;
/// A lattice that has less than this part of a label for which there are elements enough does not see its thin parts or small
/// pieces (heads and phantoms have 0.84 and more from 5,824 elements on).
const SEEN: f64 = 0.8;
/// Where a lattice has too few another is made, up to so many, for so many times as many at most, and this part on top.
const LATTICES: usize = 3;
const MOST_MORE: f64 = 1.5;
const ON_TOP: f64 = 1.01;

/// A lattice cut along all surfaces and cleared: separate pieces too small to keep, points almost in one place and, where bad
/// elements are many, the worst of these are gone.
#[derive(Clone)]
pub(super) struct Cleared<'a> {
    pub(super) work: Work<'a>,
    pub(super) crumbs: Vec<Crumb>,
    /// Where cells are smaller than wanted elsewhere because of thin parts, and the edges there.
    pub(super) bounds: Vec<(D3, f64)>,
    /// The finest edge wanted, mm.
    pub(super) finest: f64,
    /// The edges of the smallest cells, mm.
    finest_cut: f64,
    /// Whether bad elements were many.
    many: bool,
    /// Part of the elements that bettering is going to take.
    later: f64,
}

impl<'a> Cleared<'a> {
    /// With enough elements for so many, if finer lattices help, or for `more` times as many at first; `None` where nothing is
    /// left to mesh.
    pub(super) fn with_room(fields: &'a LabelFields, size: &SizeField, wanted: usize, mut more: f64) -> Option<Self> {
        let made = |more| Some(Self::new(to_count(fields, size, wanted, more)?, fields, size));
        let mut best = made(more)?;
        for _ in 1..LATTICES {
            let lacks = best.target(wanted) as f64 / best.work.count().max(1) as f64;
            if lacks <= 1.0 {
                break;
            }
            more *= lacks.min(MOST_MORE) * ON_TOP;
            best = made(more).filter(|other| other.work.count() > best.work.count()).unwrap_or(best);
        }
        Some(best)
    }

    fn new(start: Start, fields: &'a LabelFields, size: &SizeField) -> Self {
        let Start { mut raw, bounds, lattice_edge, finest, .. } = start;
        let crumbs = repair::repair(&mut raw, fields.labels.len() as u8, 0.5 * lattice_edge.powi(3), |corners, l| {
            coarse::holds(corners, l, fields)
        });
        let mut work = Work::new(raw, fields);
        // Points almost in one place, where surfaces meet.
        let close = Coarse { finest: lattice_edge, target: 0, limit: 0.3, sag: 0.08, floor: 0.3 };
        work.coarsen(&size.with_bounds(&bounds), &close);
        work.restore_lines();
        let many = work.has_more_below(BAD, MANY);
        if many {
            // Most of these can only be merged: after the count was met, it would be missed by that.
            work.improve_worst();
        }
        let coarsened = if finest > lattice_edge { LATER } else { 0.0 };
        let finest_cut = bounds.iter().map(|b| b.1).fold(lattice_edge, f64::min);
        Self { work, crumbs, bounds, finest, finest_cut, many, later: if many { LATER_OF_MANY } else { coarsened } }
    }

    /// Whether a lattice of smaller cells shows more of a label for which `wanted` elements are enough: not where cells are as
    /// fine as the labels are known, nor where many labels meet, for that takes longest to clear and to coarsen.
    pub(super) fn is_blind(&self, fields: &LabelFields, wanted: usize) -> bool {
        if self.many || self.finest_cut <= fields.step {
            return false;
        }
        let volumes = self.work.volumes(fields.labels.len());
        (0..volumes.len()).any(|l| coarse::has_many(l, wanted, fields) && volumes[l] < SEEN * fields.volumes[l])
    }

    /// A copy for another count, where bad elements are many, for then clearing takes longest and few counts are met at once.
    pub(super) fn kept(&self) -> Option<Self> {
        self.many.then(|| self.clone())
    }

    /// Whether it has enough elements for so many.
    pub(super) fn has_room(&self, wanted: usize) -> bool {
        self.work.count() >= self.target(wanted)
    }

    /// How many elements to coarsen to so that bettering leaves so many.
    pub(super) fn target(&self, wanted: usize) -> usize {
        ((1.0 + self.later) * wanted as f64) as usize
    }
}
