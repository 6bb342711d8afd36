//! The way of a tool through tissue: press, puncture, cut, hold and rub, withdraw.
//!
//! Outside, the rod pushes the outer surface. When the force on its end (physical mode) or the dimple (both modes) reaches
//! what the membrane bears, the membrane yields and the tip is inside. From there on the shaft holds the material points
//! it has passed (`Anchor`): across its axis firmly, along it until the force exceeds the friction of that piece of shaft,
//! at the tip until it exceeds what it takes to cut. A wall to another region is pushed, dimples and yields in turn.

use super::detect::{self, Found, Side};
use super::{Advance, Anchor, Coupling, Rule, ToolState};
use crate::material::Insertion;
use crate::membrane::OUTSIDE;
use crate::sphere_tree::Spheres;
use crate::tool::Rod;
use crate::vec3::{V3, add, axpy, cross, dot, norm, scale, sub, xyz};
use crate::{CollisionResponse, Event, Material, Model, State};
use core::cell::OnceCell;
use monro_geometry::{Patient, Point};

/// Distance of the anchors along the shaft, in radii of the tool.
const SPACING: f32 = 1.0;
/// Shaft in tissue behind a tip that is outside, in spacings of anchors, from which the tip has come out on the far side.
const THROUGH: f32 = 2.0;
/// Stiffness of an anchor over modulus times spacing: two orders above the tissue around the shaft.
const PENALTY: f32 = 100.0;

/// Tissue dragged further than this, in radii of the tool, tears off the shaft. A line dragged by `u` shears what is beside
/// it by `u` over the radius and the logarithm of outer over inner radius (3.3, see `drag_length`): here by 1.5.
const TEAR: f32 = 5.0;
/// So does tissue whose place on the shaft is this far from it across the axis, in radii of the tool: one with a hold on the
/// skull cannot follow, and by then it would bear 200 moduli times the square of the radius.
const OUT: f32 = 2.0;
/// How far around the shaft tissue tells where it would be without it, in those lengths.
const AROUND: f32 = 4.0;

/// Brings the memory of a tool up to date with its new pose, whose tip goes by `way` in this frame, and lists its couplings.
pub(crate) fn prepare(
    model: &Model,
    state: &State,
    spheres: &Spheres,
    (tool, rod, way): (usize, &Rod, V3),
    memory: &mut ToolState,
    found: &mut Found,
    couplings: &mut Vec<Coupling>,
    events: &mut Vec<Event>,
) {
    let first = couplings.len();
    memory.heading.follow(rod, way);
    let advance = memory.heading.advance;
    if model.collision == CollisionResponse::Insertion {
        follow_tip(model, state, spheres, (tool, rod, advance), memory, found, events);
        renew_anchors(model, state, spheres, rod, memory, found);
    }
    match memory.inside {
        None => detect::membranes(model, state, spheres, rod, Side::Outside, tool as u32, found, couplings),
        // A wall that the tip has dimpled lies against it on the way back, too.
        Some(r) if advance == Advance::Forwards || memory.press.is_some() => {
            detect::membranes(model, state, spheres, rod, Side::Within(r), tool as u32, found, couplings);
            couplings.retain(|c| c.tool != tool as u32 || resists(model, r, c.source));
        }
        Some(_) => {}
    }
    debug_assert!(couplings.len() >= first, "only this tool's couplings are dropped");
    hold(model, rod, tool, advance, memory, couplings);
}

/// A wall between two fluids is none.
fn resists(model: &Model, from: u8, to: u32) -> bool {
    let fluid = |r: usize| model.regions[r].material.fluid;
    !(fluid(from as usize) && fluid(to as usize))
}

/// Notices where the tip has got to without having punctured anything in the last step.
fn follow_tip(
    model: &Model,
    state: &State,
    spheres: &Spheres,
    (tool, rod, advance): (usize, &Rod, Advance),
    memory: &mut ToolState,
    found: &mut Found,
    events: &mut Vec<Event>,
) {
    let now = detect::locate(model, state, spheres, rod.tip, found).map(|p| model.region[p.tet as usize]);
    memory.ahead = if advance == Advance::Forwards { now } else { None };
    memory.beyond = false;
    let Some(was) = memory.inside else { return };
    let label = |r: u8| model.regions[r as usize].label;
    memory.seen |= now.is_some();
    match now {
        Some(r) if r == was => {}
        // The wall that it presses on decides (`settle`).
        Some(r) if memory.press.is_some() && advance == Advance::Backwards && resists(model, was, u32::from(r)) => {}
        Some(r) if advance == Advance::Backwards => {
            events.push(Event::Withdrawn { tool, from: label(was), to: Some(label(r)) });
            (memory.inside, memory.press) = (Some(r), None);
        }
        Some(r) if !resists(model, was, u32::from(r)) => {
            events.push(Event::Entered { tool, from: label(was), to: label(r), point: patient(model, rod.tip) });
            memory.inside = Some(r);
        }
        // Advancing, the wall in front decides (`settle`).
        Some(_) => {}
        // Through the far side: the shaft is still held.
        None if memory.seen && memory.anchors.iter().any(|a| a.arc > THROUGH * spacing(rod)) => memory.beyond = true,
        None if memory.seen => {
            events.push(Event::Withdrawn { tool, from: label(was), to: None });
            (memory.inside, memory.press, memory.seen) = (None, None, false);
            memory.anchors.clear();
        }
        // Just punctured: the tip has not arrived yet.
        None if advance == Advance::Backwards => memory.inside = None,
        None => {}
    }
}

