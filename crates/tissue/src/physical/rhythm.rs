//! When what is done in a substep: which sweeps go over what and how far, and what follows them.

use super::sweep::Pace;
use crate::vec3::V3;

/// A vertex goes this many times as far as its own minimum (successive over-relaxation): smooth motions converge in fewer
/// sweeps, and below 2 no energy rises. More than this, pressures that follow made blocks breathe while they are shaken
/// (docs/speed.md). The last sweep of a substep goes to the minimum: it takes away what over-relaxation leaves, which is
/// rough.
const BEYOND: f32 = 1.5;
/// With a predicted space, in sweeps over all: what is outside gets few, and its motion is smooth.
const FAR_BEYOND: f32 = 1.8;
/// In calm tissue, what is missing to twice as far, times the vertices along an edge of a cube of as many: the finer a mesh, the
/// more sweeps smooth motion takes, and the nearer to 2 the factor with which it takes the fewest (Young 1954; measured in
/// docs/speed.md). There all pressures follow one sweep in six only, and that one goes to the minimum. With a predicted space
/// they follow one in twelve, and sweeps over all lack half as much.
const LACKS: f64 = 1.5;
/// Sweeps for each step of the pressures near what moves fast: after a single over-relaxed one they would follow what is
/// not there yet. And sweeps for each step of all pressures in calm tissue, without and with a predicted space.
const SWEEPS_A_STEP: u32 = 2;
const SWEEPS_A_WHOLE_STEP: u32 = 6;
const SWEEPS_A_FAR_STEP: u32 = 12;
/// With a predicted space, one sweep in so many goes over the whole tissue, and after that it is chosen; and in calm tissue,
/// where what is outside would otherwise be left further behind.
const WHOLE_EVERY: u32 = 3;
const CALM_WHOLE_EVERY: u32 = 2;

