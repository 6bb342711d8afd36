//! `monro bench mesh`: the mesher on phantoms, scans and label volumes, in many sizes.

mod embedding;
mod measure;
mod surfaces;
mod truth;

use super::peak_memory_mib;
use crate::args::PhantomKind;
use crate::bench::args::MeshBenchArgs;
use crate::columns::{Column, column, lines, percent, table};
use crate::console::Console;
use crate::{mesh, phantom};
use anyhow::Result;
use measure::Subject;
use monro_anatomy::phantom::{HeadModel, HeadOptions};
use monro_geometry::{Patient, Point, Volume};
use monro_prepare::{Request, Silent, simulated_labels};
use monro_scan::ReadOptions;
use serde_json::{Value, json};
use std::path::Path;
use truth::Truth;

/// Elements of the mesh that a scan is prepared with, which is not looked at.
const LEAST: usize = 5_824;

/// Runs the bench.
pub(super) fn run(args: &MeshBenchArgs, console: &Console) -> Result<()> {
    // What cannot be read is told before minutes of phantoms.
    let files = args.subjects.iter().map(|path| of_file(path)).collect::<Result<Vec<_>>>()?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads.into()).build()?;
    let mut rows: Vec<Value> = Vec::new();
    let mut measure = |subject: &Subject| {
        for &elements in &args.elements {
            let row = pool.install(|| subject.measure(elements, args.repeat.into(), args.embedding));
            console.note(&format!("{} at {elements}: {} s", subject.name, row["seconds"]["without_report"]));
            rows.push(row);
        }
    };
    let mut voxels = Vec::new();
    for seed in 0..args.seeds {
        let subject = of_phantom(seed)?;
        let off = subject.truth.as_ref().map(|t| t.compare_voxels(&subject.labels));
        voxels.push(json!({ "subject": subject.name, "to_truth": off }));
        measure(&subject);
    }
    files.iter().for_each(measure);
    let mut result = json!({ "threads": args.threads, "repeat": args.repeat, "voxels": voxels, "meshes": rows });
    if args.surfaces {
        result["surfaces"] = pool.install(surfaces::measure)?;
    }
    let mut text = result["meshes"].as_array().map_or_else(String::new, |rows| table(rows, &columns()));
    if args.surfaces {
        text += &format!("\nsurfaces\n{}", lines(&result["surfaces"]));
    }
    console.result(&result, &text);
    Ok(())
}

/// What of each mesh is told to people.
fn columns() -> Vec<Column> {
    vec![
        column("subject", "/subject"),
        column("wanted", "/wanted"),
        column("elements", "/elements"),
        column("seconds", "/seconds/without_report"),
        column("CPU s", "/cpu_seconds/without_report"),
        column("MiB", "/peak_memory_mib"),
        column("angle min", "/dihedral_min_deg"),
        column("1 %", "/dihedral_p1_deg"),
        column("max", "/dihedral_max_deg"),
        column("radius ratio", "/radius_ratio_min"),
        column("edge near mm", "/core_edge_mean_mm"),
        column("along path", "/path_edge_mean_mm"),
        percent("volume off %", "/worst_volume_error"),
        column("to truth mm", "/to_truth/mean_mm"),
        column("at most", "/to_truth/max_mm"),
        column("bind ms", "/embedding/bind_ms"),
        column("manifold", "/manifold"),
    ]
}

/// The true labels of a phantom, with the path from Kocher's point to the foramen of Monro on the right.
fn of_phantom(seed: u64) -> Result<Subject> {
    let made = phantom::make(PhantomKind::Head, seed)?;
    let model = HeadModel::new(&HeadOptions { seed, ..HeadOptions::default() });
    let path = [made.landmarks.kocher_right, made.landmarks.monro_right];
    let mut subject = simulated(format!("phantom {seed}"), &made.labels, path);
    subject.truth = Truth::new(&model, &subject.labels);
    Ok(subject)
}

/// A case, a label volume, or a scan, which is segmented and planned first.
fn of_file(path: &Path) -> Result<Subject> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let is_case = path.join("case.toml").is_file();
    if is_case || (path.is_file() && monro_scan::read_labels(path).is_ok_and(|l| is_label_volume(&l))) {
        let mesh::Input { labels, keep, fine, path, .. } = mesh::read_input(path)?;
        return Ok(Subject { name, labels, keep, fine, path, truth: None });
    }
    let scan = monro_scan::read(path, &ReadOptions::default())?;
    let request = Request { elements: LEAST, ..Request::default() };
    let made = monro_prepare::build(scan, &request, &Silent)?;
    Ok(simulated(name, &made.segmentation.labels, [made.case.plan.entry(), made.case.plan.target()]))
}

/// A scan has thousands of values, labels have few.
fn is_label_volume(labels: &Volume<u16>) -> bool {
    labels.data().iter().all(|&l| l < 1000)
}

fn simulated(name: String, labels: &Volume<u8>, path: [Point<Patient>; 2]) -> Subject {
    let (merged, keep, fine) = simulated_labels(labels);
    Subject { name, labels: merged.map(u16::from), keep, fine, path: Some(path), truth: None }
}