fn spacing(rod: &Rod) -> f32 {
    SPACING * rod.radius
}

/// Drops anchors that the shaft has left, and adds one wherever a piece of shaft in tissue has none.
fn renew_anchors(
    model: &Model,
    state: &State,
    spheres: &Spheres,
    rod: &Rod,
    memory: &mut ToolState,
    found: &mut Found,
) {
    if memory.inside.is_none() {
        memory.anchors.clear();
        return;
    }
    let step = spacing(rod);
    let around = OnceCell::new();
    let torn = |a: &Anchor| is_torn(model, state, rod, a, &around);
    memory.anchors.retain(|a| a.arc > -0.5 * step && a.arc < rod.length && !torn(a));
    memory.anchors.sort_by(|a, b| a.arc.total_cmp(&b.arc));
    let old = memory.anchors.len();
    // A new anchor at the tip takes over the load of the old one: cutting goes on, it does not start anew.
    let load = memory.anchors.first().map_or(0.0, |a| a.stretch.min(0.0));
    let mut next = 0;
    let stations = (rod.length / step).min(4096.0) as usize;
    for i in 0..=stations {
        let arc = i as f32 * step;
        while next < old && memory.anchors[next].arc < arc - 0.75 * step {
            next += 1;
        }
        if next < old && memory.anchors[next].arc <= arc + 0.75 * step {
            continue;
        }
        match detect::locate(model, state, spheres, rod.at(arc), found) {
            Some(place) => {
                let stretch = if i == 0 { load } else { 0.0 };
                let (asides, count) = asides(rod, model.volumes.edge(place.tet) as f32);
                let share = 1.0 / count as f32;
                for aside in &asides[..count] {
                    let place = match *aside == [0.0; 3] {
                        true => Some(place),
                        false => detect::locate(model, state, spheres, add(rod.at(arc), *aside), found),
                    };
                    let new = place.and_then(|p| anchor(model, p, (arc, *aside), (stretch, share)));
                    // What has just torn off is not caught again before it has gone back.
                    memory.anchors.extend(new.filter(|a| !torn(a)));
                }
            }
            // The shaft leaves the tissue here; beyond the last old anchor it does not come back.
            None if i > 0 && next >= old => break,
            None => {}
        }
    }
    memory.anchors.sort_by(|a, b| a.arc.total_cmp(&b.arc));
}

/// Whether an anchor has come off the shaft: the shaft has gone out of it sideways, or drags it too far. `around` keeps the
/// mean way of the tissue around the shaft, which is sought when it is first asked for.
fn is_torn(model: &Model, state: &State, rod: &Rod, a: &Anchor, around: &OnceCell<V3>) -> bool {
    let gap = sub(held_at(rod, a), current(state, a));
    if norm(axpy(gap, -dot(gap, rod.back), rod.back)) > OUT * rod.radius {
        return true;
    }
    let moved = sub(current(state, a), rest_point(model, a));
    let far = |way: V3| norm(way) > TEAR * rod.radius;
    // Tissue that moves with all around it, as a brain that shifts does, is not dragged.
    far(moved) && far(sub(moved, *around.get_or_init(|| way_around(model, state, rod))))
}

/// Points on a circle around the axis that a piece of shaft holds in small elements, and its radius over the tool's.
const AROUND_AXIS: usize = 6;
const CIRCLE: f32 = 0.75;
/// Elements with edges below this many radii of the tool are small: held at single points, their corners would be torn away
/// from all around them, and the finer they are the softer the tissue would seem.
const SMALL: f32 = 1.0;

