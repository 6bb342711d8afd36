//! Poses that never change: measured ones tremble in their last digits, those of a server that hangs do not.

use crate::Batch;
use crate::igtl::is_tool;
use monro_geometry::{Rigid, Tool, Tracker};
use std::collections::BTreeMap;

/// Poses that have been the same to the last bit for so long are told, s.
const STILL_S: f64 = 1.0;
/// Tools that are watched at most.
const MOST: usize = 256;

/// Since when each tool has been where it is to the last bit.
#[derive(Debug, Clone, Default)]
pub struct Stillness {
    tools: BTreeMap<String, Still>,
    now: f64,
}

#[derive(Debug, Clone)]
struct Still {
    pose: Rigid<Tracker, Tool>,
    since: f64,
    until: f64,
}

impl Stillness {
    /// Takes a frame. What stays at the identity is not measured, but what all poses are to, or out of view.
    pub fn take(&mut self, batch: &Batch) {
        for told in &batch.poses {
            self.now = self.now.max(told.arrival_time);
            let measured = told.tracker_from_tool.filter(|pose| *pose != Rigid::IDENTITY);
            let (Some(pose), now) = (measured, told.arrival_time) else { continue };
            let new = Still { pose, since: now, until: now };
            match self.tools.get_mut(&told.name) {
                Some(still) if still.pose == pose => still.until = now,
                Some(still) => *still = new,
                None => {
                    if self.tools.len() < MOST {
                        self.tools.insert(told.name.clone(), new);
                    }
                }
            }
        }
    }

    /// That a tool does not move at all, where it does not; by the name that is sent.
    pub fn of(&self, name: &str) -> Option<String> {
        let still = self.tools.get(name)?;
        let time = still.until - still.since;
        // One that is not seen any more is told as that.
        (time > STILL_S && self.now - still.until < STILL_S).then(|| {
            format!("not moved to the last digit for {time:.0} s: measured poses tremble, so it is frozen, or made up")
        })
    }

    /// The same of those of some tools that do not.
    pub fn words(&self, wanted: &[&str]) -> Option<String> {
        let names = self.tools.keys().filter(|name| wanted.iter().any(|w| is_tool(name, w)));
        let still: Vec<String> = names.filter_map(|name| Some(format!("'{name}' has {}", self.of(name)?))).collect();
        (!still.is_empty()).then(|| still.join("; "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Vector;
    use monro_wire::TimedPose;

    #[test]
    fn a_server_that_hangs_was_taken_for_a_hand_that_rests() {
        let mut stillness = Stillness::default();
        let mut tell = |time: f64, tremble: f64| {
            let at = |x: f64| Rigid::from_quaternion([1.0, 0.0, 0.0, 0.0], Vector::new(x, 0.0, 0.0)).expect("pose");
            let pose = |name, x| TimedPose::new(name, None, time, Ok((at(x), None)));
            let poses = vec![pose("CatheterToTracker", 5.0), pose("Reference", 7.0 + tremble)];
            stillness.take(&Batch { poses, ..Batch::default() });
            stillness.words(&["Catheter", "Reference"])
        };
        assert!((0..60).all(|i| tell(f64::from(i) / 60.0, f64::from(i % 3) * 1e-3).is_none()));
        let words = tell(3.2, 0.0).expect("still");
        assert!(words.contains("'CatheterToTracker' has not moved to the last digit for 3 s"), "{words}");
        let words = (0..90).filter_map(|i| tell(3.2 + f64::from(i) / 60.0, 0.0)).last().expect("still");
        assert!(words.contains("'CatheterToTracker' has") && words.contains("; 'Reference' has"), "{words}");
    }

    /// A reference that all poses are to stays at the identity: it raised the alarm from the second second on, and hid the
    /// catheter's.
    #[test]
    fn what_all_poses_are_to_is_not_frozen() {
        let mut stillness = Stillness::default();
        for i in 0..200 {
            let time = f64::from(i) / 60.0;
            let poses = vec![TimedPose::new("Reference", None, time, Ok((Rigid::IDENTITY, None)))];
            stillness.take(&Batch { poses, ..Batch::default() });
        }
        assert_eq!(stillness.words(&["Catheter", "Reference"]), None);
    }
}
