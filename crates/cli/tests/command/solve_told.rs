//! What `monro solve` refuses and remarks upon.

use crate::common::{json, monro, point, refusal, text};
use crate::solve::{changed, held};
use monro_case::vtu;
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

/// What is told of the case "stretch", changed.
fn told(change: impl FnOnce(&mut Value)) -> Value {
    let dir = tempfile::tempdir().expect("temp");
    let args = changed(dir.path(), |s| change(&mut s["cases"]["stretch"]));
    json(&args.each_ref().map(String::as_str))
}

/// What is said when the case "stretch", changed, is refused.
fn refused(change: impl FnOnce(&mut Value)) -> String {
    let dir = tempfile::tempdir().expect("temp");
    let args = changed(dir.path(), |s| change(&mut s["cases"]["stretch"]));
    refusal(&args.each_ref().map(String::as_str))
}

fn remarks(told: &Value) -> String {
    told["remarks"].as_array().expect("remarks").iter().filter_map(Value::as_str).collect::<Vec<_>>().join("\n")
}

#[track_caller]
fn says(said: &str, words: &[&str]) {
    assert!(words.iter().all(|w| said.contains(w)), "{words:?} in: {said}");
}

fn punched(from: [f64; 3], to: [f64; 3]) -> impl FnOnce(&mut Value) {
    move |case| {
        case["dirichlet"] = json!([held("z0", "xyz", [0.0; 3])]);
        case["contact"] = json!([{ "radius": 0.02, "fricton": 0.3, "centre_start": from, "centre_end": to }]);
    }
}

fn rod(radius: f64, end: f64) -> impl FnOnce(&mut Value) {
    move |case| {
        case["embedded_rod"] = json!({ "radius": radius, "p0": [0.01, 0.01, 0.005], "p1": [0.01, 0.01, end],
            "displacement": [0.0, 0.0, 0.001], "cupling": "bonded" });
    }
}

#[test]
fn the_scene_s_own_files_are_not_overwritten() {
    let dir = tempfile::tempdir().expect("temp");
    let args = changed(dir.path(), |s| s["meshes"]["other"] = json!({ "file": "other.vtu" }));
    let [mesh, other, link] = ["cube.vtu", "other.vtu", "link.vtu"].map(|n| dir.path().join(n));
    fs::copy(&mesh, &other).expect("copy");
    std::os::unix::fs::symlink(&mesh, &link).expect("link");
    let before = fs::read(&mesh).expect("mesh");
    for out in [&mesh, &other, &link, &dir.path().join("./cube.vtu")] {
        let mut args = args.each_ref().map(String::as_str);
        args[7] = text(out);
        says(&refusal(&args), &[text(out), "command reads", "elsewhere"]);
        assert_eq!(fs::read(out).expect("mesh"), before);
    }
    let mut args = args.each_ref().map(String::as_str);
    let nowhere = dir.path().join("none/out.vtu");
    args[7] = text(&nowhere);
    says(&refusal(&args), &["no folder", "none"]);
}

#[test]
fn a_set_is_told_forces_only_in_components_that_it_holds() {
    // The far side holds x only, but shares vertices with sides that bear forces along y.
    let told = told(|case| case["dirichlet"].as_array_mut().expect("list").push(held("y1", "y", [0.0; 3])));
    let force = |set: &str| point(&told["reactions_N"][set]);
    assert!(force("y1")[1].abs() > 1e-3 && force("y1")[0] == 0.0, "{told}");
    assert!(force("x1")[0].abs() > 1e-3 && force("x1")[1..] == [0.0; 2], "{told}");
    assert_eq!(told["reactions_held"]["x1"], "x");
}

