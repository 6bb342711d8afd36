//! A tool that goes to and fro between two places faster than anything moves: two devices send it under one name, each in messages of
//! its own, or its markers are taken for one another.

use monro_geometry::{Point, Tracker};
use monro_wire::TimedPose;
use std::collections::{BTreeMap, VecDeque};

/// Places that are less apart than this are one, mm.
const APART_MM: f64 = 5.0;
/// Who goes back comes as near as this share of the way to where it was: what is shaken by hand turns round elsewhere.
const BACK: f64 = 0.2;
/// Poses that are looked back on, and how many of these go back from one place to the other.
const LAST: usize = 16;
const MOST: usize = 8;
/// After a silence of this length all begins anew, s.
const SILENCE_S: f64 = 1.0;
/// Tools that are remembered at most.
const MOST_TOOLS: usize = 256;

/// Where each tool, by the name that is sent, was of late.
#[derive(Debug, Clone, Default)]
pub(crate) struct ToAndFro(BTreeMap<String, Course>);

#[derive(Debug, Clone)]
struct Course {
    here: Point<Tracker>,
    /// Where it was before it last leapt.
    there: Option<Point<Tracker>>,
    at: f64,
    /// Of the last poses, whether each went back.
    back: VecDeque<bool>,
}

impl ToAndFro {
    /// Takes a pose; how far apart the places are (mm) between which its tool goes, if it does.
    pub(crate) fn take(&mut self, pose: &TimedPose) -> Option<f64> {
        let place = Point::ORIGIN + pose.tracker_from_tool?.translation();
        if self.0.len() >= MOST_TOOLS && !self.0.contains_key(&pose.name) {
            return None;
        }
        let begin = || Course { here: place, there: None, at: pose.arrival_time, back: VecDeque::new() };
        let course = self.0.entry(pose.name.clone()).or_insert_with(begin);
        if pose.arrival_time - course.at > SILENCE_S {
            *course = begin();
        }
        course.take(place, pose.arrival_time)
    }
}

impl Course {
    fn take(&mut self, place: Point<Tracker>, at: f64) -> Option<f64> {
        let leap = place.distance(self.here);
        let goes_back = leap > APART_MM && self.there.is_some_and(|there| place.distance(there) < BACK * leap);
        if leap > APART_MM {
            self.there = Some(self.here);
        }
        (self.here, self.at) = (place, at);
        self.back.push_back(goes_back);
        if self.back.len() > LAST {
            self.back.pop_front();
        }
        let often = self.back.iter().filter(|b| **b).count() >= MOST;
        self.there.filter(|_| often).map(|there| self.here.distance(there))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_geometry::{Rigid, Vector};

    /// Whether it was told within a second at 60 Hz, by place over time.
    fn told(of: impl Fn(usize) -> f64) -> Option<f64> {
        let mut all = ToAndFro::default();
        let pose = |i: usize| {
            let at = Rigid::from_quaternion([1.0, 0.0, 0.0, 0.0], Vector::new(of(i), 2.0, 3.0)).expect("pose");
            TimedPose::new("Catheter", None, i as f64 / 60.0, Ok((at, None)))
        };
        (0..60).filter_map(|i| all.take(&pose(i))).last()
    }

    #[test]
    fn two_sources_of_one_name_in_turn_are_told_however_often_each_sends() {
        let drift = |i: usize| 0.5 * i as f64;
        for every in [2, 3, 4] {
            let apart = told(|i| drift(i) + if i % every == 0 { 60.0 } else { 0.0 }).expect("told");
            assert!((apart - 60.0).abs() < 2.0, "{every}: {apart}");
        }
        assert!(told(|i| if i % 2 == 0 { 7.0 } else { 0.0 }).is_some());
    }

    #[test]
    fn a_tool_that_is_moved_shaken_or_put_elsewhere_is_no_two() {
        assert_eq!(told(|i| 15.0 * i as f64), None);
        assert_eq!(told(|i| if i < 30 { 0.0 } else { 200.0 }), None);
        assert_eq!(told(|i| 0.4 * (i % 7) as f64), None);
        for (hz, mm) in [(2.0, 150.0), (3.3, 80.0), (5.0, 40.0), (7.1, 25.0), (9.0, 15.0)] {
            let shaken = |i: usize| mm * (core::f64::consts::TAU * hz * i as f64 / 60.0 + 0.3).sin();
            assert_eq!(told(shaken), None, "{hz} Hz");
        }
    }
}
