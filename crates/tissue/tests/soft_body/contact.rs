//! What a rod does to the tissue it meets, whatever the mesh.

use crate::common::{block, nodes, options, paper, physical, rod};
use monro_geometry::{Patient, Point, TetMesh, Vector};
use monro_tissue::{
    CollisionResponse, Event, FrameSettings, Insertion, Material, Model, State, StepReport, Stepper, TipShape, Tool,
    ToolMotion, ToolPose,
};

/// Places of the outer surface on the line through `through` along `axis`, as coordinates on that axis.
fn surface(mesh: &TetMesh, model: &Model, state: &State, axis: usize, through: [f64; 3]) -> Vec<f64> {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let hit = |t: &[u32; 3]| {
        let p = t.map(|n| model.position(state, n as usize).to_array());
        let side = |i: usize| {
            let (a, b) = (p[i], p[(i + 1) % 3]);
            (b[u] - a[u]) * (through[v] - a[v]) - (b[v] - a[v]) * (through[u] - a[u])
        };
        let s = [side(1), side(2), side(0)];
        let all = s.iter().sum::<f64>();
        let inside = s.iter().all(|x| *x >= 0.0) || s.iter().all(|x| *x <= 0.0);
        (inside && all != 0.0).then(|| (0..3).map(|i| s[i] / all * p[i][axis]).sum::<f64>())
    };
    mesh.boundary(|_| true).iter().filter_map(hit).collect()
}

#[test]
fn a_rod_presses_the_surface_down_wherever_it_meets_it_and_however_large_the_elements_are() {
    let (size, depth) = (48.0, 4.0);
    for mode in [physical(), paper()] {
        for cells in [2, 4, 8, 14] {
            let mesh = block([cells; 3], size / cells as f64, |_| 4);
            let mut o = options(mode, &nodes(&mesh, |p| p.z == 0.0));
            o.collision = CollisionResponse::Plain;
            let model = Model::new(&mesh, &o).expect("model");
            // On a vertex, between two, in the middle of a triangle, anywhere.
            let h = size / cells as f64;
            for [x, y] in [[24.0, 24.0], [24.0 + 0.5 * h, 24.0], [24.0 + 0.3 * h, 24.0 + 0.6 * h], [21.7, 27.9]] {
                let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
                let at = |f: f64| [x, y, size + 1.0 - (depth + 1.0) * f / 30.0];
                for f in 0..30 {
                    let motion = rod(at(f.into()), at((f + 1).into()));
                    let report = stepper.step(&model, &mut state, &[motion], &FrameSettings::default());
                    assert_eq!(report.inverted, 0, "{mode:?}, {cells} cells, at {x} {y}");
                }
                let top = surface(&mesh, &model, &state, 2, at(30.0)).into_iter().fold(f64::MIN, f64::max);
                assert!(top < size - depth + 0.15, "{mode:?}, {cells} cells, at {x} {y}: surface at {top} mm");
            }
        }
    }
}

#[test]
fn a_rod_at_half_a_metre_per_second_does_not_pass_through_tip_or_side_first() {
    let way = 500.0 / 60.0;
    for mode in [physical(), paper()] {
        for cells in [3, 6] {
            let mesh = block([cells; 3], 36.0 / cells as f64, |_| 4);
            let mut o = options(mode, &nodes(&mesh, |p| p.z == 0.0 || p.x == 36.0));
            o.collision = CollisionResponse::Plain;
            let model = Model::new(&mesh, &o).expect("model");
            let run = |motion: ToolMotion| {
                let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
                let report = stepper.step(&model, &mut state, &[motion], &FrameSettings::default());
                assert!(report.contacts > 0 && report.inverted == 0, "{mode:?} {cells}: {report:?}");
                state
            };
            let state = run(rod([17.0, 16.0, 38.0], [17.0, 16.0, 38.0 - way]));
            let top = surface(&mesh, &model, &state, 2, [17.0, 16.0, 0.0]).into_iter().fold(f64::MIN, f64::max);
            assert!(top < 38.0 - way + 0.3, "{mode:?}, {cells} cells: surface at {top} mm");
            // The shaft comes from the side, along y from end to end.
            let pose = |x: f64| ToolPose { tip: Point::new(x, -9.0, 19.0), tail: Point::new(x, 45.0, 19.0) };
            let tool = Tool { tip: TipShape::Round, radius_mm: 1.5 };
            let state = run(ToolMotion { tool, from: pose(-3.0), to: pose(way - 3.0) });
            let side = surface(&mesh, &model, &state, 0, [0.0, 17.0, 19.0]).into_iter().fold(f64::MAX, f64::min);
            assert!(side > way - 3.0 + 1.5 - 0.3, "{mode:?}, {cells} cells: side at {side} mm");
        }
    }
}

