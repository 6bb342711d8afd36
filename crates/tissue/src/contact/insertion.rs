//! The way of a tool through tissue: press, puncture, cut, hold and rub, withdraw.
//!
//! Outside, the rod pushes the outer surface. When the force on its end (physical mode) or the dimple (both modes) reaches
//! what the membrane bears, the membrane yields and the tip is inside. From there on the shaft holds the material points
//! it has passed (`Anchor`): across its axis firmly, along it until the force exceeds the friction of that piece of shaft,
//! at the tip until it exceeds what it takes to cut. A wall to another region is pushed, dimples and yields in turn.

use super::detect::{self, Found, Side};
use super::wall::{Wall, away};
use super::{Advance, Coupling, Dimple, Rule, Scene, ToolState, Yielded, shaft};
use crate::model::Region;
use crate::tool::Rod;
use crate::vec3::{V3, add, dot, scale, sub};
use crate::{CollisionResponse, Event, Model};
use monro_geometry::{Patient, Point};

/// Shaft in tissue behind a tip that is outside, in spacings of anchors, from which the tip has come out on the far side.
const THROUGH: f32 = 2.0;

/// How far before the tip another region must begin, in radii, for its way to lead there: up to 70 degrees from perpendicular
/// to a wall that the rounded end touches.
const LOOKS: f32 = 2.0;

/// Brings the memory of a tool up to date with its new pose, whose tip goes by `way` in this frame, and lists its couplings.
pub(crate) fn prepare(
    scene: Scene<'_>,
    (tool, rod, way): (usize, &Rod, V3),
    memory: &mut ToolState,
    found: &mut Found,
    couplings: &mut Vec<Coupling>,
    events: &mut Vec<Event>,
) {
    let Scene { model, .. } = scene;
    let (first, new) = (couplings.len(), memory.heading.is_new());
    memory.heading.follow(rod, way);
    let advance = memory.heading.advance;
    if model.collision == CollisionResponse::Insertion {
        if new {
            find_inside(scene, (tool, rod), memory, found, events);
        }
        follow_tip(scene, (tool, rod, advance), memory, found, events);
        let on = rod.at(-LOOKS * rod.radius);
        memory.leads_out = memory.press.is_some() && detect::region_at(scene, on, found) != memory.inside;
        shaft::let_around(scene, rod, memory, found);
        shaft::renew_anchors(scene, rod, memory, found);
    }
    match memory.inside {
        None => detect::membranes(scene, rod, Side::Outside, tool as u32, found, couplings),
        // A wall that the tip has dimpled lies against it on the way back, too.
        Some(r) if advance == Advance::Forwards || memory.press.is_some() => {
            detect::membranes(scene, rod, Side::Within(r), tool as u32, found, couplings);
            couplings.retain(|c| c.tool != tool as u32 || (resists(model, r, c.source) && !is_hole(&memory.hole, c)));
        }
        Some(_) => {}
    }
    debug_assert!(couplings.len() >= first, "only this tool's couplings are dropped");
    if memory.ahead.is_some_and(|r| Some(r) != memory.inside) {
        let side = memory.inside.map_or(Side::Outside, Side::Within);
        let wall = detect::crossed(scene, rod, side, tool as u32, found);
        let is_wall = |c: &Coupling| memory.inside.is_none_or(|r| resists(model, r, c.source));
        let is_lost = |c: &Coupling| couplings[first..].iter().all(|other| other.nodes != c.nodes);
        couplings.extend(wall.filter(|c| is_wall(c) && is_lost(c)));
    }
    shaft::hold(model, rod, tool, advance, memory, couplings);
}

/// A wall between two fluids is none.
fn resists(model: &Model, from: u8, to: u32) -> bool {
    let fluid = |r: usize| model.regions[r].material.fluid;
    !(fluid(from as usize) && fluid(to as usize))
}

/// A tool that is seen for the first time, or has been put elsewhere, is in the tissue if its tip is so deep, along its
/// shaft, that the membrane would have yielded on the way; its shaft holds the tissue as it is now.
fn find_inside(
    scene: Scene<'_>,
    (tool, rod): (usize, &Rod),
    memory: &mut ToolState,
    found: &mut Found,
    events: &mut Vec<Event>,
) {
    let Scene { model, .. } = scene;
    let Some(region) = detect::region_at(scene, rod.tip, found) else { return };
    let Region { label, material, .. } = &model.regions[region as usize];
    let dimple = material.insertion.puncture_depth_mm as f32;
    if dimple < rod.length && detect::locate(scene, rod.at(dimple), found).is_some() {
        events.push(Event::Found { tool, label: *label, point: patient(model, rod.tip) });
        (memory.inside, memory.seen) = (Some(region), true);
    }
}

