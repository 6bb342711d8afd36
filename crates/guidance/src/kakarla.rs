//! Predicted catheter grade after Kakarla et al., "Safety and accuracy of bedside external ventricular drain
//! placement", Neurosurgery 63 (2008): graded by what the tip lies in.

use crate::Side;
use monro_geometry::Structure;

/// What the catheter tip lies in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TipSite {
    /// A lateral ventricle, of either side.
    LateralVentricle(Side),
    /// The third ventricle.
    ThirdVentricle,
    /// Brain known to be non-eloquent.
    NonEloquentBrain,
    /// Eloquent brain (basal ganglia, thalamus, internal capsule, brain stem), or brain not known to be otherwise.
    EloquentBrain,
    /// A fluid space that is no target: cistern, fissure, sulcus.
    OtherFluid,
    /// Outside the skull, or still in bone.
    OutsideBrain,
}

impl From<Structure> for TipSite {
    /// Labels do not tell eloquent from non-eloquent brain: all brain counts as eloquent, the grade that flatters least.
    fn from(structure: Structure) -> Self {
        match structure {
            Structure::LeftLateralVentricle => Self::LateralVentricle(Side::Left),
            Structure::RightLateralVentricle => Self::LateralVentricle(Side::Right),
            Structure::ThirdVentricle => Self::ThirdVentricle,
            Structure::Brain => Self::EloquentBrain,
            Structure::Csf => Self::OtherFluid,
            Structure::Outside | Structure::Scalp | Structure::Skull => Self::OutsideBrain,
        }
    }
}

/// The grade; smaller is better. `Kakarla::Optimal.number()` is 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kakarla {
    /// 1: ipsilateral frontal horn, or third ventricle.
    Optimal,
    /// 2: contralateral lateral ventricle, or non-eloquent brain.
    Functional,
    /// 3: eloquent brain or a fluid space that is no target; here also a tip that is not in the brain at all.
    Suboptimal,
}

impl Kakarla {
    /// The grade of a catheter that came in on `entry` side and whose tip lies in `tip`.
    pub fn predict(entry: Side, tip: TipSite) -> Self {
        match tip {
            TipSite::LateralVentricle(side) if side == entry => Self::Optimal,
            TipSite::ThirdVentricle => Self::Optimal,
            TipSite::LateralVentricle(_) | TipSite::NonEloquentBrain => Self::Functional,
            TipSite::EloquentBrain | TipSite::OtherFluid | TipSite::OutsideBrain => Self::Suboptimal,
        }
    }

    /// 1, 2 or 3.
    pub const fn number(self) -> u8 {
        match self {
            Self::Optimal => 1,
            Self::Functional => 2,
            Self::Suboptimal => 3,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_structure_has_the_grade_of_the_paper_from_the_right() {
        let grade = |s: Structure| Kakarla::predict(Side::Right, s.into()).number();
        assert_eq!(Structure::ALL.map(grade), [3, 3, 3, 3, 3, 2, 1, 1]);
    }

    #[test]
    fn the_other_side_swaps_the_lateral_ventricles_only() {
        for s in Structure::ALL {
            let (left, right) = (Kakarla::predict(Side::Left, s.into()), Kakarla::predict(Side::Right, s.into()));
            let lateral = matches!(s, Structure::LeftLateralVentricle | Structure::RightLateralVentricle);
            assert_eq!(left == right, !lateral, "{s:?}");
        }
    }

    #[test]
    fn brain_known_to_be_silent_is_functional() {
        assert_eq!(Kakarla::predict(Side::Left, TipSite::NonEloquentBrain), Kakarla::Functional);
        assert!(Kakarla::Optimal < Kakarla::Suboptimal);
    }
}
