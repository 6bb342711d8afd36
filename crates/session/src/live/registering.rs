//! Registering the patient: landmarks are touched, solved for, accepted, and touched again.
//!
//! A touch is the mean of the tip's places while it rests. Positions are in the frame of the tracked reference body, so
//! that the patient may be moved between two touches as long as the reference goes along.

use super::Registration;
use monro_geometry::{Patient, Point, Rigid, Tool, Vector};
use monro_guidance::Covariance;
use monro_guidance::registration::{
    Ambiguity, Contradiction, Landmark, LandmarkRegistration, Recheck, RegistrationError, recheck, register_landmarks,
};
use thiserror::Error;

/// What a hand adds to each touch, mm per axis: as in the simulated trials of `monro_guidance::simulation`.
const HAND_MM: f64 = 1.0;
/// Farthest that they stray from their mean, root mean square, mm: a tip that slides is not resting.
const MOST_SPREAD_MM: f64 = 1.0;
/// How far from the target a landmark can be, mm: no head is larger.
const FARTHEST_MARK_MM: f64 = 300.0;
/// Landmarks at most.
const MOST_MARKS: usize = 32;

/// Why something was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum TouchError {
    /// No such landmark.
    #[error("there is no landmark \"{0}\"")]
    Unknown(String),
    /// The name is taken, empty or too long, the place is not on this head, or there are too many.
    #[error(
        "a landmark needs a place within {FARTHEST_MARK_MM} mm of the target and a name of its own of at most 40 letters; {MOST_MARKS} landmarks at most"
    )]
    BadMark,
    /// A landmark of the case was to be removed.
    #[error("\"{0}\" belongs to the case; forget its touch instead")]
    OfTheCase(String),
    /// The tracker saw the tip too seldom.
    #[error(
        "the tip was seen {found} times, {needed} are needed: hold it still where the tracker sees it and the reference"
    )]
    TooFew {
        /// Poses taken.
        found: usize,
        /// Poses needed.
        needed: usize,
    },
    /// The tip moved.
    #[error("the tip strayed by {found:.1} mm, {allowed:.1} mm are allowed: hold it still")]
    Unsteady {
        /// Root mean square distance from the mean, mm.
        found: f64,
        /// Allowed, mm.
        allowed: f64,
    },
    /// What the place of the tip was told by changed while it was watched.
    #[error("the reference or the calibration changed while the tip was watched: touch the landmark again")]
    Voided,
    /// What was touched was touched before the reference moved.
    #[error(
        "the reference has moved since {0} touched: touch again what was; if nothing has moved on the patient, a check of one shows it"
    )]
    Moved(String),
    /// There is no tip to watch.
    #[error("the catheter is not calibrated: nothing tells where its tip is; calibrate it first")]
    NotCalibrated,
    /// Nothing to check against.
    #[error("there is no registration to check: touch three landmarks and accept")]
    NotRegistered,
    /// The registration fits as well with two names exchanged, and a landmark was to be checked that it was made of, or that fits
    /// either way.
    #[error("a check at \"{name}\" proves nothing: {ambiguity}")]
    SameMistake {
        /// The landmark.
        name: String,
        /// What may be exchanged.
        ambiguity: Box<Ambiguity<Patient, Tool>>,
    },
    /// The landmarks touched contradict each other.
    #[error("{0}")]
    Contradiction(Box<Contradiction>),
    /// The landmarks touched make no registration.
    #[error(transparent)]
    Registration(#[from] RegistrationError),
}

/// A landmark and what was touched of it.
#[derive(Debug, Clone, PartialEq)]
pub struct TouchMark {
    /// Its name.
    pub name: String,
    /// Where it is in the image.
    pub marked: Point<Patient>,
    /// Whether somebody added it in this session.
    pub added: bool,
    /// Where it was touched.
    pub touched: Option<Touch>,
    /// After how many alarms of the reference.
    alarms: u32,
}

/// A tip that rested somewhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// Mean place in the frame of the reference body, mm.
    pub at: Point<Tool>,
    /// Root mean square distance of single poses from it, mm.
    pub spread_mm: f64,
    /// Poses.
    pub samples: usize,
}

impl Touch {
    /// Poses that it is made of at least.
    pub const LEAST_SAMPLES: usize = 10;