/// Displacement of the material point `x`, linear in its element.
fn moved(mesh: &TetMesh, model: &Model, state: &State, x: Point<Patient>) -> Vector<Patient> {
    for tet in &mesh.tets {
        let p = tet.map(|v| mesh.vertices[v as usize]);
        let volume = |q: [Point<Patient>; 4]| (q[1] - q[0]).cross(q[2] - q[0]).dot(q[3] - q[0]);
        let share = |i: usize| {
            let mut q = p;
            q[i] = x;
            volume(q) / volume(p)
        };
        let shares = [0, 1, 2, 3].map(share);
        if shares.iter().all(|s| *s >= -1e-9) {
            let all = tet.iter().zip(shares);
            return all.fold(Vector::ZERO, |d, (&v, s)| d + model.displacement(state, v as usize) * s);
        }
    }
    panic!("{x:?} lies outside");
}

/// A rod pushed `depth` mm into a block of brain, then `sideways` to the side; the reports of all frames.
fn insert(model: &Model, place: [f64; 2], depth: f64, sideways: f64) -> (State, Vec<StepReport>) {
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(model));
    let (down, hold) = ((depth + 1.0) * 3.0, 30.0);
    let at = |f: f64| {
        let aside = sideways * ((f - down) / hold).clamp(0.0, 1.0);
        [place[0] + aside, place[1], 49.0 - f.min(down) / 3.0]
    };
    let step = |f: i32| {
        let motion = rod(at(f.into()), at((f + 1).into()));
        stepper.step(model, &mut state, &[motion], &FrameSettings::default())
    };
    let reports = (0..(down + 2.0 * hold) as i32).map(step).collect();
    (state, reports)
}

/// Mean motion to the side of five points beside a rod that is pushed in and then 2 mm to the side, over four insertions
/// around the middle: where it slips as it goes in is a matter of chance, and moves a single one by a tenth.
fn motions_beside(mesh: &TetMesh, model: &Model) -> [f64; 5] {
    let mut mean = [0.0; 5];
    for (x, y) in [(22.7, 24.1), (22.7, 25.3), (23.9, 24.1), (23.9, 25.3)] {
        let (state, reports) = insert(model, [x, y], 25.0, 2.0);
        let last = reports.last().expect("a frame");
        assert!(last.tools[0].inserted_mm > 15.0, "{last:?}");
        let probe = |away: f64, z: f64| moved(mesh, model, &state, Point::new(x + 2.0 + away, y, z)).x;
        let motions = [(4.0, 32.0), (6.0, 32.0), (9.0, 32.0), (-6.0, 32.0), (6.0, 38.0)].map(|(d, z)| probe(d, z));
        (0..5).for_each(|i| mean[i] += motions[i] / 4.0);
    }
    mean
}

#[test]
fn tissue_beside_a_rod_moves_alike_whatever_the_size_of_the_elements() {
    // 6,000, 35,000 and 64,000 elements.
    let told = [10, 18, 22].map(|cells| {
        let mesh = block([cells; 3], 48.0 / cells as f64, |_| 4);
        let outside = |p: Point<_>| [p.x, p.y].iter().any(|v| v.abs() < 1e-9 || (v - 48.0).abs() < 1e-9) || p.z == 0.0;
        let model = Model::new(&mesh, &options(physical(), &nodes(&mesh, outside))).expect("model");
        motions_beside(&mesh, &model)
    });
    println!("{told:?}");
    let apart = |i: usize| told[i].iter().zip(&told[2]).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max);
    // Solved to the end (60 iterations) they are 7 % apart, at ten iterations 11 to 12 % (slips are chance). Elements three times as large as the rod's radius do not show
    // how the motion fades beside it: 22 %, and at ten iterations a third.
    assert!(apart(1) < 0.13 && apart(0) < 0.35, "{told:?}");
}

