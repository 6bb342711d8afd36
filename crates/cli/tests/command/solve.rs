//! `monro solve` on a scene made here: a cube of six tetrahedra.

use crate::common::{json, monro, point, refusal, text};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};

const CORNERS: [[u8; 3]; 8] = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];
const TETS: [[u8; 4]; 6] = [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]];

/// A cube of 20 mm in metres, ASCII, with its sides as sets.
fn vtu() -> String {
    let rows = |f: &dyn Fn(&[u8; 3]) -> String| CORNERS.iter().map(f).collect::<Vec<_>>().join(" ");
    let points = rows(&|c| c.map(|v| format!("{}", f64::from(v) * 0.02)).join(" "));
    let array = |kind: &str, name: &str, n: u8, body: &str| {
        format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{n}\" format=\"ascii\">{body}</DataArray>"
        )
    };
    let sets: String = ["x", "y", "z"]
        .iter()
        .enumerate()
        .flat_map(|(a, axis)| [0, 1].map(|side| (a, format!("set_{axis}{side}"), side)))
        .map(|(a, name, side)| array("UInt8", &name, 1, &rows(&|c| u8::from(c[a] == side).to_string())))
        .collect();
    let tets = TETS.map(|t| t.map(|v| v.to_string()).join(" ")).join(" ");
    format!(
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\"><UnstructuredGrid>\
         <Piece NumberOfPoints=\"8\" NumberOfCells=\"6\"><Points>{}</Points><Cells>{}{}{}</Cells>\
         <PointData>{sets}</PointData><CellData>{}</CellData></Piece></UnstructuredGrid></VTKFile>",
        array("Float64", "Points", 3, &points),
        array("Int32", "connectivity", 1, &tets),
        array("Int32", "offsets", 1, "4 8 12 16 20 24"),
        array("UInt8", "types", 1, "10 10 10 10 10 10"),
        array("Int32", "region", 1, "1 1 1 1 1 1"),
    )
}

pub(crate) fn held(set: &str, components: &str, value: [f64; 3]) -> Value {
    json!({ "set": set, "components": components, "value": value })
}

fn scene(dir: &Path) -> PathBuf {
    let material = json!({ "1": { "E": 3000.0, "nu": 0.3 } });
    let slide = [held("x0", "x", [0.0; 3]), held("y0", "y", [0.0; 3]), held("z0", "z", [0.0; 3])];
    let stretched: Vec<Value> = slide.iter().cloned().chain([held("x1", "x", [0.006, 0.0, 0.0])]).collect();
    let clamped = [held("z0", "xyz", [0.0; 3])];
    let cases = json!({
        "stretch": { "materials": material, "dirichlet": stretched },
        "punch": { "materials": material, "dirichlet": clamped, "contact": [{
            "kind": "rigid_sphere", "radius": 0.02, "friction": 0.0,
            "centre_start": [0.01, 0.01, 0.041], "centre_end": [0.01, 0.01, 0.037] }] },
        "weight": { "materials": material, "dirichlet": clamped, "body_force": [0.0, 0.0, -1000.0] },
    });
    let meshes = json!({ "cube": { "file": "cube.vtu", "nodes": 8, "tets": 6 } });
    let scene = json!({ "energy": { "name": "stable_neo_hookean" }, "cases": cases, "meshes": meshes });
    fs::write(dir.join("cube.vtu"), vtu()).expect("mesh");
    let path = dir.join("scene.json");
    fs::write(&path, scene.to_string()).expect("scene");
    path
}

fn displacement(path: &Path) -> Vec<[f64; 3]> {
    let grid = monro_case::vtu::decode(&fs::read(path).expect("result")).expect("a VTU");
    assert_eq!(grid.points[6], [0.02; 3]);
    let array = monro_case::vtu::find(&grid.point_data, "displacement").expect("displacement");
    array.values.as_chunks::<3>().0.to_vec()
}

