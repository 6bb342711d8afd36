//! Two sources of one tool: `CatheterToTracker` beside `Catheter`, rigid bodies that were copied. Which of them is the tool
//! cannot be told, so neither is.

use crate::to_and_fro::ToAndFro;
use crate::{Batch, tool_name};
use monro_wire::{Missing, Quality};
use std::collections::{BTreeMap, BTreeSet};

/// A source that was last seen so long ago is no rival any more, s.
const GONE_S: f64 = 1.0;

/// Under which names each tool comes.
#[derive(Debug, Clone, Default)]
pub struct Rivals {
    /// Of each tool: names as they are sent, and when each was last seen, s.
    seen: BTreeMap<String, BTreeMap<String, f64>>,
    /// Tools that came twice under one name in one frame, and when last, s.
    twice: BTreeMap<String, f64>,
    /// Tools that go to and fro between two places, how far apart these are (mm), and when that was last so, s.
    leaping: BTreeMap<String, (f64, f64)>,
    courses: ToAndFro,
}

impl Rivals {
    /// Takes a frame, and the poses off all tools in it that have another source.
    pub fn settle(&mut self, batch: &mut Batch) {
        let Some(now) = batch.poses.iter().map(|p| p.arrival_time).reduce(f64::max) else { return };
        self.twice.retain(|_, at| now - *at < GONE_S);
        self.leaping.retain(|_, (_, at)| now - *at < GONE_S);
        self.seen.retain(|_, names| {
            names.retain(|_, at| now - *at < GONE_S);
            !names.is_empty()
        });
        let mut names = BTreeSet::new();
        for pose in batch.poses.iter().filter(|p| p.tracker_from_tool.is_some()) {
            let tool = tool_name(&pose.name).to_owned();
            if !names.insert(pose.name.clone()) {
                self.twice.insert(tool.clone(), now);
            }
            if let Some(apart) = self.courses.take(pose) {
                self.leaping.insert(tool.clone(), (apart, now));
            }
            self.seen.entry(tool).or_default().insert(pose.name.clone(), now);
        }
        for pose in &mut batch.poses {
            if self.is_contested(tool_name(&pose.name)) {
                (pose.tracker_from_tool, pose.quality) = (None, Quality::Missing(Missing::Ambiguous));
            }
        }
    }

    fn is_contested(&self, tool: &str) -> bool {
        self.twice.contains_key(tool)
            || self.leaping.contains_key(tool)
            || self.seen.get(tool).is_some_and(|names| names.len() > 1)
    }

    /// What is contested, in words; among tools that are wanted, or all if none are.
    pub fn words(&self, wanted: &[&str]) -> Option<String> {
        let tools = self.seen.keys().map(String::as_str);
        let tool = tools
            .filter(|t| wanted.is_empty() || wanted.iter().any(|w| tool_name(w) == *t))
            .find(|t| self.is_contested(t))?;
        let names: Vec<String> = self.seen[tool].keys().map(|n| format!("'{n}'")).collect();
        let leap = self.leaping.get(tool).filter(|_| !self.twice.contains_key(tool));
        Some(match (names.len(), leap) {
            (1, Some((apart, _))) => format!(
                "{} goes to and fro between two places {apart:.0} mm apart: do two devices send it, or are its markers taken for \
                 one another?",
                names[0]
            ),
            (1, None) => format!("{} is sent twice in one frame: which of the two is the tool? Rename one", names[0]),
            _ => format!("{} are sent, both for the tool '{tool}': switch one off, or rename it", names.join(" and ")),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::{Rigid, Vector};
    use monro_wire::TimedPose;

    fn frame(time: f64, names: &[&str]) -> Batch {
        let at = Rigid::from_quaternion([1.0, 0.0, 0.0, 0.0], Vector::new(1.0, 2.0, 3.0)).expect("pose");
        let poses = names.iter().map(|n| TimedPose::new(*n, None, time, Ok((at, None)))).collect();
        Batch { poses, ..Batch::default() }
    }

    fn seen(rivals: &mut Rivals, time: f64, names: &[&str]) -> usize {
        let mut batch = frame(time, names);
        rivals.settle(&mut batch);
        batch.poses.iter().filter(|p| p.tracker_from_tool.is_some()).count()
    }

    #[test]
    fn two_sources_of_one_tool_were_mixed_in_silence() {
        let mut rivals = Rivals::default();
        assert_eq!(seen(&mut rivals, 1.0, &["CatheterToTracker", "Reference"]), 2);
        assert_eq!(rivals.words(&["Catheter"]), None);
        // Another one, in a frame of its own: from then on neither is believed.
        assert_eq!(seen(&mut rivals, 1.1, &["Catheter"]), 0);
        assert_eq!(seen(&mut rivals, 1.2, &["CatheterToTracker", "Reference"]), 1);
        let words = rivals.words(&["Catheter"]).expect("contested");
        assert!(words.contains("'Catheter' and 'CatheterToTracker'"), "{words}");
        // Until one has been gone for a while.
        assert_eq!(seen(&mut rivals, 2.15, &["CatheterToTracker", "Reference"]), 2);
        assert_eq!(rivals.words(&[]), None);
    }

    /// Two devices of PLUS with one name, each in messages of its own: guidance jumped between both.
    #[test]
    fn a_tool_that_two_devices_send_in_turn_was_live_at_both_places() {
        let mut rivals = Rivals::default();
        let mut at = |i: u32, x: f64| {
            let pose = Rigid::from_quaternion([1.0, 0.0, 0.0, 0.0], Vector::new(x, 2.0, 3.0)).expect("pose");
            let time = f64::from(i) / 60.0;
            let poses = vec![TimedPose::new("CatheterToTracker", None, time, Ok((pose, None)))];
            let mut batch = Batch { poses, ..Batch::default() };
            rivals.settle(&mut batch);
            (batch.poses[0].tracker_from_tool.is_some(), rivals.words(&["Catheter"]))
        };
        let (seen, words) = (0..30).map(|i| at(i, f64::from(i % 2) * 60.0)).last().expect("poses");
        assert!(!seen && words.as_ref().is_some_and(|w| w.contains("60 mm apart")), "{words:?}");
        // For as long as it goes on, and a second.
        assert!(!at(31, 0.0).0 && (32..120).map(|i| at(i, 0.0)).last() == Some((true, None)));
    }

    #[test]
    fn one_name_twice_in_a_frame_is_no_pose() {
        let mut rivals = Rivals::default();
        assert_eq!(seen(&mut rivals, 1.0, &["Catheter", "Catheter", "Reference"]), 1);
        assert!(rivals.words(&["Catheter"]).is_some_and(|w| w.contains("twice")));
        assert_eq!(rivals.words(&["Reference"]), None);
        assert_eq!(seen(&mut rivals, 1.1, &["Catheter"]), 0);
        assert_eq!(seen(&mut rivals, 2.2, &["Catheter"]), 1);
    }
}
