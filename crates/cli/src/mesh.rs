//! `monro mesh`: graded tetrahedra from any label volume, or again from a case.

use crate::args::{MeshArgs, in_range};
use crate::console::{Console, seconds_json};
use crate::mesh_file::{AnyMesh, Format, Read};
use anyhow::{Context, Result, bail};
use monro_anatomy::tetra::{self, LabelReport, MeshOptions, MeshReport, Stage, SurfaceReport};
use monro_case::Case;
use monro_geometry::{Patient, Point, Structure, Volume};
use monro_prepare::simulated_labels;
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use std::time::Instant;

/// What is to be meshed.
pub(crate) struct Input {
    pub(crate) labels: Volume<u16>,
    pub(crate) keep: Vec<u16>,
    pub(crate) fine: Vec<u16>,
    pub(crate) path: Option<[Point<Patient>; 2]>,
}

/// Runs the command.
pub(crate) fn run(args: &MeshArgs, console: &Console) -> Result<()> {
    if args.out.exists() && !args.force {
        bail!("{} exists already; give --force to overwrite it, or another --out", args.out.display());
    }
    let format = Format::to_write(&args.out)?;
    if args.labels.is_file()
        && let Some(read) = console.stage("read", || Format::read(&args.labels))?
    {
        return convert(&read, format, args, console);
    }
    let input = console.stage("read", || input(args))?;
    let usual = MeshOptions::new(&input.keep, &input.fine, args.elements);
    let options = MeshOptions {
        path: input.path,
        density: args.density.as_deref().map_or_else(|| Ok(Vec::new()), parse_density)?,
        growth: args.growth.unwrap_or(usual.growth),
        coarsest: args.coarsest.unwrap_or(usual.coarsest),
        strict: args.strict,
        ..usual
    };
    let mut parts = Parts::new();
    let (mesh, report) = console.stage("mesh", || tetra::mesh_observed(&input.labels, &options, |s| parts.done(s)))?;
    let mesh = AnyMesh::Tetrahedra(mesh);
    console.stage("write", || write(&args.out, &format.encode(&mesh)?))?;
    for remark in &report.remarks {
        console.warn(remark);
    }
    let json = as_json(&report, &args.out, &console.stages(), &parts);
    let text = format!(
        "{} tetrahedra, {} vertices, dihedral angles {:.1} to {:.1} degrees, radius ratio at least {:.2}: {}",
        report.elements,
        report.vertices,
        report.dihedral_min,
        report.dihedral_max,
        report.radius_ratio_min,
        args.out.display()
    );
    console.result(&json, &text);
    Ok(())
}

/// Writes a mesh that was read, which has been checked on the way.
fn convert(Read { mesh, remarks }: &Read, format: Format, args: &MeshArgs, console: &Console) -> Result<()> {
    remarks.iter().for_each(|remark| console.warn(remark));
    console.stage("write", || write(&args.out, &format.encode(mesh)?))?;
    let (name, elements, vertices) = match mesh {
        AnyMesh::Tetrahedra(m) => ("tetrahedra", m.tets.len(), m.vertices.len()),
        AnyMesh::Surface(m) => ("triangles", m.triangles.len(), m.vertices.len()),
    };
    let out = args.out.display().to_string();
    let seconds = seconds_json(&console.stages());
    let json =
        json!({ "out": out, "elements": elements, "vertices": vertices, "seconds": seconds, "remarks": remarks });
    console.result(&json, &format!("{elements} {name}, {vertices} vertices: {out}"));
    Ok(())
}

/// Seconds of each part of the meshing.
struct Parts {
    since: Instant,
    seconds: Vec<(String, f64)>,
}

impl Parts {
    fn new() -> Self {
        Self { since: Instant::now(), seconds: Vec::new() }
    }

    fn done(&mut self, stage: Stage) {
        let now = Instant::now();
        self.seconds.push((stage.name().to_owned(), (now - self.since).as_secs_f64()));
        self.since = now;
    }
}