/// How many times as far as their minimum vertices go in calm tissue of so many of them.
pub(super) fn calm_beyond(vertices: usize) -> f32 {
    (2.0 - LACKS / (vertices.max(1) as f64).cbrt()).max(BEYOND.into()) as f32
}

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
    fn is_whole(&self, k: u32, calm: Option<f32>) -> bool {
        let every = if calm.is_some() { CALM_WHOLE_EVERY } else { WHOLE_EVERY };
        !self.predicted_space || k == 0 || self.left(k).is_multiple_of(every)
    }

    /// Whether sweep `k` is followed by a choice: the first of what is near, and those over all of the predicted space.
    pub(super) fn chooses(&self, k: u32, calm: Option<f32>) -> bool {
        self.left(k) > 0 && (k == 0 || self.predicted_space && self.is_whole(k, calm))
    }

    /// What sweep `k` is like; `calm` is how far sweeps go in tissue that is calm. Before the first one is through, nobody knows.
    pub(super) fn pace(&self, k: u32, calm: Option<f32>) -> Pace {
        let far = self.predicted_space && self.is_whole(k, calm);
        let beyond = match (self.left(k), calm.filter(|_| k > 0)) {
            (0, _) => 1.0,
            (left, Some(_)) if !self.predicted_space && left.is_multiple_of(SWEEPS_A_WHOLE_STEP) => 1.0,
            (_, Some(calm)) if far => 0.5 * (calm + 2.0),
            (_, Some(calm)) => calm,
            (_, None) if far => FAR_BEYOND,
            (_, None) => BEYOND,
        };
        Pace { beyond, only_active: !self.is_whole(k, calm), tells: self.chooses(k, calm) }
    }

    /// Where the sweeps from number `k` on end between which nothing else is done.
    pub(super) fn run(&self, k: u32, calm: Option<f32>) -> u32 {
        let ends = |k: &u32| self.chooses(*k, calm) || self.press(*k, calm).is_some();
        (k..self.iterations).find(ends).map_or(self.iterations, |last| last + 1)
    }

    /// How often all pressures take a step.
    pub(super) fn steps(&self, calm: Option<f32>) -> u32 {
        let all = |k: &u32| matches!(self.press(*k, calm), Some(Press::Between | Press::End));
        (0..self.iterations).filter(all).count() as u32
    }

    /// The same, of the fewest that there are without a predicted space. That has fewer in calm tissue, but what moves there is
    /// near, and of it nothing is gained by solving for long waves (docs/speed.md).
    pub(super) fn fewest_steps(&self) -> u32 {
        Self { predicted_space: false, ..*self }.steps(Some(BEYOND))
    }

    /// Which pressures take a step after sweep `k`. In tissue that is not calm all do, also after sweeps over the predicted space
    /// alone: held for longer, they throw what a membrane has let go.
    pub(super) fn press(&self, k: u32, calm: Option<f32>) -> Option<Press> {
        let all = match (calm, self.predicted_space) {
            (None, _) => SWEEPS_A_STEP,
            (Some(_), false) => SWEEPS_A_WHOLE_STEP,
            (Some(_), true) => SWEEPS_A_FAR_STEP,
        };
        match self.left(k) {
            0 => Some(Press::End),
            _ if k == 0 => None,
            left if left.is_multiple_of(all) => Some(Press::Between),
            left if left.is_multiple_of(SWEEPS_A_STEP) => Some(Press::Near),
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

#[cfg(test)]
mod tests {
    use super::*;

    fn substep(iterations: u32, predicted_space: bool) -> Substep {
        Substep { dt: 0.01, iterations, gravity: [0.0; 3], predicted_space }
    }

    #[test]
    fn sweeps_go_the_further_the_more_vertices_there_are_and_always_less_than_twice_as_far() {
        let counts = [0, 1, 27, 1000, 6000, 170_000, 1_000_000_000];
        let beyond = counts.map(calm_beyond);
        assert!(beyond.is_sorted() && (beyond[0] - BEYOND).abs() < 1e-6 && beyond[6] < 2.0, "{beyond:?}");
        // By hand: 1000 are a cube of ten.
        assert!((beyond[3] - 1.85).abs() < 1e-6, "{beyond:?}");
        for (k, calm) in (0..10).flat_map(|k| beyond.map(|b| (k, b))) {
            for predicted in [false, true] {
                let pace = substep(10, predicted).pace(k, Some(calm));
                assert!((1.0..2.0).contains(&pace.beyond), "sweep {k}: {pace:?}");
                assert!(k < 9 || pace.beyond == 1.0 && !pace.only_active, "the last one: {pace:?}");
            }
        }
    }

    #[test]
    fn pressures_follow_every_second_sweep_somewhere_and_at_the_end_everywhere() {
        for (iterations, predicted) in [1, 2, 7, 10, 40].into_iter().flat_map(|n| [(n, false), (n, true)]) {
            let step = substep(iterations, predicted);
            let after = |calm: Option<f32>| (0..iterations).map(|k| step.press(k, calm)).collect::<Vec<_>>();
            for calm in [None, Some(1.9)] {
                let presses = after(calm);
                assert_eq!(presses.iter().filter(|p| **p == Some(Press::End)).count(), 1);
                assert_eq!(presses[iterations as usize - 1], Some(Press::End));
                for (k, press) in presses.iter().enumerate().skip(1) {
                    let second = (iterations as usize - 1 - k).is_multiple_of(2);
                    assert_eq!(press.is_some(), second, "sweep {k} of {iterations}, calm: {calm:?}");
                }
            }
            for calm in [None, Some(1.9)] {
                let all = after(calm).into_iter().flatten().filter(|p| *p != Press::Near).count() as u32;
                assert_eq!(step.steps(calm), all);
            }
            assert_eq!(step.fewest_steps(), substep(iterations, false).steps(Some(1.9)));
            let between = |calm| after(calm).iter().filter(|p| **p == Some(Press::Between)).count() as u32;
            let every = if predicted { 12 } else { 6 };
            assert_eq!(between(Some(1.9)), iterations.saturating_sub(2) / every);
            assert_eq!(between(None), iterations.saturating_sub(2) / 2);
        }
    }
}
