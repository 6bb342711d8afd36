//! What a solution does not say by itself.

use super::limits;
use super::scene::Scene;
use monro_geometry::{Bvh, Patient, Point, TetMesh, TriangleMesh, Vector};
use monro_tissue::{NO_VOLUME, SphereContact, StaticSolution, Stop, Unfinished};
use serde_json::{Value, json};

/// A rod that is moved by so many of its radii may turn elements beside it over, however fine they are: in trials by 1.3 and 1.6 it
/// did not, by 2 and more it did.
const ROD_RADII: f64 = 1.5;

/// Remarks on a solution.
pub(super) fn remarks(scene: &Scene, solved: &StaticSolution) -> Vec<String> {
    let mut out = Vec::new();
    out.extend(solved.stop.map(|stop| stopped(stop, solved)));
    out.extend(unfinished(solved));
    out.extend(rubbed(scene, solved));
    out.extend(turned(scene, solved).filter(|_| limits::is_near(solved)));
    out.extend(turned_over(&scene.mesh, &solved.displacement).filter(|_| limits::is_near(solved)));
    out.extend(limits::all(scene, solved));
    if !scene.problem.contacts.is_empty() && solved.share >= 1.0 {
        let surfaces = [surface(&scene.mesh, None), surface(&scene.mesh, Some(&solved.displacement))];
        let all = scene.problem.contacts.iter().zip(&solved.contacts).enumerate();
        let still = !scene.problem.moves_by_itself();
        out.extend(all.filter_map(|(i, (c, force))| sphere((i, c), *force, still, &surfaces)));
    }
    out
}

/// Friction depends on the way, which is not gone again on a finer mesh unless that is asked for.
fn rubbed(scene: &Scene, solved: &StaticSolution) -> Option<String> {
    let once = scene.problem.rubs() && solved.change.is_none() && solved.unfinished.is_none();
    once.then(|| {
        "a sphere rubs, so the answer is that of one mesh, and how much a finer one would change it is not known: --refine 1 \
         goes all of the sphere's way on that, too, which may take minutes"
            .into()
    })
}

fn why(stop: Stop) -> &'static str {
    match stop {
        Stop::Asked => "time was up (--budget-ms sets the limit)",
        Stop::Steps => "the largest number of Newton steps or of steps of the motion was taken",
        Stop::Products => "the largest number of products with the Hessian was taken",
        Stop::Stuck => "no step brought the forces nearer to balance",
        Stop::Lost => "the body flew away: it may be held too loosely, or pushed too hard",
        Stop::Through => "a sphere lies inside the tissue that it should push aside",
        Stop::Unborne => "supports, rods and spheres do not bear the loads",
    }
}

fn stopped(stop: Stop, solved: &StaticSolution) -> String {
    match stop {
        Stop::Through if solved.share < 1.0 => {
            return format!(
                "stopped at {:.1} % of motion and load: pressed on, a sphere goes through the surface, for the elements under \
                 it give out; forces and displacement are those before; press less deep, or give a finer mesh under it",
                100.0 * solved.share
            );
        }
        Stop::Through => return format!("this is no answer: {}", why(stop)),
        Stop::Unborne => {
            return format!(
                "this is no answer: {}; forces out of balance sum up to {:.2} % of the loads (wanted less than 1 %), \
                 because nothing holds what they push (remarks name what is loose), or because they are small against the \
                 forces of something stiff that is moved: hold that by supports instead, or make its modulus nearer to \
                 that of its surroundings",
                why(stop),
                100.0 * solved.unborne
            );
        }
        _ => {}
    }
    if solved.steps == 0 {
        return format!("this is no answer: {}; no Newton step was taken, and the mesh is as it was", why(stop));
    }
    if solved.share == 0.0 {
        return format!(
            "this is no answer: {}; not even the least share of motion and load that was tried is borne, and the mesh is as it \
             was; impose less",
            why(stop)
        );
    }
    format!(
        "stopped before the tolerance was met: {}; {:.1} % of motion and load are imposed, with a residual of {:.2e} \
         after {} Newton steps; the displacement is the best so far{}",
        why(stop),
        100.0 * solved.share,
        solved.residual,
        solved.steps,
        if limits::is_near(solved) { "" } else { ", and forces and elements mean nothing yet" }
    )
}

