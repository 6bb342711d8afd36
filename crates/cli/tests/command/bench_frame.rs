//! `monro bench frame`: the shape of what it prints. Times are its subject and nobody's assertion.

use crate::common::{json, monro, refusal, text};
use monro_case::vtu::{self, UnstructuredGrid};
use monro_geometry::{Point, TetMesh};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// A column of 40 x 40 x 80 mm, in metres.
fn column(file: &Path) {
    let mut mesh = TetMesh::default();
    for i in 0..3 * 3 * 5 {
        let c = [i % 3, i / 3 % 3, i / 9].map(|c| c as f64 * 0.02);
        mesh.vertices.push(Point::from_array(c));
    }
    const PATHS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
    for i in 0..2 * 2 * 4 {
        for (p, path) in PATHS.iter().enumerate() {
            let mut c = [i % 2, i / 2 % 2, i / 4];
            let mut tet = [0u32; 4];
            for (k, corner) in tet.iter_mut().enumerate() {
                *corner = (c[0] + 3 * (c[1] + 3 * c[2])) as u32;
                if k < 3 {
                    c[path[k]] += 1;
                }
            }
            if p >= 3 {
                tet.swap(1, 2);
            }
            mesh.tets.push(tet);
            mesh.labels.push(4);
        }
    }
    fs::write(file, vtu::encode(&UnstructuredGrid::from_mesh(&mesh))).expect("written");
}

fn numbers(result: &Value) {
    for key in ["ms_median", "ms_p99", "cpu_ms_median", "volume_change", "residual_mm", "peak_memory_mib"] {
        assert!(result[key].is_number(), "{key}: {result}");
    }
    for stage in ["collision", "deformation", "surface", "check"] {
        assert!(result["stages_ms_median"][stage].is_number(), "{stage}: {result}");
    }
    let part = &result["predicted"];
    if part.is_object() {
        numbers(part);
        assert!(part["error_of_imposed"].as_f64().is_some_and(|e| e < 0.1), "{result}");
    }
    assert_eq!(result["inverted"], 0, "{result}");
    assert!(result["threads"].as_u64().is_some_and(|n| n >= 1), "{result}");
}

#[test]
fn the_bench_printed_a_hundred_lines_of_json_without_being_asked_for_json() {
    let dir = tempfile::tempdir().expect("temp");
    let file = dir.path().join("column.vtu");
    column(&file);
    let out = monro(&["bench", "frame", "--mesh", text(&file), "--frames", "4"]);
    let told = String::from_utf8(out.stdout).expect("text");
    assert_eq!(told.lines().count(), 2, "a heading and a row: {told}");
    assert!(told.starts_with("elements") && told.contains("ms median"), "{told}");
}

#[test]
fn a_mesh_is_probed_with_the_work_asked_for() {
    let dir = tempfile::tempdir().expect("temp");
    let file = dir.path().join("column.vtu");
    column(&file);
    for (work, kinds) in [
        ("edges,volumes", &["edges", "volumes"][..]),
        ("paper", &["edges", "volumes", "springs", "dihedral_angles", "triangles", "global_volume"]),
        ("physical", &["elements", "free_vertices", "pressures"]),
    ] {
        let result =
            json(&["bench", "frame", "--mesh", text(&file), "--scale", "1000", "--constraints", work, "--frames", "5"]);
        numbers(&result);
        let counts = result["constraints"].as_object().expect("counts");
        for (name, n) in counts {
            assert_eq!(n.as_u64() > Some(0), kinds.contains(&name.as_str()), "{name}: {result}");
        }
    }
}

#[test]
fn balls_of_each_size_are_made_and_pushed() {
    let result = json(&["bench", "frame", "--elements", "612", "--constraints", "edges,volumes", "--frames", "3"]);
    let sizes = result["sizes"].as_array().expect("sizes");
    assert_eq!(sizes.len(), 1);
    numbers(&sizes[0]);
    assert!((sizes[0]["elements"].as_f64().expect("count") / 612.0 - 1.0).abs() < 0.06);
}

#[test]
fn a_mesh_in_another_unit_is_refused_with_a_way_out() {
    let dir = tempfile::tempdir().expect("temp");
    let file = dir.path().join("column.vtu");
    column(&file);
    // It was ignored.
    let said = refusal(&["bench", "frame", "--elements", "612", "--scale", "1"]);
    assert!(said.contains("--scale") && said.contains("cannot be used"), "{said}");
    let said = refusal(&["bench", "frame", "--mesh", text(&file), "--scale", "1"]);
    assert!(said.contains("--scale") && said.contains("0.098 mm"), "{said}");
}
