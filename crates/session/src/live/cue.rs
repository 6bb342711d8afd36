//! What a step of the soft body follows: the needle, and what else the session knows that moves tissue.

use super::Session;
use crate::Loads;
use monro_guidance::NeedlePose;

/// What a step of the soft body follows.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Cue {
    /// The catheter in the patient and when it was seen, s; `None` where it is not known.
    pub needle: Option<(NeedlePose, f64)>,
    /// What is done to the patient's fluid, and gravity.
    pub loads: Loads,
    /// How the needle follows from the poses: counts what changes that. What the needle seems to do from one to the next,
    /// nothing has done.
    pub placement: u32,
    /// Counts how often the catheter or the reference was seen again after it was lost: between two of these nobody saw its way.
    pub sighting: u32,
}

impl Session {
    /// What the soft body is to follow at `now`.
    pub fn cue(&self, now: f64) -> Cue {
        Cue {
            needle: self.needle_and_time(now),
            loads: self.loads(),
            placement: self.placement(),
            sighting: self.sighting(),
        }
    }
}
