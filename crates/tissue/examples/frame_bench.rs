//! Times the whole frame on the ball meshes that the peers run.
//!
//!     cargo run --release -p monro-tissue --example frame_bench -- MESH.vtu... [--mode paper|physical] [--scene drag|rod]
//!         [--iterations N] [--substeps N] [--elements-dihedral] [--predicted] [--verbose]
//!
//! `drag`: the vertices within 3 mm of the top are moved 60 mm down in 2 s (30 frames of rest, 120 of motion, 30 of
//! holding), as in the peers' scene. `rod`: a 3 mm rod goes the same way at 10 mm/s through membrane, tissue and ventricle.

mod common;

use common::Vtu;
use monro_geometry::{Point, TetMesh};
use monro_tissue::{
    Attachment, AttachmentKind, CollisionResponse, DihedralScope, FrameSettings, Material, Mode, Model, ModelOptions,
    PaperOptions, PhysicalOptions, State, StepReport, Stepper, TipShape, Tool, ToolMotion, ToolPose,
};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

struct Args {
    meshes: Vec<PathBuf>,
    physical: bool,
    rod: bool,
    verbose: bool,
    dihedral: DihedralScope,
    settings: FrameSettings,
}

fn main() {
    let args = arguments();
    for path in &args.meshes {
        let mesh = Vtu::read(path).mesh(1e3, 4);
        let line = run(&mesh, &args);
        println!("{}: {line}", path.file_stem().map(|s| s.to_string_lossy()).unwrap_or_default());
    }
}

fn arguments() -> Args {
    let mut a = Args {
        meshes: Vec::new(),
        physical: false,
        rod: false,
        verbose: false,
        dihedral: DihedralScope::Surface,
        settings: FrameSettings::default(),
    };
    let mut words = std::env::args().skip(1);
    while let Some(w) = words.next() {
        let mut value = || words.next().expect("a value");
        match w.as_str() {
            "--mode" => a.physical = value() == "physical",
            "--scene" => a.rod = value() == "rod",
            "--iterations" => a.settings.iterations = value().parse().expect("a number"),
            "--substeps" => a.settings.substeps = value().parse().expect("a number"),
            "--predicted" => a.settings.predicted_space = true,
            "--elements-dihedral" => a.dihedral = DihedralScope::Elements,
            "--verbose" => a.verbose = true,
            _ => a.meshes.push(w.into()),
        }
    }
    a
}

/// The peers' boundary: the lowest 15 % of the vertices are held, those within 3 mm of the top are driven.
fn held_and_driven(mesh: &TetMesh) -> (Vec<u32>, Vec<u32>, Point<monro_geometry::Patient>) {
    let mut z: Vec<f64> = mesh.vertices.iter().map(|p| p.z).collect();
    z.sort_by(f64::total_cmp);
    let level = z[(z.len() as f64 * 0.15) as usize];
    let top = *mesh.vertices.iter().max_by(|a, b| a.z.total_cmp(&b.z)).expect("not empty");
    let all = 0..mesh.vertices.len() as u32;
    let held = all.clone().filter(|&v| mesh.vertices[v as usize].z <= level).collect();
    let driven = all.filter(|&v| mesh.vertices[v as usize].distance(top) <= 3.0).collect();
    (held, driven, top)
}

fn options(args: &Args, fixed: &[u32]) -> ModelOptions {
    let mode = if args.physical {
        Mode::Physical(PhysicalOptions::default())
    } else {
        Mode::Paper(PaperOptions { dihedral: args.dihedral, ..PaperOptions::default() })
    };
    ModelOptions {
        mode,
        materials: BTreeMap::from([(4, Material { poisson: 0.45, ..Material::BRAIN }), (5, Material::VENTRICLE)]),
        attachments: fixed.iter().map(|&node| Attachment { node, kind: AttachmentKind::Fixed }).collect(),
        collision: CollisionResponse::Insertion,
    }
}

