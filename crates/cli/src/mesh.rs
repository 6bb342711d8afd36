//! `monro mesh`: graded tetrahedra from any label volume, or again from a case.

mod facts;
mod figures;
mod import;
pub(crate) mod meeting;
mod of_a_case;
mod options;
mod report;

pub(crate) use facts::place;
pub(crate) use figures::{MeshSection, time_section};
pub(crate) use options::{coarsest, growth, label};

use crate::args::MeshArgs;
use crate::console::{Console, seconds_json};
use crate::mesh_file::{AnyMesh, Encoded, Format};
use crate::output_file;
use anyhow::{Result, bail};
use facts::{SurfaceFacts, bounds, label_facts, shapes_json, shapes_words};
use monro_anatomy::tetra::{self, LabelReport, MeshOptions, MeshReport, Stage, SurfaceReport};
use monro_case::Case;
use monro_geometry::{Patient, Point, Volume};
use monro_prepare::{DEFAULT_ELEMENTS, simulated_labels};
use monro_scan::labels::CaseLabels;
use serde_json::{Value, json};
use std::path::Path;
use std::time::Instant;

/// What is to be meshed.
pub(crate) struct Input {
    pub(crate) labels: Volume<u16>,
    pub(crate) keep: Vec<u16>,
    pub(crate) fine: Vec<u16>,
    pub(crate) path: Option<[Point<Patient>; 2]>,
    /// The labels are the structures of a case.
    pub(crate) structures: bool,
    /// What is doubtful in the file, and what was guessed.
    pub(crate) remarks: Vec<String>,
}

/// Runs the command.
pub(crate) fn run(args: &MeshArgs, console: &Console) -> Result<()> {
    for file in std::iter::once(&args.out).chain(&args.report) {
        output_file::check(file, args.force, &[&args.labels])?;
    }
    if args.report.as_ref() == Some(&args.out) {
        bail!("--report and --out name the same file, {}", args.out.display());
    }
    if let Some(other) = args.report.as_ref().filter(|f| !f.extension().is_some_and(|e| e.eq_ignore_ascii_case("html")))
    {
        bail!("--report {}: the report is a page, give it a name that ends in .html", other.display());
    }
    let format = Format::to_write(&args.out)?;
    if args.labels.is_file() && Format::of(&args.labels).is_some() {
        import::check_options(args)?;
        let read = console.stage("read", || Format::read(&args.labels))?;
        return import::convert(&read, format, args, console);
    }
    let input = console.stage("read", || input(args))?;
    if args.fine.is_none() && !input.fine.is_empty() && input.fine != input.keep {
        console
            .note(&format!("fine around {} (the ventricles of a case; --fine changes it)", numbers(&input.fine, ", ")));
    }
    let options = mesh_options(&input, args)?;
    let mut parts = Parts::new();
    let (mesh, mut report) =
        console.stage("mesh", || tetra::mesh_observed(&input.labels, &options, |s| parts.done(s)))?;
    report.remarks.extend(input.remarks.iter().cloned());
    report.remarks.extend(of_fine(&input));
    report.remarks.extend(of_path(&input));
    report.remarks.extend(of_size(&mesh.vertices));
    let of_mesh = json!({ "fine": input.fine, "bounds_mm": bounds(&mesh.vertices), "report": args.report });
    let mesh = AnyMesh::Tetrahedra(mesh);
    let Encoded { bytes, remark } = format.encode(&mesh)?;
    report.remarks.extend(remark);
    console.stage("write", || output_file::write(&args.out, &bytes))?;
    if let (Some(file), AnyMesh::Tetrahedra(mesh)) = (&args.report, &mesh) {
        let source = args.labels.file_name().unwrap_or_default().to_string_lossy();
        let stages = console.stages();
        let page = console.stage("report", || report::page(&source, &input, mesh, &report, &stages));
        output_file::write(file, page.as_bytes())?;
    }
    for remark in report.all_remarks() {
        console.warn(remark);
    }
    let json = merged(as_json(&report, &args.out, &console.stages(), &parts), of_mesh);
    let words = shapes_words([report.elements, report.vertices], &(&report).into());
    console.result(&json, &format!("{words}: {}", args.out.display()));
    Ok(())
}

fn mesh_options(input: &Input, args: &MeshArgs) -> Result<MeshOptions> {
    let usual = MeshOptions::new(&input.keep, &input.fine, args.elements.unwrap_or(DEFAULT_ELEMENTS));
    Ok(MeshOptions {
        path: input.path,
        density: args.density.as_deref().map_or_else(|| Ok(Vec::new()), options::density)?,
        growth: args.growth.unwrap_or(usual.growth),
        coarsest: args.coarsest.unwrap_or(usual.coarsest),
        strict: args.strict,
        ..usual
    })
}

/// What is done where none of the labels to be fine around is there.
fn of_fine(input: &Input) -> Option<String> {
    let there = |l: &u16| input.fine.contains(l) && input.keep.contains(l);
    if input.fine.is_empty() || input.labels.data().iter().any(there) {
        return None;
    }
    let instead = if input.path.is_some() {
        "the mesh is fine along the path only, where that meets what is meshed"
    } else {
        "edges are alike everywhere"
    };
    Some(format!("none of the labels to be fine around is meshed: {instead}"))
}

/// Points along a path that are looked at.
const ALONG: usize = 1000;