/// What a case or a label volume is meshed as when nothing else is asked.
pub(crate) fn read_input(path: &Path) -> Result<Input> {
    if path.is_dir() { of_case(path) } else { of_file(path) }
}

fn input(args: &MeshArgs) -> Result<Input> {
    let mut input = read_input(&args.labels)?;
    if let Some(keep) = &args.keep {
        // The numbers of the file count here, also for a case.
        if args.labels.is_dir() {
            input.labels = monro_scan::read_labels(&args.labels.join("labels.nii.gz"))?;
        }
        input.keep.clone_from(keep);
        input.fine.retain(|l| keep.contains(l));
    }
    if let Some(fine) = &args.fine {
        input.fine.clone_from(fine);
    }
    if let Some(path) = &args.path {
        input.path = Some(parse_path(path)?);
    }
    Ok(input)
}

/// A case is meshed as `prepare` does it: all inside the skull, fine around ventricles and path.
fn of_case(dir: &Path) -> Result<Input> {
    let case = Case::open(dir)?;
    let file = dir.join("labels.nii.gz");
    if !file.is_file() {
        bail!("{} has no labels.nii.gz (it was shared without images), so it cannot be meshed again", dir.display());
    }
    let labels = monro_scan::read_labels(&file)?;
    let small = labels.map(|l| u8::try_from(l).unwrap_or(0));
    let (merged, keep, fine) = simulated_labels(&small);
    Ok(Input { labels: merged.map(u16::from), keep, fine, path: Some([case.plan.entry(), case.plan.target()]) })
}

/// All labels of a file but 0; fine around the ventricles where the numbers are those of a case, else everywhere.
fn of_file(path: &Path) -> Result<Input> {
    let labels = monro_scan::read_labels(path)?;
    let mut keep = labels.data().to_vec();
    keep.sort_unstable();
    keep.dedup();
    keep.retain(|&l| l != 0);
    if keep.is_empty() {
        bail!("{} holds nothing but the label 0", path.display());
    }
    let ventricle =
        |l: &u16| u8::try_from(*l).ok().and_then(Structure::from_label).is_some_and(Structure::is_ventricle);
    let fine: Vec<u16> = keep.iter().copied().filter(ventricle).collect();
    let fine = if fine.is_empty() { keep.clone() } else { fine };
    Ok(Input { labels, keep, fine, path: None })
}

/// `X,Y,Z:X,Y,Z` in LPS mm.
fn parse_path(text: &str) -> Result<[Point<Patient>; 2]> {
    let point = |part: &str| -> Option<Point<Patient>> {
        let numbers: Vec<f64> = part.split(',').map(|n| n.trim().parse().ok()).collect::<Option<_>>()?;
        let p = Point::from_array(numbers.try_into().ok()?);
        p.is_finite().then_some(p)
    };
    let ends = text.split_once(':').and_then(|(a, b)| Some([point(a)?, point(b)?]));
    ends.with_context(|| format!("--path \"{text}\" is not X,Y,Z:X,Y,Z (LPS mm)"))
}

/// `LABEL=FACTOR,...`.
fn parse_density(text: &str) -> Result<Vec<(u16, f64)>> {
    let one = |part: &str| {
        let (label, factor) = part.split_once('=')?;
        Some((label.trim().parse().ok()?, factor.trim().parse().ok()?))
    };
    text.split(',')
        .map(one)
        .collect::<Option<_>>()
        .with_context(|| format!("--density \"{text}\" is not LABEL=FACTOR,..."))
}

/// A label.
pub(crate) fn label(text: &str) -> Result<u16, String> {
    let rule = || format!("\"{}\" is no label; give numbers from 0 to {}, as in 4,5", text.trim(), u16::MAX);
    text.trim().parse().map_err(|_| rule())
}

/// Growth of edges, mm a mm.
pub(crate) fn growth(text: &str) -> Result<f64, String> {
    in_range(text, *tetra::GROWTH.start(), *tetra::GROWTH.end())
}

/// Longest edge over the finest.
pub(crate) fn coarsest(text: &str) -> Result<f64, String> {
    in_range(text, *tetra::COARSEST.start(), *tetra::COARSEST.end())
}