fn run(mesh: &TetMesh, args: &Args) -> String {
    let (mut fixed, driven, top) = held_and_driven(mesh);
    if !args.rod {
        fixed.extend(&driven);
    }
    let start = Instant::now();
    let model = Model::new(mesh, &options(args, &fixed)).expect("a model");
    let built = start.elapsed().as_secs_f64();
    let mut state = model.rest_state();
    let mut stepper = Stepper::new(&model);
    let (mut times, mut cpu, mut last) = (Vec::new(), Vec::new(), StepReport::default());
    let frames = if args.rod { 480 } else { 180 };
    for frame in 0..frames {
        let tools = if args.rod { vec![rod(top, frame)] } else { drive(&model, &mut state, mesh, &driven, frame) };
        let (t, c) = (Instant::now(), cpu_ms());
        last = stepper.step(&model, &mut state, &tools, &args.settings);
        times.push(t.elapsed().as_secs_f64() * 1e3);
        cpu.push(cpu_ms() - c);
        for e in &last.events {
            println!("  frame {frame}: {e:?}");
        }
        if args.verbose && frame % 20 == 0 {
            println!("  {frame}: {:.2} ms {}", times[frame], summary(&last));
        }
    }
    // The first 30 frames rest; the least of the others is what a quiet machine would take.
    let least = times[30..].iter().copied().fold(f64::INFINITY, f64::min);
    times.sort_by(f64::total_cmp);
    cpu.sort_by(f64::total_cmp);
    let at = |q: f64| times[((times.len() - 1) as f64 * q) as usize];
    format!(
        "{} tets, {} nodes, built {built:.2} s, least {:.3} ms, median {:.3} ms, p99 {:.3} ms, CPU median {:.3} ms, total {:.2} s; {}",
        mesh.tets.len(),
        mesh.vertices.len(),
        least,
        at(0.5),
        at(0.99),
        cpu[cpu.len() / 2],
        times.iter().sum::<f64>() / 1e3,
        summary(&last)
    )
}

/// CPU time of this thread, ms (Linux; 0 elsewhere): what a busy machine cannot stretch.
fn cpu_ms() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split(' ').next().and_then(|v| v.parse::<f64>().ok()).unwrap_or(0.0) * 1e-6
}

fn summary(r: &StepReport) -> String {
    let tool = r.tools.first().map_or(String::new(), |t| {
        format!(
            "axial {:.1} mN, label {:?}, inserted {:.1} mm, dimpling {}",
            t.axial_force_mn, t.label, t.inserted_mm, t.dimpling
        )
    });
    format!(
        "inverted {}, volume {:+.4} %, max move {:.2} mm, residual {:.1e} mm, contacts {}, active {}, {tool}",
        r.inverted,
        r.volume_change * 100.0,
        r.max_displacement_mm,
        r.residual_mm,
        r.contacts,
        r.active_nodes
    )
}

fn drive(model: &Model, state: &mut State, mesh: &TetMesh, driven: &[u32], frame: usize) -> Vec<ToolMotion> {
    let depth = 60.0 * ((frame as f64 + 1.0 - 30.0) / 120.0).clamp(0.0, 1.0);
    for &v in driven {
        let p = mesh.vertices[v as usize];
        model.place_fixed(state, v as usize, Point::new(p.x, p.y, p.z - depth));
    }
    Vec::new()
}

fn rod(top: Point<monro_geometry::Patient>, frame: usize) -> ToolMotion {
    let pose = |f: f64| {
        let z = top.z + 5.0 - 10.0 * f / 60.0;
        ToolPose { tip: Point::new(top.x, top.y, z), tail: Point::new(top.x, top.y, z + 150.0) }
    };
    let tool = Tool { tip: TipShape::Round, radius_mm: 1.5 };
    ToolMotion { tool, from: pose(frame as f64), to: pose(frame as f64 + 1.0) }
}