/// Places beside the axis that a piece of shaft holds in elements with such edges, mm.
fn asides(rod: &Rod, edge: f32) -> ([V3; AROUND_AXIS + 1], usize) {
    let mut out = [[0.0; 3]; AROUND_AXIS + 1];
    if edge >= SMALL * rod.radius {
        return (out, 1);
    }
    let (u, v) = across(rod.back);
    for (i, aside) in out[1..].iter_mut().enumerate() {
        let turn = core::f32::consts::TAU * i as f32 / AROUND_AXIS as f32;
        let radius = CIRCLE * rod.radius;
        *aside = axpy(scale(u, radius * turn.cos()), radius * turn.sin(), v);
    }
    (out, AROUND_AXIS + 1)
}

/// Two directions across an axis and each other.
fn across(axis: V3) -> (V3, V3) {
    let least = (0..3).min_by(|&a, &b| axis[a].abs().total_cmp(&axis[b].abs())).unwrap_or(0);
    let mut one = [0.0; 3];
    one[least] = 1.0;
    let u = cross(axis, one);
    let u = scale(u, 1.0 / norm(u));
    (u, cross(axis, u))
}

/// Mean way from rest of the tissue around the shaft that is too far from it to be dragged along.
fn way_around(model: &Model, state: &State, rod: &Rod) -> V3 {
    let near = TEAR * rod.radius;
    let (mut sum, mut count) = ([0.0; 3], 0.0);
    for (p, rest) in state.positions.iter().zip(&model.rest) {
        let along = dot(sub(xyz(*p), rod.tip), rod.back).clamp(0.0, rod.length);
        let off = norm(sub(xyz(*p), rod.at(along)));
        if (near..AROUND * near).contains(&off) {
            sum = add(sum, sub(xyz(*p), xyz(*rest)));
            count += 1.0;
        }
    }
    if count > 0.0 { scale(sum, 1.0 / count) } else { sum }
}

fn anchor(
    model: &Model,
    place: detect::Place,
    (arc, aside): (f32, V3),
    (stretch, share): (f32, f32),
) -> Option<Anchor> {
    let region = model.region[place.tet as usize];
    let nodes = model.tets[place.tet as usize];
    let held = !model.regions[region as usize].material.fluid;
    let (weights, arc) = (place.weights, arc + stretch);
    held.then_some(Anchor { nodes, weights, region, slipping: false, arc, stretch, aside, share })
}

/// One coupling per anchor. Where forces mean nothing (paper mode), friction is a length: tissue is dragged as far as
/// that friction would drag it if it had its modulus, and no further.
fn hold(
    model: &Model,
    rod: &Rod,
    tool: usize,
    advance: Advance,
    memory: &mut ToolState,
    couplings: &mut Vec<Coupling>,
) {
    let step = spacing(rod);
    // What stands first is the tip's, as far as it makes one piece of shaft.
    let mut before = 0.0;
    for (i, a) in memory.anchors.iter_mut().enumerate() {
        let material = &model.regions[a.region as usize].material;
        let tip = before < 0.99 && a.arc <= step && advance == Advance::Forwards;
        before += a.share;
        let mut limit = a.share * friction(&material.insertion, a.slipping, step, tip);
        if !model.forces_are_physical() {
            let drag = drag_length(material, rod.radius, tip);
            let rest = rest_point(model, a);
            let along = dot(rod.back, sub(rod.at(a.arc), rest));
            a.arc += along.clamp(-drag, drag) - along;
            limit = f32::INFINITY;
        }
        couplings.push(Coupling {
            nodes: a.nodes,
            weights: a.weights,
            rule: Rule::Hold { axis: rod.back, target: held_at(rod, a), limit },
            stiffness: a.share * PENALTY * material.young_kpa as f32 * step,
            tool: tool as u32,
            source: i as u32,
            tip,
            force: [0.0; 3],
        });
    }
}

/// The place of the shaft that an anchor is tied to. Beside the axis it turns with it.
fn held_at(rod: &Rod, a: &Anchor) -> V3 {
    let across = axpy(a.aside, -dot(a.aside, rod.back), rod.back);
    let length = norm(across);
    let aside = if length > 0.0 { scale(across, norm(a.aside) / length) } else { [0.0; 3] };
    add(rod.at(a.arc), aside)
}

fn current(state: &State, a: &Anchor) -> V3 {
    let shares = a.nodes.iter().zip(&a.weights);
    shares.fold([0.0; 3], |x, (&n, &w)| axpy(x, w, xyz(state.positions[n as usize])))
}

fn rest_point(model: &Model, a: &Anchor) -> V3 {
    let shares = a.nodes.iter().zip(&a.weights);
    shares.fold([0.0; 3], |x, (&n, &w)| axpy(x, w, xyz(model.rest[n as usize])))
}

