//! The equilibrium solver with rods and spheres, against closed forms.

use crate::common::{block, material, nodes};
use monro_geometry::{Point, TetMesh, Vector};
use monro_tissue::{
    EmbeddedRod, Finer, Material, Model, ModelOptions, Pressure, SphereContact, StaticError, StaticOptions,
    StaticProblem, StaticSolution, Stop, Support, equilibrium,
};

fn solve(mesh: &TetMesh, o: &ModelOptions, problem: &StaticProblem) -> StaticSolution {
    let solved = equilibrium(mesh, o, problem, &StaticOptions::default(), &mut || true).expect("solved");
    assert!(solved.converged, "{} after {} steps", solved.residual, solved.steps);
    solved
}

fn hold(problem: &mut StaticProblem, set: u32, nodes: Vec<u32>, displacement_mm: [Option<f64>; 3]) {
    problem.supports.extend(nodes.into_iter().map(|node| Support { node, set, displacement_mm }));
}

fn sum(forces: &[Vector<monro_geometry::Patient>]) -> Vector<monro_geometry::Patient> {
    forces.iter().fold(Vector::ZERO, |s, &f| s + f)
}

/// A rod through the whole thickness of a square plate that is held at its sides and slides along its faces only in the
/// rod's direction: antiplane shear, `F = 2 pi mu L u / ln(R / a)` with the conformal radius of the square, 1.0787 b.
#[test]
fn the_drag_on_a_bonded_rod_is_that_of_antiplane_shear_whatever_the_mesh() {
    let (b, thick, radius, u) = (20.0, 10.0, 1.5, 0.1);
    let o = material(0.45);
    let mu = o.materials[&4].shear_kpa();
    let expected = core::f64::consts::TAU * mu * thick * u / (1.0787f64 * b / radius).ln();
    for (cells, size) in [([8, 8, 2], 5.0), ([12, 12, 3], 10.0 / 3.0)] {
        let mesh = block(cells, size, |_| 4);
        let near = |v: f64, w: f64| (v - w).abs() < 1e-9;
        let mut problem = StaticProblem::default();
        let sides = |p: Point<_>| near(p.x, 0.0) || near(p.x, 2.0 * b) || near(p.y, 0.0) || near(p.y, 2.0 * b);
        hold(&mut problem, 0, nodes(&mesh, sides), [Some(0.0); 3]);
        for (set, z) in [(1, 0.0), (2, thick)] {
            hold(&mut problem, set, nodes(&mesh, |p| near(p.z, z)), [Some(0.0), Some(0.0), None]);
        }
        problem.rods.push(EmbeddedRod {
            radius_mm: radius,
            ends: [Point::new(19.3, 20.4, -5.0), Point::new(19.3, 20.4, 15.0)],
            displacement_mm: Vector::new(0.0, 0.0, u),
        });
        let solved = solve(&mesh, &o, &problem);
        let force = solved.rods[0].z;
        assert!((force / expected - 1.0).abs() < 0.05, "{force} mN, closed form {expected} mN");
        // What the rod gives, the supports take.
        let left = sum(&solved.reaction) + solved.rods[0];
        assert!(left.norm() < 1e-3 * force, "{left:?}");
    }
}

fn press(cells: usize, depth: f64, sideways: f64, friction: f64) -> StaticSolution {
    let size = 90.0;
    let mesh = block([cells; 3], size / cells as f64, |_| 4);
    let mut problem = StaticProblem::default();
    hold(&mut problem, 0, nodes(&mesh, |p| p.z == 0.0), [Some(0.0); 3]);
    let top = size + 10.0;
    problem.contacts.push(SphereContact {
        radius_mm: 10.0,
        friction,
        from: Point::new(44.0, 46.0, top),
        to: Point::new(44.0 + sideways, 46.0, top - depth),
    });
    solve(&mesh, &material(0.3), &problem)
}

#[test]
fn a_sphere_meets_the_force_of_hertz_and_whatever_it_meets_the_supports_bear() {
    let depth = 0.3f64;
    // F = 4/3 E / (1 - nu^2) sqrt(R) d^1.5.
    let hertz = 4.0 / 3.0 * 3.0 / (1.0 - 0.09) * 10f64.sqrt() * depth.powf(1.5);
    for cells in [4, 6] {
        let solved = press(cells, depth, 0.0, 0.0);
        let force = -solved.contacts[0].z;
        assert!((force / hertz - 1.0).abs() < 0.05, "{force} mN, Hertz {hertz} mN");
        assert!((sum(&solved.reaction) + solved.contacts[0]).norm() < 1e-3 * force);
    }
}

