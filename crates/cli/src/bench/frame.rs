//! `monro bench frame`: time of the soft body's whole frame (collision, deformation, surface update).

use super::ball::{self, Probe};
use super::peak_memory_mib;
use super::samples::Samples;
use crate::bench::args::{ConstraintsArg, FrameArgs};
use crate::columns::{Column, column, percent, table};
use crate::console::Console;
use anyhow::{Context, Result};
use monro_geometry::{Embedding, Patient, Point, TetMesh, Vector};
use monro_tissue::{
    Attachment, AttachmentKind, CollisionResponse, FrameSettings, Material, Mode, Model, ModelOptions,
    PaperCoefficients, PaperOptions, PhysicalOptions, State, StepReport, Stepper, TipShape, Tool, ToolMotion, ToolPose,
};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Frames of the probe: at rest, going down, holding.
const REST: usize = 30;
const PUSH: usize = 120;
const HOLD: usize = 30;
/// How deep the probe goes, mm.
const DEPTH_MM: f64 = 60.0;
/// Deformations of a repeat, and repeats (the paper's protocol).
const DEFORMATIONS: usize = 10;
const REPEATS: usize = 5;
/// Frames of one deformation, and how deep the rod goes meanwhile, mm.
const DEFORMATION_FRAMES: usize = 20;
const ROD_DEPTH_MM: f64 = 12.0;
/// Poisson's ratio of the tissue, as in the peers' scene.
const POISSON: f64 = 0.45;

/// Runs the bench.
pub(super) fn run(args: &FrameArgs, console: &Console) -> Result<()> {
    let result = match &args.mesh {
        Some(file) => probed(&ball::read(file, args.scale)?, args, console)?,
        None => {
            let sizes: Result<Vec<Value>> = args.elements.iter().map(|&n| rodded(n, args, console)).collect();
            json!({ "sizes": sizes? })
        }
    };
    let rows = result["sizes"].as_array().map_or_else(|| vec![result.clone()], Clone::clone);
    console.result(&result, &table(&rows, &columns()));
    Ok(())
}

/// What of each size is told to people.
fn columns() -> Vec<Column> {
    vec![
        column("elements", "/elements"),
        column("vertices", "/vertices"),
        column("threads", "/threads"),
        column("iterations", "/iterations"),
        column("ms median", "/ms_median"),
        column("ms 99 %", "/ms_p99"),
        column("CPU ms", "/cpu_ms_median"),
        column("bytes/element", "/bytes_per_element"),
        column("turned", "/inverted"),
        percent("volume %", "/volume_change"),
        column("predicted: ms median", "/predicted/ms_median"),
        percent("error %", "/predicted/error_of_imposed"),
        percent("RMS %", "/predicted/rms_error_of_motion"),
    ]
}

/// A running soft body with a surface bound to it.
struct Bench {
    model: Model,
    state: State,
    stepper: Stepper,
    settings: FrameSettings,
    surface: Embedding,
    nodes: Vec<[f32; 4]>,
    moved: Vec<[f32; 4]>,
    samples: Samples,
}

impl Bench {
    fn new(mesh: &TetMesh, fixed: &[u32], args: &FrameArgs, predicted_space: bool) -> Result<Self> {
        let points = surface_points(mesh);
        let surface = Embedding::new(mesh, &points)?;
        let model = Model::new(mesh, &options(args, fixed)).context("the mesh cannot be simulated")?;
        let settings = FrameSettings {
            iterations: args.iterations,
            substeps: args.substeps,
            predicted_space,
            ..FrameSettings::default()
        };
        let (state, stepper) = (model.rest_state(), Stepper::new(&model));
        let (nodes, moved) = (Vec::with_capacity(model.node_count()), vec![[0.0; 4]; points.len()]);
        Ok(Self { model, state, stepper, settings, surface, nodes, moved, samples: Samples::default() })
    }

    fn frame(&mut self, tools: &[ToolMotion], counts: bool) -> StepReport {
        let Self { model, state, stepper, settings, surface, nodes, moved, samples, .. } = self;
        let running = core::cell::RefCell::new((state, stepper));
        samples.frame(
            |done| {
                let (state, stepper) = &mut *running.borrow_mut();
                stepper.step_observed(model, state, tools, settings, done)
            },
            || {
                let (state, stepper) = &*running.borrow();
                model.nodes_into(state, nodes);
                stepper.move_points(surface, nodes, moved);
            },
            counts,
        )
    }

