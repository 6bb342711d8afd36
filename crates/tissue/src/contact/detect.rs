//! Which membranes touch a tool, and where a point lies in the mesh.

use super::closest::{Closest, segment_triangle};
use super::{Coupling, Rule, Scene};
use crate::bytes;
use crate::membrane::{Membrane, OUTSIDE};
use crate::tool::Rod;
use crate::vec3::{V3, axpy, cross, dot, norm, scale, sub, unit, xyz};
use crate::{Model, State};

/// Stiffness of a contact in units of the tissue's modulus times a length, the larger one of the tool's radius and the
/// size of the face: stiff against the tissue, whose vertices resist in proportion to the size of their elements, and
/// soft enough for the solver.
const PENALTY: f32 = 100.0;

/// How far from a tool a face is watched, in its radii: what pushes on it in one step and lies just beside it in the next,
/// as before the tip of a cone, would be let go for a step, and spring back.
const MARGIN: f32 = 0.5;

/// Lists of a query, kept between steps.
#[derive(Debug, Clone, Default)]
pub(crate) struct Found {
    stack: Vec<u32>,
    tets: Vec<u32>,
    /// How the tool lies to each face that it touches.
    lies: Vec<Lie>,
}

impl Found {
    /// Bytes that it takes.
    pub(crate) fn bytes(&self) -> usize {
        bytes::of(&self.stack) + bytes::of(&self.tets) + bytes::of(&self.lies)
    }
}

/// How a tool lies to a face that it touches.
#[derive(Debug, Clone, Copy)]
struct Lie {
    /// Behind it: as if it had gone through.
    behind: bool,
    /// Past it, on its way forwards.
    past: bool,
    /// Not through it, and whether it is past what it is before instead.
    before: Option<bool>,
    /// The rule by which its nearest point alone would be pushed; `None` where the axis goes through that.
    point: Option<Rule>,
}

/// A place in the mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Place {
    pub(crate) tet: u32,
    pub(crate) weights: [f32; 4],
}

/// Side of the membranes a tool is on, and how much of it can touch them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Side {
    /// Outside of the tissue: the whole rod touches the outer surface.
    Outside,
    /// The tip is in this region: only its end touches the walls to other regions.
    Within(u8),
}

/// Adds a coupling for each membrane that the rod touches or is about to touch.
pub(crate) fn membranes(
    scene: Scene<'_>,
    rod: &Rod,
    side: Side,
    tool: u32,
    found: &mut Found,
    out: &mut Vec<Coupling>,
) {
    let Scene { model, state, .. } = scene;
    let from = rod.at(rod.start);
    let to = if side == Side::Outside { rod.at(rod.length) } else { from };
    let reach = (1.0 + MARGIN) * rod.radius;
    collect(scene, from, to, reach, found);
    let first = out.len();
    found.lies.clear();
    for wall in walls(model, state, &found.tets, side) {
        if let Some((coupling, lie)) = touch(model, rod, &wall, (from, to, side), tool) {
            out.push(coupling);
            found.lies.push(lie);
        }
    }
    drop_rims(first, &mut found.lies, out);
    drop_past(first, &found.lies, out);
}

/// Drops faces that a tool is behind, but no further than beside their border, where it is before the face across that, or
/// is so in turn: it has not gone through a face that is the rim of a dimple. Where it is past the face that it is before,
/// that does not push, and the border itself does, as it does as long as the tool is before both. Of couplings from number
/// `first` on.
fn drop_rims(first: usize, lies: &mut Vec<Lie>, out: &mut Vec<Coupling>) {
    while let Some((rim, past)) = (0..lies.len()).find_map(|k| Some((k, beside(k, lies, &out[first..])?))) {
        lies[rim].before = Some(past);
    }
    for k in (0..lies.len()).rev() {
        let Lie { behind: true, before: Some(past), point, .. } = lies[k] else { continue };
        match point.filter(|_| past) {
            Some(point) => out[first + k].rule = point,
            None => {
                out.remove(first + k);
                lies.remove(k);
            }
        }
    }
}