#[test]
fn a_set_of_three_numbers_a_node_held_the_wrong_nodes() {
    let dir = tempfile::tempdir().expect("temp");
    let args = changed(dir.path(), |_| ());
    let path = dir.path().join("cube.vtu");
    let mut grid = vtu::decode(&fs::read(&path).expect("mesh")).expect("VTU");
    let array = grid.point_data.iter_mut().find(|a| a.name == "set_x0").expect("set");
    array.values = array.values.iter().flat_map(|&v| [v; 3]).collect();
    array.components = 3;
    fs::write(&path, vtu::encode(&grid)).expect("mesh");
    says(&refusal(&args.each_ref().map(String::as_str)), &["set_x0", "3 components", "one number a node"]);
}

#[test]
fn a_sphere_as_good_as_flat_sank_into_what_it_pressed_on() {
    // On rollers all around, pressed by 0.5 of 20 mm: (mu + lam_hat) d / H on each area, with this energy exactly.
    let (young, nu) = (3000.0, 0.49);
    let dir = tempfile::tempdir().expect("temp");
    let args = changed(dir.path(), |scene| {
        let case = &mut scene["cases"]["stretch"];
        case["materials"] = json!({ "1": { "E": young, "nu": nu } });
        let walls = [("x0", "x"), ("x1", "x"), ("y0", "y"), ("y1", "y"), ("z0", "z")];
        case["dirichlet"] = walls.map(|(set, held_in)| held(set, held_in, [0.0; 3])).into();
        case["contact"] =
            json!([{ "radius": 100.0, "centre_start": [0.01, 0.01, 100.02], "centre_end": [0.01, 0.01, 100.0195] }]);
    });
    let told = json(&args.iter().map(String::as_str).chain(["--refine", "0"]).collect::<Vec<_>>());
    let mu = young / (2.0 * (1.0 + nu));
    let lam = young * nu / ((1.0 + nu) * (1.0 - 2.0 * nu));
    let wanted = (2.0 * mu + lam) * 0.5 / 20.0 * 0.02 * 0.02;
    let found = -point(&told["punch_forces_N"][0])[2];
    assert!((found / wanted - 1.0).abs() < 0.005, "{found} for {wanted}: {told}");
}

#[test]
fn a_set_named_twice_is_told_all_components_once() {
    let told = told(|case| {
        let list = case["dirichlet"].as_array_mut().expect("list");
        list.push(held("x1", "y", [0.0; 3]));
        list.push(held("x1", "x", [0.006, 0.0, 0.0]));
    });
    assert_eq!(told["reactions_held"]["x1"], "xy");
    let [near, far] = ["x0", "x1"].map(|s| point(&told["reactions_N"][s])[0]);
    assert!((near + far).abs() < 1e-6 * far.abs(), "{told}");
}

#[test]
fn elements_turned_inside_out_are_remarked_upon_and_not_called_converged() {
    let told = told(|case| {
        case["dirichlet"] = json!([held("z0", "xyz", [0.0; 3]), held("z1", "xyz", [0.0, 0.0, -0.025])]);
    });
    assert!(told["turned"].as_u64() > Some(0), "{told}");
    assert_eq!(told["converged"], false, "{told}");
    says(&remarks(&told), &["turned inside out", "6 of the mesh as given", "tetrahedron"]);
}

/// An answer that changed by 61 % from mesh to mesh was `converged` for whoever read that alone.
#[test]
fn whether_finer_meshes_change_the_answer_is_told_in_a_field_of_its_own() {
    let dir = tempfile::tempdir().expect("temp");
    let args = changed(dir.path(), |s| {
        let pulled = [held("z0", "xyz", [0.0; 3]), held("z1", "xyz", [0.004, 0.0, 0.0])];
        s["cases"]["stretch"]["dirichlet"] = json!(pulled);
    });
    let args = [&args.each_ref().map(String::as_str)[..], &["--force", "--refine"]].concat();
    let of = |t: &Value| (t["converged"].clone(), t["mesh_converged"].clone(), t["finer_given_up"].clone());
    let even = told(|_| {});
    assert_eq!(of(&even), (json!(true), json!(true), Value::Null), "{even}");
    for (times, mesh) in [("0", Value::Null), ("1", json!(false))] {
        let sheared = json(&[&args[..], &[times]].concat());
        assert_eq!(of(&sheared), (json!(true), mesh, Value::Null), "{sheared}");
    }
    let words = String::from_utf8(monro(&[&args[..], &["1"]].concat()).stdout).expect("text");
    says(&words, &["converged on this mesh", "FINER ONES CHANGE THE ANSWER"]);
}

