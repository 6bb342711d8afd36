//! Nodes that lie against planes: they slide, lift off, and do not go beyond.

use crate::common::{block, material, nodes, options, paper, physical};
use monro_geometry::{Patient, Point, TetMesh, Vector};
use monro_tissue::{
    Attachment, AttachmentKind, FrameSettings, Material, Model, ModelError, ModelOptions, State, StaticError,
    StaticOptions, StaticProblem, Stepper, Support,
};

const CELLS: [usize; 3] = [2, 3, 8];
const SIZE: f64 = 5.0;

fn column() -> TetMesh {
    block(CELLS, SIZE, |_| 4)
}

/// The column against planes on the sides of which `outward` tells the normals.
fn against(mesh: &TetMesh, mut o: ModelOptions, outward: &[[f64; 3]]) -> ModelOptions {
    for &n in outward {
        let side = |p: [f64; 3], a: usize| n[a] != 0.0 && p[a] == if n[a] > 0.0 { CELLS[a] as f64 * SIZE } else { 0.0 };
        let on = nodes(mesh, |p| (0..3).any(|a| side(p.to_array(), a)));
        o.attachments.extend(
            on.into_iter()
                .map(|node| Attachment { node, kind: AttachmentKind::Abutting { outward: n, drag_per_s: 0.0 } }),
        );
    }
    o
}

const DOWN: [f64; 3] = [0.0, 0.0, -2.0];
const SIDES: [[f64; 3]; 4] = [[1.0, 0.0, 0.0], [-0.5, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, -1.0, 0.0]];

fn run(model: &Model, settings: &FrameSettings, frames: usize) -> State {
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(model));
    for _ in 0..frames {
        let report = stepper.step(model, &mut state, &[], settings);
        assert_eq!((report.rollbacks, report.inverted), (0, 0));
    }
    state
}

fn pulled(gravity_mm_s2: [f64; 3]) -> FrameSettings {
    FrameSettings { gravity_mm_s2, iterations: 40, ..FrameSettings::default() }
}

#[test]
fn a_column_among_walls_sinks_by_its_weight_as_under_uniaxial_strain() {
    for poisson in [0.3, 0.45, 0.49] {
        let (mesh, g) = (column(), 2000.0);
        let planes: Vec<[f64; 3]> = SIDES.into_iter().chain([DOWN]).collect();
        let model = Model::new(&mesh, &against(&mesh, material(poisson), &planes)).expect("model");
        let settings = pulled([0.0, 0.0, -g]);
        let state = run(&model, &settings, 240);
        let m = Material { poisson, ..Material::BRAIN };
        let modulus = m.young_kpa * (1.0 - poisson) / ((1.0 + poisson) * (1.0 - 2.0 * poisson));
        let (density, high) = (m.density_kg_m3 * 1e-9, CELLS[2] as f64 * SIZE);
        // Under its own weight a column is strained by rho g (L - z) / M. The energy's next term is as large as the strain, of
        // at most 3.4 %, over three.
        let sunk = density * g * high * high / (2.0 * modulus);
        for v in nodes(&mesh, |p| p.z == high) {
            let d = model.displacement(&state, v as usize);
            assert!((-d.z / sunk - 1.0).abs() < 0.02, "{} for {sunk} mm at {poisson}", -d.z);
        }
        let beyond = |v: u32| {
            let p = model.position(&state, v as usize).to_array();
            (0..3).map(|a| (-p[a]).max(if a < 2 { p[a] - CELLS[a] as f64 * SIZE } else { 0.0 })).fold(0.0, f64::max)
        };
        let most = (0..mesh.vertices.len() as u32).map(beyond).fold(0.0, f64::max);
        assert!(most < 1e-3, "{most} mm beyond a wall");
        let borne = model.reactions(&state, &settings).expect("physical");
        let floor: f64 = borne.iter().map(|f| f.z).sum();
        let weight = model.mass_kg() * g;
        assert!((floor / weight - 1.0).abs() < 0.01, "{floor} of {weight} mN");
        let aside: f64 = borne.iter().map(|f| f.x.abs() + f.y.abs()).sum();
        assert!(aside > 0.1 * weight, "walls bear what would bulge: {aside} mN");
    }
}

/// The column held on one side, and against planes on others.
fn held(mesh: &TetMesh, on: impl Fn(Point<Patient>) -> bool, outward: &[[f64; 3]]) -> Model {
    let fixed = options(physical(), &nodes(mesh, on));
    Model::new(mesh, &against(mesh, fixed, outward)).expect("model")
}

fn apart(a: &[Vector<Patient>], b: &[Vector<Patient>]) -> (f64, f64) {
    let most = |all: &mut dyn Iterator<Item = f64>| all.fold(0.0, f64::max);
    (most(&mut a.iter().zip(b).map(|(a, b)| (*a - *b).norm())), most(&mut b.iter().map(|b| b.norm())))
}

fn displacements(model: &Model, state: &State) -> Vec<Vector<Patient>> {
    (0..model.node_count()).map(|v| model.displacement(state, v)).collect()
}