/// Whether a tool is past all the faces that it is before across the border of face `rim`, which it may have gone through;
/// `None` where it is before none.
fn beside(rim: usize, lies: &[Lie], faces: &[Coupling]) -> Option<bool> {
    let holds = |face: &Coupling| {
        let border = faces[rim].nodes.iter().zip(&faces[rim].weights).filter(|n| *n.1 > 0.0);
        border.into_iter().all(|(n, _)| face.nodes.contains(n))
    };
    let fronts = || lies.iter().zip(faces).filter(|f| holds(f.1)).filter_map(|f| f.0.before);
    lies[rim].before.is_none().then(|| fronts().reduce(|a, b| a && b)).flatten()
}

/// Drops faces that an advancing tip has gone past, of couplings from number `first` on. Not before the rims: a tip that is
/// past the face across a border is no more through the face on this side of it than one that is before both.
fn drop_past(first: usize, lies: &[Lie], out: &mut Vec<Coupling>) {
    let mut number = 0..;
    out.retain(|_| number.next().and_then(|k: usize| lies.get(k.checked_sub(first)?)).is_none_or(|lie| !lie.past));
}

fn collect(Scene { model, state, spheres }: Scene<'_>, from: V3, to: V3, reach: f32, found: &mut Found) {
    found.tets.clear();
    let Found { stack, tets, .. } = found;
    model.tree.near_segment((spheres, &state.positions), from, to, reach, stack, |t| tets.push(t));
}

/// A face of a membrane that has the tool on one of its sides.
struct Wall<'a> {
    face: &'a Membrane,
    /// Sign that turns its normal away from the tool.
    inward: f32,
    corners: [V3; 3],
    /// Normal, as long as twice its area.
    area: V3,
}

/// The faces of the elements `tets` that a tool on that side can touch.
fn walls<'a>(model: &'a Model, state: &'a State, tets: &'a [u32], side: Side) -> impl Iterator<Item = Wall<'a>> {
    // A wall has two elements: it is taken from the inner one only.
    tets.iter().flat_map(|&t| model.membranes.before(t)).filter_map(move |face| {
        let inward = faces_tool(face, side)?;
        let corners = face.nodes.map(|v| xyz(state.positions[v as usize]));
        let area = cross(sub(corners[1], corners[0]), sub(corners[2], corners[0]));
        Some(Wall { face, inward, corners, area })
    })
}

/// Sign that turns the normal of a membrane away from the tool; `None` when the tool is not on one of its sides.
fn faces_tool(face: &Membrane, side: Side) -> Option<f32> {
    match side {
        Side::Outside => (face.outer == OUTSIDE).then_some(-1.0),
        Side::Within(r) if face.outer == OUTSIDE => {
            debug_assert!(r != OUTSIDE, "a region");
            None
        }
        Side::Within(r) if face.inner == r => Some(1.0),
        Side::Within(r) if face.outer == r => Some(-1.0),
        Side::Within(_) => None,
    }
}

/// The coupling of a face that the tool touches, and how the tool lies to it.
fn touch(
    model: &Model,
    rod: &Rod,
    wall: &Wall<'_>,
    (from, to, side): (V3, V3, Side),
    tool: u32,
) -> Option<(Coupling, Lie)> {
    let push = scale(unit(wall.area)?, wall.inward);
    let near = segment_triangle(from, to, wall.corners);
    let arc = rod.start + near.t * (rod.length - rod.start) * f32::from(u8::from(side == Side::Outside));
    let radius = rod.radius_at(arc);
    let centre = rod.at(arc);
    let (none, reach) = (1e-3 * rod.radius, radius + MARGIN * rod.radius);
    let plane = plane(near, (centre, rod.back), wall.corners, push, (radius, none, reach))?;
    // A face that the axis goes through on its way is before the tip, however far that has got.
    let tip = arc <= rod.tip_end() || (near.distance2 == 0.0 && dot(push, rod.back) < 0.0);
    // Only the end of a tip that is inside touches walls, and pushes on those ahead.
    let past = side != Side::Outside && dot(push, rod.back) > 0.0;
    let behind = dot(push, sub(wall.corners[0], centre)) < 0.0 && near.distance2 > 0.0;
    let point = away(near, (centre, rod.back), wall.corners, radius);
    let point = point.map(|(normal, bound)| Rule::Push { normal, bound });
    let lie = Lie { behind, past, before: (!behind).then_some(past), point };
    Some((push_on(model, rod, wall, plane, (near, tip, tool)), lie))
}

