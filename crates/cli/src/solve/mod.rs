//! `monro solve`: a static scene (JSON and meshes in SI) to its equilibrium.

mod materials;
mod remarks;
pub(crate) mod scene;
pub(crate) mod stepping;

use crate::args::{ModeArg, SolveArgs};
use crate::console::Console;
use anyhow::{Context, Result, ensure};
use monro_case::vtu::{self, DataArray, Kind, UnstructuredGrid};
use monro_geometry::{Patient, Vector};
use monro_tissue::{
    CollisionResponse, Finer, Mode, ModelOptions, PhysicalOptions, StaticOptions, StaticSolution, equilibrium,
};
use scene::Scene;
use serde_json::{Map, Value, json};
use std::path::Path;
use std::time::{Duration, Instant};

/// Elements up to which the mesh is made finer when nothing else is asked: seconds of work.
const TETS: usize = 80_000;

/// What a solver found.
pub(crate) struct Found {
    /// Displacement of each node, mm.
    pub(crate) displacement: Vec<Vector<Patient>>,
    /// What goes into the result beside the displacement.
    pub(crate) json: Map<String, Value>,
}

/// Runs the command.
pub(crate) fn run(args: &SolveArgs, console: &Console) -> Result<()> {
    ensure!(
        args.out.extension().is_some_and(|e| e.eq_ignore_ascii_case("vtu")),
        "{}: only .vtu is written",
        args.out.display()
    );
    let scene = console.stage("read", || scene::read(&args.scene, &args.mesh, &args.case))?;
    scene.remarks.iter().for_each(|r| console.warn(r));
    let start = Instant::now();
    let deadline = args.budget_ms.map(|ms| start + Duration::from_millis(ms));
    let mut keep_going = || deadline.is_none_or(|d| Instant::now() < d);
    let found = console.stage("solve", || match args.mode {
        ModeArg::Physical => physical(&scene, args.refine.map_or(Finer::UpTo(TETS), Finer::Times), &mut keep_going),
        ModeArg::Paper => stepping::solve(&scene, &mut keep_going),
    })?;
    let seconds = start.elapsed().as_secs_f64();
    console.stage("write", || write(&args.out, &scene, &found))?;
    let mut json = found.json;
    json.insert("case".into(), args.case.clone().into());
    json.insert("mesh".into(), args.mesh.clone().into());
    json.insert("mode".into(), format!("{:?}", args.mode).to_lowercase().into());
    json.insert("out".into(), args.out.display().to_string().into());
    json.insert("seconds".into(), seconds.into());
    let largest = found.displacement.iter().map(|d| d.norm()).fold(0.0, f64::max);
    json.insert("max_displacement_mm".into(), largest.into());
    if json["converged"] == Value::Bool(false) {
        console
            .warn("stopped before the tolerance was met: the displacement is the best so far (see residual and share)");
    }
    json.insert("remarks".into(), json!(scene.remarks));
    if let Some(turned) = json.get("turned").and_then(Value::as_u64).filter(|&n| n > 0) {
        console.warn(&format!(
            "{turned} elements of the solved mesh are turned inside out: the answer means nothing around them"
        ));
    }
    let json = Value::Object(json);
    console.result(&json, &format!("{json:#}"));
    Ok(())
}

/// Physical mode: the equilibrium.
pub(crate) fn physical(scene: &Scene, finer: Finer, keep_going: &mut dyn FnMut() -> bool) -> Result<Found> {
    let options = ModelOptions {
        mode: Mode::Physical(PhysicalOptions::default()),
        materials: scene.materials.clone(),
        attachments: Vec::new(),
        collision: CollisionResponse::Plain,
    };
    let how = StaticOptions { finer, ..StaticOptions::default() };
    let solved = equilibrium(&scene.mesh, &options, &scene.problem, &how, keep_going)?;
    Ok(Found { json: forces(scene, &solved), displacement: solved.displacement })
}

fn newton(v: Vector<Patient>) -> [f64; 3] {
    v.to_array().map(|x| x * 1e-3)
}

/// Reactions and how they were found. A force along a tool's motion is positive when the tissue resists it.
fn forces(scene: &Scene, solved: &StaticSolution) -> Map<String, Value> {
    let mut json = Map::new();
    let sum = |nodes: &[u32]| nodes.iter().fold(Vector::ZERO, |s, &n| s + solved.reaction[n as usize]);
    let reactions = scene.sets.iter().map(|(name, nodes)| (name.clone(), json!(newton(sum(nodes)))));
    json.insert("reactions_N".into(), Value::Object(reactions.collect()));
    let along =
        |force: Vector<Patient>, way: Vector<Patient>| force.dot(way) / way.norm().max(f64::MIN_POSITIVE) * 1e-3;
    let p = &scene.problem;
    let spheres: Vec<f64> = p.contacts.iter().zip(&solved.contacts).map(|(c, &f)| along(f, c.to - c.from)).collect();
    let rods: Vec<f64> = p.rods.iter().zip(&solved.rods).map(|(r, &f)| along(f, r.displacement_mm)).collect();
    for (name, vectors, along, all) in [
        ("punch_force_N", "punch_forces_N", spheres, &solved.contacts),
        ("rod_force_N", "rod_forces_N", rods, &solved.rods),
    ] {
        if let Some(&first) = along.first() {
            json.insert(name.into(), first.into());
            json.insert(vectors.into(), json!(all.iter().map(|&f| newton(f)).collect::<Vec<_>>()));
        }
    }
    json.insert("converged".into(), solved.converged.into());
    json.insert("residual".into(), solved.residual.into());
    json.insert("share".into(), solved.share.into());
    json.insert("tets_solved".into(), solved.tets.into());
    json.insert("turned".into(), solved.turned.into());
    json.insert("newton_steps".into(), solved.steps.into());
    json.insert("products".into(), solved.products.into());
    json
}

/// The mesh of the scene in metres, its nodes in their order, with the point array `displacement`.
fn write(out: &Path, scene: &Scene, found: &Found) -> Result<()> {
    let metres: Vec<[f64; 3]> = found.displacement.iter().map(|&d| newton(d)).collect();
    let region = vtu::find(&scene.grid.cell_data, "region").cloned();
    let grid = UnstructuredGrid {
        points: scene.grid.points.clone(),
        tets: scene.grid.tets.clone(),
        point_data: vec![DataArray::vectors("displacement", Kind::Float64, &metres)],
        cell_data: region.into_iter().collect(),
    };
    std::fs::write(out, vtu::encode(&grid)).with_context(|| format!("cannot write {}", out.display()))
}
