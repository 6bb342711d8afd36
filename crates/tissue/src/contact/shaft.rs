//! What the shaft of a tool does to the tissue that it has passed: holds it at material points, rubs along it, lets it go.

use super::detect::{self, Found};
use super::room::Spread;
use super::wall::away;
use super::{Advance, Anchor, Coupling, Rule, Scene, ToolState};
use crate::material::Insertion;
use crate::tool::Rod;
use crate::vec3::{V3, add, axpy, cross, dot, norm, scale, sub, xyz};
use crate::{Material, Model, State};
use core::cell::OnceCell;

/// Distance of the anchors along the shaft, in radii of the tool.
const SPACING: f32 = 1.0;
/// Anchors further apart than this, in spacings, get another between them: up to twice this far they are neighbours.
const REACH: f32 = 0.75;
/// Share of a piece of shaft that is all of it, in single precision.
const WHOLE: f32 = 0.99;
/// A shaft that slides more slowly than this, mm/s, sticks (Karnopp 1985, doi 10.1115/1.3140698): well below the slowest
/// insertion (0.1 mm/s), well above what positions in single precision jump in a step.
const STICKS: f32 = 0.02;
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

pub(super) fn spacing(rod: &Rod) -> f32 {
    SPACING * rod.radius
}

/// Drops anchors that the shaft has left, and adds one wherever a piece of shaft in tissue has none.
pub(super) fn renew_anchors(scene: Scene<'_>, rod: &Rod, memory: &mut ToolState, found: &mut Found) {
    let Scene { model, state, .. } = scene;
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
    let mut next = 0;
    let stations = (rod.length / step).min(4096.0) as usize;
    for i in 0..=stations {
        let arc = i as f32 * step;
        while next < old && memory.anchors[next].arc < arc - REACH * step {
            next += 1;
        }
        if next < old && memory.anchors[next].arc <= arc + REACH * step {
            continue;
        }
        match detect::locate(scene, rod.at(arc), found) {
            Some(place) => {
                let new = around_axis(scene, rod, (arc, place, memory.anchors.len()), found);
                // What has just torn off is not caught again before it has gone back.
                memory.anchors.extend(new.filter(|a| !torn(a)));
            }
            // The shaft leaves the tissue here; beyond the last old anchor it does not come back.
            None if i > 0 && next >= old => break,
            None => {}
        }
    }
    memory.anchors.sort_by(|a, b| a.arc.total_cmp(&b.arc));
    measure(&mut memory.anchors, step);
}

/// Has the shaft hold what is at each place of it now near a wall that draws back: as far along the axis as before, and
/// without a pull to the side. The tip came to that wall through a dimple in which tissue was folded. Held at the points
/// that it passed there, some stayed on the axis though they belong millimetres beside it, and with them the wall and
/// elements that they crushed.
pub(super) fn let_around(scene: Scene<'_>, rod: &Rod, memory: &mut ToolState, found: &mut Found) {
    let Scene { model, state, .. } = scene;
    let Some(wall) = memory.yielded else { return };
    let ToolState { hole, anchors, .. } = memory;
    let mut number = 0;
    anchors.retain_mut(|a| {
        number += 1;
        if !wall.is_near(away(hole, &state.positions, current(state, a))) {
            return true;
        }
        let at = axpy(held_at(rod, a), -a.stretch, rod.back);
        let here = detect::locate(scene, at, found);
        let new = here.and_then(|place| anchor(model, place, (a.arc, a.aside), a.share));
        new.map(|new| {
            // In the same element what is around it is the same.
            let stays = new.nodes == a.nodes;
            let spread = if stays { a.spread } else { Spread::around(scene, rod, (a.arc, number), found) };
            *a = Anchor { slipping: a.slipping, stretch: a.stretch, spread, length: a.length, ..new };
        })
        .is_some()
    });
}

/// The anchors of a piece of shaft that is in tissue `arc` mm behind the tip, at `place`; there are `others`.
fn around_axis(
    scene: Scene<'_>,
    rod: &Rod,
    (arc, place, others): (f32, detect::Place, usize),
    found: &mut Found,
) -> impl Iterator<Item = Anchor> {
    let Scene { model, .. } = scene;
    let (asides, count) = asides(rod, model.volumes.edge(place.tet) as f32);
    (others..).zip(asides).take(count).filter_map(move |(turn, aside)| {
        let place = match aside == [0.0; 3] {
            true => Some(place),
            false => detect::locate(scene, add(rod.at(arc), aside), found),
        };
        let new = place.and_then(|p| anchor(model, p, (arc, aside), 1.0 / count as f32));
        new.map(|a| Anchor { spread: Spread::around(scene, rod, (arc, turn), found), ..a })
    })
}

