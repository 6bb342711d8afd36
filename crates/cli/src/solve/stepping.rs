//! A scene stepped through time until it rests: how paper mode solves it, and how the stepping modes are judged.

use super::scene::Scene;
use super::{Found, outcome};
use anyhow::{Result, bail, ensure};
use monro_geometry::{Patient, Point, Vector};
use monro_tissue::{
    Attachment, AttachmentKind, CollisionResponse, EmbeddedRod, FrameSettings, Mode, Model, ModelOptions, PaperOptions,
    SphereContact, State, Stepper, TipShape, Tool, ToolMotion, ToolPose,
};
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// Frames over which imposed motion grows.
const RAMP: u32 = 120;
/// Most frames.
const FRAMES: u32 = 6000;
/// A frame in which nothing moves further than this, over the model's size, is one of rest: what the last digits of single
/// precision leave.
const REST: f64 = 1e-6;

/// A scene made for stepping.
pub(crate) struct Stepping<'a> {
    scene: &'a Scene,
    pub(crate) model: Model,
    moved: BTreeMap<u32, [Option<f64>; 3]>,
    settings: FrameSettings,
    ramp: u32,
}

/// Solves in paper mode.
pub(super) fn solve(scene: &Scene, keep_going: &mut dyn FnMut() -> bool) -> Result<Found> {
    let stepping = Stepping::new(scene, Mode::Paper(PaperOptions::default()), FrameSettings::default(), RAMP)?;
    let (mut frames, mut still) = (0, f64::INFINITY);
    let state = stepping.run(|_, frame, moved| {
        (frames, still) = (frame, moved);
        frame < FRAMES && (frame <= RAMP || still > REST * size(scene)) && keep_going()
    });
    let displacement = stepping.displacement(&state);
    let turned = outcome::turned_given(&scene.mesh, &displacement);
    let rests = still <= REST * size(scene);
    let mut remarks = Vec::new();
    if !rests {
        let limit = format!("at most {FRAMES}, and as --budget-ms allows");
        let moving = if still.is_finite() { format!(": still moving by {still} mm a frame") } else { String::new() };
        remarks.push(format!("stopped after {frames} frames ({limit}){moving}"));
    }
    if let Some(first) = turned.first() {
        remarks.push(format!(
            "{} of {} elements are turned inside out or without volume, the first is {first}: the answer means nothing \
             around them",
            turned.len(),
            scene.mesh.tets.len()
        ));
    }
    let mut json = told(frames, still, rests && turned.is_empty());
    json.insert("turned".into(), turned.len().into());
    Ok(Found { displacement, cells: Vec::new(), json, remarks })
}

impl<'a> Stepping<'a> {
    /// Refuses what stepping cannot represent.
    pub(crate) fn new(scene: &'a Scene, mode: Mode, settings: FrameSettings, ramp: u32) -> Result<Self> {
        let moved = held(scene)?;
        for c in &scene.problem.contacts {
            ensure!(
                c.friction == 0.0,
                "stepping has no friction on a sphere (it is {}); use physical mode",
                c.friction
            );
        }
        if !scene.problem.pressures.is_empty() {
            bail!("paper mode knows no pressure: its constraints have no unit of stress; use physical mode");
        }
        let kind = |way: &[Option<f64>; 3]| match way {
            [Some(_), Some(_), Some(_)] => AttachmentKind::Fixed,
            some => AttachmentKind::Guided { held: some.map(|d| d.is_some()) },
        };
        let attachments = moved.iter().map(|(&node, way)| Attachment { node, kind: kind(way) }).collect();
        let materials = scene.materials.clone();
        let options = ModelOptions { mode, materials, attachments, collision: CollisionResponse::Plain };
        let model = Model::new(&scene.mesh, &options)?;
        // A dead force per volume is gravity on the model's own mass.
        let of = |f: f64| f * model.rest_volume_mm3() / model.mass_kg();
        let settings = FrameSettings { gravity_mm_s2: scene.problem.body_force_mn_mm3.map(of), ..settings };
        Ok(Self { scene, model, moved, settings, ramp })
    }

    /// Displacement of each node, mm.
    pub(crate) fn displacement(&self, state: &State) -> Vec<Vector<Patient>> {
        (0..self.scene.mesh.vertices.len()).map(|v| self.model.displacement(state, v)).collect()
    }