#[test]
fn friction_drags_the_tissue_up_to_its_coefficient() {
    let (smooth, rough) = (press(4, 0.3, 1.2, 0.0), press(4, 0.3, 1.2, 0.2));
    assert!(smooth.contacts[0].x < 0.05 * -smooth.contacts[0].z, "{:?}", smooth.contacts[0]);
    let ratio = rough.contacts[0].x / -rough.contacts[0].z;
    // Dragged four times as far as pressed, all of the contact slides.
    assert!((ratio - 0.2).abs() < 0.04, "{ratio}: {:?}", rough.contacts[0]);
}

#[test]
fn friction_was_gone_on_the_finer_mesh_inside() {
    let (mesh, o) = (block([3; 3], 15.0, |_| 4), material(0.3));
    let mut problem = StaticProblem::default();
    hold(&mut problem, 0, nodes(&mesh, |p| p.z == 0.0), [Some(0.0); 3]);
    let (from, to) = (Point::new(21.5, 22.5, 55.0), Point::new(23.5, 22.5, 53.0));
    problem.contacts.push(SphereContact { radius_mm: 10.0, friction: 0.2, from, to });
    let ratio = [Finer::Times(0), Finer::UpTo(1_000_000)].map(|finer| {
        let finer = StaticOptions { finer, ..StaticOptions::default() };
        let solved = equilibrium(&mesh, &o, &problem, &finer, &mut || true).expect("solved");
        assert!(solved.converged);
        solved.contacts[0].x / -solved.contacts[0].z
    });
    assert!(ratio[0] > 0.1 && (ratio[1] / ratio[0] - 1.0).abs() < 0.15, "{ratio:?}");
}

#[test]
fn a_finer_mesh_inside_keeps_an_affine_field_and_its_forces() {
    let mesh = block([2, 2, 2], 10.0, |_| 4);
    let mut problem = StaticProblem::default();
    let surface = |p: Point<_>| p.to_array().iter().any(|v| *v == 0.0 || *v == 20.0);
    for node in nodes(&mesh, surface) {
        let z = mesh.vertices[node as usize].z;
        let displacement_mm = [Some(0.2 * z), Some(0.0), Some(0.0)];
        problem.supports.push(Support { node, set: 0, displacement_mm });
    }
    let o = material(0.49);
    for times in 0..3 {
        let finer = StaticOptions { finer: Finer::Times(times), ..StaticOptions::default() };
        let solved = equilibrium(&mesh, &o, &problem, &finer, &mut || true).expect("solved");
        assert_eq!(solved.tets, 48 * 8usize.pow(times));
        assert_eq!(solved.displacement.len(), mesh.vertices.len());
        let middle = solved.displacement[13];
        assert!((middle.x - 2.0).abs() + middle.y.abs() + middle.z.abs() < 1e-4, "{middle:?}");
        let moment: f64 = solved.reaction.iter().zip(&mesh.vertices).map(|(r, p)| r.x * p.z).sum();
        assert!((moment / 8000.0 / 0.2 / o.materials[&4].shear_kpa() - 1.0).abs() < 0.01, "{moment}");
    }
}

#[test]
fn bodies_that_cannot_be_are_named() {
    let mesh = block([2, 2, 2], 5.0, |_| 4);
    let ask = |p: &StaticProblem| equilibrium(&mesh, &material(0.45), p, &StaticOptions::default(), &mut || true).err();
    let rod = EmbeddedRod {
        radius_mm: 1.0,
        ends: [Point::new(50.0, 0.0, 0.0), Point::new(60.0, 0.0, 0.0)],
        displacement_mm: Vector::new(1.0, 0.0, 0.0),
    };
    let far = StaticProblem { rods: vec![rod], ..StaticProblem::default() };
    assert_eq!(ask(&far), Some(StaticError::Rod { rod: 0, radius_mm: 1.0 }));
    let flat = StaticProblem { rods: vec![EmbeddedRod { radius_mm: 0.0, ..rod }], ..StaticProblem::default() };
    assert!(matches!(ask(&flat), Some(StaticError::Radius { what: "rod", index: 0, .. })));
}

