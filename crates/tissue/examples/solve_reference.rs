//! Runs the reference scenes through the equilibrium solver and writes the displacement for `compare.py`.
//!
//!     cargo run --release -p monro-tissue --example solve_reference -- SCENE_DIR OUT_DIR [MESH] [CASE] [--share S]

mod common;

use common::{Vtu, write_vtu};
use monro_tissue::{
    CollisionResponse, Material, Mode, Model, ModelOptions, PhysicalOptions, Pressure, StaticOptions, StaticProblem,
    StaticSolution, Support,
};
use serde_json::Value;
use std::path::Path;
use std::time::Instant;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let share = words
        .iter()
        .position(|w| w == "--share")
        .map_or(PhysicalOptions::default().nodal_shear, |i| words[i + 1].parse().expect("a number"));
    let (scene_dir, out) = (Path::new(&words[0]), Path::new(&words[1]));
    let text = std::fs::read_to_string(scene_dir.join("scene.json")).expect("scene.json");
    let scene: Value = serde_json::from_str(&text).expect("JSON");
    let wanted = |i: usize, name: &str| words.get(i).is_none_or(|w| w.starts_with("--") || w == name || w == "all");
    std::fs::create_dir_all(out).expect("output folder");
    for (mesh_name, mesh) in scene["meshes"].as_object().expect("meshes") {
        let vtu = Vtu::read(&scene_dir.join(mesh["file"].as_str().expect("file")));
        for (case_name, case) in scene["cases"].as_object().expect("cases") {
            if wanted(2, mesh_name) && wanted(3, case_name) {
                run(&vtu, mesh, case, share, (mesh_name, case_name), out);
            }
        }
    }
}

fn run(vtu: &Vtu, mesh: &Value, case: &Value, share: f64, (mesh_name, case_name): (&str, &str), out: &Path) {
    let model = model(vtu, case, share);
    let problem = problem(vtu, mesh, case);
    let start = Instant::now();
    let solved = model.equilibrium(&problem, &StaticOptions::default(), &mut || true).expect("solved");
    println!(
        "{mesh_name} {case_name}: {:.3} s, {} steps, {} products, residual {:.1e}",
        start.elapsed().as_secs_f64(),
        solved.steps,
        solved.products,
        solved.residual
    );
    reactions(vtu, case, &solved);
    let moved: Vec<[f64; 3]> = solved.displacement.iter().map(|d| d.to_array().map(|v| v * 1e-3)).collect();
    write_vtu(&out.join(format!("{mesh_name}_{case_name}.vtu")), &vtu.points, &vtu.tets, &moved);
}

fn model(vtu: &Vtu, case: &Value, share: f64) -> Model {
    let materials = case["materials"].as_object().expect("materials").iter().map(|(label, m)| {
        let of = |k: &str| m[k].as_f64().expect("number");
        let material = Material { young_kpa: of("E") * 1e-3, poisson: of("nu"), ..Material::BRAIN };
        (label.parse().expect("label"), material)
    });
    let options = ModelOptions {
        mode: Mode::Physical(PhysicalOptions { nodal_shear: share }),
        materials: materials.collect(),
        attachments: Vec::new(),
        collision: CollisionResponse::Insertion,
    };
    Model::new(&vtu.mesh(1e3, 0), &options).expect("a model")
}

fn problem(vtu: &Vtu, mesh: &Value, case: &Value) -> StaticProblem {
    let mut problem = StaticProblem::default();
    for d in case["dirichlet"].as_array().expect("dirichlet") {
        let components = d["components"].as_str().expect("components");
        let field = d["value"].as_str().map(|f| vtu.vectors(f.trim_start_matches("field:")));
        for node in vtu.set(d["set"].as_str().expect("set")) {
            let value: [f64; 3] = match &field {
                Some(f) => f[node as usize],
                None => core::array::from_fn(|a| d["value"][a].as_f64().expect("number")),
            };
            let displacement_mm =
                core::array::from_fn(|a| components.contains(["x", "y", "z"][a]).then_some(value[a] * 1e3));
            problem.supports.push(Support { node, displacement_mm });
        }
    }
    if let Some(f) = case["body_force"].as_array() {
        problem.body_force_mn_mm3 = core::array::from_fn(|a| f[a].as_f64().expect("number") * 1e-6);
    }
    for p in case["pressure"].as_array().into_iter().flatten() {
        let faces = mesh["face_sets"][p["faces"].as_str().expect("faces")].as_array().expect("face list");
        let corner = |f: &Value, i: usize| f[i].as_u64().expect("vertex") as u32;
        problem.pressures.push(Pressure {
            faces: faces.iter().map(|f| [corner(f, 0), corner(f, 1), corner(f, 2)]).collect(),
            kpa: p["pressure"].as_f64().expect("pressure") * 1e-3,
        });
    }
    problem
}

fn reactions(vtu: &Vtu, case: &Value, solved: &StaticSolution) {
    for (set, reference) in case["reference"]["force_N"].as_object().into_iter().flatten() {
        let sum = vtu.set(set).iter().fold([0.0; 3], |s: [f64; 3], &n| {
            let r = solved.reaction[n as usize].to_array();
            core::array::from_fn(|a| s[a] + r[a] * 1e-3)
        });
        println!("  reaction {set}: {sum:.6?} N, reference {reference}");
    }
}
