//! Tissue that does not come to rest although the catheter has.

use super::Run;
use super::output::small;
use super::run::Row;

/// Share of the time that the catheter rests at the end over which it is looked at: what swings has died down before.
const LAST: f64 = 0.5;
/// A way of the target, mm, and a change of the force on the catheter, mN, that are told.
const NOTICED_MM: f64 = 0.05;
const NOTICED_MN: f64 = 5.0;

/// How far the target's tissue still moves at the end of some frames; `why` is what mostly makes it.
pub(super) fn remark(run: &Run, rows: &[Row], why: &str) -> Option<String> {
    let end = rows.last()?.frame.time_s;
    let span = LAST * run.settings.hold_s;
    let rows = rows.iter().map(|r| &r.frame).filter(|f| f.time_s > end - span);
    let (ways, forces): (Vec<f64>, Vec<Option<f64>>) =
        rows.map(|f| (f.target_displacement_mm, f.axial_force_mn())).unzip();
    let forces: Vec<f64> = forces.into_iter().flatten().filter(|_| run.has_units()).collect();
    words(span, why, [&ways, &forces])
}

/// In words, by the target's displacements (mm) and the forces along the catheter (mN) of the last `span` seconds.
fn words(span: f64, why: &str, [ways, forces]: [&[f64]; 2]) -> Option<String> {
    let ([low, high], [least, most]) = (range(ways), range(forces));
    let force = match [least, most] {
        [low, high] if low.is_finite() => format!("the force went from {low:.0} to {high:.0} mN"),
        _ => String::new(),
    };
    let begin = format!("In the last {span:.1} s, with the catheter still, ");
    let end = "and figures of the end are those of a moment.";
    if high - low > NOTICED_MM {
        let (low, high, and) = (small(low), small(high), if force.is_empty() { "" } else { ", and " });
        Some(format!(
            "{begin}the target's tissue was {low} to {high} mm from its place{and}{force}: it has not come to rest, mostly \
             because {why}, {end}"
        ))
    } else {
        // What is stiff or slow to give way presses on without moving to speak of.
        (most - least > NOTICED_MN).then(|| format!("{begin}{force}: what it is in has not come to rest, {end}"))
    }
}

fn range(of: &[f64]) -> [f64; 2] {
    [of.iter().copied().fold(f64::INFINITY, f64::min), of.iter().copied().fold(f64::NEG_INFINITY, f64::max)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tissue_that_swung_at_the_end_gave_one_of_its_moments_without_a_word() {
        let of = |ways: &[f64], forces: &[f64]| words(0.5, "a wall is folded around the tip", [ways, forces]);
        let told = of(&[0.51, 0.36, 0.21, 0.19, 0.24], &[83.4, 57.1, 57.4, 56.2, 56.8]).expect("told");
        assert!(told.starts_with("In the last 0.5 s") && told.contains("0.19 to 0.51 mm"), "{told}");
        assert!(told.contains("from 56 to 83 mN"), "{told}");
        let paper = of(&[0.51, 0.36], &[]).expect("told");
        assert!(!paper.contains("mN"), "{paper}");
        assert_eq!(of(&[0.201, 0.199, 0.23], &[50.0, 51.0]), None);
        let force = of(&[0.201, 0.199, 0.21], &[50.0, 66.0]).expect("told");
        assert!(
            force.contains("from 50 to 66 mN") && !force.contains("target") && !force.contains("folded"),
            "{force}"
        );
        assert_eq!(of(&[], &[]), None);
    }
}
