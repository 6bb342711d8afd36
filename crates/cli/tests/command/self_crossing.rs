//! Bodies that pass through themselves: nothing keeps tissue from itself, so that has to be told.

use crate::common::{json, monro, point, text};
use monro_case::vtu::{self, DataArray, Kind, UnstructuredGrid};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

/// Edge of a cell, m.
const EDGE: f64 = 0.01;

/// A U of seven cubes of 10 mm, six tetrahedra each, with its foot and the ends of its arms as sets.
fn horseshoe() -> UnstructuredGrid {
    let cells = [[0, 0], [1, 0], [2, 0], [0, 1], [2, 1], [0, 2], [2, 2]];
    let mut nodes: Vec<[u8; 3]> = Vec::new();
    let mut tets = Vec::new();
    for [x, z] in cells {
        for order in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
            let mut at = [x, 0, z];
            let mut corners = vec![at];
            for axis in order {
                at[axis] += 1;
                corners.push(at);
            }
            let mut node = |p| nodes.iter().position(|n| *n == p).unwrap_or_else(|| (nodes.push(p), nodes.len() - 1).1);
            let tet: Vec<u32> = corners.into_iter().map(|p| node(p) as u32).collect();
            let even = order[1] == (order[0] + 1) % 3;
            tets.push(if even { [tet[0], tet[1], tet[2], tet[3]] } else { [tet[0], tet[1], tet[3], tet[2]] });
        }
    }
    let set = |name: &str, holds: &dyn Fn(&[u8; 3]) -> bool| {
        DataArray::scalars(name, Kind::UInt8, nodes.iter().map(|n| f64::from(u8::from(holds(n)))).collect())
    };
    let ends = |n: &[u8; 3], left: bool| n[2] == 3 && (n[0] < 2) == left;
    UnstructuredGrid {
        points: nodes.iter().map(|n| n.map(|c| f64::from(c) * EDGE)).collect(),
        point_data: vec![
            set("set_foot", &|n| n[2] == 0),
            set("set_left", &|n| ends(n, true)),
            set("set_right", &|n| ends(n, false)),
        ],
        cell_data: vec![DataArray::scalars("region", Kind::Int32, vec![1.0; tets.len()])],
        tets,
        ..UnstructuredGrid::default()
    }
}

/// Arguments that solve with the ends of the arms moved towards each other, each by `by` m.
fn pinched(dir: &Path, by: f64, mode: &str) -> Vec<String> {
    let held = |set: &str, value: [f64; 3]| json!({ "set": set, "components": "xyz", "value": value });
    let case = json!({
        "materials": { "1": { "E": 3000.0, "nu": 0.3 } },
        "dirichlet": [held("foot", [0.0; 3]), held("left", [by, 0.0, 0.0]), held("right", [-by, 0.002, 0.0])],
    });
    let scene = json!({
        "energy": { "name": "stable_neo_hookean" },
        "meshes": { "u": { "file": "u.vtu" } },
        "cases": { "pinch": case },
    });
    fs::write(dir.join("u.vtu"), vtu::encode(&horseshoe())).expect("mesh");
    fs::write(dir.join("scene.json"), scene.to_string()).expect("scene");
    let (scene, out) = (dir.join("scene.json"), dir.join("out.vtu"));
    let args = ["solve", text(&scene), "--mesh", "u", "--case", "pinch", "--mode", mode, "--out", text(&out)];
    args.map(str::to_owned).to_vec()
}

fn told(by: f64, mode: &str) -> Value {
    let dir = tempfile::tempdir().expect("temp");
    let args = pinched(dir.path(), by, mode);
    json(&args.iter().map(String::as_str).collect::<Vec<_>>())
}

#[test]
fn arms_pressed_through_each_other_were_an_answer_without_a_word() {
    for mode in ["physical", "paper"] {
        let found = told(0.008, mode);
        assert_eq!(found["converged"], false, "{mode}: {found}");
        assert_eq!(found["turned"], 0, "{mode}: {found}");
        let crossing = &found["self_crossing"];
        assert!(crossing["pairs"].as_u64() > Some(4), "{mode}: {found}");
        let at = point(&crossing["at_m"]);
        assert!((0.01..0.02).contains(&at[0]) && at[2] > 0.015 && at[2] < 0.031, "{mode}: {at:?}");
        assert!(found["remarks"].to_string().contains("passes through itself"), "{found}");
    }
}

#[test]
fn arms_that_only_come_near_are_an_answer() {
    for mode in ["physical", "paper"] {
        let found = told(0.003, mode);
        assert_eq!((&found["converged"], &found["self_crossing"]), (&true.into(), &Value::Null), "{mode}: {found}");
        assert!(!found["remarks"].to_string().contains("passes through itself"), "{found}");
    }
}

#[test]
fn a_body_that_passes_through_itself_is_said_to_on_the_terminal() {
    let dir = tempfile::tempdir().expect("temp");
    let args = pinched(dir.path(), 0.008, "physical");
    let done = monro(&args.iter().map(String::as_str).collect::<Vec<_>>());
    let [out, err] = [done.stdout, done.stderr].map(|t| String::from_utf8(t).expect("text"));
    assert!(out.contains("NO ANSWER, the body passes through itself"), "{out}");
    assert!(err.contains("warning: the surface of the tissue"), "{err}");
}