#[test]
fn a_rod_between_held_corners_is_not_counted_among_the_supports() {
    // Every vertex of the mesh as given is held; what holds the rod are vertices that the solver adds.
    let mesh = block([1, 1, 1], 20.0, |_| 4);
    let mut problem = StaticProblem::default();
    hold(&mut problem, 0, nodes(&mesh, |p| p.z == 0.0), [Some(0.0); 3]);
    hold(&mut problem, 1, nodes(&mesh, |p| p.z == 20.0), [None, None, Some(0.0)]);
    let rod = EmbeddedRod {
        radius_mm: 1.5,
        ends: [Point::new(10.0, 10.0, 10.0), Point::new(10.0, 10.0, 25.0)],
        displacement_mm: Vector::new(0.0, 0.0, -0.5),
    };
    problem.rods.push(rod);
    let solved = solve(&mesh, &material(0.3), &problem);
    let force = solved.rods[0].z;
    // Where the rod leaves the tissue the support holds what both hold, so the rod pushes and both sides bear it.
    assert!(force < -5.0, "{force} mN");
    let (bottom, top): (Vec<_>, Vec<_>) = solved.reaction.iter().zip(&mesh.vertices).partition(|(_, p)| p.z == 0.0);
    let z = |of: &[(&Vector<_>, &Point<_>)]| of.iter().map(|(r, _)| r.z).sum::<f64>();
    let (bottom, top) = (z(&bottom), z(&top));
    assert!((bottom + top + force).abs() < 1e-4 * -force, "{bottom} + {top} + {force}");
    assert!(bottom > 0.05 * -force && top > 0.05 * -force, "{bottom} {top} {force}");
}

#[test]
fn a_sphere_that_begins_inside_is_refused() {
    let mesh = block([2; 3], 10.0, |_| 4);
    let mut problem = StaticProblem::default();
    hold(&mut problem, 0, nodes(&mesh, |p| p.z == 0.0), [Some(0.0); 3]);
    let (from, to) = (Point::new(10.0, 9.0, 12.0), Point::new(10.0, 9.0, 11.0));
    problem.contacts.push(SphereContact { radius_mm: 5.0, friction: 0.0, from, to });
    let told = equilibrium(&mesh, &material(0.3), &problem, &StaticOptions::default(), &mut || true);
    assert!(matches!(told, Err(StaticError::Inside { sphere: 0, radius_mm: 5.0, .. })), "{told:?}");
}

/// A block of 60 mm with a sphere of 5 mm radius over the middle of a face of its surface, as coarse as it is.
fn over_a_face(hold_top: impl Fn(f64) -> bool, depth: f64, refine: bool) -> Result<StaticSolution, StaticError> {
    let mesh = block([6; 3], 10.0, |_| 4);
    let mut problem = StaticProblem::default();
    hold(&mut problem, 0, nodes(&mesh, |p| p.z == 0.0), [Some(0.0); 3]);
    hold(&mut problem, 1, nodes(&mesh, |p| p.z == 60.0 && hold_top(p.x)), [Some(0.0); 3]);
    let (from, to) = (Point::new(33.5, 36.5, 66.0), Point::new(33.5, 36.5, 65.0 - depth));
    problem.contacts.push(SphereContact { radius_mm: 5.0, friction: 0.0, from, to });
    let (o, how) = (material(0.3), StaticOptions::default());
    if refine {
        return equilibrium(&mesh, &o, &problem, &how, &mut || true);
    }
    Model::new(&mesh, &o)?.equilibrium(&problem, &how, &mut || true)
}

#[test]
fn a_sphere_between_the_vertices_of_a_coarse_mesh_does_not_slip_through() {
    let solved = over_a_face(|_| false, 1.0, false).expect("solved");
    assert!(solved.converged && solved.overlaps.is_empty(), "{:?} {:?}", solved.stop, solved.overlaps);
    assert!(-solved.contacts[0].z > 1.0, "{:?}", solved.contacts[0]);
}

