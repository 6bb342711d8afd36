//! Tools that are sent in a way that is no pose: they look as if they were out of view.

use crate::doctor::advice;
use crate::{Batch, is_tool};
use monro_wire::{Missing, Quality};
use std::collections::BTreeMap;

/// Tools that are remembered at most.
const MOST: usize = 256;

/// Tools whose latest pose was refused for what was sent.
#[derive(Debug, Clone, Default)]
pub struct Unusable(BTreeMap<String, Missing>);

impl Unusable {
    /// Takes a frame.
    pub fn take(&mut self, batch: &Batch) {
        for pose in &batch.poses {
            match pose.quality {
                Quality::Missing(
                    why @ (Missing::NotRigid | Missing::NoOrientation | Missing::Misfit | Missing::TooFar),
                ) => {
                    if self.0.len() < MOST || self.0.contains_key(&pose.name) {
                        self.0.insert(pose.name.clone(), why);
                    }
                }
                _ => {
                    self.0.remove(&pose.name);
                }
            }
        }
    }

    /// What is wrong with a tool that is wanted, in words.
    pub fn words(&self, wanted: &[&str]) -> Option<String> {
        let (name, &why) = self.0.iter().find(|(name, _)| wanted.iter().any(|w| is_tool(name, w)))?;
        Some(format!("'{name}' is sent, but what is sent is no pose ({}): {}", why.name(), advice(why)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::{Rigid, Vector};
    use monro_wire::TimedPose;

    /// A live session said "receiving", and its user looked for what hid the markers.
    #[test]
    fn a_mirrored_catheter_was_said_to_be_out_of_view() {
        let good = Rigid::from_quaternion([1.0, 0.0, 0.0, 0.0], Vector::new(1.0, 2.0, 3.0)).expect("pose");
        let frame = |name: &str, pose| Batch { poses: vec![TimedPose::new(name, None, 1.0, pose)], ..Batch::default() };
        let mut unusable = Unusable::default();
        unusable.take(&frame("CatheterToTracker", Err(Missing::NotRigid)));
        unusable.take(&frame("ReferenceToTracker", Ok((good, None))));
        let words = unusable.words(&["Catheter", "Reference"]).expect("the catheter");
        assert!(words.contains("'CatheterToTracker'") && words.contains("mirrored"), "{words}");
        assert_eq!(unusable.words(&["Reference"]), None);
        for better in [Ok((good, None)), Err(Missing::NotTracked)] {
            unusable.take(&frame("CatheterToTracker", Err(Missing::NotRigid)));
            unusable.take(&frame("CatheterToTracker", better));
            assert_eq!(unusable.words(&["Catheter"]), None);
        }
    }
}