#[test]
fn a_stretched_cube_has_the_closed_form_in_metres_and_newtons() {
    let dir = tempfile::tempdir().expect("temp");
    let (scene, out) = (scene(dir.path()), dir.path().join("out.vtu"));
    let told = json(&["solve", text(&scene), "--mesh", "cube", "--case", "stretch", "--out", text(&out)]);
    assert_eq!(told["converged"], true);
    // E 3 kPa, nu 0.3, stretch 1.3: the lateral stretch and the stress of the reference material.
    let (lateral, stress) = (0.916_644_252_9, 1.885_569_482_9 / 0.05 / 0.05);
    let corner = displacement(&out)[6];
    for (got, wanted) in corner.iter().zip([0.006, (lateral - 1.0) * 0.02, (lateral - 1.0) * 0.02]) {
        assert!((got - wanted).abs() < 1e-8, "{corner:?}");
    }
    let force = point(&told["reactions_N"]["x1"])[0];
    assert!((force / (stress * 4e-4) - 1.0).abs() < 1e-6, "{force} N");
}

#[test]
fn an_existing_file_was_replaced_without_force() {
    let dir = tempfile::tempdir().expect("temp");
    let (scene, out) = (scene(dir.path()), dir.path().join("out.vtu"));
    let ask = ["solve", text(&scene), "--mesh", "cube", "--case", "stretch", "--out", text(&out)];
    fs::write(&out, "mine").expect("write");
    assert!(refusal(&ask).contains("--force"));
    assert_eq!(fs::read(&out).expect("still there"), b"mine");
    json(&[&ask[..], &["--force"]].concat());
    displacement(&out);
    let told = String::from_utf8(monro(&[&ask[..], &["--force"]].concat()).stdout).expect("text");
    assert!(!told.contains('{') && told.contains("converged") && told.contains("set x1, holding x"), "JSON: {told}");
}

#[test]
fn a_punch_is_felt_and_weight_is_borne() {
    let dir = tempfile::tempdir().expect("temp");
    let (scene, out) = (scene(dir.path()), dir.path().join("out.vtu"));
    let ask = |case: &str, mode: &str| {
        let what = ["solve", text(&scene), "--mesh", "cube", "--case", case, "--mode", mode];
        let refine: &[&str] = if mode == "physical" { &["--refine", "1"] } else { &[] };
        json(&[&what[..], &["--out", text(&out), "--force"], refine].concat())
    };
    let punch = ask("punch", "physical");
    let (force, borne) = (punch["punch_force_N"].as_f64().expect("force"), point(&punch["reactions_N"]["z0"])[2]);
    assert!(force > 1e-3 && (force - borne).abs() < 1e-5 * force.max(1.0), "{punch}");
    let weight = ask("weight", "physical");
    assert!((point(&weight["reactions_N"]["z0"])[2] - 1000.0 * 8e-6).abs() < 1e-8, "{weight}");
    let paper = ask("weight", "paper");
    assert_eq!(paper["converged"], true, "{paper}");
    assert!(displacement(&out)[6][2] < 0.0);
}

#[test]
fn paper_mode_holds_single_components_too() {
    let dir = tempfile::tempdir().expect("temp");
    let (scene, out) = (scene(dir.path()), dir.path().join("out.vtu"));
    let ask = ["solve", text(&scene), "--mesh", "cube", "--case", "stretch", "--mode", "paper", "--out", text(&out)];
    assert_eq!(json(&ask)["converged"], true);
    for (corner, moved) in CORNERS.iter().zip(displacement(&out)) {
        for a in 0..3 {
            // The near sides slide in their planes; the far one is pulled along x, the other two come nearer.
            match (corner[a], a) {
                (0, _) => assert!(moved[a].abs() < 1e-9, "{corner:?}: {moved:?}"),
                (_, 0) => assert!((moved[0] - 0.006).abs() < 1e-9, "{corner:?}: {moved:?}"),
                _ => assert!((-0.006..-0.000_2).contains(&moved[a]), "{corner:?}: {moved:?}"),
            }
        }
    }
}

#[test]
fn no_time_gives_what_there_is_and_says_so() {
    let dir = tempfile::tempdir().expect("temp");
    let (scene, out) = (scene(dir.path()), dir.path().join("out.vtu"));
    let args = ["solve", text(&scene), "--mesh", "cube", "--case", "weight", "--out", text(&out), "--budget-ms", "0"];
    let told = json(&args);
    assert_eq!(told["converged"], false, "{told}");
    assert_eq!(displacement(&out).len(), 8);
}

