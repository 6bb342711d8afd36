//! Other catheters that stand beside the one that is planned.

use super::{Run, coarse};
use crate::args::{SimulateArgs, path};
use anyhow::Result;
use monro_case::Case;
use monro_geometry::{Point, Structure};
use monro_guidance::Plan;
use serde_json::{Value, json};

/// Their paths, as asked for.
pub(super) fn paths(args: &SimulateArgs, case: &Case) -> Result<Vec<Plan>> {
    let one = |text: &String| {
        let [entry, target] = path("--beside", text)?;
        // Of which side it is nothing asks.
        Ok(Plan::new(case.plan.side(), entry, target)?)
    };
    args.beside.iter().map(one).collect()
}

/// A remark where the mesh, which is fine along the plan, is coarse along one of their paths.
pub(super) fn coarse(run: &Run) -> Option<String> {
    let (i, mm) = run.beside.iter().enumerate().find_map(|(i, plan)| Some((i, coarse::too_large(&run.rest, plan)?)))?;
    Some(format!(
        "The tetrahedra along the path of catheter {} beside have edges of {mm:.1} mm on average: the mesh is fine along the plan \
         alone. How deep it goes until walls give way depends on the mesh by some millimetres. \"monro prepare --elements\" makes all \
         of them smaller.",
        i + 1
    ))
}

/// What the tip of each lies in when the planned one has come to rest.
fn tips(run: &Run) -> impl Iterator<Item = (&Plan, Option<Structure>)> {
    run.beside.iter().enumerate().map(|(i, plan)| (plan, run.last().and_then(|f| f.beside(i))))
}

/// A line for each.
pub(super) fn words(run: &Run) -> impl Iterator<Item = String> {
    tips(run).map(|(plan, tip)| {
        let place = |p: Point<_>| p.to_array().map(|c| format!("{c:.1}")).join(", ");
        format!(
            "another catheter beside it, from ({}) to ({}) mm, its tip in {}",
            place(plan.entry()),
            place(plan.target()),
            tip.map_or_else(|| "no simulated tissue".into(), Structure::words)
        )
    })
}

/// For programs.
pub(super) fn json(run: &Run) -> Value {
    let one = |(plan, tip): (&Plan, Option<Structure>)| {
        json!({
            "entry_lps_mm": plan.entry().to_array(),
            "target_lps_mm": plan.target().to_array(),
            "at_tip": tip.map(Structure::name),
        })
    };
    tips(run).map(one).collect()
}
