//! What a solve found, for people.

use crate::columns::{Column, column, short, table};
use serde_json::{Value, json};

/// The verdict, the largest displacement, and the forces of supports and tools.
pub(super) fn of(found: &Value) -> String {
    let verdict = match (found["converged"].as_bool(), found["mode"] == "paper") {
        (Some(true), _) if found["mesh_converged"] == false => {
            "converged on this mesh, but FINER ONES CHANGE THE ANSWER, see the warnings above"
        }
        (Some(true), _) => "converged",
        (Some(false), _) if !found["self_crossing"].is_null() => {
            "NO ANSWER, the body passes through itself, see the warnings above"
        }
        (Some(false), _) => "NOT CONVERGED, see the warnings above",
        (None, _) => "done",
    };
    let work = match found["mode"] == "paper" {
        true => format!(
            "{} frames, largest motion in the last {} mm",
            short(&found["frames"]),
            short(&found["residual_mm"])
        ),
        false => format!(
            "residual {}, {} Newton steps on {} tetrahedra",
            short(&found["residual"]),
            short(&found["newton_steps"]),
            short(&found["tets_solved"])
        ),
    };
    let mut out = vec![
        format!(
            "{} on {}, {} mode: {verdict} ({work}, {} s)",
            short(&found["case"]),
            short(&found["mesh"]),
            short(&found["mode"]),
            short(&found["seconds"])
        ),
        format!("Largest displacement: {} mm", short(&found["max_displacement_mm"])),
    ];
    let forces = forces(found);
    if !forces.is_empty() {
        out.push(table(&forces, &columns()));
    }
    out.extend(found["note"].as_str().map(str::to_owned));
    out.push(format!("Written: {}", short(&found["out"])));
    out.join("\n")
}

/// A row for each set that holds and each tool that pushes, N.
fn forces(found: &Value) -> Vec<Value> {
    let held = found["reactions_N"].as_object().into_iter().flatten();
    let mut rows: Vec<Value> = held
        .map(|(set, force)| json!({ "of": format!("set {set}, holding {}", short(&found["reactions_held"][set])), "N": force }))
        .collect();
    for (key, tool) in [("punch_forces_N", "sphere"), ("rod_forces_N", "rod")] {
        let tools = found[key].as_array().into_iter().flatten().enumerate();
        rows.extend(tools.map(|(i, force)| json!({ "of": format!("{tool} {i}"), "N": force })));
    }
    rows
}

fn columns() -> [Column; 4] {
    [column("Force on the tissue, N", "/of"), column("x", "/N/0"), column("y", "/N/1"), column("z", "/N/2")]
}