#[test]
fn a_column_drawn_off_its_planes_is_as_without_them() {
    let (mesh, settings) = (column(), pulled([0.0, 0.0, 2000.0]));
    let at_rest = |planes: &[[f64; 3]]| {
        let model = held(&mesh, |p| p.z == 40.0, planes);
        displacements(&model, &run(&model, &settings, 240))
    };
    // It is compressed towards its top, and bulges there: off the floor, and away from no side.
    let (apart, most) = apart(&at_rest(&[DOWN]), &at_rest(&[]));
    assert!(most > 0.4 && apart < 0.005 * most, "{apart} of {most} mm");
}

#[test]
fn a_column_drawn_along_its_plane_slides_as_on_rollers() {
    let (mesh, g) = (column(), [3000.0, 0.0, -15000.0]);
    let model = held(&mesh, |p| p.x == 0.0 && p.z > 20.0, &[DOWN]);
    let settings = pulled(g);
    let state = run(&model, &settings, 360);
    let borne = model.reactions(&state, &settings).expect("physical");
    let floor = nodes(&mesh, |p| p.z == 0.0);
    assert!(floor.iter().all(|&v| borne[v as usize].z > 0.0), "all of the floor bears");
    let density = Material::BRAIN.density_kg_m3 * 1e-9;
    let support = |&node: &u32| Support { node, set: 0, displacement_mm: [None, None, Some(0.0)] };
    let problem = StaticProblem {
        supports: floor.iter().map(support).collect(),
        body_force_mn_mm3: g.map(|g| g * density),
        ..StaticProblem::default()
    };
    let mut rollers = options(physical(), &nodes(&mesh, |p| p.x == 0.0 && p.z > 20.0));
    let sets = rollers.attachments.drain(..).map(|a| Support { node: a.node, set: 1, displacement_mm: [Some(0.0); 3] });
    let problem = StaticProblem { supports: problem.supports.iter().copied().chain(sets).collect(), ..problem };
    let on_rollers = Model::new(&mesh, &rollers).expect("model");
    let solved = on_rollers.equilibrium(&problem, &StaticOptions::default(), &mut || true).expect("solved");
    let (apart, most) = apart(&displacements(&model, &state), &solved.displacement);
    assert!(most > 1.0 && apart < 0.02 * most, "{apart} of {most} mm");
}

#[test]
fn paper_mode_keeps_to_planes_too() {
    let (mesh, dt, frames) = (column(), 1.0 / 60.0, 24);
    let model = Model::new(&mesh, &against(&mesh, options(paper(), &[]), &[DOWN])).expect("model");
    let fallen = |g: f64| g * dt * dt * (frames * (frames + 1)) as f64 / 2.0;
    for g in [[0.0, 0.0, 300.0], [200.0, 0.0, -300.0]] {
        let all = displacements(&model, &run(&model, &pulled(g), frames));
        let mean = all.iter().fold(Vector::ZERO, |sum, d| sum + *d) * (1.0 / all.len() as f64);
        // The column leans while it slides.
        assert!((mean.x - fallen(g[0])).abs() < 0.05 * (1.0 + fallen(g[0])), "{mean:?}");
        assert!(g[2] < 0.0 || (mean.z - fallen(g[2])).abs() < 0.5, "{mean:?}");
        let floor = nodes(&mesh, |p| p.z == 0.0);
        assert!(floor.iter().all(|&v| all[v as usize].z > -1e-3));
    }
}

#[test]
fn what_lies_against_planes_rests_to_the_last_bit() {
    let mesh = column();
    let planes: Vec<[f64; 3]> = SIDES.into_iter().chain([DOWN]).collect();
    let model = Model::new(&mesh, &against(&mesh, options(physical(), &[]), &planes)).expect("model");
    let state = run(&model, &pulled([0.0; 3]), 100);
    assert!((0..mesh.vertices.len()).all(|v| model.displacement(&state, v).norm() == 0.0));
}

#[test]
fn planes_without_a_direction_and_equilibria_are_refused() {
    let (mesh, fixed) = (column(), options(physical(), &[]));
    for outward in [[0.0; 3], [f64::NAN, 0.0, 1.0]] {
        let kind = AttachmentKind::Abutting { outward, drag_per_s: 0.0 };
        let o = ModelOptions { attachments: vec![Attachment { node: 3, kind }], ..fixed.clone() };
        assert!(matches!(Model::new(&mesh, &o), Err(ModelError::Option { .. })), "{outward:?}");
    }
    // The ninth was passed over.
    let many = [DOWN; 9].map(|outward| AttachmentKind::Abutting { outward, drag_per_s: 0.0 });
    let with = |n: usize| ModelOptions {
        attachments: many[..n].iter().map(|&kind| Attachment { node: 3, kind }).collect(),
        ..fixed.clone()
    };
    assert!(Model::new(&mesh, &with(8)).is_ok());
    let refused = Model::new(&mesh, &with(9)).err();
    assert!(matches!(refused, Some(ModelError::Planes { node: 3, planes: 9, most: 8 })), "{refused:?}");
    let o = against(&mesh, fixed, &[DOWN]);
    let model = Model::new(&mesh, &o).expect("model");
    let found = model.equilibrium(&StaticProblem::default(), &StaticOptions::default(), &mut || true);
    assert_eq!(found.err(), Some(StaticError::Abutting { nodes: 12 }));
}
