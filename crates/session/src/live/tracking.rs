//! The tracking loop: poses in as they arrive, the latest of each tool out.

use monro_geometry::{Rigid, Tool, Tracker};
use std::collections::BTreeMap;

/// Tools that are remembered at most; of more, those seen last.
const MOST_TOOLS: usize = 256;

/// One tool, seen or missed by the tracker at one moment.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// Name of the tool.
    pub name: String,
    /// When it arrived, s on the session's clock.
    pub time_s: f64,
    /// Where the tool is; `None` when the tracker does not see it.
    pub tracker_from_tool: Option<Rigid<Tracker, Tool>>,
}

/// The latest pose of each tool. A tool that is reported as not seen keeps its last pose, which then grows old.
#[derive(Debug, Clone, Default)]
pub struct Tracking {
    latest: BTreeMap<String, (f64, Rigid<Tracker, Tool>)>,
}

impl Tracking {
    /// Takes an observation. One that is older than what is known (network disorder) or whose time is not finite is left
    /// out; returns whether something new is known.
    pub fn observe(&mut self, seen: &Observation) -> bool {
        let Some(pose) = seen.tracker_from_tool else { return false };
        let known = self.latest.get(&seen.name);
        if !seen.time_s.is_finite() || known.is_some_and(|(t, _)| seen.time_s < *t) {
            return false;
        }
        if known.is_none() && self.latest.len() >= MOST_TOOLS {
            self.forget_oldest();
        }
        self.latest.insert(seen.name.clone(), (seen.time_s, pose));
        true
    }

    /// Makes room: what is needed is seen all the time.
    fn forget_oldest(&mut self) {
        let oldest = self.latest.iter().min_by(|a, b| a.1.0.total_cmp(&b.1.0)).map(|(name, _)| name.clone());
        oldest.map(|name| self.latest.remove(&name));
    }

    /// When a tool was last seen (s), and where.
    pub fn latest(&self, name: &str) -> Option<(f64, Rigid<Tracker, Tool>)> {
        self.latest.get(name).copied()
    }

    /// Names of the tools seen so far, sorted.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.latest.keys().map(String::as_str)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::Vector;

    fn at(x: f64) -> Rigid<Tracker, Tool> {
        Rigid::from_quaternion([1.0, 0.0, 0.0, 0.0], Vector::new(x, 0.0, 0.0)).expect("pose")
    }

    fn seen(time_s: f64, x: Option<f64>) -> Observation {
        Observation { name: "Catheter".into(), time_s, tracker_from_tool: x.map(at) }
    }

    #[test]
    fn the_latest_wins_whatever_the_order_of_arrival() {
        let mut t = Tracking::default();
        assert!(t.observe(&seen(1.0, Some(1.0))));
        assert!(t.observe(&seen(3.0, Some(3.0))));
        assert!(!t.observe(&seen(2.0, Some(2.0))));
        assert_eq!(t.latest("Catheter"), Some((3.0, at(3.0))));
    }

    #[test]
    fn a_missed_tool_does_not_get_younger() {
        let mut t = Tracking::default();
        t.observe(&seen(1.0, Some(1.0)));
        assert!(!t.observe(&seen(2.0, None)));
        assert!(!t.observe(&seen(f64::NAN, Some(9.0))));
        assert_eq!(t.latest("Catheter").map(|(s, _)| s), Some(1.0));
    }

    #[test]
    fn a_flood_of_names_is_bounded() {
        let mut t = Tracking::default();
        for i in 0..1000 {
            t.observe(&Observation { name: format!("tool {i}"), time_s: 0.0, tracker_from_tool: Some(at(0.0)) });
        }
        assert_eq!(t.names().count(), MOST_TOOLS);
        // The catheter came after the last place was taken, and was never seen.
        assert!(t.observe(&seen(1.0, Some(1.0))) && t.latest("Catheter").is_some());
    }
}
