//! Scenes of static problems: a JSON file beside its meshes, all in SI. What is read is in mm, mN and kPa.

use super::json::Unique;
use super::{held, joined, materials, remarks, units};
use anyhow::{Context, Result, anyhow, bail, ensure};
use monro_case::vtu::{self, DataArray, UnstructuredGrid};
use monro_geometry::{Patient, Point, TetMesh, Vector, tet_signed_volume};
use monro_tissue::{EmbeddedRod, Material, Pressure, SphereContact, StaticProblem, Support};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

const MM: f64 = 1e3;

/// Words (small letters) of units that are not of SI without prefixes. Not "in" and "g", which are other words, too.
const NOT_SI: [&str; 20] = [
    "mm",
    "cm",
    "dm",
    "um",
    "µm",
    "km",
    "inch",
    "inches",
    "millimetre",
    "millimetres",
    "millimeter",
    "millimeters",
    "centimetre",
    "centimetres",
    "centimeter",
    "centimeters",
    "kpa",
    "mpa",
    "gpa",
    "mmhg",
];
/// Largest coordinate of a mesh, m.
const FAR: f64 = 1e4;

/// One case on one mesh.
#[derive(Debug)]
pub(crate) struct Scene {
    pub(crate) grid: UnstructuredGrid,
    /// The mesh in mm; labels are the regions.
    pub(crate) mesh: TetMesh,
    pub(crate) materials: BTreeMap<u16, Material>,
    pub(crate) problem: StaticProblem,
    /// Nodes of each set that is held, by name; the numbers of `Support::set` count them.
    pub(crate) sets: Vec<(String, Vec<u32>)>,
    /// What looks like a mistake in it and is none for certain.
    pub(crate) remarks: Vec<String>,
    /// The file of the scene and those of all its meshes.
    pub(crate) sources: Vec<PathBuf>,
}

/// Reads a case of a scene on one of its meshes.
pub(crate) fn read(path: &Path, mesh: &str, case: &str) -> Result<Scene> {
    let file = if path.is_dir() { path.join("scene.json") } else { path.to_owned() };
    let text = fs::read_to_string(&file).with_context(|| format!("cannot read {}", file.display()))?;
    let scene = parse(&text).with_context(|| file.display().to_string())?;
    let folder = file.parent().map_or_else(PathBuf::new, Path::to_owned);
    let mut built = build(&scene, &folder, mesh, case).with_context(|| file.display().to_string())?;
    let meshes = scene["meshes"].as_object().into_iter().flat_map(Map::values);
    built.sources = meshes.filter_map(|m| Some(folder.join(m["file"].as_str()?))).chain([file]).collect();
    Ok(built)
}

fn parse(text: &str) -> Result<Value> {
    let hint = |e: &serde_json::Error| {
        let line = text.lines().nth(e.line().saturating_sub(1)).unwrap_or_default().to_lowercase();
        let endless = ["nan", "infinity"].iter().any(|w| line.contains(w));
        if endless { "JSON has no NaN and no Infinity: write a finite number" } else { "mend it there" }
    };
    let read = serde_json::from_str(text.trim_start_matches('\u{feff}'));
    read.map(|Unique(value)| value).map_err(|e| match e.is_data() {
        true => anyhow!("{e}: leave one of them"),
        false => anyhow!("not JSON: {e}: {}", hint(&e)),
    })
}

fn build(scene: &Value, folder: &Path, mesh_name: &str, case_name: &str) -> Result<Scene> {
    let mesh = pick(scene, "meshes", "mesh", mesh_name)?;
    let case = pick(scene, "cases", "case", case_name)?;
    let unread = remarks::unread(scene, mesh, case);
    let mut built = of_case((scene, mesh, case), folder, [mesh_name, case_name]).map_err(|e| {
        // A field that is missing has most likely been misspelt.
        if unread.is_empty() { e } else { anyhow!("{e:#}; {}", unread.join("; ")) }
    })?;
    built.remarks.splice(0..0, unread);
    Ok(built)
}