/// Notices where the tip has got to without having punctured anything in the last step.
fn follow_tip(
    scene: Scene<'_>,
    (tool, rod, advance): (usize, &Rod, Advance),
    memory: &mut ToolState,
    found: &mut Found,
    events: &mut Vec<Event>,
) {
    let Scene { model, state, .. } = scene;
    let now = detect::region_at(scene, rod.tip, found);
    let wall = Yielded::follow(&mut memory.yielded, now, away(&memory.hole, &state.positions, rod.tip));
    let waits = advance == Advance::Forwards && wall == Wall::DrawsBack;
    memory.ahead = now.filter(|_| advance == Advance::Forwards && !waits);
    memory.beyond = false;
    let Some(was) = memory.inside else { return };
    let label = |r: u8| model.regions[r as usize].label;
    memory.seen |= now.is_some();
    match now {
        Some(r) if r == was => {}
        Some(_) if waits => {}
        // The wall that it presses on decides (`settle`).
        Some(r) if memory.press.is_some() && advance == Advance::Backwards && resists(model, was, u32::from(r)) => {}
        // Drawn back, or the wall was slack and did not come.
        Some(r) if advance == Advance::Backwards || wall == Wall::Slack => {
            events.push(Event::Withdrawn { tool, from: label(was), to: Some(label(r)) });
            (memory.inside, memory.press, memory.yielded) = (Some(r), None, None);
            memory.hole.clear();
        }
        Some(r) if !resists(model, was, u32::from(r)) => {
            events.push(Event::Entered { tool, from: label(was), to: label(r), point: patient(model, rod.tip) });
            memory.inside = Some(r);
        }
        // Advancing, the wall in front decides (`settle`).
        Some(_) => {}
        // Through the far side: the shaft is still held.
        None if memory.seen && memory.anchors.iter().any(|a| a.arc > THROUGH * shaft::spacing(rod)) => {
            memory.beyond = true;
        }
        None if waits => {}
        None if memory.seen || wall == Wall::Slack => {
            events.push(Event::Withdrawn { tool, from: label(was), to: None });
            (memory.inside, memory.press, memory.seen) = (None, None, false);
            memory.anchors.clear();
        }
        // Just punctured: the tip has not arrived yet.
        None if advance == Advance::Backwards => memory.inside = None,
        None => {}
    }
}

/// After the solve: lets anchors slip, and membranes yield.
pub(crate) fn settle(
    model: &Model,
    positions: &[[f32; 4]],
    (tool, rod, dt): (usize, &Rod, f32),
    memory: &mut ToolState,
    couplings: &mut [Coupling],
    events: &mut Vec<Event>,
) {
    let forward = rod.back.map(|v| -v);
    let mut press: Option<Press> = None;
    for c in couplings.iter().filter(|c| c.tool == tool as u32) {
        match c.rule {
            Rule::Hold { axis, target, limit } => {
                let stretch = dot(axis, sub(target, c.point(positions)));
                shaft::slip(&mut memory.anchors[c.source as usize], c, stretch, (axis, limit), dt);
            }
            Rule::Push { .. } if c.tip => press = Some(Press::and(press, c, forward)),
            Rule::Push { .. } => {}
        }
    }
    if model.collision == CollisionResponse::Insertion {
        memory.yielded.iter_mut().for_each(|y| y.since += dt);
        let was = memory.inside;
        let borne = yield_membrane(model, (tool, rod, forward), memory, press, events);
        if memory.inside != was {
            pierce(positions, (tool as u32, rod), (was, memory), couplings);
        }
        // A step may go far beyond the moment at which the membrane gave way; the tool never felt more than that.
        let pushing = couplings.iter_mut().filter(|c| presses(c, tool as u32));
        pushing.for_each(|c| c.force = scale(c.force, borne));
    }
}

/// How the end of a tool presses on the membranes before it.
#[derive(Clone, Copy)]
struct Press {
    /// Summed force, mN, and its part along the tool.
    sum: V3,
    along: f32,
    /// The part of the face that presses hardest, and the region behind that: its membrane is the one that yields.
    most: f32,
    to: u32,
}

