//! How far the procedure has come, as an explicit machine: every event in every phase has one defined outcome.

use core::fmt;
use thiserror::Error;

/// How far the procedure has come. Each phase contains what the ones before it have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Phase {
    /// Nothing is loaded.
    NoCase,
    /// A case is loaded.
    Case,
    /// The tip and axis of the catheter are known in its tracked body.
    Calibrated,
    /// The patient is registered to the tracked reference.
    Registered,
    /// A landmark touched again has confirmed the registration.
    Checked,
    /// Guidance is shown.
    Navigating,
}

/// What happens to a session.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// A case was loaded.
    CaseOpened,
    /// The case was put away.
    CaseClosed,
    /// The catheter was calibrated.
    Calibrated,
    /// The catheter was exchanged, or found bent: its calibration is void.
    ToolChanged,
    /// The patient was registered.
    Registered,
    /// The reference was bumped: the registration is void.
    ReferenceMoved,
    /// The tip rested at a landmark, wherever that lay.
    Touched,
    /// A landmark was touched again and lay where it should.
    CheckPassed,
    /// A landmark was touched again and lay elsewhere.
    CheckFailed,
    /// Guidance was asked for.
    Started,
    /// Guidance was ended.
    Stopped,
}

/// What must be done before an event makes sense.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ToFirst {
    /// Open a case.
    OpenCase,
    /// Close the open case.
    CloseCase,
    /// Calibrate the catheter.
    Calibrate,
    /// Register the patient.
    Register,
    /// Touch a landmark again.
    Check,
    /// End the navigation.
    Stop,
}

/// An event that does not fit the phase. The phase stays as it was.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("\"{event}\" is not possible in phase \"{phase}\"; first {first}")]
pub struct Refusal {
    /// The phase.
    pub phase: Phase,
    /// The event.
    pub event: Event,
    /// The way out.
    pub first: ToFirst,
}

impl Phase {
    /// All phases, in order.
    pub const ALL: [Self; 6] =
        [Self::NoCase, Self::Case, Self::Calibrated, Self::Registered, Self::Checked, Self::Navigating];

    /// The phase after an event. What voids something falls back as far as it must, from any phase; what builds on
    /// something missing is refused.
    ///
    /// # Errors
    /// When the event makes no sense here, with what has to be done first.
    pub fn after(self, event: Event) -> Result<Self, Refusal> {
        use Phase::{Calibrated, Case, Checked, Navigating, NoCase, Registered};
        let refuse = |first| Err(Refusal { phase: self, event, first });
        match (event, self) {
            (Event::CaseOpened, NoCase) => Ok(Case),
            (Event::CaseOpened, _) => refuse(ToFirst::CloseCase),
            (Event::CaseClosed, _) => Ok(NoCase),

            // Landmarks were touched with the tip as it was known before.
            (Event::Calibrated, Case | Calibrated | Registered | Checked) => Ok(Calibrated),
            (Event::Registered, Calibrated | Registered | Checked) => Ok(Registered),
            (Event::Calibrated | Event::Registered, Navigating) => refuse(ToFirst::Stop),

            (Event::ToolChanged, _) => Ok(self.min(Case)),
            (Event::ReferenceMoved, _) => Ok(self.min(Calibrated)),

            (Event::Touched, Calibrated | Registered | Checked | Navigating) => Ok(self),
            (Event::CheckPassed, Registered | Checked) => Ok(Checked),
            (Event::CheckPassed, Navigating) => Ok(Navigating),
            (Event::CheckFailed, Registered | Checked | Navigating) => Ok(Registered),

            (Event::Started, Checked | Navigating) => Ok(Navigating),
            (Event::Stopped, _) => Ok(self.min(Checked)),

            (
                Event::Calibrated
                | Event::Registered
                | Event::Touched
                | Event::CheckPassed
                | Event::CheckFailed
                | Event::Started,
                _,
            ) => refuse(self.next_step()),
        }
    }

    /// What is still to be done before numbers can be shown, for people; `None` while navigating.
    pub fn before_navigation(self) -> Option<String> {
        match self {
            Self::Navigating => None,
            Self::Checked => Some("start the navigation".to_owned()),
            other => Some(other.next_step().to_string()),
        }
    }

    /// What leads on from here.
    const fn next_step(self) -> ToFirst {
        match self {
            Self::NoCase => ToFirst::OpenCase,
            Self::Case => ToFirst::Calibrate,
            Self::Calibrated => ToFirst::Register,
            Self::Registered => ToFirst::Check,
            Self::Checked | Self::Navigating => ToFirst::Stop,
        }
    }

