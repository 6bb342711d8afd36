//! How much of the force that cuts the tissue the tip has really met.

use super::Run;
use monro_geometry::{Structure, TetLocator};
use monro_guidance::Plan;
use monro_session::CATHETER_MM;
use monro_tissue::TipShape;
use serde_json::{Value, json};
use std::ops::RangeInclusive;

/// The tip is looked at between walls: from so far behind the brain's surface, and up to as far before a ventricle, mm. Beside them
/// it presses on a wall.
const CLEAR_MM: f64 = 8.0;
/// Speeds at which tissue has the time to rub as it is asked to, mm/s.
const SPEEDS: RangeInclusive<f64> = 0.5..=20.0;
/// Less way than this tells nothing, mm.
const LEAST_WAY_MM: f64 = 10.0;
/// Between these parts of what was asked for it is as asked: it comes in jerks, of which each springs back.
const AS_ASKED: RangeInclusive<f64> = 0.75..=1.25;
/// Steps in which the path is followed into the tissue, mm.
const STEP_MM: f64 = 0.1;
/// The materials' forces are given for [`CATHETER_MM`]; by what part another diameter is like it.
const LIKE: f64 = 0.1;

/// The axial force beside friction, on the way through the brain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cutting {
    asked_mn: f64,
    mean_mn: f64,
}

impl Cutting {
    /// Of a run; `None` where there was too little way, nothing to cut, no unit, or too much speed.
    pub(super) fn of(run: &Run) -> Option<Self> {
        let brain = &run.settings.model.materials.brain.insertion;
        if !run.has_units() || brain.cut_force_mn <= 0.0 || !SPEEDS.contains(&run.settings.speed_mm_s) {
            return None;
        }
        let (surface, cut) = (run.surface_mm?, between_walls(run)?);
        let way = cut.last()?.0 - cut.first()?.0;
        let beside_friction =
            |&(depth, force): &(f64, f64)| force - brain.dynamic_friction_mn_per_mm * (depth - surface);
        let mean_mn = cut.iter().map(beside_friction).sum::<f64>() / cut.len() as f64;
        (way >= LEAST_WAY_MM).then_some(Self { asked_mn: brain.cut_force_mn, mean_mn })
    }

    /// For programs.
    pub(super) fn json(self) -> Value {
        json!({ "asked_mn": self.asked_mn, "mean_mn": self.mean_mn })
    }

    fn words(self) -> Option<String> {
        let Self { asked_mn, mean_mn } = self;
        (!AS_ASKED.contains(&(mean_mn / asked_mn))).then(|| {
            format!(
                "On its way through the brain the tip met {mean_mn:.0} mN on average beside friction, where the materials' cut_force_mn is \
                 {asked_mn}: tissue that is soft for such a force, or elements that are large for such a tip, give way before they are cut. \
                 Forces in the brain are wrong by as much, and another mesh gives others."
            )
        })
    }
}

/// The depth at which a path comes into the tissue at rest, mm.
pub(super) fn surface_mm(locator: &TetLocator, plan: &Plan) -> Option<f64> {
    plan.every(STEP_MM).find(|(_, at)| locator.locate(*at).is_some()).map(|(depth, _)| depth)
}

/// Depth and axial force of the tip on the way in, away from the brain's surface and the first ventricle.
fn between_walls(run: &Run) -> Option<Vec<(f64, f64)>> {
    let within = |r: &&super::run::Row| r.frame.at_tip == Some(Structure::Brain);
    let first = run.rows.iter().find(within)?.frame.depth_mm + CLEAR_MM;
    let last = run.csf().map_or(run.last()?.depth_mm, |f| f.depth_mm) - CLEAR_MM;
    let rows = run.rows.iter().map(|r| &r.frame).take_while(|f| f.depth_mm < last);
    let felt = rows.filter(|f| f.depth_mm > first).filter_map(|f| Some((f.depth_mm, f.axial_force_mn()?)));
    Some(felt.collect())
}

/// A cutting force that was not met as it was asked for.
pub(super) fn missed(run: &Run) -> Option<String> {
    Cutting::of(run)?.words()
}

/// A catheter that the materials' forces are not for.
pub(super) fn unlike(run: &Run) -> Option<String> {
    let (mm, tip) = (run.settings.diameter_mm, run.settings.tip);
    let other = (mm / CATHETER_MM - 1.0).abs() > LIKE || tip != TipShape::Round;
    (other && run.has_units() && run.materials_file.is_none()).then(|| {
        let shape = if tip == TipShape::Round { "a rounded" } else { "a conical" };
        format!(
            "Walls, cutting and friction bear what they bear against a rounded rod of {CATHETER_MM} mm, for {shape} one of {mm} mm, too: none of \
             these follows from --diameter and --tip, and what force is printed changes with them by the tissue that is moved alone. \
             Give those of your catheter with --materials."
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cutting_force_is_told_where_it_is_not_near_what_was_asked_for() {
        let said = |asked_mn: f64, mean_mn: f64| Cutting { asked_mn, mean_mn }.words();
        assert_eq!([said(80.0, 64.0), said(80.0, 74.0), said(80.0, 95.0)], [None, None, None]);
        let soft = said(80.0, 17.0).expect("a fifth of it");
        assert!(soft.contains("met 17 mN") && soft.contains("cut_force_mn is 80"), "{soft}");
        assert!(said(400.0, 169.0).is_some() && said(80.0, 110.0).is_some());
    }
}
