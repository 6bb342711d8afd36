//! What is done to the fluid of the ventricles, and gravity: the causes of brain shift.

use monro_tissue::{Csf, FrameSettings, Mode};
use thiserror::Error;

/// A millimetre of mercury (conventional), kPa.
pub const KPA_PER_MMHG: f64 = 0.133_322;
/// The largest gravity taken, m/s2: twice the Earth's.
const MOST_GRAVITY_M_S2: f64 = 20.0;
/// The most that is drained or infused, ml, and the largest pressure, mmHg.
const MOST_FLUID: f64 = 150.0;

/// Time over which loads come on, s. At once they would throw the tissue; this is many periods of its slowest motion (a head's:
/// about 8 Hz).
pub(crate) const BRING_ON_S: f64 = 1.0;
/// After that the tissue comes to rest, s: while loads change, pressures in it lag behind, and it gives way 5 to 14 % too far.
const SETTLE_S: f64 = 0.5;
/// A volume that is drained is waited for, s: the pressure that takes it out is found as it goes.
const DRAIN_S: f64 = 2.0;

/// What is done to the fluid, and gravity.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Loads {
    /// What is done to the fluid of the ventricles.
    pub csf: Csf,
    /// Acceleration that the tissue has begun to feel since the scan, mm/s2, patient frame.
    pub gravity_mm_s2: [f64; 3],
}

/// Why a load cannot be put on.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum LoadError {
    /// A soft body without units has no pressures and bears no weight.
    #[error(
        "paper mode has no pressure, and no stiffness to bear weight with, so what comes of it depends on the mesh: draining (--drain-ml), --csf-pressure-mmhg and --gravity needs --mode physical"
    )]
    Paper,
    /// More than anybody drains.
    #[error("{0} ml to be drained: wanted -{MOST_FLUID} to {MOST_FLUID}, and no more than the ventricles hold")]
    Volume(f64),
    /// More than any head bears.
    #[error("a pressure of {0} mmHg more than in the scan: wanted -{MOST_FLUID} to {MOST_FLUID}")]
    Pressure(f64),
    /// More than twice the Earth's.
    #[error("a gravity of {0} m/s2: wanted at most {MOST_GRAVITY_M_S2} (the Earth's is 9.81; are these mm/s2?)")]
    Gravity(f64),
    /// More fluid is to be drained than there is.
    #[error("{ml} ml cannot be drained: the ventricles of the case hold {holds_ml:.1} ml")]
    Drained {
        /// What is to be drained.
        ml: f64,
        /// Volume of all ventricles.
        holds_ml: f64,
    },
}

impl Loads {
    /// Those of a frame.
    pub const fn of(frame: &FrameSettings) -> Self {
        Self { csf: frame.csf, gravity_mm_s2: frame.gravity_mm_s2 }
    }

    /// A frame with these and no others.
    #[must_use]
    pub const fn on(self, frame: FrameSettings) -> FrameSettings {
        FrameSettings { csf: self.csf, gravity_mm_s2: self.gravity_mm_s2, ..frame }
    }

    /// Whether there are any.
    pub fn any(&self) -> bool {
        *self != Self::default()
    }

    /// Whether they can be put on in a mode, on any head.
    ///
    /// # Errors
    /// One that is not finite or out of range, any in paper mode.
    pub fn check(&self, mode: Mode) -> Result<(), LoadError> {
        let within = |v: f64, most: f64| v.abs() <= most;
        let gravity = self.gravity_mm_s2.iter().map(|g| g * g).sum::<f64>().sqrt() * 1e-3;
        match self.csf {
            _ if self.any() && matches!(mode, Mode::Paper(_)) => Err(LoadError::Paper),
            Csf::Drained { ml } if !within(ml, MOST_FLUID) => Err(LoadError::Volume(ml)),
            Csf::Pressure { kpa } if !within(kpa / KPA_PER_MMHG, MOST_FLUID) => {
                Err(LoadError::Pressure(kpa / KPA_PER_MMHG))
            }
            _ if !within(gravity, MOST_GRAVITY_M_S2) => Err(LoadError::Gravity(gravity)),
            _ => Ok(()),
        }
    }

    /// What is to be drained, ml; `None` where the fluid is not held at a volume.
    pub const fn drained_ml(&self) -> Option<f64> {
        if let Csf::Drained { ml } = self.csf { Some(ml) } else { None }
    }

    /// The pressure that the fluid is held at, mmHg; `None` where it is not.
    pub fn pressure_mmhg(&self) -> Option<f64> {
        if let Csf::Pressure { kpa } = self.csf { Some(kpa / KPA_PER_MMHG) } else { None }
    }

    /// As [`Loads::check`], and that the ventricles, of which there are `holds_ml`, hold what is to be drained of them.
    ///
    /// # Errors
    /// As there, and more fluid than there is.
    pub fn check_on(&self, mode: Mode, holds_ml: f64) -> Result<(), LoadError> {
        self.check(mode)?;
        match self.drained_ml() {
            Some(ml) if ml >= holds_ml => Err(LoadError::Drained { ml, holds_ml }),
            _ => Ok(()),
        }
    }

    /// How long they are waited for once they are on, s; nothing where there are none.
    pub(crate) const fn rest_s(&self) -> f64 {
        if self.drained_ml().is_some() { DRAIN_S } else { SETTLE_S }
    }
}

