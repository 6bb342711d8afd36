//! `monro solve`: a static scene (JSON and meshes in SI) to its equilibrium.

mod held;
mod joined;
mod json;
mod limits;
mod materials;
mod outcome;
mod remarks;
pub(crate) mod scene;
pub(crate) mod stepping;
mod stress;
mod thin;
mod units;
mod words;

use crate::args::{ModeArg, SolveArgs};
use crate::console::Console;
use crate::{output_file, soft_body};
use anyhow::{Result, ensure};
use monro_case::vtu::{self, DataArray, Kind, UnstructuredGrid};
use monro_geometry::{Patient, TetMesh, Vector, Walls};
use monro_tissue::{
    CollisionResponse, Finer, Mode, ModelOptions, Moment, PhysicalOptions, StaticOptions, StaticSolution, equilibrium,
};
use scene::Scene;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Elements up to which the mesh is made finer when nothing else is asked: seconds of work, tens near nu 0.5.
const TETS: usize = 80_000;

/// Milliseconds after which a solve ends when nothing else is asked.
const BUDGET_MS: u64 = 600_000;

/// What a solver found.
pub(crate) struct Found {
    /// Displacement of each node, mm.
    pub(crate) displacement: Vec<Vector<Patient>>,
    /// Arrays of the elements of the mesh as given.
    pub(crate) cells: Vec<DataArray>,
    /// What goes into the result beside the displacement.
    pub(crate) json: Map<String, Value>,
    /// What the user should not miss.
    pub(crate) remarks: Vec<String>,
}

/// Runs the command.
pub(crate) fn run(args: &SolveArgs, console: &Console) -> Result<()> {
    ensure!(
        args.mode == ModeArg::Physical || args.refine.is_none(),
        "paper mode does not refine the mesh: --refine needs --mode physical"
    );
    let mut scene = console.stage("read", || scene::read(&args.of.scene, &args.of.mesh, &args.of.case))?;
    writable(&args.out, args.force, &scene.sources)?;
    scene.remarks.iter().for_each(|r| console.warn(r));
    let start = Instant::now();
    let deadline = start.checked_add(Duration::from_millis(args.budget_ms.unwrap_or(BUDGET_MS)));
    let mut keep_going = || deadline.is_none_or(|d| Instant::now() < d);
    let mut found = console.stage("solve", || match args.mode {
        ModeArg::Physical => physical(&scene, args.refine.map_or(Finer::UpTo(TETS), Finer::Times), &mut keep_going),
        ModeArg::Paper => stepping::solve(&scene, &mut keep_going),
    })?;
    let seconds = start.elapsed().as_secs_f64();
    console.stage("check walls", || self_crossing(&scene.mesh, &mut found));
    console.stage("write", || write(&args.out, &scene, &found))?;
    let mut json = found.json;
    json.insert("case".into(), args.of.case.clone().into());
    json.insert("mesh".into(), args.of.mesh.clone().into());
    json.insert("mode".into(), format!("{:?}", args.mode).to_lowercase().into());
    json.insert("out".into(), args.out.display().to_string().into());
    json.insert("seconds".into(), seconds.into());
    let largest = found.displacement.iter().map(|d| d.norm()).fold(0.0, f64::max);
    json.insert("max_displacement_mm".into(), largest.into());
    found.remarks.iter().for_each(|r| console.warn(r));
    scene.remarks.extend(found.remarks);
    json.insert("remarks".into(), json!(scene.remarks));
    let json = Value::Object(json);
    console.result(&json, &words::of(&json));
    Ok(())
}

/// Says where the body passes through itself, which no solver here looks at: then what was found is no answer.
fn self_crossing(mesh: &TetMesh, found: &mut Found) {
    let now: Vec<_> = mesh.vertices.iter().zip(&found.displacement).map(|(p, d)| *p + *d).collect();
    let crossing = Walls::new(mesh).passed_through(&now);
    let told = crossing.map(|c| json!({ "pairs": c.pairs, "at_m": c.at.to_array().map(|x| x * 1e-3) }));
    found.json.insert("self_crossing".into(), json!(told));
    if let Some(c) = crossing {
        found.json.insert("converged".into(), false.into());
        found.remarks.push(format!(
            "{}: this is no answer where they do; impose less, or look at a smaller share of the motion",
            soft_body::passed_through(&c)
        ));
    }
}

/// Refuses what could not be written in the end, and what would take the place of the scene's own files.
fn writable(out: &Path, force: bool, sources: &[PathBuf]) -> Result<()> {
    let vtu = out.extension().is_some_and(|e| e.eq_ignore_ascii_case("vtu"));
    ensure!(vtu, "{}: only .vtu is written", out.display());
    output_file::check(out, force, &sources.iter().map(PathBuf::as_path).collect::<Vec<_>>())
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
    let mut remarks = outcome::remarks(scene, &solved);
    if matches!(finer, Finer::UpTo(_)) {
        remarks.extend(limits::as_given(scene, &solved));
    }
    let cells = stress::arrays(scene, &solved.displacement).to_vec();
    Ok(Found { json: forces(scene, &solved), cells, displacement: solved.displacement, remarks })
}

