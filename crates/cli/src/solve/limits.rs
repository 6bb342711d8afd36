//! Where a solution ends to be one: what spheres overlap, what elements cannot tell, what no mesh can tell.

use super::scene::Scene;
use monro_tissue::{Coarse, Overlap, StaticSolution};

/// A point support that bears less than this share of all reactions only keeps the body in its place.
const BEARS: f64 = 1e-3;

/// A change by this from one mesh to the next is told.
const CHANGED: f64 = 0.05;

/// Remarks on the limits of a solution.
pub(super) fn all(scene: &Scene, solved: &StaticSolution) -> Vec<String> {
    let mut out: Vec<String> = solved.overlaps.iter().flat_map(|o| overlap(scene, o)).collect();
    out.extend(solved.coarse.iter().map(coarse));
    out.extend(points(scene, solved));
    out.extend(changing(solved));
    out
}

/// A solution that finer meshes will change further.
fn changing(solved: &StaticSolution) -> Option<String> {
    let c = solved.change.filter(|c| c.displacement.max(c.force) > CHANGED)?;
    Some(format!(
        "from {} to {} elements the displacement changed by {:.1} % and the forces by {:.1} %: finer meshes will change them \
         further, by up to as much again where something driven or held has a sharp edge; give a finer mesh there, or ask for \
         --refine 1 to 3 and compare",
        c.tets,
        solved.tets,
        100.0 * c.displacement,
        100.0 * c.force
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
    let all: f64 = solved.reaction.iter().map(|r| r.norm()).sum();
    let bears = |n: &&u32| solved.reaction[**n as usize].norm() > BEARS * all;
    let bearing: Vec<u32> = solved.points.iter().filter(bears).copied().collect();
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