/// Bars near incompressible were called converged with a corner crushed to a fifth of its volume, without a word.
#[test]
fn what_hardly_changes_its_volume_and_lost_half_is_remarked_upon() {
    let pressed = |poisson: f64, by: f64| {
        let told = told(|case| {
            case["materials"]["1"]["nu"] = json!(poisson);
            case["dirichlet"] = json!([held("z0", "xyz", [0.0; 3]), held("z1", "xyz", [0.0, 0.0, by])]);
        });
        remarks(&told)
    };
    says(&pressed(0.49, -0.012), &["6 elements", "tetrahedron 0, 40 %", "Poisson's ratio", "--refine"]);
    for (poisson, by) in [(0.3, -0.012), (0.49, -0.002)] {
        assert!(!pressed(poisson, by).contains("Poisson"), "{poisson} {by}");
    }
}

#[test]
fn a_sphere_that_never_touches_is_told_with_its_distance() {
    let near = told(punched([0.01, 0.01, 0.1], [0.01, 0.01, 0.06]));
    says(&remarks(&near), &["sphere 0 does not touch it in the end", "60.0000 mm", "20.0000 mm"]);
    // What rounding leaves of forces had "changed by 10 %".
    assert!(near["mesh_change"]["force"].as_f64().is_none_or(|f| f == 0.0), "{near}");
    let deep = told(punched([0.01, 0.01, 0.039], [0.01, 0.01, 0.038]));
    says(&remarks(&deep), &["sphere 0 begins 1.0000 mm deep"]);
    let far = told(punched([0.01, 0.01, 5.0], [0.01, 0.01, 0.039]));
    says(&remarks(&far), &["the way of sphere 0", "4961 mm", "34.6"]);
    assert!(far["punch_force_N"].as_f64() > Some(1e-3) && far["converged"] == true, "{far}");
}

#[test]
fn a_misspelt_field_is_named() {
    says(&remarks(&told(punched([0.01, 0.01, 0.041], [0.01, 0.01, 0.039]))), &["contact 0", "fricton"]);
    says(&remarks(&told(rod(0.005, 0.015))), &["embedded_rod", "cupling"]);
    let told = told(|case| {
        case["dirichlet"][0]["components_"] = json!("y");
        case["materials"]["1"]["E_kPa"] = json!(3.0);
        case["description"] = json!("nothing odd");
    });
    says(&remarks(&told), &["dirichlet 0", "components_", "materials of region 1", "E_kPa"]);
    assert!(!remarks(&told).contains("description"));
}

/// The error told that the right name was null, and the wrong name was never told.
#[test]
fn a_field_that_is_missing_is_told_with_what_was_not_read() {
    let from_to = |case: &mut Value| {
        case["contact"] = json!([{ "radius": 0.02, "center_start": [0, 0, 0.05], "centre_end": [0, 0, 0.04] }]);
    };
    says(&refused(from_to), &["there is no \"centre_start\", wanted three numbers", "contact 0: center_start"]);
    says(
        &refused(|case| case["dirichlet"][0] = json!({ "set": "x0", "component": "x", "value": [0, 0, 0] })),
        &["there is no \"components\"", "dirichlet 0: component"],
    );
    let dir = tempfile::tempdir().expect("temp");
    let args =
        changed(dir.path(), |s| s["meshs"] = s.as_object_mut().and_then(|s| s.remove("meshes")).expect("meshes"));
    says(&refusal(&args.each_ref().map(String::as_str)), &["no \"meshes\"; there are: energy, cases, meshs"]);
}

