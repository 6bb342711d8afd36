//! Tissue that does not come to rest although the catheter has.

use super::Run;
use super::output::small;
use super::run::Row;

/// Share of the time that the catheter rests at the end over which it is looked at: what swings has died down before.
const LAST: f64 = 0.5;
/// A way of the target, mm, and a change of the force on the catheter, mN, that are told.
const NOTICED_MM: f64 = 0.05;
const NOTICED_MN: f64 = 5.0;
/// A way of the target that leaves no result, mm: where it ends is chance.
const MUCH_MM: f64 = 0.5;

/// The last of some frames, in which it should be at rest.
struct End {
    /// Their time, s.
    span: f64,
    /// The target's displacements, mm, and the forces along the catheter where there are such, mN.
    ways: Vec<f64>,
    forces: Vec<f64>,
}

impl End {
    fn of(run: &Run, rows: &[Row]) -> Self {
        let span = LAST * run.settings.hold_s;
        let after = rows.last().map_or(0.0, |r| r.frame.time_s) - span;
        let frames = rows.iter().map(|r| &r.frame).filter(|f| f.time_s > after);
        let forces = frames.clone().filter_map(|f| f.axial_force_mn().filter(|_| run.has_units()));
        Self { span, forces: forces.collect(), ways: frames.map(|f| f.target_displacement_mm).collect() }
    }

    /// Whether where it ends is chance.
    fn is_chance(&self) -> bool {
        let [low, high] = range(&self.ways);
        high - low > MUCH_MM
    }
}

/// That the target's tissue moves so much at the end of some frames that they have no result.
pub(super) fn broken(run: &Run, rows: &[Row]) -> Option<String> {
    let end = End::of(run, rows);
    let [low, high] = range(&end.ways).map(small);
    end.is_chance().then(|| {
        format!(
            "In the last {:.1} s, with the catheter still, the target's tissue was {low} to {high} mm from its place: it does not come \
             to rest, and where it is at the end is chance, not a result.",
            end.span
        )
    })
}

/// How far the target's tissue still moves at the end of some frames that have a result; `why` is what may make it.
pub(super) fn remark(run: &Run, rows: &[Row], why: &str) -> Option<String> {
    let end = End::of(run, rows);
    if end.is_chance() { None } else { words(&end, why) }
}

/// In words.
fn words(end: &End, why: &str) -> Option<String> {
    let ([low, high], [least, most]) = (range(&end.ways), range(&end.forces));
    let force = match [least, most] {
        [low, high] if low.is_finite() => format!("the force went from {low:.0} to {high:.0} mN"),
        _ => String::new(),
    };
    let begin = format!("In the last {:.1} s, with the catheter still, ", end.span);
    let moment = "and figures of the end are those of a moment.";
    if high - low > NOTICED_MM {
        let (low, high, and) = (small(low), small(high), if force.is_empty() { "" } else { ", and " });
        Some(format!(
            "{begin}the target's tissue was {low} to {high} mm from its place{and}{force}: it has not come to rest \
             (perhaps {why}), {moment}"
        ))
    } else {
        // What is stiff or slow to give way presses on without moving to speak of.
        (most - least > NOTICED_MN).then(|| format!("{begin}{force}: what it is in has not come to rest, {moment}"))
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
        let end = |ways: &[f64], forces: &[f64]| End { span: 0.5, ways: ways.into(), forces: forces.into() };
        let of = |ways: &[f64], forces: &[f64]| words(&end(ways, forces), "a wall is folded around the tip");
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
        let chance = |ways: &[f64]| end(ways, &[]).is_chance();
        assert!(chance(&[0.755, 1.64, 1.1]) && !chance(&[0.51, 0.1]) && !chance(&[]));
    }
}
