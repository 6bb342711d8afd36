//! Bringing points back to the surfaces that they have left for the sake of a bad element.

use super::super::vec3::{add, distance, scale, sub};
use super::volume::GOOD;
use super::work::Work;

/// Rounds over all points: one that gives way makes room for the next.
const ROUNDS: usize = 2;
/// Points nearer to their surface than this part of the mean edge around them stay.
const NEAR: f64 = 0.02;
/// Parts of the way back, the first that leaves the elements good.
const WAYS: [f64; 4] = [1.0, 0.5, 0.25, 0.12];

impl Work<'_> {
    /// Moves the points of surfaces towards these as far as elements stay good, or as bad as they
    /// were. What a point was let off for has often been mended since, by others.
    pub(super) fn tighten(&mut self) {
        for _ in 0..ROUNDS {
            for v in 0..self.points.len() as u32 {
                if self.masks[v as usize].count() > 1 && !self.stars[v as usize].is_empty() {
                    self.return_to_surface(v);
                }
            }
        }
    }

    fn return_to_surface(&mut self, v: u32) {
        let from = self.points[v as usize];
        let edge = self.middle(v).1;
        let Some(place) = self.constrain(v, &self.freedom(v), from, edge) else { return };
        if distance(place, from) < NEAR * edge {
            return;
        }
        let floor = GOOD.min(self.worst_around(v)) - 1e-9;
        for part in WAYS {
            if self.try_move(v, add(from, scale(sub(place, from), part)), floor) {
                return;
            }
        }
    }
}
