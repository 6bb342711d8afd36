//! Where a solution ends to be one: what spheres overlap, what elements cannot tell, what no mesh can tell.

use super::outcome::moved;
use super::scene::Scene;
use core::ops::Range;
use monro_geometry::{Patient, Point, TetMesh};
use monro_tissue::{Coarse, Material, Overlap, StaticSolution};
use std::collections::{BTreeMap, BTreeSet};

/// A point support that bears less than this share of all reactions only keeps the body in its place.
const BEARS: f64 = 1e-3;

/// A change by this from one mesh to the next is told.
const CHANGED: f64 = 0.05;

/// A mesh of less elements is a trial.
const FEW: usize = 50;
/// Where more than this part of the elements has a corner on the surface, there are two layers at most nearly everywhere; where
/// it has all four there, one.
const OUTER: f64 = 0.95;
/// A region that many times as stiff as the softest bears the bending,
const STIFF: f64 = 4.0;
/// and bends where it reaches so many times as far as it is thick; a cube has 5.
const SLENDER: f64 = 10.0;
/// So many times as many elements have twice the layers, or nearly so.
const REFINED: usize = 5;

/// Poisson's ratio from which a material hardly changes its volume: with 0.45, half of it takes 4.5 shear moduli.
const NEARLY_INCOMPRESSIBLE: f64 = 0.45;
/// Volumes over those at rest that such elements do not get to: where answers are right, the worst have 0.83 and 1.2.
const VOLUMES: Range<f64> = 0.5..2.0;