/// A scene of which one mesh and one case are meant.
fn of_case(
    (scene, mesh, case): (&Value, &Value, &Value),
    folder: &Path,
    [mesh_name, case_name]: [&str; 2],
) -> Result<Scene> {
    let energy = match &scene["energy"] {
        of @ Value::Object(_) => {
            of["name"].as_str().with_context(|| wanted(&of["name"], "name", "that of the energy"))?
        }
        name => word(name, "energy", "stable_neo_hookean")?,
    };
    ensure!(energy == "stable_neo_hookean", "the energy is \"{energy}\"; only stable_neo_hookean is known");
    si(&scene["units"])?;
    let name = mesh["file"].as_str().with_context(|| format!("mesh \"{mesh_name}\" names no file"))?;
    let file = folder.join(name);
    let bytes = fs::read(&file).with_context(|| format!("cannot read {}", file.display()))?;
    let grid = vtu::decode(&bytes).with_context(|| file.display().to_string())?;
    counts(mesh, &grid).with_context(|| file.display().to_string())?;
    let in_case = || format!("case \"{case_name}\"");
    let materials = materials::read(case).with_context(in_case)?;
    let tets = mesh_mm(&grid, &materials).with_context(|| file.display().to_string())?;
    let (problem, sets) = problem(&grid, mesh, case).with_context(in_case)?;
    let mut remarks = remarks::all(&problem, &sets);
    remarks.extend(materials::unread(&grid));
    remarks.extend(materials::odd(&materials));
    remarks.extend(materials::unused(&materials, &tets.labels));
    remarks.extend(remarks::nothing_to_find(tets.vertices.len(), &problem));
    remarks.extend(remarks::overlapping(&tets));
    remarks.extend(joined::unshared(&tets));
    remarks.extend(held::apart(&tets, &problem));
    remarks.extend(joined::lines(&tets, &problem, &sets));
    remarks.extend(held::free(&tets, &problem));
    remarks.extend(remarks::outside(&tets, &problem));
    remarks.extend(held::hinged(&tets, &problem));
    remarks.extend(units::check(&tets, &problem, &sets).with_context(in_case)?);
    remarks.extend(units::weighed(&tets, &problem, &materials).with_context(in_case)?);
    remarks.extend(units::pressed(&tets, &problem, &materials));
    Ok(Scene { grid, mesh: tets, materials, problem, sets, remarks, sources: Vec::new() })
}

/// Refuses units other than SI, if a scene names its units: "SI (mm)" is none either.
fn si(units: &Value) -> Result<()> {
    let is_si = |text: &str| {
        let mut words = text.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty()).map(str::to_lowercase);
        words.next().is_some_and(|first| first == "si") && words.all(|w| !NOT_SI.contains(&w.as_str()))
    };
    let named = units.as_str().map_or(units.is_null(), is_si);
    ensure!(named, "the units are {units}; only SI is read (m, N, Pa): convert the scene and its mesh, and say \"SI\"");
    Ok(())
}

/// A scene that counts its nodes and elements must mean this file.
fn counts(mesh: &Value, grid: &UnstructuredGrid) -> Result<()> {
    for (name, there) in [("nodes", grid.points.len()), ("tets", grid.tets.len())] {
        let said = &mesh[name];
        let same = said.is_null() || said.as_u64() == Some(there as u64);
        ensure!(same, "has {there} {name}, but the scene says {said}: it is another mesh");
    }
    Ok(())
}

/// The entry of a map by name, or an error that lists the names there are.
fn pick<'a>(scene: &'a Value, map: &str, what: &str, name: &str) -> Result<&'a Value> {
    let entries = scene[map].as_object().with_context(|| format!("no \"{map}\"; there are: {}", keys(scene)))?;
    entries.get(name).with_context(|| format!("no {what} \"{name}\"; there are: {}", keys(&scene[map])))
}

fn keys(of: &Value) -> String {
    let keys: Vec<&str> = of.as_object().into_iter().flat_map(Map::keys).map(String::as_str).collect();
    if keys.is_empty() { "none".into() } else { keys.join(", ") }
}

fn mesh_mm(grid: &UnstructuredGrid, materials: &BTreeMap<u16, Material>) -> Result<TetMesh> {
    let labels = materials::regions(grid, materials)?;
    let far = grid.points.iter().position(|p| p.iter().any(|v| v.is_finite() && v.abs() > FAR));
    if let Some(node) = far {
        bail!(
            "node {node} is at {} m, further than {FAR} m from the origin; move the mesh there, or mend it",
            grid.points[node].map(|v| format!("{v:e}")).join(" ")
        );
    }
    let vertices: Vec<Point<Patient>> = grid.points.iter().map(|p| Point::from_array(p.map(|v| v * MM))).collect();
    let mut tets = grid.tets.clone();
    let corner = |v: u32| vertices.get(v as usize).copied().unwrap_or(Point::ORIGIN);
    let volumes: Vec<f64> = tets.iter().map(|t| tet_signed_volume(t.map(corner))).collect();
    let turned = volumes.iter().filter(|&&v| v <= 0.0).count();
    if volumes.iter().all(|&v| v < 0.0) {
        // A mesh of the other orientation throughout is as good.
        tets.iter_mut().for_each(|t| t.swap(2, 3));
    } else if let Some(first) = volumes.iter().position(|&v| v <= 0.0) {
        bail!(
            "{turned} of {} tetrahedra are turned inside out or without volume, and the others are not: the first is \
             {first} with a volume of {} mm3; swap two vertices of each, or mesh the body anew if they overlap their \
             neighbours or are flat",
            tets.len(),
            volumes[first]
        );
    }
    let mesh = TetMesh { vertices, tets, labels };
    mesh.validate()?;
    Ok(mesh)
}