    /// From the places of the tip while it rested.
    ///
    /// # Errors
    /// Too few of them, or too far apart.
    pub fn new(samples: &[Point<Tool>]) -> Result<Self, TouchError> {
        let found = samples.len();
        if found < Self::LEAST_SAMPLES {
            return Err(TouchError::TooFew { found, needed: Self::LEAST_SAMPLES });
        }
        let sum = samples.iter().fold(Vector::ZERO, |s, p| s + (*p - Point::ORIGIN));
        let at = Point::ORIGIN + sum / found as f64;
        let spread_mm = (samples.iter().map(|p| p.distance(at).powi(2)).sum::<f64>() / found as f64).sqrt();
        if spread_mm.is_nan() || spread_mm > MOST_SPREAD_MM {
            return Err(TouchError::Unsteady { found: spread_mm, allowed: MOST_SPREAD_MM });
        }
        Ok(Self { at, spread_mm, samples: found })
    }

    /// Hand and tracker together. The tracker's error hardly changes while the tip rests: its spread is not averaged out.
    fn noise<F>(&self) -> Covariance<F> {
        Covariance::isotropic(HAND_MM).plus(&Covariance::isotropic(self.spread_mm / 3f64.sqrt()))
    }
}

/// The landmarks of one session.
#[derive(Debug, Clone)]
pub struct Registering {
    marks: Vec<TouchMark>,
    target: Point<Patient>,
    accepted: Option<LandmarkRegistration<Patient, Tool>>,
    /// How else what was accepted may be named, until a check elsewhere has held.
    ambiguities: Vec<Ambiguity<Patient, Tool>>,
    round: u64,
}

impl Registering {
    /// With the landmarks of the case that can be touched; the predicted error is that at `target`.
    pub fn new(landmarks: impl IntoIterator<Item = (String, Point<Patient>)>, target: Point<Patient>) -> Self {
        let mark = |(name, marked)| TouchMark { name, marked, added: false, touched: None, alarms: 0 };
        Self {
            marks: landmarks.into_iter().map(mark).collect(),
            target,
            accepted: None,
            ambiguities: Vec::new(),
            round: 0,
        }
    }

    /// All landmarks.
    pub fn marks(&self) -> &[TouchMark] {
        &self.marks
    }

    fn index(&self, name: &str) -> Result<usize, TouchError> {
        self.marks.iter().position(|m| m.name == name).ok_or_else(|| TouchError::Unknown(name.to_owned()))
    }

    /// Adds a landmark that can be seen in the image and found on the patient.
    ///
    /// # Errors
    /// [`TouchError::BadMark`].
    pub fn mark(&mut self, name: &str, marked: Point<Patient>) -> Result<(), TouchError> {
        let (name, full) = (name.trim(), self.marks.len() >= MOST_MARKS);
        let on_head = marked.distance(self.target) <= FARTHEST_MARK_MM;
        if full || name.is_empty() || name.chars().count() > 40 || !on_head || self.index(name).is_ok() {
            return Err(TouchError::BadMark);
        }
        self.marks.push(TouchMark { name: name.to_owned(), marked, added: true, touched: None, alarms: 0 });
        Ok(())
    }

    /// Removes a landmark that was added.
    ///
    /// # Errors
    /// No such landmark, or one of the case.
    pub fn unmark(&mut self, name: &str) -> Result<(), TouchError> {
        let index = self.index(name)?;
        if !self.marks[index].added {
            return Err(TouchError::OfTheCase(name.to_owned()));
        }
        self.marks.remove(index);
        Ok(())
    }

    /// Takes the touch of a landmark, after so many alarms of the reference, in place of an earlier one.
    ///
    /// # Errors
    /// No such landmark.
    pub fn touch(&mut self, name: &str, touch: Touch, alarms: u32) -> Result<(), TouchError> {
        let index = self.index(name)?;
        (self.marks[index].touched, self.marks[index].alarms) = (Some(touch), alarms);
        Ok(())
    }

    /// Forgets the touch of a landmark.
    ///
    /// # Errors
    /// No such landmark.
    pub fn forget(&mut self, name: &str) -> Result<(), TouchError> {
        let index = self.index(name)?;
        self.marks[index].touched = None;
        Ok(())
    }

    /// The registration by the landmarks touched so far.
    ///
    /// # Errors
    /// Fewer than three, or on a line.
    pub fn solve(&self) -> Result<LandmarkRegistration<Patient, Tool>, RegistrationError> {
        register_landmarks(&self.touched())
    }

    /// Why a solution must not be accepted, if so: the landmarks contradict each other.
    pub fn contradiction(&self, solved: &LandmarkRegistration<Patient, Tool>) -> Option<Contradiction> {
        solved.contradiction(&self.touched())
    }