#[test]
fn a_key_that_stands_twice_was_called_no_json() {
    let dir = tempfile::tempdir().expect("temp");
    let args = changed(dir.path(), |_| ());
    fs::write(&args[1], "{\"units\": \"SI\",\n \"units\": \"SI\"}").expect("scene");
    let said = refusal(&args.each_ref().map(String::as_str));
    says(&said, &["the key \"units\" stands twice in one object at line 2", "leave one of them"]);
    assert!(!said.contains("not JSON"), "{said}");
}

#[test]
fn a_sphere_on_a_body_that_nothing_holds_is_told() {
    let loose = told(|case| {
        punched([0.01, 0.01, 0.041], [0.01, 0.01, 0.039])(case);
        case["dirichlet"] = json!([]);
    });
    says(&remarks(&loose), &["nothing holds the body", "pushes it along"]);
}

#[test]
fn paper_mode_took_refine_without_a_word() {
    let dir = tempfile::tempdir().expect("temp");
    let args = changed(dir.path(), |_| ());
    let args = [&args.each_ref().map(String::as_str)[..], &["--mode", "paper", "--refine", "1"]].concat();
    says(&refusal(&args), &["--refine needs --mode physical"]);
}

/// Only keys within a case were looked at: "unit" for "units" was read as SI without a word.
#[test]
fn a_misspelt_field_beside_the_cases_is_named() {
    let dir = tempfile::tempdir().expect("temp");
    let args = changed(dir.path(), |s| {
        (s["unit"], s["title"]) = (json!("mm"), json!("nothing odd"));
        s["meshes"]["cube"]["face_set"] = json!({});
    });
    let said = remarks(&json(&args.each_ref().map(String::as_str)));
    says(&said, &["not read in the scene: unit (", "not read in the mesh: face_set ("]);
    assert!(!said.contains("title"), "{said}");
}

/// It was "stopped before the tolerance was met", with a residual of 0, as if a little more patience would do.
#[test]
fn a_pressure_that_no_body_bears_is_no_answer() {
    let dir = tempfile::tempdir().expect("temp");
    let args = changed(dir.path(), |s| {
        s["meshes"]["cube"]["face_sets"] = json!({ "top": [[4, 5, 6]] });
        let case = &mut s["cases"]["stretch"];
        case["dirichlet"] = json!([held("z0", "xyz", [0.0; 3])]);
        case["pressure"] = json!([{ "faces": "top", "pressure": 1e12 }]);
    });
    let coarse = args.iter().map(String::as_str).chain(["--refine", "0"]);
    let told = json(&coarse.collect::<Vec<_>>());
    assert_eq!(told["converged"], false, "{told}");
    says(&remarks(&told), &["a pressure of 1.000e12 Pa is 333333333 times", "no answer", "as it was", "impose less"]);
}

/// The same entry given twice pushed twice as hard without a word.
#[test]
fn faces_that_two_pressures_act_on_are_named() {
    let twice = |second: Value| {
        let dir = tempfile::tempdir().expect("temp");
        let args = changed(dir.path(), |s| {
            s["meshes"]["cube"]["face_sets"] = json!({ "top": [[4, 5, 6]], "same": second });
            let entry = |faces| json!({ "faces": faces, "pressure": 10.0 });
            s["cases"]["stretch"]["pressure"] = json!([entry("top"), entry("same")]);
        });
        let coarse = args.iter().map(String::as_str).chain(["--refine", "0"]);
        remarks(&json(&coarse.collect::<Vec<_>>()))
    };
    says(&twice(json!([[6, 4, 5]])), &["entries 0 and 1", "1 in all", "[4, 5, 6]", "add up"]);
    let apart = twice(json!([[4, 6, 7]]));
    assert!(!apart.contains("add up"), "{apart}");
}

