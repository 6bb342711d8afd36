//! Why there is no data.

use crate::{Health, Source, TrackingError};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// What listening to a source has shown.
#[derive(Debug, Clone)]
pub struct Findings {
    /// A line a fact.
    pub facts: Vec<String>,
    /// What follows from them.
    pub health: Health,
}

/// Listens to a source for a while and says what it found.
///
/// # Errors
/// When the source cannot go on.
pub fn doctor(source: &mut dyn Source, wanted: &[&str], listen: Duration) -> Result<Findings, TrackingError> {
    let begun = Instant::now();
    let (mut frames, mut tracked) = (0u64, BTreeMap::<String, (u64, u64)>::new());
    while begun.elapsed() < listen {
        let Some(batch) = source.next(Duration::from_millis(50))? else { break };
        frames += u64::from(!batch.poses.is_empty());
        for pose in batch.poses {
            let entry = tracked.entry(pose.name).or_default();
            entry.0 += 1;
            entry.1 += u64::from(pose.tracker_from_tool.is_some());
        }
    }
    let mut facts = source.facts();
    facts.push(format!("{:.1} frames a second", frames as f64 / begun.elapsed().as_secs_f64().max(1e-3)));
    let share = |(all, seen): (u64, u64)| 100.0 * seen as f64 / all.max(1) as f64;
    facts.extend(tracked.into_iter().map(|(name, n)| format!("{name}: seen in {:.0} % of its frames", share(n))));
    Ok(Findings { facts, health: source.diagnosis(wanted) })
}