/// Loads on their way from what they were to what they shall be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Ramp {
    from: Loads,
    to: Loads,
    /// Since they began to change, s.
    since_s: f64,
}

impl Default for Ramp {
    /// None, and the tissue at rest.
    fn default() -> Self {
        Self { from: Loads::default(), to: Loads::default(), since_s: f64::INFINITY }
    }
}

impl Ramp {
    /// Begins to change the loads, from those that there are. Where fluid was not held at a volume (or at a pressure) before, it
    /// begins with the one that it has come to: `change_ml` more than at rest, at `kpa`.
    pub(crate) fn aim(&mut self, to: Loads, change_ml: f64, kpa: f64) {
        if to == self.to {
            return;
        }
        let now = self.now();
        let csf = match (to.csf, now.csf) {
            (Csf::Drained { .. }, Csf::Drained { .. }) => now.csf,
            (Csf::Drained { .. }, _) => Csf::Drained { ml: -change_ml },
            _ => Csf::Pressure { kpa },
        };
        *self = Self { from: Loads { csf, ..now }, to, since_s: 0.0 };
    }

    /// Goes on by `dt_s`, and gives the loads then.
    pub(crate) fn advance(&mut self, dt_s: f64) -> Loads {
        self.since_s += dt_s;
        self.now()
    }

    /// What they shall be.
    pub(crate) const fn to(&self) -> Loads {
        self.to
    }

    /// Whether they are on, and the tissue has had its time to come to rest.
    pub(crate) fn is_settled(&self) -> bool {
        self.since_s >= BRING_ON_S + self.to.rest_s()
    }

    fn now(&self) -> Loads {
        if self.since_s >= BRING_ON_S {
            return self.to;
        }
        let share = self.since_s / BRING_ON_S;
        let mix = |a: f64, b: f64| a + share * (b - a);
        let gravity_mm_s2 = core::array::from_fn(|a| mix(self.from.gravity_mm_s2[a], self.to.gravity_mm_s2[a]));
        let csf = match (self.from.csf, self.to.csf) {
            (Csf::Drained { ml: from }, Csf::Drained { ml }) => Csf::Drained { ml: mix(from, ml) },
            (Csf::Pressure { kpa: from }, Csf::Pressure { kpa }) => Csf::Pressure { kpa: mix(from, kpa) },
            (Csf::Pressure { kpa: from }, _) => Csf::Pressure { kpa: mix(from, 0.0) },
            (_, to) => to,
        };
        Loads { csf, gravity_mm_s2 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use monro_tissue::{PaperOptions, PhysicalOptions};

    fn drained(ml: f64) -> Loads {
        Loads { csf: Csf::Drained { ml }, ..Loads::default() }
    }

    #[test]
    fn what_no_head_bears_is_refused_with_its_number() {
        let physical = Mode::Physical(PhysicalOptions::default());
        let pressed = |mmhg: f64| Loads { csf: Csf::Pressure { kpa: mmhg * KPA_PER_MMHG }, ..Loads::default() };
        let heavy = |g: f64| Loads { gravity_mm_s2: [0.0, g * 1e3, 0.0], ..Loads::default() };
        for (loads, word) in [
            (drained(151.0), "151 ml"),
            (drained(f64::NAN), "NaN ml"),
            (pressed(-200.0), "-200 mmHg"),
            (heavy(9810.0), "9810 m/s2"),
            (heavy(f64::INFINITY), "inf m/s2"),
        ] {
            let refused = loads.check(physical).expect_err("out of range").to_string();
            assert!(refused.contains(word), "{refused}");
        }
        for fine in [Loads::default(), drained(-20.0), pressed(15.0), heavy(9.81)] {
            assert_eq!(fine.check(physical), Ok(()));
            let paper = fine.check(Mode::Paper(PaperOptions::default()));
            assert_eq!(paper.is_err(), fine.any(), "{fine:?}");
        }
    }

    #[test]
    fn loads_come_on_evenly_from_where_they_are() {
        let mut ramp = Ramp::default();
        assert!(ramp.is_settled());
        ramp.aim(drained(8.0), -0.5, 0.2);
        let at = |ramp: &mut Ramp, dt| match ramp.advance(dt).csf {
            Csf::Drained { ml } => ml,
            other => panic!("{other:?}"),
        };
        // It had lost half a millilitre before anybody asked for anything.
        assert!((at(&mut ramp, 0.0) - 0.5).abs() < 1e-12);
        assert!((at(&mut ramp, 0.5) - 4.25).abs() < 1e-12);
        // Another wish on the way begins there; the same once more changes nothing.
        ramp.aim(drained(2.25), -4.0, -0.3);
        ramp.aim(drained(2.25), -9.0, -0.3);
        assert!((at(&mut ramp, 0.25) - 3.75).abs() < 1e-12);
        assert!((at(&mut ramp, 5.0) - 2.25).abs() < 1e-12 && ramp.is_settled());
        // Let go, the pressure that held it comes back to rest.
        ramp.aim(Loads { gravity_mm_s2: [0.0, 4.0, 0.0], ..Loads::default() }, -2.25, -0.4);
        let half = ramp.advance(0.5);
        assert_eq!(half, Loads { csf: Csf::Pressure { kpa: -0.2 }, gravity_mm_s2: [0.0, 2.0, 0.0] });
        assert!(!ramp.is_settled());
        assert_eq!(ramp.advance(0.5), ramp.to());
    }
}