    /// How else the landmarks of a solution may be named; what fits best comes first.
    pub fn ambiguities(&self, solved: &LandmarkRegistration<Patient, Tool>) -> Vec<Ambiguity<Patient, Tool>> {
        solved.ambiguities(&self.touched(), self.target)
    }

    fn touched(&self) -> Vec<Landmark<Patient, Tool>> {
        let landmark = |m: &TouchMark| {
            let touch = m.touched?;
            Some(Landmark { name: m.name.clone(), touched: touch.at, marked: m.marked, noise: touch.noise() })
        };
        self.marks.iter().filter_map(landmark).collect()
    }

    /// Predicted error of a registration at the target, root mean square, mm.
    pub fn predicted_tre_mm(&self, registration: &LandmarkRegistration<Patient, Tool>) -> f64 {
        registration.tre(self.target).rms()
    }

    /// Forgets all touches, and what was accepted by them: the reference, or the tip, is not where it was.
    pub fn forget_all(&mut self) {
        self.marks.iter_mut().for_each(|m| m.touched = None);
        (self.accepted, self.ambiguities) = (None, Vec::new());
        self.round += 1;
    }

    /// How often all was forgotten: what was watched in an earlier round is void.
    pub const fn round(&self) -> u64 {
        self.round
    }

    /// Takes the present solution as the registration whose error at a landmark is known. While an `alarm` of the reference is
    /// raised what was touched before it is void.
    ///
    /// # Errors
    /// As [`Registering::solve`], when the landmarks contradict each other, and when some were touched before the alarm.
    pub fn accept(&mut self, alarm: Option<u32>) -> Result<Registration, TouchError> {
        self.after(alarm)?;
        let solved = self.solve()?;
        if let Some(contradiction) = self.contradiction(&solved) {
            return Err(TouchError::Contradiction(Box::new(contradiction)));
        }
        let predicted_tre_mm = Some(self.predicted_tre_mm(&solved));
        let registration = Registration { patient_from_reference: solved.to_from, predicted_tre_mm };
        self.ambiguities = self.ambiguities(&solved);
        self.accepted = Some(solved);
        Ok(registration)
    }

    /// Refuses touches from before an alarm.
    fn after(&self, alarm: Option<u32>) -> Result<(), TouchError> {
        let before = |m: &&TouchMark| m.touched.is_some() && alarm.is_some_and(|alarm| m.alarms < alarm);
        let names: Vec<String> = self.marks.iter().filter(before).map(|m| format!("\"{}\"", m.name)).collect();
        match names.len() {
            0 => Ok(()),
            1 => Err(TouchError::Moved(format!("{} was", names[0]))),
            _ => Err(TouchError::Moved(format!("{} were", names.join(", ")))),
        }
    }

    /// Compares a new touch of a landmark with the registration that is in use, wherever that came from. The error expected of
    /// one that was not accepted here is what it says of the target, none where it says nothing.
    ///
    /// # Errors
    /// No such landmark, no registration, or one in which names may be exchanged and a landmark that was touched for it (that
    /// would be the same mistake once more) or that fits either way. After a check elsewhere has held, any will do.
    pub fn check(&mut self, name: &str, touch: &Touch, used: Option<&Registration>) -> Result<Recheck, TouchError> {
        let mark = &self.marks[self.index(name)?];
        let used = used.ok_or(TouchError::NotRegistered)?;
        let accepted = self.accepted.as_ref().filter(|a| is_same(&a.to_from, &used.patient_from_reference));
        let said = || Covariance::isotropic(used.predicted_tre_mm.unwrap_or(0.0) / 3f64.sqrt());
        let tre = accepted.map_or_else(said, |a| a.tre(mark.marked));
        let found = recheck(mark.marked, used.patient_from_reference.point(touch.at), &tre, &touch.noise());
        let touched = accepted.is_some_and(|a| a.residuals.iter().any(|r| r.name == name));
        let fits = |a: &&Ambiguity<Patient, Tool>| touched || a.holds_too(touch.at, mark.marked, &found);
        if let Some(ambiguity) = self.ambiguities.iter().filter(|_| accepted.is_some()).find(fits) {
            return Err(TouchError::SameMistake { name: name.to_owned(), ambiguity: Box::new(ambiguity.clone()) });
        }
        if found.holds() && accepted.is_some() {
            self.ambiguities.clear();
        }
        Ok(found)
    }
}