/// A path that lies outside of all labels for more than half of its length; one that passes them by is another matter.
fn of_path(input: &Input) -> Option<String> {
    let [from, to] = input.path?;
    let labelled = |p| input.labels.nearest(p).is_some_and(|l| l != 0);
    let within = (0..=ALONG).filter(|&i| labelled(from.lerp(to, i as f64 / ALONG as f64))).count();
    let length = from.distance(to);
    let outside = length * (1.0 - within as f64 / (ALONG + 1) as f64);
    (within > 0 && 2.0 * outside > length).then(|| {
        format!("the path is {length:.1} mm long, {outside:.1} mm of it outside of all labels: its ends are LPS, in mm")
    })
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
        input.keep = each_once(keep);
        if input.structures {
            input.fine.retain(|l| keep.contains(l));
        } else {
            input.fine = of_a_case::usually_fine(&input.labels, &input.keep);
        }
    }
    if let Some(fine) = &args.fine {
        input.fine = each_once(fine);
    } else if !input.structures {
        input.remarks.extend(of_a_case::not_taken_for_ventricles(&input.keep, &input.fine));
    }
    if let Some(path) = &args.path {
        input.path = Some(crate::args::path("--path", path)?);
    }
    Ok(input)
}

/// The labels without those that come again.
fn each_once(labels: &[u16]) -> Vec<u16> {
    labels.iter().enumerate().filter(|(i, l)| !labels[..*i].contains(l)).map(|(_, &l)| l).collect()
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
    Ok(Input {
        labels: merged.map(u16::from),
        keep,
        fine,
        path: Some([case.plan.entry(), case.plan.target()]),
        structures: true,
        remarks: Vec::new(),
    })
}

/// All labels of a file but 0; fine around the ventricles where the numbers are those of a case, else everywhere.
fn of_file(path: &Path) -> Result<Input> {
    let CaseLabels { volume: labels, warnings: remarks, .. } = monro_scan::read_labels_with_warnings(path)?;
    let mut keep = labels.data().to_vec();
    keep.sort_unstable();
    keep.dedup();
    keep.retain(|&l| l != 0);
    if keep.is_empty() {
        bail!("{} holds nothing but the label 0", path.display());
    }
    let fine = of_a_case::usually_fine(&labels, &keep);
    Ok(Input { labels, keep, fine, path: None, structures: false, remarks })
}

/// Labels in words.
fn numbers(labels: &[u16], between: &str) -> String {
    let words: Vec<String> = labels.iter().map(u16::to_string).collect();
    words.join(between)
}

/// Both objects as one.
pub(crate) fn merged(mut head: Value, body: Value) -> Value {
    if let (Some(head), Value::Object(body)) = (head.as_object_mut(), body) {
        head.extend(body);
    }
    head
}

/// Longest sides that labels of a body have, mm: from a specimen to a whole human.
const SIDE_MM: std::ops::RangeInclusive<f64> = 1.0..=2500.0;

/// A size that no body has.
fn of_size(vertices: &[Point<Patient>]) -> Option<String> {
    let [low, high] = bounds(vertices);
    let side = (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max);
    (!SIDE_MM.contains(&side)).then(|| {
        format!("the labels are {side:.4} mm long: is the header's unit right? voxels are in mm, and so is the mesh")
    })
}

fn as_json(report: &MeshReport, out: &Path, stages: &[(String, f64)], parts: &Parts) -> Value {
    let json = json!({
        "out": out.display().to_string(),
        "elements": report.elements,
        "vertices": report.vertices,
        "seconds": seconds_json(stages),
        "mesh_seconds": seconds_json(&parts.seconds),
        "core_edge_mean_mm": report.core_edge_mean,
        "path_edge_mean_mm": report.path_edge_mean,
        "edge_bands": report.edge_bands.iter().map(|b| json!({ "from_mm": b.from, "to_mm": b.to, "mean_mm": b.mean, "edges": b.edges, "elements": b.elements })).collect::<Vec<_>>(),
        "open_at_border": report.open_at_border,
        "coarse_regions": report.coarse_regions,
        "closed_gaps": report.closed_gaps.map(|g| json!({ "voxels": g.voxels, "at_mm": g.at })),
        "self_crossing": meeting::crossing_json(report.self_crossing.as_ref()),
        "overlap": report.overlap.map(|o| json!({ "elements": o.elements, "at_mm": o.at.to_array() })),
        "remarks": report.all_remarks(),
        "labels": report.labels.iter().map(label_json).collect::<Vec<_>>(),
        "outer": surface_json(&report.outer),
    });
    merged(json, shapes_json(&report.into()))
}

pub(crate) fn label_json(l: &LabelReport) -> Value {
    let label = json!({
        "volume_error": l.volume_error,
        "interface_mean_mm": l.interface.map(|i| i.mean),
        "interface_max_mm": l.interface.map(|i| i.max),
        "interface_max_at": l.interface.map(|i| i.max_at),
        "interface_max_edge_mm": l.interface.map(|i| i.edge),
        "voxels": l.voxels,
        "lost_at": l.lost_at,
        "torn": l.torn.map(|t| json!({ "places": t.places, "voxels": t.voxels, "at_mm": t.at })),
    });
    let facts = label_facts(l.label, l.elements, l.volume, &(&l.surface).into());
    merged(merged(facts, label), against_labels(&l.surface))
}

fn surface_json(s: &SurfaceReport) -> Value {
    merged(SurfaceFacts::from(s).json(), against_labels(s))
}

/// The topology of the labels' surface, and where that of the mesh differs.
fn against_labels(s: &SurfaceReport) -> Value {
    json!({ "euler_labels": s.euler_labels, "surfaces_labels": s.surfaces_labels, "differs_at": s.differs_at })
}
