//! Bitstream versions.

use core::fmt;

/// A bitstream version, as announced by the server.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Version {
    /// Major number.
    pub major: u8,
    /// Minor number.
    pub minor: u8,
}

impl Version {
    /// The oldest version understood.
    pub const OLDEST: Self = Self::new(2, 0);
    /// The newest version whose layout is known.
    pub const NEWEST: Self = Self::new(4, 3);

    /// Major and minor number.
    pub const fn new(major: u8, minor: u8) -> Self {
        Self { major, minor }
    }

    /// Whether this version is at least `major.minor`.
    pub fn since(self, major: u8, minor: u8) -> bool {
        self >= Self::new(major, minor)
    }

    /// Whether this is newer than what is tested.
    pub fn is_newer_than_tested(self) -> bool {
        self > Self::NEWEST
    }

    /// From `4.1` or `4`.
    pub fn parse(text: &str) -> Option<Self> {
        let (major, minor) = text.split_once('.').unwrap_or((text, "0"));
        Some(Self::new(major.parse().ok()?, minor.parse().ok()?))
    }
}

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.major, self.minor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_ordered_by_number_not_by_text() {
        assert!(Version::new(2, 10) > Version::new(2, 9) && Version::new(3, 0) > Version::new(2, 11));
        assert_eq!(Version::parse("2.10"), Some(Version::new(2, 10)));
        assert_eq!((Version::parse("4"), Version::parse("x")), (Some(Version::new(4, 0)), None));
        assert!(Version::new(4, 4).is_newer_than_tested() && !Version::NEWEST.is_newer_than_tested());
    }
}