/// The coupling that keeps the point `near` of a wall beyond the plane `normal . x = bound`.
fn push_on(
    model: &Model,
    rod: &Rod,
    &Wall { face, inward, area, .. }: &Wall<'_>,
    (normal, bound): (V3, f32),
    (near, tip, tool): (Closest, bool, u32),
) -> Coupling {
    let beyond = if inward > 0.0 { face.outer } else { face.inner };
    let modulus = |r: u8| model.regions.get(usize::from(r)).map_or(0.0, |r| r.material.young_kpa as f32);
    // Beyond the outer surface there is nothing; on a wall the stiffer side bears, whichever the tool comes from.
    let modulus = modulus(face.inner).max(modulus(face.outer));
    Coupling {
        nodes: [face.nodes[0], face.nodes[1], face.nodes[2], face.nodes[0]],
        weights: [near.weights[0], near.weights[1], near.weights[2], 0.0],
        rule: Rule::Push { normal, bound },
        stiffness: if model.forces_are_physical() {
            PENALTY * modulus * rod.radius.max(norm(area).sqrt())
        } else {
            // Constraints without a modulus give way to nothing softer than a constraint.
            f32::INFINITY
        },
        tool,
        source: u32::from(beyond),
        tip,
        force: [0.0; 3],
    }
}

/// How far behind the tip a wall is looked for that it touches no longer, in radii: in a step it goes half of one.
const LOST: f32 = 4.0;

/// The coupling of the membrane on that side which the axis crosses behind the tip, the first on its way; `None` when it
/// crosses none. It keeps the wall in front of a tip that slid off the elements it pressed on, where they fold around it.
pub(crate) fn crossed(scene: Scene<'_>, rod: &Rod, side: Side, tool: u32, found: &mut Found) -> Option<Coupling> {
    let Scene { model, state, .. } = scene;
    let reach = (LOST * rod.radius).min(rod.length);
    let (tip, behind) = (rod.tip, rod.at(reach));
    collect(scene, tip, behind, 0.0, found);
    let crossing = walls(model, state, &found.tets, side)
        .map(|wall| (segment_triangle(tip, behind, wall.corners), wall))
        // Only where it went out of this side.
        .filter(|(near, wall)| near.distance2 == 0.0 && wall.inward * dot(wall.area, rod.back) < 0.0);
    // The first on its way is the furthest from the tip; the earlier of two at one place.
    let (near, wall) = crossing.reduce(|a, b| if b.0.t > a.0.t { b } else { a })?;
    let forward = scale(rod.back, -1.0);
    Some(push_on(model, rod, &wall, (forward, dot(forward, tip)), (near, true, tool)))
}

/// The plane `normal . x = bound` that the tool keeps the nearest point of a face beyond: away from its axis, or along the
/// face's normal when the axis has just gone through or is no further than `none`. `None` when they do not touch, nor lie
/// within `reach`.
fn plane(
    near: Closest,
    (centre, back): (V3, V3),
    tri: [V3; 3],
    push: V3,
    (radius, none, reach): (f32, f32, f32),
) -> Option<(V3, f32)> {
    let ahead = dot(push, sub(tri[0], centre));
    let distance = near.distance2.sqrt();
    if ahead < 0.0 || distance <= none {
        return (distance <= radius.max(none)).then(|| (push, dot(push, centre) + radius));
    }
    if distance > reach {
        return None;
    }
    away(near, (centre, back), tri, radius)
}

/// The plane that keeps the nearest point of a face out of the sphere around a place on the axis; `None` where they are one.
/// What is behind that place lies beside the shaft, which goes on there: it is kept aside, and never pushed back.
fn away(near: Closest, (centre, back): (V3, V3), tri: [V3; 3], radius: f32) -> Option<(V3, f32)> {
    let at: V3 = core::array::from_fn(|a| (0..3).map(|i| tri[i][a] * near.weights[i]).sum());
    let way = sub(at, centre);
    let behind = dot(way, back).max(0.0);
    let normal = unit(axpy(way, -behind, back))?;
    Some((normal, dot(normal, centre) + (radius * radius - behind * behind).max(0.0).sqrt()))
}