/// How far friction and cutting drag an elastic tissue: a line load `f` per mm moves its line by about `f / (2 pi mu)`
/// times the logarithm of outer over inner radius (3.3 for a rod of 1.5 mm in 40 mm of tissue), a sphere of radius `a`
/// under a force `F` moves by `F / (6 pi mu a)`.
fn drag_length(material: &Material, radius: f32, tip: bool) -> f32 {
    let (shear, insertion) = (material.shear_kpa() as f32, &material.insertion);
    let line = insertion.static_friction_mn_per_mm as f32 * 3.3 / (core::f32::consts::TAU * shear);
    let front = insertion.cut_force_mn as f32 / (3.0 * core::f32::consts::TAU * shear * radius);
    line + if tip { front } else { 0.0 }
}

fn friction(insertion: &Insertion, slipping: bool, length: f32, tip: bool) -> f32 {
    let per_mm = if slipping { insertion.dynamic_friction_mn_per_mm } else { insertion.static_friction_mn_per_mm };
    per_mm as f32 * length + if tip { insertion.cut_force_mn as f32 } else { 0.0 }
}

/// After the solve: lets anchors slip, and membranes yield.
pub(crate) fn settle(
    model: &Model,
    positions: &[[f32; 4]],
    (tool, rod): (usize, &Rod),
    memory: &mut ToolState,
    couplings: &mut [Coupling],
    events: &mut Vec<Event>,
) {
    let forward = rod.back.map(|v| -v);
    // Summed force on the end of the tool, and the region behind the membrane it touches.
    let mut press: Option<(f32, u32)> = None;
    for c in couplings.iter().filter(|c| c.tool == tool as u32) {
        match c.rule {
            Rule::Hold { axis, target, limit } => {
                slip(
                    &mut memory.anchors[c.source as usize],
                    c,
                    dot(axis, sub(target, c.point(positions))),
                    axis,
                    limit,
                );
            }
            Rule::Push { .. } if c.tip => {
                let along = dot(c.force, forward).max(0.0);
                // The membrane that presses hardest is the one that yields.
                press = Some(
                    press.map_or((along, c.source), |(sum, to)| (sum + along, if along > sum { c.source } else { to })),
                );
            }
            Rule::Push { .. } => {}
        }
    }
    if model.collision == CollisionResponse::Insertion {
        let borne = yield_membrane(model, (tool, rod, forward), memory, press, events);
        // A step may go far beyond the moment at which the membrane gave way; the tool never felt more than that.
        let pushing =
            couplings.iter_mut().filter(|c| c.tool == tool as u32 && c.tip && matches!(c.rule, Rule::Push { .. }));
        pushing.for_each(|c| c.force = scale(c.force, borne));
    }
}

/// Moves the place on the shaft that an anchor is tied to, so that what remains of its stretch carries its force.
fn slip(anchor: &mut Anchor, coupling: &Coupling, stretch: f32, axis: V3, limit: f32) {
    // By what the spring would bear without a limit: the force itself, cut to it along an oblique axis in single precision,
    // may come out a little below, and the more so the further the spring is stretched.
    anchor.slipping = (coupling.stiffness * stretch).abs() >= limit * (1.0 - 1e-5);
    if anchor.slipping {
        anchor.stretch = (limit / coupling.stiffness).copysign(stretch);
        anchor.arc += anchor.stretch - stretch;
    } else {
        anchor.stretch = dot(coupling.force, axis) / coupling.stiffness;
    }
}

/// Lets the membrane in front of the tip yield when it is time. Returns the share of the force on the tip that it bore.
fn yield_membrane(
    model: &Model,
    (tool, rod, forward): (usize, &Rod, V3),
    memory: &mut ToolState,
    press: Option<(f32, u32)>,
    events: &mut Vec<Event>,
) -> f32 {
    let slipped = memory.ahead.filter(|&r| Some(r) != memory.inside);
    let (force, to) = match (press, slipped) {
        (Some(press), _) => press,
        // Elements much larger than the tool can give way beside it: a tip that is behind the wall has gone through.
        (None, Some(r)) => (0.0, u32::from(r)),
        (None, None) => {
            memory.press = None;
            return 1.0;
        }
    };
    if force <= 0.0 && memory.press.is_none() && press.is_some() {
        return 1.0;
    }
    let start = *memory.press.get_or_insert(rod.tip);
    let depth = dot(sub(rod.tip, start), forward);
    if to == u32::from(OUTSIDE) || (press.is_some() && !gives_way(model, to, force, depth)) {
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
