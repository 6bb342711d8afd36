//! When what is done in a substep: which sweeps go over what and how far, and what follows them.

use super::sweep::Pace;
use crate::vec3::V3;

/// A vertex goes this many times as far as its own minimum (successive over-relaxation): smooth motions converge in fewer
/// sweeps, and below 2 no energy rises. More than this, pressures that follow made blocks breathe while they are shaken
/// (docs/speed.md). The last sweep of a substep goes to the minimum: it takes away what over-relaxation leaves, which is
/// rough.
const BEYOND: f32 = 1.5;
/// The same in calm tissue, where all pressures follow one sweep in six only, and that one goes to the minimum.
const CALM_BEYOND: f32 = 1.8;
/// With a predicted space, in sweeps over all, and such in calm tissue: what is outside gets few, and its motion is smooth.
const FAR_BEYOND: f32 = 1.8;
const CALM_FAR_BEYOND: f32 = 1.9;
/// Sweeps for each step of the pressures near what moves fast: after a single over-relaxed one they would follow what is
/// not there yet. And sweeps for each step of all pressures.
const SWEEPS_A_STEP: u32 = 2;
const SWEEPS_A_WHOLE_STEP: u32 = 6;
/// With a predicted space, one sweep in so many goes over the whole tissue, and after that it is chosen; and in calm tissue,
/// where what is outside would otherwise be left further behind.
const WHOLE_EVERY: u32 = 3;
const CALM_WHOLE_EVERY: u32 = 2;

/// Numbers of a substep.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Substep {
    pub(crate) dt: f32,
    pub(crate) iterations: u32,
    pub(crate) gravity: V3,
    pub(crate) predicted_space: bool,
}

impl Substep {
    /// Sweeps that are left after sweep `k`: rhythms are counted from the end, where all that there is comes together.
    fn left(&self, k: u32) -> u32 {
        self.iterations - 1 - k
    }

    /// Whether sweep `k` goes over the whole tissue, calm or not.
    fn is_whole(&self, k: u32, calm: bool) -> bool {
        let every = if calm { CALM_WHOLE_EVERY } else { WHOLE_EVERY };
        !self.predicted_space || k == 0 || self.left(k).is_multiple_of(every)
    }

    /// Whether sweep `k` is followed by a choice: the first of what is near, and those over all of the predicted space.
    pub(super) fn chooses(&self, k: u32, calm: bool) -> bool {
        self.left(k) > 0 && (k == 0 || self.predicted_space && self.is_whole(k, calm))
    }

    /// What sweep `k` is like, in tissue that is calm or not: before the first one is through, nobody knows.
    pub(super) fn pace(&self, k: u32, calm: bool) -> Pace {
        let far = self.predicted_space && self.is_whole(k, calm);
        let beyond = match (self.left(k), calm && k > 0) {
            (0, _) => 1.0,
            (left, true) if !self.predicted_space && left.is_multiple_of(SWEEPS_A_WHOLE_STEP) => 1.0,
            (_, true) if far => CALM_FAR_BEYOND,
            (_, true) => CALM_BEYOND,
            (_, false) if far => FAR_BEYOND,
            (_, false) => BEYOND,
        };
        Pace { beyond, only_active: !self.is_whole(k, calm), tells: self.chooses(k, calm) }
    }

    /// Where the sweeps from number `k` on end between which nothing else is done.
    pub(super) fn run(&self, k: u32, calm: bool) -> u32 {
        let ends = |k: &u32| self.chooses(*k, calm) || self.press(*k, calm).is_some();
        (k..self.iterations).find(ends).map_or(self.iterations, |last| last + 1)
    }

    /// Which pressures take a step after sweep `k`, in tissue that is calm or not. While it is not, also after sweeps over the
    /// predicted space alone: held for longer, they throw what a membrane has let go.
    pub(super) fn press(&self, k: u32, calm: bool) -> Option<Press> {
        let all = if calm { SWEEPS_A_WHOLE_STEP } else { SWEEPS_A_STEP };
        match self.left(k) {
            0 => Some(Press::End),
            _ if k == 0 => None,
            left if left.is_multiple_of(all) => Some(Press::Between),
            left if calm && left.is_multiple_of(SWEEPS_A_STEP) => Some(Press::Near),
            _ => None,
        }
    }
}

/// When pressures follow the positions: before the first sweep, without a step of their own; between sweeps, all or near
/// what moves fast; and after the last, when nobody asks for the elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Press {
    Begin,
    Near,
    Between,
    End,
}
