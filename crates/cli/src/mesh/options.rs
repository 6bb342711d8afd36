//! Options of `monro mesh` from text.

use crate::args::in_range;
use anyhow::{Context, Result, bail};
use monro_anatomy::tetra;

/// Densities that can be asked for; the mesher refuses others, but cannot say which option they came from.
const DENSITIES: std::ops::RangeInclusive<f64> = 0.01..=100.0;

/// `LABEL=FACTOR,...`.
pub(super) fn density(text: &str) -> Result<Vec<(u16, f64)>> {
    let one = |part: &str| {
        let (label, factor) = part.split_once('=')?;
        Some((label.trim().parse().ok()?, factor.trim().parse().ok()?))
    };
    let all: Vec<(u16, f64)> = text.split(',').map(one).collect::<Option<_>>().with_context(|| {
        format!("--density \"{text}\" is not LABEL=FACTOR,... with the numbers that the volume holds, as 5=2,6=2")
    })?;
    for (i, &(label, factor)) in all.iter().enumerate() {
        if !DENSITIES.contains(&factor) {
            let (low, high) = DENSITIES.into_inner();
            bail!("--density {label}={factor}: the factor must be from {low} to {high}");
        }
        if let Some(&(_, other)) = all[..i].iter().find(|d| d.0 == label) {
            bail!("--density \"{text}\" has label {label} twice, {other} and {factor}; give one");
        }
    }
    Ok(all)
}

/// A label.
pub(crate) fn label(text: &str) -> Result<u16, String> {
    let rule = || format!("\"{}\" is no label; give numbers from 0 to {}, as in 4,5", text.trim(), u16::MAX);
    text.trim().parse().map_err(|_| rule())
}

/// Growth of edges, mm a mm.
pub(crate) fn growth(text: &str) -> Result<f64, String> {
    in_range(text, *tetra::GROWTH.start(), *tetra::GROWTH.end())
}

/// Longest edge over the finest.
pub(crate) fn coarsest(text: &str) -> Result<f64, String> {
    in_range(text, *tetra::COARSEST.start(), *tetra::COARSEST.end())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn densities_are_labels_with_factors_or_an_error_that_shows_the_form() {
        assert_eq!(density("4=2, 7=0.5").expect("two"), [(4, 2.0), (7, 0.5)]);
        for bad in ["", "4", "4=x", "-1=2", "4=2,"] {
            assert!(density(bad).expect_err("refused").to_string().contains("LABEL=FACTOR"), "{bad}");
        }
    }

    #[test]
    fn one_of_two_densities_of_a_label_was_taken_in_silence() {
        let said = density("2=2,4=1,2=3").expect_err("refused").to_string();
        assert!(said.contains("label 2 twice, 2 and 3"), "{said}");
        let said = density("4=1,2=0").expect_err("refused").to_string();
        assert!(said.contains("--density 2=0") && said.contains("0.01 to 100"), "{said}");
        assert!(density("2=NaN").is_err());
    }
}
