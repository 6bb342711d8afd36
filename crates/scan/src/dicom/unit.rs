//! What the values of an image are once they are rescaled.

/// By `RescaleType` (PS3.3 C.11.1.1.2), in capitals and without signs: optical density, effective atomic number, electron
/// density, mass per volume, percent; and as makers write these.
const MAPS: [&str; 10] = ["OD", "ZEFF", "EFFZ", "Z", "ED", "EDW", "MGML", "MGCM3", "PCT", "PERCENT"];

/// The quantity of an image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Unit {
    /// HU, and what is taken for it: nothing said, or "unspecified", as many write.
    Hu,
    /// HU that were modified, or a type that is not known.
    Doubtful(String),
    /// Another quantity: a spectral CT's map of a material or of the electron density.
    Map(String),
}

impl Unit {
    /// By the header's `RescaleType`.
    pub(crate) fn of(kind: Option<String>) -> Self {
        let Some(kind) = kind else { return Self::Hu };
        let bare: String = kind.chars().filter(char::is_ascii_alphanumeric).collect::<String>().to_ascii_uppercase();
        match bare.as_str() {
            "HU" | "US" | "UNSPECIFIED" => Self::Hu,
            word if word.starts_with("HOUNSFIELD") => Self::Hu,
            word if MAPS.contains(&word) || kind.contains('%') => Self::Map(kind),
            _ => Self::Doubtful(kind),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rescale_types_of_all_makers() {
        let of = |kind: &str| Unit::of(Some(kind.to_owned()));
        assert_eq!(Unit::of(None), Unit::Hu);
        for hu in ["HU", "hu", "US", "Hounsfield Units"] {
            assert_eq!(of(hu), Unit::Hu, "{hu}");
        }
        for map in ["OD", "Z_EFF", "ED", "EDW", "%EDW", "MGML", "mg/ml", "PCT", "%"] {
            assert_eq!(of(map), Unit::Map(map.into()));
        }
        for other in ["HU_MOD", "normalized", "?"] {
            assert_eq!(of(other), Unit::Doubtful(other.into()));
        }
    }
}