#[test]
fn what_a_scene_does_not_have_is_listed() {
    let dir = tempfile::tempdir().expect("temp");
    let (scene, out) = (scene(dir.path()), dir.path().join("out.vtu"));
    let ask = |mesh: &str, case: &str, mode: &str| {
        refusal(&["solve", text(&scene), "--mesh", mesh, "--case", case, "--out", text(&out), "--mode", mode])
    };
    let said = ask("fine", "stretch", "physical");
    assert!(said.contains("\"fine\"") && said.contains("there are: cube"), "{said}");
    let said = ask("cube", "bend", "physical");
    assert!(said.contains("\"bend\"") && ["stretch", "punch", "weight"].iter().all(|c| said.contains(c)), "{said}");
    assert!(!out.exists());
}

/// The scene with one change, asked for the case "stretch".
pub(crate) fn changed(dir: &Path, change: impl FnOnce(&mut Value)) -> [String; 8] {
    let path = scene(dir);
    let mut value: Value = serde_json::from_slice(&fs::read(&path).expect("scene")).expect("JSON");
    change(&mut value);
    fs::write(&path, value.to_string()).expect("scene");
    let out = dir.join("out.vtu");
    ["solve", text(&path), "--mesh", "cube", "--case", "stretch", "--out", text(&out)].map(str::to_owned)
}

#[test]
fn what_is_wrong_in_a_scene_is_named_with_its_number_and_a_way_out() {
    let case = "/cases/stretch";
    let put = |at: &str, value: Value| (format!("{case}{at}"), value);
    let table = [
        (put("/materials/1", json!({ "E": 3000.0 })), vec!["region 1", "E and nu", "lam_hat"]),
        (put("/materials/1/E", json!(-3.0)), vec!["region 1", "-3 Pa", "more than 0"]),
        (put("/materials/1/E", json!(1e13)), vec!["region 1", "1e13 Pa", "1e-6 to 1e12"]),
        (put("/materials/1/nu", json!(0.5)), vec!["region 1", "0.5", "0.4999", "0.499 "]),
        (put("/materials/1/nu", json!(-0.2)), vec!["region 1", "-0.2", "from 0 to below 0.4999", "say 0 for"]),
        (
            put("/materials/1", json!({ "E": 3000.0, "nu": 0.3, "mu": 5.0, "lam": 3.0 })),
            vec!["region 1", "mean mu 1153.8", "mu 5"],
        ),
        (
            put("/materials", json!({ "2": { "E": 1.0, "nu": 0.3 } })),
            vec!["6 of 6 tetrahedra", "region 1", "regions 2", "add"],
        ),
        (put("/dirichlet/0/set", json!("left")), vec!["set_left", "set_x0"]),
        (put("/dirichlet/0/components", json!("")), vec!["x0", "xyz"]),
        (put("/dirichlet/0/components", json!(["x"])), vec!["x0", "[\"x\"]", "xyz"]),
        (put("/dirichlet/0/value", json!([0.0, "nan", 0.0])), vec!["x0", "nan", "three numbers"]),
        // One of the two would have counted, in silence.
        (
            put("/materials", json!({ "1": { "E": 3000.0, "nu": 0.3 }, "01": { "E": 500.0, "nu": 0.3 } })),
            vec!["region \"01\"", "plain number"],
        ),
        (("/energy".into(), json!("ogden")), vec!["ogden", "stable_neo_hookean"]),
        (("/energy".into(), json!(3)), vec!["energy", "3", "text"]),
        (("/meshes/cube/nodes".into(), json!(9)), vec!["8 nodes", "says 9"]),
        (("/meshes/cube/nodes".into(), json!("8")), vec!["8 nodes", "says \"8\""]),
        (("/meshes/cube/nodes".into(), json!(8.5)), vec!["8 nodes", "says 8.5"]),
    ];
    for ((pointer, value), said) in table {
        let dir = tempfile::tempdir().expect("temp");
        let args = changed(dir.path(), |scene| *scene.pointer_mut(&pointer).expect("an entry") = value);
        let told = refusal(&args.each_ref().map(String::as_str));
        assert!(said.iter().all(|s| told.contains(s)), "{pointer}: {told}");
        assert!(!dir.path().join("out.vtu").exists());
    }
}