#[test]
fn held_vertices_under_a_sphere_bear_no_invented_force() {
    let free = over_a_face(|_| false, 3.0, true).expect("solved");
    let force = -free.contacts[0].z;
    assert!(free.converged && free.overlaps.is_empty() && force > 0.0);
    match over_a_face(|_| true, 3.0, true) {
        Err(StaticError::OnlyHeld { sphere: 0, vertices, depth_mm }) => {
            assert!(vertices > 0 && (depth_mm - 3.0).abs() < 0.1, "{vertices} {depth_mm}");
        }
        other => panic!("{other:?}"),
    }
    // Half of the surface is held, up to the edge of the contact.
    let half = over_a_face(|x| x < 35.0, 3.0, true).expect("solved");
    let overlap = half.overlaps.first().expect("told");
    assert!(overlap.held > 0 && overlap.held_mm > 0.1 && -half.contacts[0].z < 3.0 * force, "{overlap:?} {force}");
}

#[test]
fn a_sphere_that_goes_through_the_surface_is_never_called_converged() {
    let solved = over_a_face(|_| false, 30.0, false).expect("solved");
    assert!(!solved.converged, "{:?} {:?}", solved.stop, solved.overlaps);
    let force = -solved.contacts[0].z;
    assert!(solved.stop != Some(Stop::Through) || force > 0.0, "{force} at {}", solved.share);
}

#[test]
fn a_rod_far_thinner_than_the_elements_ends_soon_and_is_told() {
    let mesh = block([5; 3], 10.0, |_| 4);
    let mut problem = StaticProblem::default();
    hold(&mut problem, 0, nodes(&mesh, |p| p.z == 0.0), [Some(0.0); 3]);
    let ends = [Point::new(25.0, 25.0, 50.0), Point::new(25.0, 25.0, 10.0)];
    let rod = |radius_mm, up| EmbeddedRod { radius_mm, ends, displacement_mm: Vector::new(0.0, 0.0, up) };
    problem.rods.push(rod(1e-3, 2.0));
    let solved = equilibrium(&mesh, &material(0.3), &problem, &StaticOptions::default(), &mut || true);
    let solved = solved.expect("its axis is on vertices");
    assert_eq!((solved.coarse[0].what, solved.coarse[0].index), ("rod", 0));
    assert!(solved.tets < 150_000, "{}", solved.tets);
    // A second one in its place has nothing left to hold.
    problem.rods = vec![rod(1.5, 2.0), rod(1.5, -2.0)];
    let taken = equilibrium(&mesh, &material(0.3), &problem, &StaticOptions::default(), &mut || true);
    assert!(matches!(taken, Err(StaticError::Taken { rod: 1, vertices }) if vertices > 0), "{taken:?}");
}

/// A soft beam on a stub a million times as stiff, which is pulled: its weight is nothing against that.
#[test]
fn loads_small_against_what_something_stiff_bears_are_borne_all_the_same() {
    let mesh = block([10, 2, 2], 10.0, |c| if c[0] < 2 { 5 } else { 4 });
    let sag = |stiff: f64| {
        let mut o = material(0.3);
        o.materials.insert(5, Material { young_kpa: stiff, poisson: 0.3, ..Material::BRAIN });
        let mut problem = StaticProblem { body_force_mn_mm3: [0.0, 0.0, -1e-4], ..StaticProblem::default() };
        hold(&mut problem, 0, nodes(&mesh, |p| p.x == 0.0), [Some(0.0); 3]);
        hold(&mut problem, 1, nodes(&mesh, |p| p.x == 10.0), [Some(1.0), None, None]);
        let solved = solve(&mesh, &o, &problem);
        assert!((sum(&solved.reaction).z / (1e-4 * 40_000.0) - 1.0).abs() < 0.01, "{:?}", sum(&solved.reaction));
        nodes(&mesh, |p| p.x == 100.0).into_iter().map(|n| solved.displacement[n as usize].z).sum::<f64>() / 9.0
    };
    let (some, much) = (sag(3e3), sag(6.5e6));
    assert!((much / some - 1.0).abs() < 0.03, "{much} mm against {some} mm");
}

