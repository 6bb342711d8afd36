//! What the soft body looks like at one moment, and what it says.

use core::fmt;
use monro_geometry::{Patient, Point, Structure};

/// The soft body at one moment. Immutable once made, so that displays can share it.
#[derive(Debug, Clone, PartialEq)]
pub struct Deformed {
    /// Counts the steps; 0 is before any.
    pub step: u64,
    /// How the needle followed from the poses then ([`Cue::placement`](super::Cue::placement)).
    pub placement: u32,
    /// Time of the needle pose that it answers to, s; `None` before the first.
    pub pose_time_s: Option<f64>,
    /// Displacement of each node from rest, mm, in the order of the case's mesh.
    pub displacements: Vec<[f32; 3]>,
    /// Where the tissue of the planned target is now.
    pub target: Point<Patient>,
    /// What the tip is in, if in tissue.
    pub at_tip: Option<Structure>,
    /// How deep under the entry, along the plan, the tip was when it first was in a ventricle in this passage, mm; `None` where it was
    /// not, or is outside of the tissue.
    pub csf_depth_mm: Option<f64>,
    /// Force of the tissue along the shaft, against the advance, mN: the middle one of the last three steps. `None` where nothing is
    /// felt, and in paper mode.
    pub axial_force_mn: Option<f64>,
    /// Largest displacement of a node, mm.
    pub largest_mm: f64,
    /// What the ventricles hold more than at rest, ml.
    pub csf_change_ml: f64,
    /// How much more pressure there is in the middle of their fluid than at rest, kPa.
    pub csf_change_kpa: f64,
    /// Elements of tissue with less than half or more than twice of their volume, when they were last counted: how far walls have moved
    /// around them is a matter of chance.
    pub crushed: usize,
    /// Why it is no result: nothing may be read off it.
    pub doubt: Option<Doubt>,
    /// Whether the solver had to take a step back, and hold or retry, within the last three seconds that it ran: shown,
    /// not hidden.
    pub fault: bool,
    /// Steps so far that were taken back or held.
    pub faults: u64,
}

/// Why a soft body shows no result.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Doubt {
    /// So many elements are turned inside out.
    Inverted(usize),
    /// The target's tissue has moved so far, mm.
    Far(f64),
}

/// Farthest that the tissue of a target deep in the brain is believed to move, mm: a choice, beyond the largest that any pressure up
/// to 150 mmHg made of three heads that the skull holds (14 mm).
pub const MOST_SHIFT_MM: f64 = 20.0;

impl Doubt {
    /// What there is to doubt in tissue with so many elements turned inside out, whose target has moved so far (mm).
    pub(super) fn of(inverted: usize, target_shift_mm: f64) -> Option<Self> {
        let far = || (target_shift_mm > MOST_SHIFT_MM).then_some(Self::Far(target_shift_mm));
        if inverted > 0 { Some(Self::Inverted(inverted)) } else { far() }
    }
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Inverted(count) => write!(f, "{count} elements of the soft body are turned inside out"),
            Self::Far(mm) => write!(f, "the soft body has the target {mm:.0} mm from its place"),
        }?;
        f.write_str(": ask for less drainage, pressure or gravity, or draw the catheter out")
    }
}

impl Deformed {
    /// Tissue at rest.
    pub fn at_rest(target: Point<Patient>, nodes: usize) -> Self {
        let displacements = vec![[0.0; 3]; nodes];
        Self {
            step: 0,
            crushed: 0,
            placement: 0,
            pose_time_s: None,
            displacements,
            target,
            at_tip: None,
            csf_depth_mm: None,
            axial_force_mn: None,
            largest_mm: 0.0,
            csf_change_ml: 0.0,
            csf_change_kpa: 0.0,
            doubt: None,
            fault: false,
            faults: 0,
        }
    }
}