/// A column of brain with these thresholds, held at its sides.
fn column(insertion: Insertion) -> (TetMesh, Model) {
    let mesh = block([8, 8, 8], 6.0, |_| 4);
    let sides = |p: Point<_>| p.x == 0.0 || p.x == 48.0 || p.y == 0.0 || p.y == 48.0 || p.z == 0.0;
    let mut o = options(physical(), &nodes(&mesh, sides));
    o.materials.insert(4, Material { insertion, ..Material::BRAIN });
    let model = Model::new(&mesh, &o).expect("model");
    (mesh, model)
}

#[test]
fn a_fast_catheter_at_first_touch_feels_no_more_than_the_membrane_bears() {
    // All corners of the face that it meets are held, as beside a burr hole in a coarse mesh.
    let mesh = block([3, 3, 3], 16.0, |_| 4);
    let model = Model::new(&mesh, &options(physical(), &nodes(&mesh, |p| p.z == 0.0 || p.z == 48.0))).expect("model");
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
    let at = |frame: i32| [23.3, 24.7, 50.2 - f64::from(frame) * 40.0 / 60.0];
    let (mut felt, mut went_through) = (Vec::new(), false);
    for frame in 0..12 {
        let report = stepper.step(&model, &mut state, &[rod(at(frame), at(frame + 1))], &FrameSettings::default());
        let tool = &report.tools[0];
        let shaft = Insertion::BRAIN.static_friction_mn_per_mm * tool.inserted_mm + Insertion::BRAIN.cut_force_mn;
        let bears = if went_through { shaft } else { Insertion::BRAIN.puncture_force_mn };
        felt.push((tool.axial_force_mn, bears));
        went_through |= tool.label.is_some();
    }
    assert!(went_through && felt.iter().all(|(f, bears)| *f < bears + 5.0), "{felt:?}");
}

#[test]
fn the_surface_gives_way_at_the_force_or_the_depth_asked_for() {
    let first = |insertion: Insertion| {
        let (_, model) = column(insertion);
        let (_, reports) = insert(&model, [23.3, 24.7], 9.0, 0.0);
        let mut events = reports.iter().flat_map(|r| &r.events);
        let found = events.find_map(|e| match *e {
            Event::Punctured { force_mn, depth_mm, .. } => Some((force_mn, depth_mm)),
            _ => None,
        });
        found.expect("a puncture")
    };
    for asked in [40.0, 90.0] {
        let (force, depth) = first(Insertion { puncture_force_mn: asked, puncture_depth_mm: 50.0, ..Insertion::BRAIN });
        assert!((force - asked).abs() < 1e-3 && depth < 9.0, "{force} mN, {asked} asked for");
    }
    for asked in [2.0, 4.0] {
        let (force, depth) = first(Insertion { puncture_force_mn: 1e6, puncture_depth_mm: asked, ..Insertion::BRAIN });
        assert!(depth >= asked && depth < asked + 0.4, "{depth} mm at {force} mN, {asked} asked for");
    }
}