type Sets = Vec<(String, Vec<u32>)>;

fn problem(grid: &UnstructuredGrid, mesh: &Value, case: &Value) -> Result<(StaticProblem, Sets)> {
    let mut problem = StaticProblem::default();
    let mut sets = Sets::new();
    for entry in list(&case["dirichlet"]) {
        let name = entry["set"].as_str().context("an entry of \"dirichlet\" names no set")?;
        let nodes = set(grid, name)?;
        hold(grid, entry, &nodes, sets.len() as u32, &mut problem.supports)
            .with_context(|| format!("set \"{name}\""))?;
        sets.push((name.to_owned(), nodes));
    }
    if !case["body_force"].is_null() {
        // 1 N/m3 is 1e-6 mN/mm3.
        problem.body_force_mn_mm3 = vector(&case["body_force"], "body_force")?.map(|v| v * 1e-6);
    }
    for p in list(&case["pressure"]) {
        problem.pressures.push(pressure(mesh, p)?);
    }
    for c in list(&case["contact"]) {
        problem.contacts.push(contact(c)?);
    }
    for r in list(&case["embedded_rod"]) {
        problem.rods.push(rod(r)?);
    }
    Ok((problem, sets))
}

/// The items of a list; a single object is a list of one, nothing is an empty list.
fn list(value: &Value) -> Vec<&Value> {
    match value {
        Value::Null => Vec::new(),
        Value::Array(items) => items.iter().collect(),
        other => vec![other],
    }
}

fn array<'a>(grid: &'a UnstructuredGrid, name: &str) -> Result<&'a DataArray> {
    let names = || grid.point_data.iter().map(|a| a.name.as_str()).collect::<Vec<_>>().join(", ");
    vtu::find(&grid.point_data, name)
        .with_context(|| format!("the mesh has no point array \"{name}\"; there are: {}", names()))
}

fn set(grid: &UnstructuredGrid, name: &str) -> Result<Vec<u32>> {
    let flags = array(grid, &format!("set_{name}"))?;
    ensure!(
        flags.components == 1,
        "the point array \"set_{name}\" has {} components, wanted one number a node, 0 or 1; \"components\" says which of x, y \
         and z are held",
        flags.components
    );
    let odd = flags.values.iter().position(|v| !v.is_finite());
    ensure!(
        odd.is_none(),
        "the point array \"set_{name}\" is no number at node {}; wanted 0 or 1",
        odd.unwrap_or_default()
    );
    let nodes: Vec<u32> = (0..flags.values.len() as u32).filter(|&i| flags.values[i as usize] != 0.0).collect();
    ensure!(!nodes.is_empty(), "the set \"{name}\" is empty: its point array \"set_{name}\" is 0 at every node");
    Ok(nodes)
}

fn hold(grid: &UnstructuredGrid, entry: &Value, nodes: &[u32], set: u32, out: &mut Vec<Support>) -> Result<()> {
    let given = &entry["components"];
    let components = given.as_str().with_context(|| wanted(given, "components", "letters of \"xyz\""))?;
    ensure!(
        !components.is_empty() && components.chars().all(|c| "xyz".contains(c)),
        "components \"{components}\"; wanted letters of \"xyz\""
    );
    let held = |a: usize| components.contains(["x", "y", "z"][a]);
    let field = match entry["value"].as_str() {
        Some(text) => {
            let name = text.strip_prefix("field:").with_context(|| format!("value \"{text}\"; wanted field:NAME"))?;
            let field = array(grid, name)?;
            ensure!(field.components == 3, "the array \"{name}\" has {} components, wanted 3", field.components);
            Some(&field.values)
        }
        None => None,
    };
    let constant = if field.is_none() { vector(&entry["value"], "value")? } else { [0.0; 3] };
    for &node in nodes {
        let at = |a: usize| field.map_or(constant[a], |f| f[3 * node as usize + a]);
        let displacement_mm = core::array::from_fn(|a| held(a).then(|| at(a) * MM));
        let finite = displacement_mm.iter().flatten().all(|v: &f64| v.is_finite());
        ensure!(finite, "the displacement of node {node} is {:?} m", [0, 1, 2].map(at));
        out.push(Support { node, set, displacement_mm });
    }
    Ok(())
}