fn newton(v: Vector<Patient>) -> [f64; 3] {
    v.to_array().map(|x| x * 1e-3)
}

/// Force of each set, by name, in the components that it holds, and these components.
fn reactions(scene: &Scene, solved: &StaticSolution) -> [Value; 2] {
    // Entries of one name hold the same nodes, so that what two of them hold bears the same force in both.
    let mut held = BTreeMap::<&str, [Option<f64>; 3]>::new();
    for s in &scene.problem.supports {
        let (name, force) = (&scene.sets[s.set as usize].0, solved.sets[&s.set].to_array());
        let of = held.entry(name).or_default();
        (0..3).filter(|&a| s.displacement_mm[a].is_some()).for_each(|a| of[a] = Some(force[a]));
    }
    let (mut force, mut components) = (Map::new(), Map::new());
    for (name, of) in held {
        let axes = (0..3).filter(|&a| of[a].is_some()).map(|a| ["x", "y", "z"][a]);
        components.insert(name.into(), axes.collect::<String>().into());
        force.insert(name.into(), json!(newton(Vector::from_array(of.map(Option::unwrap_or_default)))));
    }
    [Value::Object(force), Value::Object(components)]
}

/// What the forces of each set, by name, turn on the tissue; that of rods, in their order.
fn moments(scene: &Scene, solved: &StaticSolution) -> [Value; 2] {
    let of = |m: &Moment| json!({ "Nm": m.mn_mm.to_array().map(|v| v * 1e-6), "about_m": m.about.to_array().map(|v| v * 1e-3) });
    let sets = solved.set_moments.iter().map(|(&set, m)| (scene.sets[set as usize].0.clone(), of(m)));
    [Value::Object(sets.collect()), solved.rod_moments.iter().map(|m| json!(m.as_ref().map(of))).collect()]
}

/// Reactions and how they were found. A force along a tool's motion is positive when the tissue resists it.
fn forces(scene: &Scene, solved: &StaticSolution) -> Map<String, Value> {
    let mut json = Map::new();
    let [force, held] = reactions(scene, solved);
    json.insert("reactions_N".into(), force);
    json.insert("reactions_held".into(), held);
    let [of_sets, of_rods] = moments(scene, solved);
    json.insert("moments".into(), of_sets);
    if !scene.problem.rods.is_empty() {
        json.insert("rod_moments".into(), of_rods);
    }
    // What stands still resists along no way.
    let along =
        |force: Vector<Patient>, way: Vector<Patient>| (way.norm() > 0.0).then(|| force.dot(way) / way.norm() * 1e-3);
    let p = &scene.problem;
    let spheres: Vec<Option<f64>> =
        p.contacts.iter().zip(&solved.contacts).map(|(c, &f)| along(f, c.to - c.from)).collect();
    let rods: Vec<Option<f64>> = p.rods.iter().zip(&solved.rods).map(|(r, &f)| along(f, r.displacement_mm)).collect();
    for (name, vectors, along, all) in [
        ("punch_force_N", "punch_forces_N", spheres, &solved.contacts),
        ("rod_force_N", "rod_forces_N", rods, &solved.rods),
    ] {
        if let Some(&first) = along.first() {
            json.insert(name.into(), json!(first));
            json.insert(vectors.into(), json!(all.iter().map(|&f| newton(f)).collect::<Vec<_>>()));
        }
    }
    json.insert("converged".into(), solved.converged.into());
    json.insert("residual".into(), solved.residual.into());
    json.insert("unborne".into(), solved.unborne.into());
    json.insert("share".into(), solved.share.into());
    json.insert("tets_solved".into(), solved.tets.into());
    json.extend(outcome::of_mesh(scene, solved).map(|(name, value)| (name.into(), value)));
    json.insert("turned".into(), solved.turned.into());
    json.insert("newton_steps".into(), solved.steps.into());
    json.insert("products".into(), solved.products.into());
    json
}

/// The mesh of the scene in metres, its nodes in their order, with the point array `displacement` and what its elements have.
fn write(out: &Path, scene: &Scene, found: &Found) -> Result<()> {
    let metres: Vec<[f64; 3]> = found.displacement.iter().map(|&d| newton(d)).collect();
    let region = vtu::find(&scene.grid.cell_data, "region").cloned();
    let grid = UnstructuredGrid {
        points: scene.grid.points.clone(),
        tets: scene.grid.tets.clone(),
        point_data: vec![DataArray::vectors("displacement", Kind::Float64, &metres)],
        cell_data: region.into_iter().chain(found.cells.iter().cloned()).collect(),
        ..UnstructuredGrid::default()
    };
    output_file::write(out, &vtu::encode(&grid))
}