    /// For JSON and messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NoCase => "no_case",
            Self::Case => "case",
            Self::Calibrated => "calibrated",
            Self::Registered => "registered",
            Self::Checked => "checked",
            Self::Navigating => "navigating",
        }
    }
}

impl Event {
    /// All events.
    pub const ALL: [Self; 11] = [
        Self::CaseOpened,
        Self::CaseClosed,
        Self::Calibrated,
        Self::ToolChanged,
        Self::Registered,
        Self::ReferenceMoved,
        Self::Touched,
        Self::CheckPassed,
        Self::CheckFailed,
        Self::Started,
        Self::Stopped,
    ];

    /// For messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::CaseOpened => "case opened",
            Self::CaseClosed => "case closed",
            Self::Calibrated => "catheter calibrated",
            Self::ToolChanged => "catheter changed",
            Self::Registered => "patient registered",
            Self::ReferenceMoved => "reference moved",
            Self::Touched => "landmark touched",
            Self::CheckPassed => "check passed",
            Self::CheckFailed => "check failed",
            Self::Started => "navigation started",
            Self::Stopped => "navigation stopped",
        }
    }
}

impl fmt::Display for Phase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl fmt::Display for ToFirst {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::OpenCase => "open a case",
            Self::CloseCase => "close the case",
            Self::Calibrate => "calibrate the catheter",
            Self::Register => "register the patient",
            Self::Check => "touch a landmark again",
            Self::Stop => "stop the navigation",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// One row per event, one letter per phase from no case to navigating: where it leads, or `-` for refused.
    /// n(o case) c(ase) C(alibrated) R(egistered) K (checked) N(avigating).
    const TABLE: [(Event, &str); 11] = [
        (Event::CaseOpened, "c-----"),
        (Event::CaseClosed, "nnnnnn"),
        (Event::Calibrated, "-CCCC-"),
        (Event::ToolChanged, "nccccc"),
        (Event::Registered, "--RRR-"),
        (Event::ReferenceMoved, "ncCCCC"),
        (Event::Touched, "--CRKN"),
        (Event::CheckPassed, "---KKN"),
        (Event::CheckFailed, "---RRR"),
        (Event::Started, "----NN"),
        (Event::Stopped, "ncCRKK"),
    ];

    fn phase_of(letter: char) -> Option<Phase> {
        "ncCRKN".find(letter).map(|i| Phase::ALL[i])
    }

    #[test]
    fn all_pairs_are_as_in_the_table() {
        assert_eq!(TABLE.map(|(e, _)| e), Event::ALL);
        for (event, row) in TABLE {
            for (phase, letter) in Phase::ALL.into_iter().zip(row.chars()) {
                assert_eq!(phase.after(event).ok(), phase_of(letter), "{event} in {phase}");
            }
        }
    }

    #[test]
    fn a_refusal_says_what_to_do_first_and_doing_it_helps() {
        let first = |phase: Phase, event| phase.after(event).expect_err("refused").first;
        assert_eq!(first(Phase::NoCase, Event::Started), ToFirst::OpenCase);
        assert_eq!(first(Phase::Case, Event::Registered), ToFirst::Calibrate);
        assert_eq!(first(Phase::Calibrated, Event::CheckPassed), ToFirst::Register);
        assert_eq!(first(Phase::Registered, Event::Started), ToFirst::Check);
        assert_eq!(first(Phase::Navigating, Event::Calibrated), ToFirst::Stop);
        assert_eq!(first(Phase::Checked, Event::CaseOpened), ToFirst::CloseCase);
        let said = Phase::Case.after(Event::Started).expect_err("refused").to_string();
        assert_eq!(said, "\"navigation started\" is not possible in phase \"case\"; first calibrate the catheter");
    }

    proptest! {
        /// Nobody gets to navigate without a check since the last registration and the last calibration.
        #[test]
        fn navigation_is_only_reached_over_a_check(events in proptest::collection::vec(0..Event::ALL.len(), 0..60)) {
            let (mut phase, mut checked) = (Phase::NoCase, false);
            for event in events.into_iter().map(|i| Event::ALL[i]) {
                let Ok(next) = phase.after(event) else { continue };
                match event {
                    Event::CheckPassed => checked = true,
                    Event::Started | Event::Stopped | Event::Touched => {}
                    _ => checked = false,
                }
                phase = next;
                prop_assert!(phase < Phase::Checked || checked, "{phase} after {event}");
            }
        }
    }
}
