//! Why there is no data.

use crate::igtl::is_tool;
use crate::late::DELAYED;
use crate::{Health, Rivals, Source, Stillness, TrackingError};
use monro_guidance::clock::{Expiry, age};
use monro_wire::{Missing, Quality, TimedPose};
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
    let (mut rivals, mut stillness) = (Rivals::default(), Stillness::default());
    while begun.elapsed() < listen {
        let Some(mut batch) = source.next(Duration::from_millis(50))? else { break };
        stillness.take(&batch);
        rivals.settle(&mut batch);
        let now = source.now();
        for pose in batch.poses {
            let age = age(now, (pose.arrival_time, pose.lag), pose.source_time, batch.clock.as_ref());
            tools.entry(pose.name.clone()).or_default().take(&pose, age);
        }
    }
    // Of one tool: a source may send each in a message, and so in a batch, of its own.
    let frames = tools.values().map(|t| t.frames).max().unwrap_or(0);
    let mut facts = source.facts();
    facts.push(format!("{:.1} frames a second", frames as f64 / begun.elapsed().as_secs_f64().max(1e-3)));
    let still = |name: &str| stillness.of(name).map_or_else(String::new, |still| format!("; {still}"));
    facts.extend(tools.iter().map(|(name, tool)| format!("{name}: {tool}{}", still(name))));
    let ill = rivals.words(wanted).map(Health::ill).or_else(|| unseen(&tools, wanted)).or_else(|| old(&tools, wanted));
    // The source knows best why a tool does not come.
    let told = with_poses(source.diagnosis(wanted), &tools);
    let ill = ill.or_else(|| absent(&tools, wanted).filter(|_| told.well));
    let health = ill.unwrap_or(told);
    Ok(Findings { facts, health })
}

/// What was told of a tool.
#[derive(Debug, Default)]
struct Seen {
    frames: u64,
    seen: u64,
    missing: Option<Missing>,
    /// Sum of their ages, s.
    ages: f64,
}

impl Seen {
    fn take(&mut self, pose: &TimedPose, age: f64) {
        self.frames += 1;
        match pose.quality {
            Quality::Tracked { .. } => {
                self.seen += 1;
                self.ages += age;
            }
            Quality::Missing(why) => self.missing = Some(why),
        }
    }

    /// Mean age of its poses, s.
    fn age(&self) -> f64 {
        self.ages / self.seen.max(1) as f64
    }
}

impl fmt::Display for Seen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "seen in {:.0} % of its frames", 100.0 * self.seen as f64 / self.frames.max(1) as f64)?;
        self.missing.map_or(Ok(()), |why| write!(f, " (else: {})", why.name()))
    }
}

/// That poses come as they should is not enough when there are none.
fn with_poses(health: Health, tools: &BTreeMap<String, Seen>) -> Health {
    if health.well && tools.is_empty() {
        return Health::ill(format!(
            "{}, but no tool is among what is sent: are there rigid bodies or tools, and is their streaming switched on?",
            health.words
        ));
    }
    health
}

/// A tool that is wanted and of which nothing came, as others did.
fn absent(tools: &BTreeMap<String, Seen>, wanted: &[&str]) -> Option<Health> {
    let name = wanted.iter().find(|w| !tools.keys().any(|name| is_tool(name, w)))?;
    let others: Vec<&str> = tools.keys().map(String::as_str).collect();
    Some(Health::ill(format!("no pose of '{name}' came, but of {}: is it the name that is sent?", others.join(", "))))
}

/// A tool that is wanted, or any when none is, whose poses are old when they arrive.
fn old(tools: &BTreeMap<String, Seen>, wanted: &[&str]) -> Option<Health> {
    let asked = |name: &String| wanted.is_empty() || wanted.iter().any(|w| is_tool(name, w));
    let (name, tool) = tools.iter().find(|(name, t)| asked(name) && t.age() > Expiry::default().lost)?;
    Some(Health::ill(format!(
        "'{name}' is {:.1} s old when it arrives, by the server's own clock, and counts as lost: {DELAYED}",
        tool.age()
    )))
}

/// A tool that is wanted, or, when none is, every tool, that was told of and never seen.
fn unseen(tools: &BTreeMap<String, Seen>, wanted: &[&str]) -> Option<Health> {
    let dark: Vec<_> = tools.iter().filter(|(_, t)| t.seen == 0).collect();
    let wanted_dark = dark.iter().find(|(name, _)| wanted.iter().any(|w| is_tool(name, w)));
    let all_dark = dark.first().filter(|_| dark.len() == tools.len());
    let (name, tool) = wanted_dark.or(all_dark)?;
    let more = if wanted_dark.is_none() && tools.len() > 1 { ", nor were the others" } else { "" };
    Some(Health::ill(never_seen(name, tool.missing.unwrap_or(Missing::NotTracked), more)))
}

/// That a tool is told of but has never had a pose, why, and what to do; `more` goes between.
pub fn never_seen(name: &str, why: Missing, more: &str) -> String {
    format!("'{name}' is sent, but was never seen ({}){more}: {}", why.name(), advice(why))
}

/// What to do about poses that are missing.
pub(crate) const fn advice(why: Missing) -> &'static str {
    match why {
        Missing::NotRigid => {
            "what is sent is scaled, sheared, mirrored or not finite: let the server send rotation and translation alone, right-handed"
        }
        Missing::TooFar => "let the server send metres by NatNet, millimetres by OpenIGTLink",
        Missing::NoOrientation => "let the server send its orientation, too",
        Missing::Misfit => "define the rigid body anew; are markers bent, or taken for one another?",
        Missing::Ambiguous => "which of the two is the tool? Rename one",
        _ => "is it in the cameras' view?",
    }
}
