//! Why there is no data.

use crate::{Health, Source, TrackingError, tool_name};
use monro_wire::{Missing, Quality};
use std::collections::BTreeMap;
use std::fmt;
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
    let mut tools = BTreeMap::<String, Seen>::new();
    while begun.elapsed() < listen {
        let Some(batch) = source.next(Duration::from_millis(50))? else { break };
        for pose in batch.poses {
            let tool = tools.entry(pose.name).or_default();
            tool.frames += 1;
            match pose.quality {
                Quality::Tracked { .. } => tool.seen += 1,
                Quality::Missing(why) => tool.missing = Some(why),
            }
        }
    }
    // Of one tool: a source may send each in a message, and so in a batch, of its own.
    let frames = tools.values().map(|t| t.frames).max().unwrap_or(0);
    let mut facts = source.facts();
    facts.push(format!("{:.1} frames a second", frames as f64 / begun.elapsed().as_secs_f64().max(1e-3)));
    facts.extend(tools.iter().map(|(name, tool)| format!("{name}: {tool}")));
    Ok(Findings { facts, health: unseen(&tools, wanted).unwrap_or_else(|| source.diagnosis(wanted)) })
}

/// What was told of a tool.
#[derive(Debug, Default)]
struct Seen {
    frames: u64,
    seen: u64,
    missing: Option<Missing>,
}

impl fmt::Display for Seen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "seen in {:.0} % of its frames", 100.0 * self.seen as f64 / self.frames.max(1) as f64)?;
        self.missing.map_or(Ok(()), |why| write!(f, " (else: {})", why.name()))
    }
}

/// A tool that is wanted, or, when none is, every tool, that was told of and never seen.
fn unseen(tools: &BTreeMap<String, Seen>, wanted: &[&str]) -> Option<Health> {
    let dark: Vec<_> = tools.iter().filter(|(_, t)| t.seen == 0).collect();
    let wanted_dark = dark.iter().find(|(name, _)| wanted.iter().any(|w| name == w || tool_name(name) == *w));
    let all_dark = dark.first().filter(|_| dark.len() == tools.len());
    let (name, tool) = wanted_dark.or(all_dark)?;
    let more = if wanted_dark.is_none() && tools.len() > 1 { ", nor were the others" } else { "" };
    Some(Health::ill(never_seen(name, tool.missing.unwrap_or(Missing::NotTracked), more)))
}

/// That a tool is told of but has never had a pose, why, and what to do; `more` goes between.
pub fn never_seen(name: &str, why: Missing, more: &str) -> String {
    let advice = match why {
        Missing::NotRigid => {
            "what is sent is scaled, sheared, mirrored or not finite: let the server send rotation and translation alone, right-handed"
        }
        _ => "is it in the cameras' view?",
    };
    format!("'{name}' is sent, but was never seen ({}){more}: {advice}", why.name())
}