#[test]
fn millimetres_written_as_metres_are_seen() {
    says(&refused(|case| case["dirichlet"][3]["value"] = json!([6, 0, 0])), &["\"x1\"", "6000 mm", "34.6", "0.006"]);
    says(&remarks(&told(rod(0.005, 5.0))), &["length of rod 0", "4995 mm", "34.6"]);
    let large = told(|case| {
        case["contact"] =
            json!({ "radius": 20, "centre_start": [0.01, 0.01, 20.1], "centre_end": [0.01, 0.01, 20.05] });
    });
    says(&remarks(&large), &["radius of sphere 0", "20000 mm", "0.02"]);
}

#[test]
fn a_sphere_that_swallows_the_body_is_refused() {
    let said = refused(|case| {
        case["contact"] = json!({ "radius": 20, "centre_start": [0.01, 0.01, 0.05], "centre_end": [0.01, 0.01, 0.04] });
    });
    says(&said, &["sphere 0 begins in the body", "19966.8338 mm", "34.6", "outside"]);
}

#[test]
fn a_rod_without_radius_and_a_sphere_with_negative_friction_are_told_apart() {
    let said = refused(rod(0.0, 0.015));
    says(&said, &["rod 0", "radius 0 mm", "above 0"]);
    assert!(!said.contains("friction"), "{said}");
    let said = refused(|case| {
        case["contact"] = json!({ "radius": 0.02, "friction": -0.1, "centre_start": [0.01, 0.01, 0.05],
            "centre_end": [0.01, 0.01, 0.04] });
    });
    says(&said, &["sphere 0", "friction -0.1", "from 0"]);
}

#[test]
fn not_a_number_in_the_json_is_named() {
    let dir = tempfile::tempdir().expect("temp");
    let args = changed(dir.path(), |_| ());
    let written = fs::read_to_string(&args[1]).expect("scene").replace("0.006", "NaN");
    fs::write(&args[1], written).expect("scene");
    says(&refusal(&args.each_ref().map(String::as_str)), &["line 1", "no NaN", "finite"]);
}

/// The mesh of the scene with one text replaced.
fn with_mesh(dir: &Path, from: &str, to: &str) -> [String; 8] {
    let args = changed(dir, |_| ());
    let mesh = dir.join("cube.vtu");
    let written = fs::read_to_string(&mesh).expect("mesh");
    assert!(written.contains(from), "{written}");
    fs::write(&mesh, written.replace(from, to)).expect("mesh");
    args
}

#[test]
fn an_element_of_the_other_orientation_is_named_with_a_way_out() {
    let dir = tempfile::tempdir().expect("temp");
    let args = with_mesh(dir.path(), "0 2 3 6", "0 3 2 6");
    says(
        &refusal(&args.each_ref().map(String::as_str)),
        &["1 of 6 tetrahedra", "the first is 1", "mm3", "swap two vertices"],
    );
}

#[test]
fn a_negative_budget_is_named() {
    let dir = tempfile::tempdir().expect("temp");
    let args = changed(dir.path(), |_| ());
    let args = [&args.each_ref().map(String::as_str)[..], &["--budget-ms", "-5"]].concat();
    says(&refusal(&args), &["-5", "--budget-ms", "milliseconds from 0"]);
}

#[test]
fn a_load_that_tears_the_body_off_ends_and_says_why() {
    let told = told(|case| {
        case["dirichlet"] = json!([held("z0", "xyz", [0.0; 3])]);
        case["body_force"] = json!([0.0, 0.0, -1e9]);
    });
    assert_eq!(told["converged"], false, "{told}");
    assert!(!remarks(&told).is_empty(), "{told}");
}

#[test]
fn every_printed_field_is_explained_by_help() {
    let dir = tempfile::tempdir().expect("temp");
    let args = changed(dir.path(), |s| {
        punched([0.01, 0.01, 0.041], [0.01, 0.01, 0.039])(&mut s["cases"]["stretch"]);
        rod(0.005, 0.01)(&mut s["cases"]["stretch"]);
    });
    let physical = json(&args.each_ref().map(String::as_str));
    let dir = tempfile::tempdir().expect("temp");
    let args = changed(dir.path(), |_| ());
    let paper = json(&[&args.each_ref().map(String::as_str)[..], &["--mode", "paper"]].concat());
    let help = String::from_utf8(monro(&["solve", "--help"]).stdout).expect("help");
    for told in [physical, paper] {
        for field in told.as_object().expect("an object").keys() {
            assert!(help.contains(field.as_str()), "{field} is not explained:\n{help}");
        }
    }
}

