//! Air in the ventricles, as after an operation: it stands where fluid would, and says nothing of how dark fluid is.

use crate::image::{Mask, Raster, dilate};
use std::collections::VecDeque;

/// Darker than this inside the skull is air, HU (smoothed; fat does not lie there).
const AIR: f32 = -100.0;
/// So far about it voxels are partly air, or smoothed with it, mm.
const RIM: f32 = 2.0;
/// Half way from air to tissue or fluid, HU: the border of a bubble.
const BORDER: f32 = -480.0;

/// Bubbles of air, and voxels partly so.
pub(super) struct Air {
    bubbles: Mask,
    /// They and the rim about them.
    pub(super) all: Mask,
}

impl Air {
    pub(super) fn of(hu: &Raster<f32>, cavity: &Mask) -> Self {
        let within = |below: f32| hu.zip(cavity, |v, c| c && v < below);
        Self { bubbles: within(BORDER), all: dilate(&within(AIR), RIM) }
    }

    /// Volume of the bubbles in the mask, mL, on voxels of 1 mm.
    pub(super) fn ml(&self, within: impl Fn(usize) -> bool) -> f64 {
        (0..self.all.data.len()).filter(|&n| self.bubbles.data[n] && within(n)).count() as f64 / 1000.0
    }

    /// Puts fluid into the bubbles, so that they count as a part of their ventricle, and into the rim about them what lies
    /// nearest beyond it: partly air, it would look like fluid where brain is.
    pub(super) fn fill(&self, hu: &mut Raster<f32>, fluid: f32) {
        if !self.all.data.contains(&true) {
            return;
        }
        let mut open = VecDeque::new();
        let mut left = self.all.clone();
        for n in 0..left.data.len() {
            if self.bubbles.data[n] {
                (hu.data[n], left.data[n]) = (fluid, false);
            } else if !left.data[n] && hu.neighbours(n).any(|m| self.all.data[m]) {
                open.push_back(n);
            }
        }
        while let Some(n) = open.pop_front() {
            for m in hu.neighbours(n) {
                if left.data[m] {
                    (hu.data[m], left.data[m]) = (hu.data[n], false);
                    open.push_back(m);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fluid of 10 mm between brain, its upper half a bubble, blurred.
    #[test]
    fn a_bubble_counts_as_fluid_and_its_rim_as_what_lies_beyond() {
        let mut hu = Raster::filled([40, 40, 40], 35f32);
        for n in 0..hu.data.len() {
            let [i, j, k] = hu.voxel(n);
            if (15..25).contains(&i) && (10..30).contains(&k) {
                hu.data[n] = if j < 20 { -1000.0 } else { 5.0 };
            }
        }
        let cavity = Mask::filled(hu.dims, true);
        let blurred = crate::image::gaussian(&hu, 1.0);
        let air = Air::of(&blurred, &cavity);
        let mut filled = blurred.clone();
        air.fill(&mut filled, 5.0);
        let wrong = |n: &usize| {
            let ([i, j, k], is_fluid) = (filled.voxel(*n), filled.data[*n] < 20.0);
            // But for where bubble, fluid and brain meet.
            let level = (16..24).contains(&j);
            !level && (2..38).contains(&j) && (12..28).contains(&k) && is_fluid != (15..25).contains(&i)
        };
        assert_eq!((0..filled.data.len()).filter(wrong).count(), 0);
        assert!((air.ml(|_| true) - 10.0 * 20.0 * 20.0 / 1000.0).abs() < 0.2, "{}", air.ml(|_| true));
        let none = Air::of(&crate::image::gaussian(&hu.map(|v: f32| v.max(5.0)), 1.0), &cavity);
        let mut same = hu.clone();
        none.fill(&mut same, 5.0);
        assert!(none.ml(|_| true) == 0.0 && same.data == hu.data && !none.all.data.contains(&true));
    }
}