/// The element that holds the point `x`; `None` outside of the mesh.
pub(crate) fn locate(scene: Scene<'_>, x: V3, found: &mut Found) -> Option<Place> {
    let Scene { model, state, .. } = scene;
    collect(scene, x, x, 0.0, found);
    let mut best: Option<(f32, Place)> = None;
    for &tet in &found.tets {
        let Some(weights) = barycentric(model.corners(state, tet as usize), x) else { continue };
        let least = weights.iter().copied().fold(f32::INFINITY, f32::min);
        // Ties go to the lower number, so the order of the search does not matter.
        let better = best.is_none_or(|(l, p)| least > l || (least == l && tet < p.tet));
        if least >= -1e-4 && better {
            best = Some((least, Place { tet, weights }));
        }
    }
    best.map(|b| b.1)
}

/// The region that holds the point `x`; `None` outside of the mesh.
pub(crate) fn region_at(scene: Scene<'_>, x: V3, found: &mut Found) -> Option<u8> {
    let Scene { model, .. } = scene;
    locate(scene, x, found).map(|place| model.region[place.tet as usize])
}

/// Barycentric coordinates of `x`; `None` for a flat or inverted element.
fn barycentric(p: [V3; 4], x: V3) -> Option<[f32; 4]> {
    let [a, b, c] = [sub(p[1], p[0]), sub(p[2], p[0]), sub(p[3], p[0])];
    let r = sub(x, p[0]);
    let volume = dot(cross(a, b), c);
    if volume <= 0.0 {
        return None;
    }
    let w1 = dot(cross(r, b), c) / volume;
    let w2 = dot(cross(a, r), c) / volume;
    let w3 = dot(cross(a, b), r) / volume;
    Some([1.0 - w1 - w2 - w3, w1, w2, w3])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Model;
    use crate::model::tests::{block, paper_options};
    use crate::sphere_tree::Spheres;
    use crate::{TipShape, Tool, ToolMotion, ToolPose};
    use monro_geometry::Point;

    #[test]
    fn a_point_is_found_with_its_weights_and_one_outside_is_not() {
        let mesh = block([3, 3, 3], 4.0);
        let model = Model::new(&mesh, &paper_options()).expect("model");
        let state = model.rest_state();
        let mut spheres = Spheres::default();
        model.tree.follow(&mut spheres, &state.positions, &crate::fast::Pool::new(1));
        let mut found = Found::default();
        for x in [[0.1, 0.2, 0.3], [-5.9, 5.8, 1.0], [2.0, 2.0, 2.0]] {
            let place =
                locate(Scene { model: &model, state: &state, spheres: &spheres }, x, &mut found).expect("inside");
            let tet = model.tets[place.tet as usize];
            let back = (0..4).fold([0.0; 3], |s, i| axpy(s, place.weights[i], xyz(state.positions[tet[i] as usize])));
            assert!((0..3).all(|a| (back[a] - x[a]).abs() < 1e-5));
        }
        assert!(
            locate(Scene { model: &model, state: &state, spheres: &spheres }, [6.1, 0.0, 0.0], &mut found).is_none()
        );
    }

    /// What pushes on a tool with this tip, from this direction, in the upper of two regions, once those vertices of the
    /// wall between them, which is flat at a height of 0, have moved by `up`.
    fn pushes_on(moved: impl Fn(V3) -> bool, up: f32, tip: [f64; 3], back: [f64; 3]) -> Vec<(Coupling, [V3; 3])> {
        let mut mesh = block([4, 4, 4], 1.5);
        for (tet, label) in mesh.tets.iter().zip(&mut mesh.labels) {
            *label = if tet.iter().any(|&v| mesh.vertices[v as usize].z < 3.0) { 5 } else { 4 };
        }
        let model = Model::new(&mesh, &paper_options()).expect("model");
        let above = model.regions.iter().position(|r| r.label == 4).expect("brain") as u8;
        let mut state = model.rest_state();
        let wall = state.positions.iter_mut().filter(|p| p[2].abs() < 0.1 && moved(xyz(**p)));
        assert!(wall.map(|p| p[2] += up).count() > 0, "vertices of the wall");
        let mut spheres = Spheres::default();
        model.tree.follow(&mut spheres, &state.positions, &crate::fast::Pool::new(1));
        let at = |s: f64| Point::from_array(core::array::from_fn(|a| tip[a] + s * back[a]));
        let at = ToolPose { tip: at(0.0), tail: at(50.0) };
        let tool = Tool { tip: TipShape::Round, radius_mm: 1.5 };
        let rod = Rod::between(&ToolMotion { tool, from: at, to: at }, Point::new(0.0, 0.0, 0.0), 1.0).expect("a rod");
        let (mut found, mut out) = (Found::default(), Vec::new());
        membranes(
            Scene { model: &model, state: &state, spheres: &spheres },
            &rod,
            Side::Within(above),
            0,
            &mut found,
            &mut out,
        );
        let corners = |c: &Coupling| [0, 1, 2].map(|i| xyz(state.positions[c.nodes[i] as usize]));
        out.into_iter().map(|c| (c, corners(&c))).collect()
    }

    fn normal(c: &Coupling) -> V3 {
        let Rule::Push { normal, .. } = c.rule else { panic!("a wall only pushes: {c:?}") };
        normal
    }

    /// Beside its edge a tip was pushed on by it as though it had gone through: newtons, for a frame.
    #[test]
    fn the_rim_of_a_dimple_does_not_push_on_the_tip_in_it() {
        let pushes = pushes_on(|x| x[0].hypot(x[1]) < 0.1, -2.9, [0.5, 0.1, -2.5], [0.0, 0.0, 1.0]);
        let flat = |corners: &[V3; 3]| corners.iter().all(|x| x[2].abs() < 0.1);
        assert!(pushes.iter().any(|(_, corners)| !flat(corners)), "{pushes:?}");
        assert!(!pushes.iter().any(|(c, corners)| flat(corners) && normal(c)[2] < -0.9), "{pushes:?}");
    }

    /// It seemed to have gone through the near side: tissue was thrown to and fro, 0.5 mm at 12 Hz.
    #[test]
    fn a_tip_past_the_ridge_of_a_wall_is_not_pushed_on_by_its_near_side() {
        // A roof 2 mm high along y; the tool comes over it from -x, and its end is past the top.
        let pushes = pushes_on(|x| x[0].abs() < 0.1, 2.0, [2.05, 0.1, 1.75], [-0.9, 0.0, 0.436]);
        assert!(!pushes.iter().any(|(c, _)| normal(c)[0] > 0.3), "{pushes:?}");
    }

    /// Walls that fold around a tip pushed it on, by half a newton for a frame, from behind the middle of its end.
    #[test]
    fn what_lies_behind_the_end_of_a_tip_is_kept_aside_and_not_pushed_back() {
        let back = [-0.9, 0.0, 0.436];
        let mut beside = 0;
        for along in 0..12 {
            // Over the ridge of a roof, a millimetre above it and on.
            let tip = [0.5 + 0.2 * f64::from(along), 0.1, 2.2 - 0.1 * f64::from(along)];
            for (c, _) in pushes_on(|x| x[0].abs() < 0.1, 2.0, tip, back) {
                let pushed_back = dot(normal(&c), back.map(|v| v as f32));
                assert!(pushed_back < 1e-5, "{along}: {pushed_back}, {c:?}");
                beside += usize::from(pushed_back.abs() < 1e-5);
            }
        }
        assert!(beside > 3, "{beside}");
    }

    /// Its ridge was let go when the tip's centre came behind the plane of its near side: in turn, thirty times a second.
    #[test]
    fn the_ridge_of_a_wall_pushes_on_a_tip_past_it_from_both_sides_of_a_plane() {
        // The plane of the near side goes through x = 0.3 at a height of 2.4, where the centre of the tip's end is.
        let ridge = |height: f64| {
            let tip = [0.3 + 1.5 * 0.9, 0.1, height - 1.5 * 0.436];
            let pushes = pushes_on(|x| x[0].abs() < 0.1, 2.0, tip, [-0.9, 0.0, 0.436]);
            let near_side = |x: &[V3; 3]| x.iter().map(|x| x[0]).sum::<f32>() < -0.1 && x.iter().any(|x| x[2] > 1.9);
            let pushes = pushes.into_iter().filter(|(_, x)| near_side(x));
            pushes.map(|(c, _)| (c.nodes, normal(&c))).collect::<Vec<_>>()
        };
        let (behind, before) = (ridge(2.39), ridge(2.41));
        // Those near the tip: what is further away is listed on one side only, and pushes on neither.
        assert!(behind.len() > 2, "{behind:?}");
        for (nodes, one) in behind {
            let other = before.iter().find(|b| b.0 == nodes).expect("the same face").1;
            assert!((0..3).all(|a| (one[a] - other[a]).abs() < 0.05), "{one:?}, {other:?}");
        }
    }
}