/// Whether two poses are the same but for rounding: on the way a pose is written and read.
fn is_same(a: &Rigid<Patient, Tool>, b: &Rigid<Patient, Tool>) -> bool {
    let corners = [[0.0; 3], [100.0, 0.0, 0.0], [0.0, 100.0, 0.0], [0.0, 0.0, 100.0]].map(Point::from_array);
    corners.into_iter().all(|p| a.point(p).distance(b.point(p)) < 1e-6)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLACES: [(&str, [f64; 3]); 4] = [
        ("nasion", [0.0, -95.0, 0.0]),
        ("left ear", [75.0, 0.0, -5.0]),
        ("right ear", [-75.0, 2.0, -5.0]),
        ("vertex", [0.0, 5.0, 100.0]),
    ];

    fn truth() -> Rigid<Patient, Tool> {
        Rigid::from_axis_angle(Vector::new(1.0, 2.0, -0.5), 1.1, Vector::new(30.0, -50.0, 80.0)).expect("axis")
    }

    fn registering() -> Registering {
        let marks = PLACES.map(|(n, p)| (n.to_owned(), Point::from_array(p)));
        Registering::new(marks, Point::new(5.0, -10.0, 40.0))
    }

    /// The tip at a patient point, shaking by `shake` mm along x.
    fn resting(p: Point<Patient>, shake: f64) -> Vec<Point<Tool>> {
        let at = truth().inverse().point(p);
        (0..20).map(|i| at + Vector::new(if i % 2 == 0 { shake } else { -shake }, 0.0, 0.0)).collect()
    }

    fn touched() -> Registering {
        let mut r = registering();
        for (name, p) in PLACES {
            let touch = Touch::new(&resting(Point::from_array(p), 0.2)).expect("resting");
            r.touch(name, touch, 0).expect("known");
        }
        r
    }

    #[test]
    fn exact_touches_register_exactly_and_predict_the_noise_of_the_hand() {
        let mut r = touched();
        let got = r.accept(None).expect("registered");
        let target = Point::new(5.0, -10.0, 40.0);
        assert!(got.patient_from_reference.point(truth().inverse().point(target)).distance(target) < 1e-9);
        let tre = got.predicted_tre_mm.expect("predicted");
        assert!((0.5..1.5).contains(&tre), "{tre}");
    }

    #[test]
    fn a_check_holds_where_the_landmark_is_and_fails_where_it_is_not() {
        let mut r = touched();
        let nasion = Point::from_array(PLACES[0].1);
        let at = |p| Touch::new(&resting(p, 0.0)).expect("resting");
        assert_eq!(r.check("nasion", &at(nasion), None), Err(TouchError::NotRegistered));
        let used = r.accept(None).expect("registered");
        assert!(r.check("nasion", &at(nasion), Some(&used)).expect("check").holds());
        let moved = r.check("nasion", &at(nasion + Vector::new(0.0, 0.0, 6.0)), Some(&used)).expect("check");
        assert!(!moved.holds() && (moved.distance - 6.0).abs() < 1e-9, "{moved:?}");
    }

    #[test]
    fn a_check_compared_with_the_registration_accepted_last_though_another_was_in_use() {
        let mut r = touched();
        let accepted = r.accept(None).expect("registered");
        let nasion = Touch::new(&resting(Point::from_array(PLACES[0].1), 0.0)).expect("resting");
        let shift = Rigid::from_axis_angle(Vector::new(0.0, 0.0, 1.0), 0.0, Vector::new(9.0, 0.0, 0.0)).expect("axis");
        let patient_from_reference = shift.after(&accepted.patient_from_reference);
        let other = Registration { patient_from_reference, predicted_tre_mm: Some(0.3) };
        let found = r.check("nasion", &nasion, Some(&other)).expect("check");
        assert!(!found.holds() && (found.distance - 9.0).abs() < 1e-6, "{found:?}");
        // One that never was accepted here is checked as well.
        let found = registering().check("nasion", &nasion, Some(&accepted)).expect("check");
        assert!(found.holds() && found.distance < 1e-6 && found.limit < 5.0, "{found:?}");
    }

    #[test]
    fn the_same_two_exchanged_once_more_passed_for_a_check() {
        // Both ears and the nasion: left for right, the head is taken for one that lies on its face.
        let mut r = registering();
        let at = |i: usize| Touch::new(&resting(Point::from_array(PLACES[i].1), 0.2)).expect("resting");
        for (name, place) in [("nasion", 0), ("left ear", 2), ("right ear", 1)] {
            r.touch(name, at(place), 0).expect("known");
        }
        let used = r.accept(None).expect("it fits");
        let again = r.check("left ear", &at(2), Some(&used)).expect_err("the same mistake");
        assert!(again.to_string().contains("exchanged"), "{again}");
        let vertex = r.check("vertex", &at(3), Some(&used)).expect("another place");
        assert!(!vertex.holds() && vertex.distance > 100.0, "{vertex:?}");
        // At the back of the head, where the head is turned about, both fit.
        let back = Point::new(0.0, 95.0, -9.0);
        r.mark("inion", back).expect("new");
        let touch = Touch::new(&resting(back, 0.0)).expect("resting");
        let both = r.check("inion", &touch, Some(&used));
        assert!(matches!(both, Err(TouchError::SameMistake { .. })), "{both:?}");
        // Rightly named, one check elsewhere is enough for all that come.
        (1..3).for_each(|i| r.touch(PLACES[i].0, at(i), 0).expect("known"));
        let used = r.accept(None).expect("registered");
        assert!(matches!(r.check("nasion", &at(0), Some(&used)), Err(TouchError::SameMistake { .. })));
        assert!(r.check("vertex", &at(3), Some(&used)).expect("another place").holds());
        assert!(r.check("nasion", &at(0), Some(&used)).expect("known to be right").holds());
    }

    #[test]
    fn touches_from_before_the_reference_moved_do_not_register_again() {
        let mut r = touched();
        r.accept(None).expect("registered");
        r.forget_all();
        assert!(r.marks().iter().all(|m| m.touched.is_none()));
        assert!(matches!(r.accept(None), Err(TouchError::Registration(RegistrationError::TooFew { found: 0, .. }))));
    }

    /// One landmark touched anew lowered the alarm, and the others were from before the reference moved: a target 4.8 mm off.
    #[test]
    fn one_touch_after_an_alarm_is_not_enough_for_all() {
        let mut r = touched();
        assert!(r.accept(None).is_ok());
        let refused = r.accept(Some(1)).expect_err("all are from before").to_string();
        assert!(PLACES.iter().take(3).all(|(n, _)| refused.contains(n)), "{refused}");
        let touch = |i: usize| Touch::new(&resting(Point::from_array(PLACES[i].1), 0.0)).expect("resting");
        r.touch(PLACES[0].0, touch(0), 1).expect("known");
        let refused = r.accept(Some(1)).expect_err("others are from before").to_string();
        assert!(!refused.contains(PLACES[0].0) && refused.contains(PLACES[1].0), "{refused}");
        r.forget(PLACES[0].0).expect("known");
        assert!(r.accept(Some(1)).is_err(), "what was forgotten again counts for nothing");
        (0..4).for_each(|i| r.touch(PLACES[i].0, touch(i), 1).expect("known"));
        assert!(r.accept(Some(1)).is_ok() && r.accept(Some(2)).is_err());
        // A check has shown that the reference is where it was.
        assert!(r.accept(None).is_ok());
    }

    #[test]
    fn a_sliding_tip_and_a_hidden_one_are_refused() {
        let slid = Touch::new(&resting(Point::ORIGIN, 1.5));
        assert!(matches!(slid, Err(TouchError::Unsteady { found, .. }) if (found - 1.5).abs() < 1e-9));
        assert_eq!(Touch::new(&[Point::ORIGIN; 9]), Err(TouchError::TooFew { found: 9, needed: 10 }));
    }

    #[test]
    fn own_landmarks_come_and_go_and_those_of_the_case_stay() {
        let mut r = registering();
        assert_eq!(r.mark("nasion", Point::ORIGIN), Err(TouchError::BadMark));
        assert_eq!(r.mark(" ", Point::ORIGIN), Err(TouchError::BadMark));
        for nowhere in [1e30, -400.0, f64::NAN] {
            assert_eq!(r.mark("far", Point::new(nowhere, 0.0, 0.0)), Err(TouchError::BadMark), "{nowhere}");
        }
        r.mark("scar", Point::ORIGIN).expect("new");
        assert!(r.marks()[4].added);
        r.unmark("scar").expect("own");
        assert_eq!(r.unmark("scar"), Err(TouchError::Unknown("scar".into())));
        assert_eq!(r.unmark("nasion"), Err(TouchError::OfTheCase("nasion".into())));
    }

    #[test]
    fn a_forgotten_touch_does_not_count() {
        let mut r = touched();
        r.forget("nasion").expect("known");
        assert_eq!(r.solve().expect("three").residuals.len(), 3);
        r.forget("vertex").expect("known");
        assert_eq!(r.solve().err(), Some(RegistrationError::TooFew { found: 2, needed: 3 }));
    }
}