/// Remarks on the limits of a solution.
pub(super) fn all(scene: &Scene, solved: &StaticSolution) -> Vec<String> {
    let mut out: Vec<String> = solved.overlaps.iter().flat_map(|o| overlap(scene, o)).collect();
    out.extend(solved.coarse.iter().map(coarse));
    out.extend(solved.contested.iter().enumerate().filter(|c| *c.1 > 0).map(contested));
    out.extend(points(scene, solved));
    out.extend(changing(solved));
    out.extend(thin(&scene.mesh, &scene.materials, solved.tets));
    out.extend(swollen(scene, solved));
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

/// A body, or a stiff sheet in one, across which there are so few elements that it hardly bends.
fn thin(mesh: &TetMesh, materials: &BTreeMap<u16, Material>, solved: usize) -> Vec<String> {
    let too_few = |given: usize, layers: usize| {
        // Halved once they are twice as many, and eight times as many elements.
        let wanted = if layers == 1 { 8 * REFINED } else { REFINED };
        given >= FEW && solved < wanted * mesh.tets.len()
    };
    let told = |layers: usize, [of, across, how]: [&str; 3]| {
        format!(
            "the elements {of} make hardly more than {layers} layer{} across {across}, {solved} solved for {} given in all: where \
             it bends it is too stiff ({how}), and a change from one mesh to the next does not show all of it; give four layers \
             or more, or ask for --refine 1 to 3 and compare",
            if layers == 1 { "" } else { "s" },
            mesh.tets.len()
        )
    };
    if let Some(layers) = layers(mesh, |_| true).filter(|&layers| too_few(mesh.tets.len(), layers)) {
        let how = "a clamped plate of two layers gave way half as far as it should, of one a ninth";
        return vec![told(layers, ["given", "the whole body", how])];
    }
    let of_region = |region: u16| {
        let given = mesh.labels.iter().filter(|&&l| l == region).count();
        let layers = layers(mesh, |l| l == region).filter(|&layers| too_few(given, layers))?;
        let how = "a skin of one layer on a soft block by 15 to 24 %";
        (slenderness(mesh, region) >= SLENDER).then(|| told(layers, [&format!("of region {region}"), "it", how]))
    };
    stiff_regions(mesh, materials).into_iter().filter_map(of_region).collect()
}

/// The regions that are much stiffer than the softest one: they bear the bending.
fn stiff_regions(mesh: &TetMesh, materials: &BTreeMap<u16, Material>) -> Vec<u16> {
    let labels: BTreeSet<u16> = mesh.labels.iter().copied().collect();
    let shear = |l: &u16| materials[l].shear_kpa();
    let softest = labels.iter().map(shear).fold(f64::INFINITY, f64::min);
    labels.into_iter().filter(|l| shear(l) >= STIFF * softest).collect()
}

/// How far a region reaches over its thickness, both as of a square plate of its volume and surface.
fn slenderness(mesh: &TetMesh, region: u16) -> f64 {
    let corners = |f: [u32; 3]| f.map(|v| mesh.vertices[v as usize]);
    let area = |[a, b, c]: [Point<Patient>; 3]| 0.5 * (b - a).cross(c - a).norm();
    let surface: f64 = mesh.boundary(|l| l == region).into_iter().map(|f| area(corners(f))).sum();
    let own = (0..mesh.tets.len()).filter(|&t| mesh.labels[t] == region);
    (0.5 * surface).sqrt() / (2.0 * own.map(|t| mesh.volume(t)).sum::<f64>() / surface)
}

/// How many layers of elements there are across the whole of what is kept, if one or two.
fn layers(mesh: &TetMesh, keep: impl Fn(u16) -> bool + Copy) -> Option<usize> {
    let mut outer = vec![false; mesh.vertices.len()];
    mesh.boundary(keep).iter().flatten().for_each(|&v| outer[v as usize] = true);
    let kept: Vec<&[u32; 4]> = mesh.tets.iter().zip(&mesh.labels).filter(|(_, l)| keep(**l)).map(|(t, _)| t).collect();
    let corners = |t: &[u32; 4]| t.iter().filter(|&&v| outer[v as usize]).count();
    let most = OUTER * kept.len() as f64;
    [4, 1].iter().position(|&n| kept.iter().filter(|t| corners(t) >= n).count() as f64 > most).map(|i| i + 1)
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
    let odd: Vec<(usize, f64)> = volumes.filter(|(_, v)| *v > 0.0 && !VOLUMES.contains(v)).collect();
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
/// nothing is known of it where there was none.
pub(super) fn mesh_converged(solved: &StaticSolution) -> Option<bool> {
    solved.change.map(|c| c.displacement_eightfold.max(c.force) <= CHANGED)
}

/// A solution that finer meshes will change further.
fn changing(solved: &StaticSolution) -> Option<String> {
    let c = solved.change.filter(|_| mesh_converged(solved) == Some(false))?;
    Some(format!(
        "from {} to {} elements the displacement changed by {:.1} %{} and the forces by {:.1} %: finer meshes will change them \
         further, by up to as much again where something driven or held has a sharp edge; give a finer mesh there, or ask for \
         --refine 1 to 3 and compare",
        c.tets,
        solved.tets,
        100.0 * c.displacement,
        match c.displacement_eightfold > c.displacement {
            true => format!(" (at that rate {:.0} % for eight times as many)", 100.0 * c.displacement_eightfold),
            false => String::new(),
        },
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
    let least = BEARS * solved.at_work_mn();
    let bears = |n: &&u32| solved.reaction[**n as usize].norm() > least;
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A plate of so many cells, six elements each.
    fn plate([nx, ny, nz]: [u32; 3]) -> TetMesh {
        let at = |[i, j, k]: [u32; 3]| (k * (ny + 1) + j) * (nx + 1) + i;
        let corners = (0..=nz).flat_map(|k| (0..=ny).flat_map(move |j| (0..=nx).map(move |i| [i, j, k])));
        let vertices: Vec<_> = corners.map(|c| Point::from_array(c.map(f64::from))).collect();
        let mut tets = Vec::new();
        for (i, j, k) in (0..nz).flat_map(|k| (0..ny).flat_map(move |j| (0..nx).map(move |i| (i, j, k)))) {
            for [a, b, c] in [[0, 1, 2], [0, 2, 1], [1, 2, 0], [1, 0, 2], [2, 0, 1], [2, 1, 0]] {
                let mut p = [i, j, k];
                tets.push([a, b, c].into_iter().fold(vec![at(p)], |mut t, axis: usize| {
                    p[axis] += 1;
                    t.push(at(p));
                    t
                }));
            }
        }
        // Every other one is turned the other way round.
        let turned =
            |(n, t): (usize, Vec<u32>)| if n % 2 == 0 { [t[0], t[1], t[2], t[3]] } else { [t[0], t[1], t[3], t[2]] };
        let tets: Vec<[u32; 4]> = tets.into_iter().enumerate().map(turned).collect();
        TetMesh { vertices, labels: vec![1; tets.len()], tets }
    }

    /// A clamped plate of two layers gave way half as far as it should, "converged" and without a remark.
    #[test]
    fn two_layers_of_elements_are_told_from_four() {
        let found = [[12, 12, 1], [12, 12, 2], [12, 12, 4], [6, 6, 6]].map(|cells| layers(&plate(cells), |_| true));
        assert_eq!(found, [Some(1), Some(2), None, None]);
    }

    /// A skin of one layer, ten times as stiff, was 15 to 24 % too stiff, and nothing but a change of 6 % was told.
    #[test]
    fn a_stiff_sheet_of_one_layer_on_a_block_was_not_told() {
        let mut mesh = plate([12, 12, 6]);
        assert!((slenderness(&plate([5; 3]), 1) - 27f64.sqrt()).abs() < 1e-9);
        mesh.labels.iter_mut().take(12 * 12 * 6).for_each(|l| *l = 2);
        let (surface, volume) = (2.0 * 144.0 + 4.0 * 12.0, 144.0);
        let wanted = (0.5f64 * surface).sqrt() * surface / (2.0 * volume);
        assert!((slenderness(&mesh, 2) - wanted).abs() < 1e-9 * wanted, "{wanted}");
        let with = |times: f64, solved: usize| {
            let of = |young_kpa| Material { young_kpa, ..Material::BRAIN };
            thin(&mesh, &[(1, of(1.0)), (2, of(times))].into(), solved)
        };
        let told = with(10.0, 30_000);
        assert!(told.len() == 1 && told[0].contains("of region 2 make hardly more than 1 layer across it"), "{told:?}");
        // Nearly as soft as the block, or halved often enough.
        assert_eq!([with(2.0, 30_000).len(), with(10.0, 300_000).len()], [0, 0]);
    }
}
