//! Which catheter is where in which frame: others go in one after the other and stay, then the one that is planned goes in,
//! rests, and is drawn out again where that is asked for.

use crate::insertion::InsertionSettings;
use crate::loads::{BRING_ON_S, Loads};
use monro_guidance::Plan;
use monro_tissue::{FrameSettings, Tool, ToolMotion, ToolPose};

/// Length of a catheter behind its tip, mm (ventricular catheters are 200 to 350 mm long).
pub(crate) const CATHETER_LENGTH_MM: f64 = 250.0;

/// A catheter and the frames in which it goes in.
#[derive(Debug, Clone, Copy)]
struct Passage {
    path: Plan,
    /// The frame in which it begins to move.
    sets_out: usize,
}

/// The frames of an insertion.
#[derive(Debug)]
pub(crate) struct Schedule {
    /// The planned one first: it is the first tool of the soft body.
    passages: Vec<Passage>,
    tool: Tool,
    dt_s: f64,
    speed_mm_s: f64,
    /// Frames over which fluid and gravity come on.
    pub(crate) frames_on: usize,
    /// The frame in which the planned one begins to move, and the one in which it is drawn back.
    pub(crate) begins: usize,
    pub(crate) turns: usize,
    /// All of them.
    pub(crate) total: usize,
}

impl Schedule {
    /// Of the planned path and those of catheters that stand beside it.
    pub(crate) fn new(plan: &Plan, beside: &[Plan], settings: &InsertionSettings) -> Self {
        let (dt_s, speed_mm_s) = (settings.frame.dt_s, settings.speed_mm_s);
        let moving = |path: &Plan| (path.length() / speed_mm_s / dt_s).ceil() as usize;
        let resting = (settings.hold_s / dt_s).ceil() as usize;
        let [frames_on, mut begins] = frames_before(&settings.frame);
        let mut standing = Vec::new();
        for path in beside {
            standing.push(Passage { path: *path, sets_out: begins });
            begins += moving(path) + resting;
        }
        let mut passages = vec![Passage { path: *plan, sets_out: begins }];
        passages.append(&mut standing);
        let turns = begins + moving(plan) + resting;
        let total = turns + if settings.withdraw { moving(plan) + resting } else { 0 };
        Self { passages, tool: settings.tool(), dt_s, speed_mm_s, frames_on, begins, turns, total }
    }

    /// Motions of all catheters in a frame.
    pub(crate) fn motions(&self, frame: usize) -> impl Iterator<Item = ToolMotion> + '_ {
        (0..self.passages.len()).map(move |i| ToolMotion {
            tool: self.tool,
            from: self.pose(i, frame),
            to: self.pose(i, frame + 1),
        })
    }

    fn pose(&self, i: usize, frame: usize) -> ToolPose {
        let Passage { path, sets_out } = self.passages[i];
        let way = |since: usize| frame.saturating_sub(since) as f64 * self.dt_s * self.speed_mm_s;
        let back = if i == 0 { way(self.turns) } else { 0.0 };
        let depth = (way(sets_out).min(path.length()) - back).max(0.0);
        ToolPose { tip: path.at_depth(depth), tail: path.at_depth(depth - CATHETER_LENGTH_MM) }
    }
}

/// Frames over which loads come on, and those before the first catheter begins to move.
fn frames_before(settings: &FrameSettings) -> [usize; 2] {
    let frames = |s: f64| (s / settings.dt_s).ceil() as usize;
    let loads = Loads::of(settings);
    if !loads.any() {
        return [0; 2];
    }
    [frames(BRING_ON_S), frames(BRING_ON_S) + frames(loads.rest_s())]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Mode, ModelSettings};
    use monro_geometry::Point;
    use monro_guidance::Side;
    use monro_tissue::{Csf, PaperOptions, TipShape};

    fn path(x: f64, length: f64) -> Plan {
        Plan::new(Side::Right, Point::new(x, 0.0, length), Point::new(x, 0.0, 0.0)).expect("a path")
    }

    fn settings(withdraw: bool) -> InsertionSettings {
        InsertionSettings {
            model: ModelSettings::of(Mode::Paper(PaperOptions::default())),
            speed_mm_s: 25.0,
            diameter_mm: 3.0,
            tip: TipShape::Round,
            hold_s: 0.5,
            withdraw,
            frame: FrameSettings { csf: Csf::Pressure { kpa: 0.1 }, ..FrameSettings::default() },
        }
    }

    #[test]
    fn catheters_go_in_one_after_the_other_and_only_the_planned_one_comes_out() {
        let (plan, beside) = (path(0.0, 60.0), [path(10.0, 50.0), path(20.0, 40.0)]);
        let all = Schedule::new(&plan, &beside, &settings(true));
        let lengths = [60.0, 50.0, 40.0];
        let depths = |frame: usize| -> Vec<f64> {
            all.motions(frame).zip(lengths).map(|(m, length)| length - m.to.tip.z).collect()
        };
        let mut last: Vec<ToolMotion> = all.motions(0).collect();
        for frame in 1..all.total {
            let now: Vec<ToolMotion> = all.motions(frame).collect();
            assert!(now.iter().zip(&last).all(|(a, b)| a.from == b.to), "a jump at frame {frame}");
            let moving = now.iter().filter(|m| m.from != m.to).count();
            assert!(moving <= 1, "{moving} at once in frame {frame}");
            // 25 mm/s for a sixtieth of a second.
            assert!(now.iter().all(|m| m.from.tip.distance(m.to.tip) < 0.42), "frame {frame}");
            last = now;
        }
        assert_eq!(depths(all.frames_on - 1), [0.0; 3]);
        assert_eq!(depths(all.begins - 1), [0.0, 50.0, 40.0]);
        assert_eq!(depths(all.turns - 1), [60.0, 50.0, 40.0]);
        assert_eq!(depths(all.total - 1), [0.0, 50.0, 40.0]);
        let stays = Schedule::new(&plan, &beside, &settings(false));
        assert_eq!((stays.begins, stays.turns, stays.total), (all.begins, all.turns, all.turns));
    }
}