/// Conjugate gradients went on until all products were spent: the sphere did not touch yet, and nothing else bore the weight.
#[test]
fn a_slab_that_only_a_sphere_will_bear_never_took_a_step() {
    let mesh = block([4, 4, 2], 10.0, |_| 4);
    let near = |v: f64, w: f64| (v - w).abs() < 1e-9;
    let sides = |p: Point<_>| near(p.x, 0.0) || near(p.x, 40.0) || near(p.y, 0.0) || near(p.y, 40.0);
    for gap in [0.1, 1.0] {
        // 100 N/m3, downwards.
        let mut problem = StaticProblem { body_force_mn_mm3: [0.0, 0.0, -1e-4], ..StaticProblem::default() };
        hold(&mut problem, 0, nodes(&mesh, sides), [Some(0.0), Some(0.0), None]);
        let at = Point::new(20.5, 19.5, -8.0 - gap);
        problem.contacts.push(SphereContact { radius_mm: 8.0, friction: 0.0, from: at, to: at });
        let solved = solve(&mesh, &material(0.3), &problem);
        let weight = 1e-4 * 40.0 * 40.0 * 20.0;
        assert!((solved.contacts[0].z / weight - 1.0).abs() < 0.01, "{gap}: {:?} mN for {weight}", solved.contacts[0]);
        let lowest = solved.displacement.iter().map(|d| d.z).fold(0.0, f64::min);
        assert!(lowest < -gap && lowest > -gap - 3.0, "{gap}: {lowest} mm");
    }
}

/// It went through with a force three times too large, without a word.
#[test]
fn a_rod_through_a_held_surface_is_told_of_the_vertices_that_do_not_go_with_it() {
    let mesh = block([4, 4, 4], 5.0, |_| 4);
    let mut problem = StaticProblem::default();
    hold(&mut problem, 0, nodes(&mesh, |p| p.z == 0.0 || p.z == 20.0), [Some(0.0); 3]);
    let rod = |low: f64, high: f64| EmbeddedRod {
        radius_mm: 1.5,
        ends: [Point::new(10.0, 10.0, low), Point::new(10.0, 10.0, high)],
        displacement_mm: Vector::new(0.0, 0.0, 0.1),
    };
    problem.rods = vec![rod(8.0, 25.0)];
    assert!(solve(&mesh, &material(0.3), &problem).contested[0] > 0);
    problem.rods = vec![rod(8.0, 14.0)];
    assert_eq!(solve(&mesh, &material(0.3), &problem).contested, [0]);
}

#[test]
fn a_sphere_beside_a_pressure_that_follows_a_free_end_found_no_equilibrium() {
    let mesh = block([12, 4, 4], 5.0, |_| 4);
    let end = mesh.boundary(|_| true).into_iter().filter(|f| f.iter().all(|&v| mesh.vertices[v as usize].x == 60.0));
    let end: Vec<[u32; 3]> = end.collect();
    // A tenth of Young's modulus, pushed and pulled.
    for kpa in [0.3, -0.3] {
        let mut problem = StaticProblem::default();
        hold(&mut problem, 0, nodes(&mesh, |p| p.x == 0.0), [Some(0.0); 3]);
        problem.pressures.push(Pressure { faces: end.clone(), kpa });
        let (from, to) = (Point::new(41.0, 9.0, 28.0), Point::new(41.0, 9.0, 26.0));
        problem.contacts.push(SphereContact { radius_mm: 8.0, friction: 0.0, from, to });
        let options = StaticOptions { finer: Finer::Times(0), ..StaticOptions::default() };
        let solved = equilibrium(&mesh, &material(0.3), &problem, &options, &mut || true).expect("solved");
        assert!(solved.converged && solved.steps < 200, "{} after {} steps", solved.residual, solved.steps);
        // What presses on the faces as they lie in the end, the sphere and the supports are in balance.
        let at = |v: u32| mesh.vertices[v as usize] + solved.displacement[v as usize];
        let area = |f: &[u32; 3]| (at(f[1]) - at(f[0])).cross(at(f[2]) - at(f[0])) * 0.5;
        let pushed = end.iter().fold(Vector::ZERO, |s, f| s - area(f) * kpa);
        let left = sum(&solved.reaction) + solved.contacts[0] + pushed;
        assert!(left.norm() < 1e-3 * pushed.norm(), "{left:?} of {pushed:?}");
        assert!(solved.contacts[0].z < -1.0, "{:?}", solved.contacts[0]);
    }
}