fn pressure(mesh: &Value, p: &Value) -> Result<Pressure> {
    let name = p["faces"].as_str().context("an entry of \"pressure\" names no faces")?;
    let lists = || ["face_sets", "faces"].into_iter().filter_map(|k| mesh[k].as_object());
    let there = || lists().flat_map(Map::keys).map(String::as_str).collect::<Vec<_>>().join(", ");
    let found: Vec<&Value> = lists().filter_map(|l| l.get(name)).collect();
    ensure!(found.len() < 2, "the mesh has two face lists \"{name}\", in \"face_sets\" and in \"faces\"; keep one");
    let faces =
        found.first().with_context(|| format!("the mesh has no face list \"{name}\"; there are: {}", there()))?;
    let faces =
        faces.as_array().with_context(|| format!("the face list \"{name}\" is {faces}, wanted a list of faces"))?;
    ensure!(!faces.is_empty(), "the face list \"{name}\" is empty: its pressure would push nothing");
    let corner = |v: &Value| v.as_u64().and_then(|v| u32::try_from(v).ok());
    let face = |(i, f): (usize, &Value)| {
        let corners = f.as_array().and_then(|f| f.iter().map(corner).collect::<Option<Vec<u32>>>());
        let three = corners.and_then(|c| <[u32; 3]>::try_from(c).ok());
        three.with_context(|| format!("face {i} of the list \"{name}\" is {f}, wanted three vertex numbers"))
    };
    let faces = faces.iter().enumerate().map(face).collect::<Result<_>>()?;
    Ok(Pressure { faces, kpa: number(&p["pressure"], "pressure")? * 1e-3 })
}

fn contact(c: &Value) -> Result<SphereContact> {
    ensure!(c.is_object(), "a \"contact\" is {c}, wanted an object with radius, centre_start and centre_end");
    for name in ["kind", "type", "shape"] {
        let kind = word(&c[name], name, "rigid_sphere")?;
        ensure!(kind == "rigid_sphere", "contact of {name} \"{kind}\"; only rigid_sphere is known");
    }
    let nested = c["rigid_sphere"].is_object();
    let twice = ["radius", "friction", "centre_start", "centre_end"].into_iter().find(|k| nested && !c[*k].is_null());
    ensure!(
        twice.is_none(),
        "a \"contact\" has \"{}\" beside its object \"rigid_sphere\"; all numbers belong into one of the two",
        twice.unwrap_or_default()
    );
    let c = if nested { &c["rigid_sphere"] } else { c };
    let place = |name: &str| Ok::<_, anyhow::Error>(Point::from_array(vector(&c[name], name)?.map(|v| v * MM)));
    let friction = if c["friction"].is_null() { 0.0 } else { number(&c["friction"], "friction")? };
    Ok(SphereContact {
        radius_mm: number(&c["radius"], "radius")? * MM,
        friction,
        from: place("centre_start")?,
        to: place("centre_end")?,
    })
}

fn rod(r: &Value) -> Result<EmbeddedRod> {
    let coupling = word(&r["coupling"], "coupling", "bonded")?;
    ensure!(
        coupling.starts_with("bonded"),
        "embedded_rod with coupling \"{coupling}\"; only bonded (no slip) is known"
    );
    let place = |name: &str| Ok::<_, anyhow::Error>(Point::from_array(vector(&r[name], name)?.map(|v| v * MM)));
    Ok(EmbeddedRod {
        radius_mm: number(&r["radius"], "radius")? * MM,
        ends: [place("p0")?, place("p1")?],
        displacement_mm: Vector::from_array(vector(&r["displacement"], "displacement")?.map(|v| v * MM)),
    })
}

/// A text, or what is meant where there is none.
fn word<'a>(value: &'a Value, name: &str, usual: &'a str) -> Result<&'a str> {
    if value.is_null() { Ok(usual) } else { value.as_str().with_context(|| wanted(value, name, "text")) }
}

fn number(value: &Value, name: &str) -> Result<f64> {
    value.as_f64().with_context(|| wanted(value, name, "a number"))
}

fn vector(value: &Value, name: &str) -> Result<[f64; 3]> {
    let numbers = value.as_array().and_then(|v| v.iter().map(Value::as_f64).collect::<Option<Vec<f64>>>());
    let three = numbers.and_then(|v| <[f64; 3]>::try_from(v).ok());
    three.with_context(|| wanted(value, name, "three numbers"))
}

/// That a field is not there, or is something else.
fn wanted(value: &Value, name: &str, what: &str) -> String {
    if value.is_null() {
        format!("there is no \"{name}\", wanted {what}")
    } else {
        format!("\"{name}\" is {value}, wanted {what}")
    }
}