    fn positions(&self) -> Vec<Point<Patient>> {
        let mut out = Vec::new();
        self.model.positions_into(&self.state, &mut out);
        out
    }

    /// Bytes that model, state and memory to work in take for each element, by what they are for.
    fn bytes(&self, tets: usize) -> serde_json::Map<String, Value> {
        let state = [("state", self.state.bytes())];
        let held = self.model.bytes().into_iter().chain(state).chain(self.stepper.bytes());
        held.map(|(name, bytes)| (name.to_owned(), json!(bytes as f64 / tets as f64))).collect()
    }

    fn json(&self, mesh: &TetMesh, last: &StepReport) -> Value {
        let bytes = self.bytes(mesh.tets.len());
        let tets = mesh.tets.len();
        let counts: serde_json::Map<String, Value> =
            self.model.constraint_counts().into_iter().map(|(n, c)| (n.to_owned(), json!(c))).collect();
        let mut out = json!({
            "elements": tets, "vertices": mesh.vertices.len(), "surface_points": self.moved.len(),
            "constraints": counts, "iterations": self.settings.iterations, "substeps": self.settings.substeps,
            "predicted_space": self.settings.predicted_space, "threads": self.stepper.threads(),
            "inverted": last.inverted, "inverted_share": last.inverted as f64 / tets as f64,
            "volume_change": last.volume_change, "residual_mm": last.residual_mm,
            "max_displacement_mm": last.max_displacement_mm, "active_nodes": last.active_nodes,
            "peak_memory_mib": peak_memory_mib(),
            "bytes_per_element": bytes.values().filter_map(Value::as_f64).sum::<f64>().round(), "bytes_of_it": bytes,
        });
        if let (Some(all), Value::Object(times)) = (out.as_object_mut(), self.samples.json()) {
            all.extend(times);
        }
        out
    }
}

/// Constraint weights for the work that all engines do: a half of each edge's error in an iteration, all of a volume's.
fn equal_work(iterations: u32) -> PaperCoefficients {
    let stretch = 1.0 - 0.5f64.powi(i32::try_from(iterations).unwrap_or(i32::MAX));
    PaperCoefficients { stretch, dihedral: 0.0, triangle: 0.0, volume: 1.0, hetero: 0.0 }
}

fn options(args: &FrameArgs, fixed: &[u32]) -> ModelOptions {
    let mode = match args.constraints {
        ConstraintsArg::EdgesVolumes => Mode::Paper(PaperOptions { global_volume: 0.0, ..PaperOptions::default() }),
        ConstraintsArg::Paper => Mode::Paper(PaperOptions::default()),
        ConstraintsArg::Physical => Mode::Physical(PhysicalOptions::default()),
    };
    let [tissue, fluid] = ball::labels();
    let mut materials =
        BTreeMap::from([(tissue, Material { poisson: POISSON, ..Material::BRAIN }), (fluid, Material::VENTRICLE)]);
    if args.constraints == ConstraintsArg::EdgesVolumes {
        materials.values_mut().for_each(|m| m.paper = equal_work(args.iterations));
    }
    let attachments = fixed.iter().map(|&node| Attachment { node, kind: AttachmentKind::Fixed }).collect();
    ModelOptions { mode, materials, attachments, collision: CollisionResponse::Insertion }
}

/// Points of the surfaces of a finer model: corners and edge middles of all boundary triangles.
fn surface_points(mesh: &TetMesh) -> Vec<Point<Patient>> {
    let [_, fluid] = ball::labels();
    let mut points = Vec::new();
    for t in mesh.boundary(|_| true).into_iter().chain(mesh.boundary(|l| l == fluid)) {
        let p = t.map(|v| mesh.vertices[v as usize]);
        for i in 0..3 {
            points.extend([p[i], p[i].lerp(p[(i + 1) % 3], 0.5)]);
        }
    }
    points
}

/// Positions after parts of a scene, to be compared.
type Moments = Vec<Vec<Point<Patient>>>;