/// Both objects as one.
pub(crate) fn merged(mut head: Value, body: Value) -> Value {
    if let (Some(head), Value::Object(body)) = (head.as_object_mut(), body) {
        head.extend(body);
    }
    head
}

/// Writes aside and renames, so that an interrupted run leaves no half file.
fn write(out: &Path, bytes: &[u8]) -> Result<()> {
    let mut name = out.file_name().unwrap_or_default().to_owned();
    name.push(format!(".partial-{}", std::process::id()));
    let aside = out.with_file_name(name);
    fs::write(&aside, bytes).with_context(|| format!("cannot write {}", aside.display()))?;
    fs::rename(&aside, out).with_context(|| format!("cannot write {}", out.display()))
}

fn as_json(report: &MeshReport, out: &Path, stages: &[(String, f64)], parts: &Parts) -> Value {
    json!({
        "out": out.display().to_string(),
        "elements": report.elements,
        "vertices": report.vertices,
        "seconds": seconds_json(stages),
        "mesh_seconds": seconds_json(&parts.seconds),
        "dihedral_min_deg": report.dihedral_min,
        "dihedral_max_deg": report.dihedral_max,
        "dihedral_p1_deg": report.dihedral_p1,
        "radius_ratio_min": report.radius_ratio_min,
        "radius_ratio_median": report.radius_ratio_median,
        "core_edge_mean_mm": report.core_edge_mean,
        "edge_bands": report.edge_bands.iter().map(|b| json!({ "from_mm": b.from, "to_mm": b.to, "mean_mm": b.mean, "edges": b.edges, "elements": b.elements })).collect::<Vec<_>>(),
        "open_at_border": report.open_at_border,
        "coarse_regions": report.coarse_regions,
        "remarks": report.remarks,
        "bad_shapes": report.bad_shapes.map_or(0, |bad| bad.count),
        "worst_shape_at": report.bad_shapes.map(|bad| bad.worst_at),
        "labels": report.labels.iter().map(label_json).collect::<Vec<_>>(),
        "outer": surface_json(&report.outer),
    })
}

pub(crate) fn label_json(l: &LabelReport) -> Value {
    let label = json!({
        "label": l.label,
        "elements": l.elements,
        "volume_mm3": l.volume,
        "volume_error": l.volume_error,
        "interface_mean_mm": l.interface.map(|i| i.mean),
        "interface_max_mm": l.interface.map(|i| i.max),
        "interface_max_at": l.interface.map(|i| i.max_at),
        "voxels": l.voxels,
        "lost_at": l.lost_at,
    });
    merged(label, surface_json(&l.surface))
}

fn surface_json(s: &SurfaceReport) -> Value {
    json!({
        "euler": s.euler,
        "euler_labels": s.euler_labels,
        "surfaces": s.surfaces,
        "surfaces_labels": s.surfaces_labels,
        "differs_at": s.differs_at,
        "closed": s.closed,
        "manifold": s.manifold,
        "pinched_at": s.pinched_at,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn densities_are_labels_with_factors_or_an_error_that_shows_the_form() {
        assert_eq!(parse_density("4=2, 7=0.5").expect("two"), [(4, 2.0), (7, 0.5)]);
        for bad in ["", "4", "4=x", "-1=2", "4=2,"] {
            assert!(parse_density(bad).expect_err("refused").to_string().contains("LABEL=FACTOR"), "{bad}");
        }
    }

    #[test]
    fn a_path_is_two_points_or_an_error_that_shows_the_form() {
        let [a, b] = parse_path("1,-2.5,3: 4,5,6e1").expect("a path");
        assert_eq!((a, b), (Point::new(1.0, -2.5, 3.0), Point::new(4.0, 5.0, 60.0)));
        for bad in ["", "1,2,3", "1,2:3,4", "1,2,3:4,5,x", "1,2,3:4,5,inf"] {
            assert!(parse_path(bad).expect_err("refused").to_string().contains("X,Y,Z:X,Y,Z"), "{bad}");
        }
    }
}
