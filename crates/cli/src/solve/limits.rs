//! Where a solution ends to be one: what spheres overlap, what elements cannot tell, what no mesh can tell.

use super::outcome::moved;
use super::scene::Scene;
use super::thin;
use core::ops::Range;
use monro_tissue::{Coarse, NO_VOLUME, Overlap, StaticSolution};

/// A point support that bears less than this share of all reactions only keeps the body in its place.
const BEARS: f64 = 1e-3;

/// A change by this from one mesh to the next is told.
const CHANGED: f64 = 0.05;

/// Poisson's ratio from which a material hardly changes its volume: with 0.45, half of it takes 4.5 shear moduli.
const NEARLY_INCOMPRESSIBLE: f64 = 0.45;
/// Volumes over those at rest that such elements do not get to: where answers are right, the worst have 0.83 and 1.2.
const VOLUMES: Range<f64> = 0.5..2.0;

/// Share of the forces that may be out of balance where something can be told of the elements at all: before, they lie as it
/// came.
const BALANCED: f64 = 0.1;

/// Whether the state is near enough to an equilibrium to tell of its elements.
pub(super) fn is_near(solved: &StaticSolution) -> bool {
    solved.residual < BALANCED
}

/// Remarks on the limits of a solution.
pub(super) fn all(scene: &Scene, solved: &StaticSolution) -> Vec<String> {
    let mut out: Vec<String> = solved.overlaps.iter().flat_map(|o| overlap(scene, o)).collect();
    out.extend(solved.coarse.iter().map(coarse));
    out.extend(solved.contested.iter().enumerate().filter(|c| *c.1 > 0).map(contested));
    out.extend(points(scene, solved));
    out.extend(unstable(solved));
    out.extend(changing(solved));
    out.extend(of_set(scene, solved));
    out.extend(thin::remarks(&scene.mesh, &scene.materials, solved.tets));
    out.extend(swollen(scene, solved).filter(|_| is_near(solved)));
    out
}

/// A mesh that was not refined though nobody asked for that.
pub(super) fn as_given(scene: &Scene, solved: &StaticSolution) -> Option<String> {
    let untold =
        solved.change.is_none() && solved.unfinished.is_none() && solved.stop.is_none() && !scene.problem.rubs();
    untold.then(|| {
        format!(
            "the mesh of {} elements was solved as it is ({} elements with what tools need): how much a finer one would change \
             the answer is not known; --refine 1 tells, and may take minutes",
            scene.mesh.tets.len(),
            solved.tets
        )
    })
}

/// A rod with tissue in it that goes another way.
fn contested((rod, vertices): (usize, &usize)) -> String {
    format!(
        "{vertices} vertices inside rod {rod} are moved otherwise by a support or by another rod, and stay with that: the tissue \
         beside them is torn, and the rod's force is that of tearing it; leave what lies in the rod out of the set, or part the rods"
    )
}

/// Elements whose volume changed though their material hardly lets it. Pressure is a mean around vertices, so that in large
/// stretches some may shrink beside others that swell, which balances and is no answer of the body.
fn swollen(scene: &Scene, solved: &StaticSolution) -> Option<String> {
    let now = moved(&scene.mesh, &solved.displacement);
    let stiff = |t: &usize| scene.materials[&scene.mesh.labels[*t]].poisson >= NEARLY_INCOMPRESSIBLE;
    let volumes = (0..now.tets.len()).filter(stiff).map(|t| (t, now.volume(t) / scene.mesh.volume(t)));
    // What is turned inside out is told as such.
    let odd: Vec<(usize, f64)> = volumes.filter(|(_, v)| *v > NO_VOLUME && !VOLUMES.contains(v)).collect();
    let (first, volume) = odd.first()?;
    Some(format!(
        "{} elements have less than half or more than twice of their volume, the first, tetrahedron {first}, {:.0} % of it, \
         though a Poisson's ratio from {NEARLY_INCOMPRESSIBLE} on hardly lets them: this may be a false equilibrium, or more \
         than they bear; compare with --refine 1 or 2, with less motion or load, and with a Poisson's ratio of 0.49 if it is \
         higher",
        odd.len(),
        100.0 * volume
    ))
}

/// Whether the last refinement hardly changed the answer, nor would one to eight times as many elements change how far it moves;
/// nothing is known of it where there was none, or where time was up before it was known whether the body stays. Where it would
/// not there is no answer for meshes to converge to.
pub(super) fn mesh_converged(solved: &StaticSolution) -> Option<bool> {
    let hardly = solved.change.map(|c| c.displacement_eightfold.max(c.force).max(c.moment) <= CHANGED);
    if solved.unstable { Some(false) } else { hardly.filter(|hardly| !(*hardly && solved.unlooked)) }
}