impl Press {
    fn and(this: Option<Self>, face: &Coupling, forward: V3) -> Self {
        let (force, along, to) = (face.force, dot(face.force, forward), face.source);
        let Some(p) = this else { return Self { sum: force, along, most: along, to } };
        let (most, to) = if along > p.most { (along, to) } else { (p.most, p.to) };
        Self { sum: add(p.sum, force), along: p.along + along, most, to }
    }
}

/// Whether a face and the tip of this tool press on each other.
fn presses(c: &Coupling, tool: u32) -> bool {
    c.tool == tool && c.tip && matches!(c.rule, Rule::Push { .. })
}

/// Remembers the wall of region `from` that has just yielded, and the faces of it that the tip of a tool pressed on.
fn pierce(
    positions: &[[f32; 4]],
    (tool, rod): (u32, &Rod),
    (from, memory): (Option<u8>, &mut ToolState),
    couplings: &[Coupling],
) {
    let pressed = couplings.iter().filter(|c| presses(c, tool));
    memory.hole.clear();
    memory.hole.extend(pressed.filter(|c| memory.inside == Some(c.source as u8)).flat_map(|c| &c.nodes[..3]));
    memory.hole.sort_unstable();
    memory.hole.dedup();
    let reach = away(&memory.hole, positions, rod.tip).fold(0.0, f32::max) + 2.0 * rod.radius;
    memory.yielded = Some(Yielded { from, since: 0.0, arrived: false, reach });
}

/// Whether a face is one that the tip has gone through, or shares an edge with one: it lies around the shaft, and only
/// seems to be a wall ahead or at its side.
fn is_hole(hole: &[u32], face: &Coupling) -> bool {
    face.nodes[..3].iter().filter(|n| hole.binary_search(n).is_ok()).count() > 1
}

/// Lets the membrane in front of the tip yield when it is time. Returns the share of the force on the tip that it bore.
fn yield_membrane(
    model: &Model,
    (tool, rod, forward): (usize, &Rod, V3),
    memory: &mut ToolState,
    press: Option<Press>,
    events: &mut Vec<Event>,
) -> f32 {
    let slipped = memory.ahead.filter(|&r| Some(r) != memory.inside);
    let (push, force, to) = match (press, slipped) {
        (Some(press), _) if press.along > 0.0 => {
            // Along a wall that it only grazes a tip may go any way, as long as it is not behind it.
            let is_before = memory.leads_out || slipped.is_some();
            (if is_before { forward } else { press.sum }, press.along, press.to)
        }
        // A tip that is behind the wall though its axis crosses none has gone around it.
        (None, Some(r)) if memory.heading.goes_on(rod.tip) => (forward, 0.0, u32::from(r)),
        // Behind it, but not pressed on in this step, or about to turn.
        (_, Some(_)) => return 1.0,
        (_, None) => {
            memory.press = None;
            return 1.0;
        }
    };
    let depth = memory.press.insert(Dimple::follow(memory.press, rod.tip, push)).depth;
    // On its way back a tip is pushed on, and goes through nothing, nor does one that has begun to turn.
    let is_back = memory.heading.advance == Advance::Backwards || !memory.heading.goes_on(rod.tip);
    if is_back || (press.is_some() && !gives_way(model, to, force, depth)) {
        return 1.0;
    }
    let borne = borne(model, to, force);
    events.push(Event::Punctured {
        tool,
        from: memory.inside.map(|r| model.regions[r as usize].label),
        to: model.regions[to as usize].label,
        point: patient(model, rod.tip),
        force_mn: (borne * force).into(),
        depth_mm: depth.into(),
    });
    memory.seen = memory.inside.is_some();
    (memory.inside, memory.press) = (Some(to as u8), None);
    borne
}

/// The share of a force (mN) that the membrane in front of region `to` bears before it yields.
fn borne(model: &Model, to: u32, force: f32) -> f32 {
    let most = model.regions[to as usize].material.insertion.puncture_force_mn as f32;
    if model.forces_are_physical() && force > most { most / force } else { 1.0 }
}

/// Whether the membrane in front of region `to` yields to this force (mN, where forces mean something) or dimple (mm).
fn gives_way(model: &Model, to: u32, force: f32, depth: f32) -> bool {
    let bears = model.regions[to as usize].material.insertion;
    let torn = model.forces_are_physical() && f64::from(force) >= bears.puncture_force_mn;
    torn || f64::from(depth) >= bears.puncture_depth_mm
}

fn patient(model: &Model, x: V3) -> Point<Patient> {
    model.to_patient([x[0], x[1], x[2], 0.0])
}
