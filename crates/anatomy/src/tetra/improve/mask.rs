//! Which labels meet at a point, and whether the outside does.

use std::ops::{BitAnd, BitOr, BitOrAssign};

/// Labels that can be told apart: their numbers fit a byte beside the marks of elements without one.
pub(in super::super) const MOST_LABELS: usize = 250;

const WORDS: usize = 4;
/// The last bit of the last word.
const OUTSIDE_BIT: u64 = 1 << 63;

/// A set of labels by their numbers, and the outside.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(in super::super) struct Mask([u64; WORDS]);

impl Mask {
    pub(super) const OUTSIDE: Self = Self([0, 0, 0, OUTSIDE_BIT]);
    pub(super) const ALL: Self = Self([u64::MAX; WORDS]);

    pub(super) const fn of(label: u8) -> Self {
        let mut words = [0; WORDS];
        words[label as usize / 64] = 1 << (label % 64);
        Self(words)
    }

    pub(super) const fn is_outside(self) -> bool {
        self.0[WORDS - 1] & OUTSIDE_BIT != 0
    }

    /// Without the outside.
    pub(super) const fn labels(self) -> Self {
        let mut words = self.0;
        words[WORDS - 1] &= !OUTSIDE_BIT;
        Self(words)
    }

    /// Labels, and the outside.
    pub(super) fn count(self) -> u32 {
        self.0.iter().map(|w| w.count_ones()).sum()
    }

    /// Whether all that is here is in `other`.
    pub(super) fn is_within(self, other: Self) -> bool {
        self.0.iter().zip(other.0).all(|(a, b)| a & !b == 0)
    }

    /// The lowest of its bits.
    fn first(self) -> Option<u8> {
        let word = self.0.iter().position(|&w| w != 0)?;
        Some((64 * word) as u8 + self.0[word].trailing_zeros() as u8)
    }

    /// Its three lowest labels, as far as there are so many.
    pub(super) fn lowest(self) -> [Option<u8>; 3] {
        let mut rest = self.labels();
        std::array::from_fn(|_| {
            let label = rest.first()?;
            rest.0[usize::from(label) / 64] &= !(1 << (label % 64));
            Some(label)
        })
    }
}

impl BitAnd for Mask {
    type Output = Self;
    fn bitand(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] & other.0[i]))
    }
}

impl BitOr for Mask {
    type Output = Self;
    fn bitor(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] | other.0[i]))
    }
}

impl BitOrAssign for Mask {
    fn bitor_assign(&mut self, other: Self) {
        *self = *self | other;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_in_different_words_and_the_outside_are_told_apart() {
        let mask = Mask::of(3) | Mask::of(130) | Mask::of(249) | Mask::of(64) | Mask::OUTSIDE;
        assert_eq!(mask.count(), 5);
        assert!(mask.is_outside() && !mask.labels().is_outside());
        assert_eq!(mask.lowest(), [Some(3), Some(64), Some(130)]);
        assert_eq!((Mask::of(249) | Mask::OUTSIDE).lowest(), [Some(249), None, None]);
        assert!(
            (Mask::of(64) | Mask::OUTSIDE).is_within(mask)
                && !Mask::of(65).is_within(mask)
                && mask.is_within(Mask::ALL)
        );
        assert_eq!(mask & Mask::of(64), Mask::of(64));
    }
}