type Change = Box<dyn FnOnce(&mut Value)>;

#[test]
fn input_that_was_read_as_something_else_is_refused() {
    let face = |list: Value| {
        move |s: &mut Value| {
            s["meshes"]["cube"]["face_sets"] = json!({ "f": list });
            s["cases"]["stretch"]["pressure"] = json!({ "faces": "f", "pressure": 100.0 });
        }
    };
    let put = |at: &'static str, value: Value| move |s: &mut Value| s["cases"]["stretch"][at] = value;
    let table: [(Change, &[&str]); 12] = [
        (Box::new(face(json!([]))), &["list \"f\" is empty"]),
        (Box::new(face(json!([[0, 1, 2, 3]]))), &["face 0", "[0,1,2,3]", "three"]),
        (Box::new(put("body_force", json!([0.0, 0.0, -1.0, "x"]))), &["body_force", "three numbers"]),
        (Box::new(|s| s["units"] = json!("mm")), &["\"mm\"", "only SI"]),
        (Box::new(|s| s["units"] = json!("SI (mm)")), &["\"SI (mm)\"", "only SI"]),
        (Box::new(|s| s["units"] = json!("SI: m, kg, s, N, kPa")), &["only SI"]),
        (Box::new(|s| s["units"] = json!("simple")), &["only SI"]),
        (Box::new(|s| s["energy"] = json!({})), &["\"name\"", "energy"]),
        (Box::new(put("materials", json!({ "1": { "E": "3000", "nu": 0.3 } }))), &["\"E\" is \"3000\"", "a number"]),
        (
            Box::new(put("materials", json!({ "1": { "E": 3000.0, "nu": 0.49, "mu": 1006.711, "lam": 45000.0 } }))),
            &["it also says lam 45000: -8.", "one pair only"],
        ),
        (Box::new(put("materials", json!({ "1": { "E": 0.0, "nu": 0.3, "mu": 1e-300 } }))), &["E is 0", "more than 0"]),
        (
            Box::new(put("embedded_rod", json!([rod_json(0.001), rod_json(-0.001)]))),
            &["rod 1", "already hold all", "apart"],
        ),
    ];
    for (change, words) in table {
        let dir = tempfile::tempdir().expect("temp");
        let args = changed(dir.path(), change);
        says(&refusal(&args.each_ref().map(String::as_str)), words);
    }
}

fn rod_json(up: f64) -> Value {
    json!({ "radius": 0.003, "p0": [0.01, 0.01, 0.005], "p1": [0.01, 0.01, 0.015], "displacement": [0.0, 0.0, up] })
}

#[test]
fn moduli_typed_in_kilopascal_and_bodies_only_carried_along_are_remarked_upon() {
    let soft = told(|case| case["materials"]["1"]["E"] = json!(0.3));
    says(&remarks(&soft), &["region 1", "3e-1 Pa", "moduli are in Pa", "300"]);
    let carried = told(|case| case["dirichlet"] = json!([held("x1", "xyz", [0.5, 0.0, 0.0])]));
    says(&remarks(&carried), &["carried along", "times the body's diagonal"]);
}

#[test]
fn a_body_that_nothing_holds_and_nothing_acts_on_was_solved_without_a_word() {
    let idle = told(|case| {
        case["dirichlet"] = json!([]);
        case.as_object_mut().expect("a case").remove("body_force");
    });
    says(&remarks(&idle), &["nothing is moved and nothing acts"]);
}