#[test]
fn a_shaft_sticks_up_to_its_static_friction_and_slides_with_its_dynamic_one() {
    let insertion = Insertion {
        puncture_depth_mm: 1.0,
        cut_force_mn: 0.0,
        static_friction_mn_per_mm: 2.0,
        dynamic_friction_mn_per_mm: 1.0,
        ..Insertion::BRAIN
    };
    let (mesh, model) = column(insertion);
    let (mut state, reports) = insert(&model, [23.3, 24.7], 24.0, 0.0);
    let length = reports.last().expect("a frame").tools[0].inserted_mm;
    let mut stepper = Stepper::new(&model);
    // Drawn back at 1 mm/s.
    let tip = |f: f64| [23.3, 24.7, 24.0 + f / 60.0];
    let mut forces = Vec::new();
    let mut beside = Vec::new();
    for f in 0..300 {
        let motion = rod(tip(f.into()), tip((f + 1).into()));
        let report = stepper.step(&model, &mut state, &[motion], &FrameSettings::default());
        forces.push(-report.tools[0].axial_force_mn);
        beside.push(moved(&mesh, &model, &state, Point::new(24.0, 24.0, 36.0)).z);
    }
    let peak = (0..300).max_by(|&a, &b| forces[a].total_cmp(&forces[b])).expect("a peak");
    let slides = forces[260..].iter().sum::<f64>() / 40.0;
    let left = length - 280.0 / 60.0;
    println!(
        "length {length} peak {} at {peak}, slides {slides}, {:?}",
        forces[peak],
        (beside[0], beside[peak], beside[299])
    );
    assert!(forces[peak] > 1.3 * slides && forces[peak] < 2.0 * length * 1.02, "{} and {slides} mN", forces[peak]);
    assert!((slides / left - 1.0).abs() < 0.1, "{slides} mN over {left} mm");
    assert!(
        beside[peak] - beside[0] > 2.0 * (beside[299] - beside[280]).abs() + 0.1,
        "the tissue follows until it slips"
    );
}

#[test]
fn two_catheters_far_apart_feel_what_each_alone_would_and_leave_nothing_behind() {
    let mesh = block([16, 8, 8], 6.0, |_| 4);
    let sides = |p: Point<_>| p.x == 0.0 || p.x == 96.0 || p.y == 0.0 || p.y == 48.0 || p.z == 0.0;
    let model = Model::new(&mesh, &options(physical(), &nodes(&mesh, sides))).expect("model");
    let depth = |f: f64| 49.0 - if f < 60.0 { f / 3.0 } else { (120.0 - f) / 3.0 };
    let run = |places: &[[f64; 2]]| {
        let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
        let mut felt = Vec::new();
        for f in 0..126 {
            let (a, b) = (depth(f.into()), depth((f + 1).into()));
            let tools: Vec<_> = places.iter().map(|[x, y]| rod([*x, *y, a], [*x, *y, b])).collect();
            let report = stepper.step(&model, &mut state, &tools, &FrameSettings::default());
            felt.push(report.tools.iter().map(|t| (t.axial_force_mn, t.label)).collect::<Vec<_>>());
        }
        for _ in 0..180 {
            stepper.step(&model, &mut state, &[], &FrameSettings::default());
        }
        let left = (0..mesh.vertices.len()).map(|v| model.displacement(&state, v).norm()).fold(0.0, f64::max);
        (felt, left)
    };
    let (left, right) = ([23.3, 24.7], [73.1, 22.9]);
    let (both, after) = run(&[left, right]);
    for (k, place) in [left, right].into_iter().enumerate() {
        let (alone, _) = run(&[place]);
        let largest = alone.iter().map(|f| f[0].0.abs()).fold(0.0, f64::max);
        assert!(largest > 50.0 && alone[59][0].1 == Some(4) && alone[125][0].1.is_none(), "{largest} mN");
        // It sticks and slips, a little earlier or later: not frame by frame.
        let of = |felt: &[Vec<(f64, _)>], k: usize| felt[..60].iter().map(|f| f[k].0).sum::<f64>() / 60.0;
        let (one, two) = (of(&alone, 0), of(&both, k));
        assert!((one / two - 1.0).abs() < 0.05, "rod {k}: {one} mN alone, {two} mN beside the other");
    }
    assert!(after < 0.02, "{after} mm are left after both came out");
}

#[test]
fn the_force_was_no_number_in_a_frame_that_no_step_could_solve() {
    let (_, model) = column(Insertion::BRAIN);
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
    let at = |frame: i32| [23.3, 24.7, 50.0 - 0.1 * f64::from(frame)];
    let thrown = FrameSettings { gravity_mm_s2: [0.0, 0.0, -1e30], ..FrameSettings::default() };
    for frame in 0..160 {
        let settings = if frame < 150 { FrameSettings::default() } else { thrown };
        let report = stepper.step(&model, &mut state, &[rod(at(frame), at(frame + 1))], &settings);
        assert_eq!(report.events.contains(&Event::Held), frame >= 150, "{report:?}");
        assert!(report.tools[0].axial_force_mn.is_finite() && report.residual_mm.is_finite(), "{report:?}");
    }
}
