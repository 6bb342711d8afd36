//! Bringing points back to the surfaces that they have left for the sake of a bad element.

use super::mask::Mask;
use super::volume::GOOD;
use super::work::Work;
use monro_geometry::d3::{D3, add, distance, scale, sub};

/// Rounds over all points: one that gives way makes room for the next.
const ROUNDS: usize = 2;
/// Rounds over the points of lines: they have further to go, and lie next to each other.
const LINE_ROUNDS: usize = 8;
/// What lies around lines may become as bad as this: it is bettered afterwards.
const EARLY: f64 = 0.1;
/// Points nearer to their surface than this part of the mean edge around them stay.
const NEAR: f64 = 0.02;
/// So many mean edges off, a surface is not sought any more.
const REACH: f64 = 1.5;
/// Parts of the way back, the first that leaves the elements good.
const WAYS: [f64; 4] = [1.0, 0.5, 0.25, 0.12];

/// Where a point belongs, how far that is, and the mean edge around it, mm.
pub(super) struct Off {
    pub(super) place: D3,
    pub(super) way: f64,
    pub(super) edge: f64,
}

impl Work<'_> {
    /// Moves the points of surfaces towards these as far as elements stay good, or as bad as they
    /// were. What a point was let off for has often been mended since, by others.
    pub(super) fn tighten(&mut self) {
        self.return_all(ROUNDS, GOOD, |labels| labels.count() > 1);
    }

    /// Moves the points where three labels meet to that line, before anything is bettered: where elements were given to another
    /// label, so that surfaces are manifold, they lie up to a cell off, and are later in each other's way.
    pub(in super::super) fn restore_lines(&mut self) {
        self.return_all(LINE_ROUNDS, EARLY, |labels| labels.labels().count() == 3);
    }

    fn return_all(&mut self, rounds: usize, good: f64, which: impl Fn(Mask) -> bool) {
        for _ in 0..rounds {
            for v in 0..self.points.len() as u32 {
                if which(self.masks[v as usize]) && !self.stars[v as usize].is_empty() {
                    self.return_to_surface(v, good);
                }
            }
        }
    }

    /// How far a point lies off the surface or line that it is on, if not too far to tell.
    pub(super) fn off(&self, v: u32) -> Option<Off> {
        let (from, edge) = (self.points[v as usize], self.middle(v).1);
        let place = self.own_place(v, &self.freedom(v), from, REACH * edge)?;
        Some(Off { place, way: distance(place, from), edge })
    }

    fn return_to_surface(&mut self, v: u32, good: f64) {
        let from = self.points[v as usize];
        let Some(Off { place, way, edge }) = self.off(v) else { return };
        if way < NEAR * edge {
            return;
        }
        let floor = good.min(self.worst_around(v)) - 1e-9;
        for part in WAYS {
            if self.try_move(v, add(from, scale(sub(place, from), part)), floor) {
                return;
            }
        }
    }
}