/// Tells each anchor how much shaft it answers for: from half of the way to the piece before it to half of that to the next.
/// Tissue comes upon the shaft at any distance, and where it is compressed its anchors draw together.
fn measure(anchors: &mut [Anchor], step: f32) {
    let halfway = |d: f32| if d < 2.0 * REACH * step { 0.5 * d } else { 0.5 * step };
    let (mut start, mut before) = (0, None);
    while let Some((end, here)) = piece(anchors, start) {
        // What is within reach of the tip is the first piece.
        let front = match before {
            None if here < REACH * step => here.max(0.0),
            None => 0.5 * step,
            Some(b) => halfway(here - b),
        };
        let back = piece(anchors, end).map_or(0.5 * step, |(_, next)| halfway(next - here));
        let all: f32 = anchors[start..end].iter().map(|a| a.share).sum();
        anchors[start..end].iter_mut().for_each(|a| a.length = a.share / all * (front + back));
        (start, before) = (end, Some(here));
    }
}

/// The end of the anchors from number `start` on that hold one piece of shaft, and where that is, mm behind the tip.
fn piece(anchors: &[Anchor], start: usize) -> Option<(usize, f32)> {
    let (mut share, mut end, mut sum) = (0.0, start, 0.0);
    while share < WHOLE && end < anchors.len() {
        share += anchors[end].share;
        sum += anchors[end].share * anchors[end].arc;
        end += 1;
    }
    (share > 0.0).then(|| (end, sum / share))
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
pub(super) fn across(axis: V3) -> (V3, V3) {
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

fn anchor(model: &Model, place: detect::Place, (arc, aside): (f32, V3), share: f32) -> Option<Anchor> {
    let region = model.region[place.tet as usize];
    let nodes = model.tets[place.tet as usize];
    let held = !model.regions[region as usize].material.fluid;
    let (weights, slipping, stretch, spread, length) = (place.weights, false, 0.0, Spread::default(), 0.0);
    held.then_some(Anchor { nodes, weights, region, slipping, arc, stretch, aside, spread, share, length })
}

/// One coupling per anchor. Where forces mean nothing (paper mode), friction is a length: tissue is dragged as far as
/// that friction would drag it if it had its modulus, and no further.
pub(super) fn hold(
    model: &Model,
    rod: &Rod,
    tool: usize,
    advance: Advance,
    memory: &mut ToolState,
    couplings: &mut Vec<Coupling>,
) {
    let step = spacing(rod);
    // What is cut is what the tip is in: nothing in a fluid, and nothing on its way back.
    let cuts = memory.inside.filter(|_| advance == Advance::Forwards);
    let cut_mn = cuts.map_or(0.0, |r| model.regions[r as usize].material.insertion.cut_force_mn as f32);
    let all: f32 = memory.anchors.iter().map(|a| a.share * bears(a.arc / step)).sum();
    for (i, a) in memory.anchors.iter_mut().enumerate() {
        let material = &model.regions[a.region as usize].material;
        let cut_mn = if all > 0.0 { cut_mn * bears(a.arc / step) / all } else { 0.0 };
        let mut limit = friction(&material.insertion, a) + cut_mn * a.share;
        if !model.forces_are_physical() {
            let drag = drag_length(material, rod.radius, cut_mn);
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
            tip: cut_mn > 0.0,
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
fn drag_length(material: &Material, radius: f32, cut_mn: f32) -> f32 {
    let (shear, insertion) = (material.shear_kpa() as f32, &material.insertion);
    let line = insertion.static_friction_mn_per_mm as f32 * 3.3 / (core::f32::consts::TAU * shear);
    line + cut_mn / (3.0 * core::f32::consts::TAU * shear * radius)
}

/// The part of a cutting tip's load that an anchor so many spacings behind the tip bears, beside the parts of the others.
/// Each takes it over little by little while the tip goes on by one spacing, and gives it up over the next. One that lost it
/// at once would spring back, and the next, pushed forwards by as much, would bear less than it takes to cut meanwhile.
fn bears(spacings: f32) -> f32 {
    (1.0 - (spacings - 1.0).abs()).max(0.0)
}

/// Friction along the axis that an anchor passes on at most, mN.
fn friction(insertion: &Insertion, a: &Anchor) -> f32 {
    let per_mm = if a.slipping { insertion.dynamic_friction_mn_per_mm } else { insertion.static_friction_mn_per_mm };
    per_mm as f32 * a.length
}

/// Moves the place on the shaft that an anchor is tied to, so that what remains of its stretch carries its force.
pub(super) fn slip(anchor: &mut Anchor, coupling: &Coupling, stretch: f32, (axis, limit): (V3, f32), dt: f32) {
    // By what the spring would bear without a limit: the force itself, cut to it along an oblique axis in single precision,
    // may come out a little below, and the more so the further the spring is stretched.
    if (coupling.stiffness * stretch).abs() >= limit * (1.0 - 1e-5) {
        anchor.stretch = (limit / coupling.stiffness).copysign(stretch);
        let slid = anchor.stretch - stretch;
        anchor.slipping = slid.abs() > STICKS * dt;
        anchor.arc += slid;
    } else {
        anchor.slipping = false;
        anchor.stretch = dot(coupling.force, axis) / coupling.stiffness;
    }
}