#[test]
fn a_weight_that_nothing_bears_is_refused() {
    let dir = tempfile::tempdir().expect("temp");
    let args = changed(dir.path(), |s| {
        s["cases"]["stretch"]["dirichlet"] = json!([held("x0", "x", [0.0; 3])]);
        s["cases"]["stretch"]["body_force"] = json!([0.0, 0.0, -1000.0]);
    });
    let told = refusal(&args.each_ref().map(String::as_str));
    assert!(told.contains("no support") && told.contains("carried away"), "{told}");
}

#[test]
fn entries_that_say_two_things_at_once_were_taken_for_one_of_them() {
    let faces = json!({ "top": [[4, 5, 6]] });
    let pressed = json!([{ "faces": "top", "pressure": 10.0 }]);
    let sphere = json!({ "radius": 0.01, "centre_start": [0.01, 0.01, 0.041], "centre_end": [0.01, 0.01, 0.037] });
    let cases = [
        ("contact", json!([{ "rigid_sphere": sphere, "radius": 0.02 }]), "\"radius\" beside"),
        ("contact", json!([{ "type": "rigid_sphere", "shape": "cone" }]), "shape \"cone\""),
        ("pressure", pressed, "two face lists"),
    ];
    for (entry, value, expected) in cases {
        let dir = tempfile::tempdir().expect("temp");
        let args = changed(dir.path(), |s| {
            (s["meshes"]["cube"]["faces"], s["meshes"]["cube"]["face_sets"]) = (faces.clone(), faces.clone());
            s["cases"]["stretch"][entry] = value.clone();
        });
        let told = refusal(&args.each_ref().map(String::as_str));
        assert!(told.contains(expected), "{told}");
    }
}

#[test]
fn what_is_odd_but_legal_is_solved_and_remarked_upon() {
    let dir = tempfile::tempdir().expect("temp");
    // E 3 kPa and nu 0.3 by their Lamé constants, a misspelt weight, the end pulled by two sets, the latter as before.
    let args = changed(dir.path(), |s| {
        let (mu, lam) = (3000.0 / 2.6, 0.9 * 1000.0 / (1.3 * 0.4));
        let case = &mut s["cases"]["stretch"];
        case["materials"]["1"] = json!({ "mu": mu, "lam_hat": mu + lam });
        case["bodyforce"] = json!([0.0, 0.0, -10.0]);
        let end = case["dirichlet"].as_array_mut().expect("a list").pop().expect("the end");
        case["dirichlet"].as_array_mut().expect("a list").extend([held("x1", "x", [0.001; 3]), end]);
        s["energy"] = json!("stable_neo_hookean");
        // Two regions under another name, as "monro mesh" calls them.
        let mesh = vtu().replace("Name=\"region\"", "Name=\"label\"").replace(">1 1 1 1 1 1<", ">4 5 4 4 4 5<");
        fs::write(dir.path().join("cube.vtu"), mesh).expect("mesh");
    });
    let told = json(&args.each_ref().map(String::as_str));
    assert_eq!((told["converged"].as_bool(), told["turned"].as_u64()), (Some(true), Some(0)), "{told}");
    let stress = 1.885_569_482_9 / 0.05 / 0.05;
    let pulled = told["reactions_N"]["x1"][0].as_f64().expect("a force");
    assert!((pulled / (stress * 4e-4) - 1.0).abs() < 1e-4, "{told}");
    let remarks = told["remarks"].to_string();
    assert!(
        remarks.contains("bodyforce")
            && remarks.contains("x1")
            && remarks.contains("4 components")
            && remarks.contains("not read: label"),
        "{remarks}"
    );
}

#[test]
fn the_example_of_the_documentation_gives_what_is_printed_there() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let page = fs::read_to_string(root.join("docs/scenes.md")).expect("docs/scenes.md");
    let (dir, scene) = (tempfile::tempdir().expect("temp"), root.join("examples/block/scene.json"));
    for case in ["weight", "sphere", "pressure", "rod"] {
        let out = dir.path().join(case).with_extension("vtu");
        let ask = ["solve", text(&scene), "--mesh", "block", "--case", case, "--refine", "0", "--out", text(&out)];
        let told = String::from_utf8(monro(&ask).stdout).expect("text");
        let (first, moved) = (told.lines().next().unwrap_or_default(), told.lines().nth(1).unwrap_or_default());
        assert!(first.starts_with(&format!("{case} on block, physical mode: converged")), "{told}");
        assert!(moved.starts_with("Largest") && page.contains(moved), "not in docs/scenes.md: {told}");
    }
}