/// Why a finer mesh was given up.
fn given_up(finer: &Unfinished) -> String {
    match (finer.stop, finer.residual.is_finite()) {
        _ if let Some(refused) = &finer.refused => format!("of the finer mesh: {refused}"),
        (None, _) => format!("{} of its elements turned inside out", finer.turned),
        (Some(stop), true) => {
            format!("residual {:.2e}, {} elements turned; {}", finer.residual, finer.turned, why(stop))
        }
        (Some(stop), false) => why(stop).to_owned(),
    }
}

/// A finer mesh than that of the answer, given up.
fn unfinished_finer(solved: &StaticSolution) -> Option<&Unfinished> {
    solved.unfinished.as_ref().filter(|finer| finer.tets != solved.tets)
}

/// How far the answer depends on the mesh, for scripts: whether the last refinement hardly changed it, what that changed, and
/// the finer mesh that was given up.
pub(super) fn of_mesh(scene: &Scene, solved: &StaticSolution) -> [(&'static str, Value); 3] {
    let set = |(set, share): (u32, f64)| json!({ "set": scene.sets[set as usize].0, "share": share });
    let change = solved.change.map(|c| {
        json!({
            "tets_before": c.tets, "displacement": c.displacement, "force": c.force, "moment": c.moment,
            "displacement_eightfold": c.displacement_eightfold, "set_force_eightfold": c.set.map(set),
        })
    });
    let finer = unfinished_finer(solved).map(|finer| json!({ "tets": finer.tets, "why": given_up(finer) }));
    [
        ("mesh_converged", json!(limits::mesh_converged(solved))),
        ("mesh_change", json!(change)),
        ("finer_given_up", json!(finer)),
    ]
}

fn unfinished(solved: &StaticSolution) -> Option<String> {
    let finer = unfinished_finer(solved)?;
    let collapse = match finer.is_collapse() {
        true => {
            "; what a coarse mesh bears and a finer one does not is most likely more than the body bears: impose less"
        }
        false => "",
    };
    let unknown = match solved.change {
        None => ", and how much a finer one would change it is not known",
        Some(_) => "",
    };
    Some(format!(
        "a finer mesh of {} elements was given up ({}); the answer is that of {} elements, with a residual of \
         {:.2e}{unknown}{collapse}",
        finer.tets,
        given_up(finer),
        solved.tets,
        solved.residual
    ))
}

fn turned(scene: &Scene, solved: &StaticSolution) -> Option<String> {
    let given = turned_given(&scene.mesh, &solved.displacement);
    let first = solved.first_turned.or(given.first().copied())?;
    let rods = scene.problem.rods.iter().any(|rod| rod.displacement_mm.norm() > ROD_RADII * rod.radius_mm);
    let helps = match rods {
        true => {
            "impose less: rods that are moved by more than one and a half of their radii tear what is beside them on any mesh"
        }
        false => "impose less, or give a finer mesh there",
    };
    Some(format!(
        "{} of {} elements solved, and {} of the {} of the mesh as given, are turned inside out or without volume, the \
         first in tetrahedron {first} of the mesh as given: the answer means nothing around them; {helps}",
        solved.turned,
        solved.tets,
        given.len(),
        scene.mesh.tets.len()
    ))
}

/// That the whole body has turned over: an equilibrium, but hardly the one that was meant, as of a column that hangs from the rollers
/// it stood on. The mean cosine between where vertices lie from the middle before and after is `(1 + 2 cos a) / 3` for a ball
/// that has turned by `a`.
fn turned_over(mesh: &TetMesh, displacement: &[Vector<Patient>]) -> Option<String> {
    let now = moved(mesh, displacement);
    let arms = |mesh: &TetMesh| {
        let sum = mesh.vertices.iter().fold(Vector::ZERO, |s, p| s + (*p - Point::ORIGIN));
        let middle = Point::ORIGIN + sum * (1.0 / mesh.vertices.len() as f64);
        mesh.vertices.iter().map(|p| (*p - middle).normalized().unwrap_or(Vector::ZERO)).collect::<Vec<_>>()
    };
    let sum: f64 = arms(mesh).iter().zip(arms(&now)).map(|(before, after)| before.dot(after)).sum();
    (sum < 0.0).then(|| {
        "the body as a whole has turned over, by more than a right angle: this may be an equilibrium, but on the way to it the \
         body left its place; hold it against that, or look at a smaller share of the load"
            .into()
    })
}

/// Elements of the mesh as given that a displacement (mm) leaves turned inside out or without volume.
pub(super) fn turned_given(mesh: &TetMesh, displacement: &[Vector<Patient>]) -> Vec<usize> {
    let moved = moved(mesh, displacement);
    (0..moved.tets.len()).filter(|&t| moved.volume(t) <= NO_VOLUME * mesh.volume(t)).collect()
}

pub(super) fn moved(mesh: &TetMesh, displacement: &[Vector<Patient>]) -> TetMesh {
    let vertices = mesh.vertices.iter().zip(displacement).map(|(p, d)| *p + *d).collect();
    TetMesh { vertices, ..mesh.clone() }
}

/// The outer surface, at rest or displaced.
fn surface(mesh: &TetMesh, displacement: Option<&[Vector<Patient>]>) -> Bvh {
    let vertices = displacement.map_or_else(|| mesh.vertices.clone(), |d| moved(mesh, d).vertices);
    Bvh::new(&TriangleMesh { vertices, triangles: mesh.boundary(|_| true) })
}

/// A sphere that does nothing in the end, or that did something already at first.
/// `still`: whether nothing but spheres moves the tissue, so that one is known to press it along its way.
fn sphere(
    (index, c): (usize, &SphereContact),
    force: Vector<Patient>,
    still: bool,
    [rest, end]: &[Bvh; 2],
) -> Option<String> {
    let away = |of: &Bvh, at| of.nearest(at).map_or(f64::INFINITY, |n| n.distance);
    let (first, last) = (away(rest, c.from), away(end, c.to));
    let crossed = rest.ray(c.from, c.to - c.from).is_some_and(|h| h.t <= 1.0);
    if force.norm() == 0.0 {
        let how = if crossed {
            "went through the body at rest and ends beyond it"
        } else if last < c.radius_mm {
            "only grazes its surface in the end, between vertices"
        } else {
            "does not touch it in the end"
        };
        return Some(format!(
            "sphere {index} {how}: it begins {:.4} mm from the surface and ends {:.4} mm from it, and pushes with no force",
            first - c.radius_mm,
            last - c.radius_mm
        ));
    }
    let along = force.dot(c.to - c.from) / force.norm() / (c.to - c.from).norm().max(f64::MIN_POSITIVE);
    if still && along < 0.0 && c.friction == 0.0 && first >= c.radius_mm {
        return Some(format!(
            "sphere {index} is pushed on along its motion, by {:.2e} N, and has no friction: it has slipped past what it \
             pressed on; look at steps of the way before",
            -along * force.norm() * 1e-3
        ));
    }
    // What rounding leaves of a sphere that just touches is not told.
    (first < c.radius_mm * (1.0 - 1e-9)).then(|| {
        format!(
            "sphere {index} begins {:.4} mm deep in the surface: its motion counts from there; begin it {:.4} mm away",
            c.radius_mm - first,
            c.radius_mm
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// It stood on rollers, hung from them in the end, and was converged without a remark.
    #[test]
    fn a_column_that_turned_over_was_an_answer_like_any_other() {
        let corners = [[0.0; 3], [20.0, 0.0, 0.0], [0.0, 20.0, 0.0], [0.0, 0.0, 100.0]];
        let mesh =
            TetMesh { vertices: corners.map(Point::from_array).to_vec(), tets: vec![[0, 1, 2, 3]], labels: vec![1] };
        let told = |to: fn(Point<Patient>) -> Point<Patient>| {
            turned_over(&mesh, &mesh.vertices.iter().map(|&p| to(p) - p).collect::<Vec<_>>())
        };
        assert_eq!(told(|p| Point::new(p.x + 300.0, 1.5 * p.y, 0.6 * p.z)), None);
        assert_eq!(told(|p| Point::new(p.x, p.z, -p.y)), None);
        assert!(told(|p| Point::new(p.x, -p.y, -p.z)).is_some_and(|said| said.contains("turned over")));
    }
}