#[test]
fn constants_that_contradict_the_pair_that_counts_are_refused_one_by_one() {
    for (name, value) in [("mu", 900.0), ("lam", 1.0), ("lam_hat", 1.0)] {
        let said = refused(|case| case["materials"]["1"] = json!({ "E": 3000.0, "nu": 0.45, name: value }));
        says(&said, &["E and nu mean", &format!("it also says {name} {value}"), "one pair only"]);
    }
    let said = refused(|case| case["materials"]["1"] = json!({ "mu": 1000.0, "lam": 9000.0, "lam_hat": 1.0 }));
    says(&said, &["mu and lam (or lam_hat) mean lam_hat 10000"]);
    let agreeing = json!({ "E": 2900.0, "nu": 0.45, "mu": 1000.0, "lam": 9000.0, "lam_hat": 10000.0 });
    assert_eq!(told(|case| case["materials"]["1"] = agreeing)["converged"], true);
}

#[test]
fn a_material_of_no_element_is_remarked_upon() {
    let told = told(|case| case["materials"]["7"] = json!({ "E": 3000.0, "nu": 0.45 }));
    says(&remarks(&told), &["no tetrahedron is of region 7"]);
}

#[test]
fn a_coordinate_beyond_all_bodies_is_named_by_its_node() {
    let dir = tempfile::tempdir().expect("temp");
    let args = with_mesh(dir.path(), "0.02 0.02 0.02", "0.02 0.02 1e300");
    says(&refusal(&args.each_ref().map(String::as_str)), &["node 6", "1e300", "10000 m"]);
}

#[test]
fn a_sphere_that_stays_where_it_is_did_nothing_in_paper_mode() {
    let dir = tempfile::tempdir().expect("temp");
    let at = [0.01, 0.01, 0.037];
    let args = changed(dir.path(), |s| punched(at, at)(&mut s["cases"]["stretch"]));
    let args = args.each_ref().map(String::as_str);
    for mode in ["physical", "paper"] {
        let told = json(&[&args[..], &["--mode", mode, "--force"]].concat());
        let moved = told["max_displacement_mm"].as_f64().expect("displacement");
        assert!(moved > 0.3, "{mode}: {told}");
    }
}

/// Half of the force that a bar takes went missing, and it was "converged".
#[test]
fn a_mesh_whose_halves_share_nothing_was_solved_without_a_word() {
    let dir = tempfile::tempdir().expect("temp");
    let args = changed(dir.path(), |_| ());
    let file = dir.path().join("cube.vtu");
    let mut grid = vtu::decode(&fs::read(&file).expect("mesh")).expect("vtu");
    // A second cube goes on where the first ends, but for rounding, with vertices of its own.
    let old = grid.clone();
    grid.points.extend(old.points.iter().map(|p| [p[0] + 0.02 + 1e-9, p[1], p[2]]));
    grid.tets.extend(old.tets.iter().map(|t| t.map(|v| v + 8)));
    grid.cell_data.iter_mut().for_each(|a| a.values.extend(a.values.clone()));
    for a in &mut grid.point_data {
        let (first, second) = match a.name.as_str() {
            "set_x0" => (1.0, 0.0),
            "set_x1" => (0.0, 1.0),
            _ => (1.0, 1.0),
        };
        let own = a.values.clone();
        a.values = own.iter().map(|v| v * first).chain(own.iter().map(|v| v * second)).collect();
    }
    fs::write(&file, vtu::encode(&grid)).expect("written");
    let scene = dir.path().join("scene.json");
    let mut json_of: Value = serde_json::from_slice(&fs::read(&scene).expect("scene")).expect("json");
    for count in ["nodes", "tets"] {
        json_of["meshes"]["cube"].as_object_mut().expect("mesh").remove(count);
    }
    fs::write(&scene, json_of.to_string()).expect("written");
    let said = remarks(&json(&args.each_ref().map(String::as_str)));
    says(&said, &["face(s) lie on others", "neither motion nor force goes", "in 2 pieces that share no vertex"]);
}
