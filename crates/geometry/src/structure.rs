//! The label numbers of a case, in one place.

/// A labelled structure of a case. The number is the value in `labels.nii.gz` and in the cell data `label` of `tets.vtu`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u8)]
pub enum Structure {
    /// Air and everything that is not the head.
    Outside = 0,
    /// Scalp and other soft tissue outside the skull.
    Scalp = 1,
    /// Bone.
    Skull = 2,
    /// Intracranial cerebrospinal fluid outside the ventricles.
    Csf = 3,
    /// Brain tissue.
    Brain = 4,
    /// The patient's left lateral ventricle.
    LeftLateralVentricle = 5,
    /// The patient's right lateral ventricle.
    RightLateralVentricle = 6,
    /// Third ventricle.
    ThirdVentricle = 7,
}

impl Structure {
    /// All structures, in the order of their numbers.
    pub const ALL: [Self; 8] = [
        Self::Outside,
        Self::Scalp,
        Self::Skull,
        Self::Csf,
        Self::Brain,
        Self::LeftLateralVentricle,
        Self::RightLateralVentricle,
        Self::ThirdVentricle,
    ];

    /// The number in label files.
    pub const fn label(self) -> u8 {
        self as u8
    }

    /// The structure of a number; `None` above 7.
    pub fn from_label(label: impl Into<u16>) -> Option<Self> {
        Self::ALL.get(usize::from(label.into())).copied()
    }

    /// Stable identifier for files and JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Outside => "outside",
            Self::Scalp => "scalp",
            Self::Skull => "skull",
            Self::Csf => "csf",
            Self::Brain => "brain",
            Self::LeftLateralVentricle => "left_lateral_ventricle",
            Self::RightLateralVentricle => "right_lateral_ventricle",
            Self::ThirdVentricle => "third_ventricle",
        }
    }

    /// The name for people, as in "left lateral ventricle".
    pub fn words(self) -> String {
        self.name().replace('_', " ")
    }

    /// Colour on the screen and in files of other programs, told apart by brightness too (red, green, blue).
    pub const fn colour(self) -> [u8; 3] {
        match self {
            Self::Outside => [0, 0, 0],
            Self::Scalp => [150, 150, 150],
            Self::Skull => [230, 220, 200],
            Self::Csf => [86, 180, 233],
            Self::Brain => [240, 228, 66],
            Self::LeftLateralVentricle => [0, 158, 115],
            Self::RightLateralVentricle => [213, 94, 0],
            Self::ThirdVentricle => [204, 121, 167],
        }
    }

    /// Whether this is one of the ventricles.
    pub const fn is_ventricle(self) -> bool {
        matches!(self, Self::LeftLateralVentricle | Self::RightLateralVentricle | Self::ThirdVentricle)
    }

    /// Whether this lies inside the skull (CSF, brain, ventricles).
    pub const fn is_intracranial(self) -> bool {
        self as u8 >= Self::Csf as u8
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_structures_agree() {
        for (i, s) in Structure::ALL.into_iter().enumerate() {
            assert_eq!(usize::from(s.label()), i);
            assert_eq!(Structure::from_label(s.label()), Some(s));
        }
        assert_eq!((Structure::from_label(8u8), Structure::from_label(256u16)), (None, None));
    }
}