/// Both figures of a scene: the whole solution, and with the predicted deformation space beside it its largest distance
/// from the whole solution over the imposed displacement, `imposed_mm`, and the RMS distance over the RMS motion.
fn both(mesh: &TetMesh, mut run: impl FnMut(bool) -> Result<(Value, Moments)>, imposed_mm: f64) -> Result<Value> {
    let (mut whole, exact) = run(false)?;
    let (mut part, near) = run(true)?;
    let apart = || exact.iter().flatten().zip(near.iter().flatten()).map(|(p, q)| p.distance(*q));
    let moved = exact.iter().flat_map(|m| m.iter().zip(&mesh.vertices)).map(|(p, q)| p.distance(*q));
    let square = |sum: f64, d: f64| sum + d * d;
    part["error_of_imposed"] = json!(apart().fold(0.0, f64::max) / imposed_mm);
    part["rms_error_of_motion"] = json!((apart().fold(0.0, square) / moved.fold(0.0, square)).sqrt());
    whole["predicted"] = part;
    Ok(whole)
}

/// The peers' scene on a mesh from a file.
fn probed(mesh: &TetMesh, args: &FrameArgs, console: &Console) -> Result<Value> {
    let probe = Probe::new(mesh)?;
    let fixed = [probe.held.clone(), probe.driven.clone()].concat();
    let frames = args.frames.unwrap_or(REST + PUSH + HOLD);
    let depth = |frame: usize| DEPTH_MM * ((frame as f64 + 1.0 - REST as f64) / PUSH as f64).clamp(0.0, 1.0);
    if frames < REST + PUSH {
        let deep = depth(frames - 1);
        console.warn(&format!(
            "with {frames} frames the probe goes {deep:.1} of {DEPTH_MM:.0} mm deep (the first {REST} are at rest): not the scene that other engines are compared on"
        ));
    }
    let skip = if frames > REST + 5 { REST } else { 1 };
    let run = |predicted: bool| {
        let mut bench = Bench::new(mesh, &fixed, args, predicted)?;
        let mut last = StepReport::default();
        console.stage("frames", || {
            for frame in 0..frames {
                for &v in &probe.driven {
                    let to = mesh.vertices[v as usize] - Vector::new(0.0, 0.0, depth(frame));
                    bench.model.place_fixed(&mut bench.state, v as usize, to);
                }
                last = bench.frame(&[], frame >= skip);
            }
        });
        Ok((bench.json(mesh, &last), vec![bench.positions()]))
    };
    both(mesh, run, depth(frames - 1).max(f64::MIN_POSITIVE))
}

/// A rod pushed into a ball of so many elements from ten sides, five times over.
fn rodded(elements: usize, args: &FrameArgs, console: &Console) -> Result<Value> {
    let mesh = console.stage(&format!("ball of {elements}"), || ball::made(elements))?;
    let probe = Probe::new(&mesh)?;
    let run = |predicted: bool| {
        let mut bench = Bench::new(&mesh, &probe.held, args, predicted)?;
        let (mut last, mut moments) = (StepReport::default(), Moments::new());
        console.stage(&format!("frames at {elements}"), || {
            for deformation in 0..REPEATS * DEFORMATIONS {
                bench.state = bench.model.rest_state();
                for frame in 0..args.frames.unwrap_or(DEFORMATION_FRAMES) {
                    last = bench.frame(&[rod(&probe, deformation % DEFORMATIONS, frame)], frame > 0);
                }
                if deformation < DEFORMATIONS {
                    moments.push(bench.positions());
                }
            }
        });
        Ok((bench.json(&mesh, &last), moments))
    };
    both(&mesh, run, ROD_DEPTH_MM)
}

/// A 3 mm rod on its way to the centre from a side of its own.
fn rod(probe: &Probe, deformation: usize, frame: usize) -> ToolMotion {
    let turn = core::f64::consts::TAU * deformation as f64 / DEFORMATIONS as f64;
    let out = Vector::new(0.5 * turn.cos(), 0.5 * turn.sin(), 1.0);
    let out = out * (1.0 / out.norm());
    let semi = ball::OUTER;
    let to_surface = 1.0 / ((out.x / semi[0]).powi(2) + (out.y / semi[1]).powi(2) + (out.z / semi[2]).powi(2)).sqrt();
    let centre = Point::new(0.0, 0.0, probe.top.z - semi[2]);
    let pose = |f: usize| {
        let depth = ROD_DEPTH_MM * f as f64 / DEFORMATION_FRAMES as f64 - 1.0;
        let tip = centre + out * (to_surface - depth);
        ToolPose { tip, tail: tip + out * 150.0 }
    };
    let tool = Tool { tip: TipShape::Round, radius_mm: 1.5 };
    ToolMotion { tool, from: pose(frame), to: pose(frame + 1) }
}