/// An equilibrium that is none in practice, or may be.
fn unstable(solved: &StaticSolution) -> Option<String> {
    let what = if solved.unstable {
        "forces balance each other, but the body would not stay so: the least push lets it buckle, and the state in which it \
         then stays was not found; impose less, or push it a little to the side it should take"
    } else if solved.unlooked {
        "forces balance each other, but time or work was up before it was known whether the body would stay so or buckle; give \
         more (--budget-ms)"
    } else {
        return None;
    };
    Some(what.to_owned())
}

/// A set whose force the next meshes will change, though it is little of the forces that balance each other there.
fn of_set(scene: &Scene, solved: &StaticSolution) -> Option<String> {
    let (set, share) = solved.change.filter(|c| c.force <= CHANGED)?.set.filter(|(_, share)| *share > CHANGED)?;
    Some(format!(
        "the force of \"{}\" is not converged: at the rate of the last refinement eight times as many elements would change it \
         by {:.0} %; it is little of the forces that balance each other on what is held",
        scene.sets[set as usize].0,
        100.0 * share
    ))
}

/// A solution that finer meshes will change further.
fn changing(solved: &StaticSolution) -> Option<String> {
    let c = solved.change.filter(|_| mesh_converged(solved) == Some(false))?;
    Some(format!(
        "from {} to {} elements the displacement changed by {:.1} %{} and the forces by {:.1} %{}: finer meshes will change them \
         further, by up to as much again where something driven or held has a sharp edge; give a finer mesh there, or ask for \
         --refine 1 to 3 and compare",
        c.tets,
        solved.tets,
        100.0 * c.displacement,
        match c.displacement_eightfold > c.displacement {
            true => format!(" (at that rate {:.0} % for eight times as many)", 100.0 * c.displacement_eightfold),
            false => String::new(),
        },
        100.0 * c.force,
        if c.moment > c.force { format!(" (moments by {:.1} %)", 100.0 * c.moment) } else { String::new() }
    ))
}

fn overlap(scene: &Scene, o: &Overlap) -> Vec<String> {
    let radius = scene.problem.contacts[o.sphere].radius_mm;
    let mut out = Vec::new();
    if o.passed {
        let centre = if o.centre_inside { ", and its centre lies inside the tissue" } else { "" };
        out.push(format!(
            "sphere {} (radius {radius:.4} mm) has gone through the surface: it reaches {:.4} mm into the tissue that it \
             should push aside{centre}; its force means nothing; press less deep, or give a finer mesh under it",
            o.sphere, o.depth_mm
        ));
    }
    if o.held > 0 {
        out.push(format!(
            "sphere {} overlaps {} held vertices, the deepest by {:.4} mm: they cannot give way, and its force leaves them \
             out; hold less of the surface under it, or move it",
            o.sphere, o.held, o.held_mm
        ));
    }
    out
}

fn coarse(c: &Coarse) -> String {
    format!(
        "{} {} wants elements of {:.2e} mm, 1/{:.0} of those given around it ({:.4} mm): they were refined to {:.2e} mm \
         only, so its force is that of a coarser mesh; give finer elements there, or a thicker tool",
        c.what,
        c.index,
        c.wanted_mm,
        c.given_mm / c.wanted_mm,
        c.given_mm,
        c.least_mm
    )
}

/// Point supports that bear something on a mesh finer than the one they were given on.
fn points(scene: &Scene, solved: &StaticSolution) -> Option<String> {
    let least = BEARS * solved.at_work_mn();
    // What a face bears that the vertex is also of is not the point's.
    let alone = |n: u32, held: [bool; 3]| {
        let force = solved.reaction[n as usize].to_array();
        (0..3).filter(|&a| held[a]).map(|a| force[a] * force[a]).sum::<f64>().sqrt()
    };
    let bears = |&&(n, held): &&(u32, [bool; 3])| alone(n, held) > least;
    let bearing: Vec<u32> = solved.points.iter().filter(bears).map(|p| p.0).collect();
    let first = bearing.first().filter(|_| solved.tets > scene.mesh.tets.len())?;
    Some(format!(
        "{} vertices are held by themselves (the first is {first}), with no held edge or face around them, and bear load: \
         under a point the tissue gives way the more the finer the mesh, so the answer there depends on the mesh \
         ({} elements, {} given); hold an edge or a patch, or ask for --refine 0",
        bearing.len(),
        solved.tets,
        scene.mesh.tets.len()
    ))
}