    /// Steps as long as `go_on` says, given the state, the frames so far and the largest motion in the last one, mm.
    pub(crate) fn run(&self, mut go_on: impl FnMut(&State, u32, f64) -> bool) -> State {
        let (model, scene) = (&self.model, self.scene);
        let (mut state, mut stepper) = (model.rest_state(), Stepper::new(model));
        let (mut still, mut frame, middle) = (f64::INFINITY, 0, middle(scene));
        let (mut before, mut now) = (Vec::new(), Vec::new());
        model.positions_into(&state, &mut before);
        while go_on(&state, frame, still) {
            let share = |f: u32| (f64::from(f) / f64::from(self.ramp)).min(1.0);
            for (&node, &way) in &self.moved {
                let to = scene.mesh.vertices[node as usize] + full(way) * share(frame + 1);
                model.place_fixed(&mut state, node as usize, to);
            }
            let spheres = scene.problem.contacts.iter();
            let tools: Vec<ToolMotion> = spheres.map(|c| sphere(c, middle, share(frame), share(frame + 1))).collect();
            stepper.step(model, &mut state, &tools, &self.settings);
            model.positions_into(&state, &mut now);
            still = before.iter().zip(&now).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
            core::mem::swap(&mut before, &mut now);
            frame += 1;
        }
        state
    }
}

fn told(frames: u32, still: f64, converged: bool) -> Map<String, Value> {
    let mut json = Map::new();
    json.insert("converged".into(), converged.into());
    json.insert("frames".into(), frames.into());
    json.insert("residual_mm".into(), still.into());
    let note = "paper mode: normalised coefficients, so E and nu of the scene are not used and forces have no unit";
    json.insert("note".into(), note.into());
    json
}

fn size(scene: &Scene) -> f64 {
    let first = scene.mesh.vertices[0];
    scene.mesh.vertices.iter().map(|p| p.distance(first)).fold(0.0, f64::max)
}

/// The displacement, nothing along what is free.
fn full(way: [Option<f64>; 3]) -> Vector<Patient> {
    Vector::from_array(way.map(|d| d.unwrap_or(0.0)))
}

/// Displacement of every node that is held, along the axes along which it is.
fn held(scene: &Scene) -> Result<BTreeMap<u32, [Option<f64>; 3]>> {
    let mut out = BTreeMap::<u32, [Option<f64>; 3]>::new();
    for s in &scene.problem.supports {
        let all = out.entry(s.node).or_default();
        (0..3).for_each(|a| all[a] = s.displacement_mm[a].or(all[a]));
    }
    for (i, rod) in scene.problem.rods.iter().enumerate() {
        let inside = nodes_in(scene, rod);
        ensure!(
            !inside.is_empty(),
            "no node lies inside rod {i}: paper mode does not refine the mesh; use physical mode"
        );
        for node in inside {
            let all = out.entry(node).or_default();
            let way = rod.displacement_mm.to_array();
            (0..3).for_each(|a| all[a] = all[a].or(Some(way[a])));
        }
    }
    Ok(out)
}

fn nodes_in(scene: &Scene, rod: &EmbeddedRod) -> Vec<u32> {
    let [a, b] = rod.ends;
    let way = b - a;
    let inside = |p: Point<Patient>| {
        let t = ((p - a).dot(way) / way.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        p.distance(a + way * t) <= rod.radius_mm
    };
    (0..scene.mesh.vertices.len() as u32).filter(|&v| inside(scene.mesh.vertices[v as usize])).collect()
}

/// A sphere is the round tip of a rod that comes along the way; one that stays where it is comes towards the middle of the body.
fn sphere(c: &SphereContact, middle: Point<Patient>, from: f64, to: f64) -> ToolMotion {
    let way = c.to - c.from;
    let along = way.normalized().or_else(|| (middle - c.to).normalized()).unwrap_or(Vector::new(0.0, 0.0, -1.0));
    let ahead = along * c.radius_mm;
    let pose = |t: f64| {
        let centre = c.from + way * t;
        ToolPose { tip: centre + ahead, tail: centre - ahead * 10.0 }
    };
    ToolMotion { tool: Tool { tip: TipShape::Round, radius_mm: c.radius_mm }, from: pose(from), to: pose(to) }
}

/// Mean of the vertices.
fn middle(scene: &Scene) -> Point<Patient> {
    let all = &scene.mesh.vertices;
    let sum = all.iter().fold(Vector::ZERO, |s, &p| s + (p - Point::ORIGIN));
    Point::ORIGIN + sum * (1.0 / all.len() as f64)
}
