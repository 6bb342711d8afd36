//! What attachments are to the equilibrium.

use crate::common::{block, nodes, options, physical};
use monro_geometry::{Point, TetMesh};
use monro_tissue::{
    Attachment, AttachmentKind, Finer, Model, ModelOptions, StaticError, StaticOptions, StaticProblem, StaticSolution,
    Support, equilibrium,
};

fn bar() -> TetMesh {
    block([4, 2, 2], 5.0, |_| 4)
}

fn weight(supports: Vec<Support>) -> StaticProblem {
    StaticProblem { supports, body_force_mn_mm3: [0.0, 0.0, -4e-4], ..StaticProblem::default() }
}

fn solve(o: &ModelOptions, problem: &StaticProblem) -> StaticSolution {
    let finer = StaticOptions { finer: Finer::Times(1), ..StaticOptions::default() };
    let solved = equilibrium(&bar(), o, problem, &finer, &mut || true).expect("solved");
    assert!(solved.converged && solved.tets == 8 * bar().tets.len(), "{solved:?}");
    solved
}

fn attached(kind: AttachmentKind, to: impl Fn(Point<monro_geometry::Patient>) -> bool) -> Vec<Attachment> {
    nodes(&bar(), to).into_iter().map(|node| Attachment { node, kind }).collect()
}

fn supports(displacement_mm: [Option<f64>; 3]) -> Vec<Support> {
    nodes(&bar(), |p| p.x == 0.0).into_iter().map(|node| Support { node, set: 3, displacement_mm }).collect()
}

#[test]
fn a_bar_held_by_attachments_bent_further_where_the_mesh_was_cut_finer_than_one_held_by_supports() {
    let held = solve(&options(physical(), &[]), &weight(supports([Some(0.0); 3])));
    let fixed = solve(&options(physical(), &nodes(&bar(), |p| p.x == 0.0)), &weight(Vec::new()));
    assert_eq!(held.displacement, fixed.displacement);
    assert_eq!(held.reaction, fixed.reaction);
}

#[test]
fn the_refusal_of_guided_nodes_sent_to_the_equilibrium_which_refused_them_too() {
    let mut guided = options(physical(), &nodes(&bar(), |p| p.x == 0.0 && p.y == 0.0));
    guided.attachments = attached(AttachmentKind::Guided { held: [true, false, true] }, |p| p.x == 0.0);
    guided.attachments.extend(attached(AttachmentKind::Guided { held: [false, true, false] }, |p| p.y == 0.0));
    let mut held = supports([Some(0.0), None, Some(0.0)]);
    let sides = nodes(&bar(), |p| p.y == 0.0);
    held.extend(sides.iter().map(|&node| Support { node, set: 3, displacement_mm: [None, Some(0.0), None] }));
    let (one, other) = (solve(&guided, &weight(Vec::new())), solve(&options(physical(), &[]), &weight(held)));
    assert_eq!(one.displacement, other.displacement);
}

#[test]
fn a_support_of_a_fixed_node_counts() {
    let fixed = options(physical(), &nodes(&bar(), |p| p.x == 0.0));
    let moved = solve(&fixed, &weight(supports([None, None, Some(2.0)])));
    let same = solve(&options(physical(), &[]), &weight(supports([Some(0.0), Some(0.0), Some(2.0)])));
    let apart = moved.displacement.iter().zip(&same.displacement).map(|(a, b)| (*a - *b).norm()).fold(0.0, f64::max);
    assert!(apart < 1e-5, "{apart} mm");
}

#[test]
fn springs_bore_nothing_in_the_equilibrium_and_nothing_was_said() {
    let mut o = options(physical(), &nodes(&bar(), |p| p.x == 0.0));
    o.attachments.extend(attached(AttachmentKind::Spring { stiffness_mn_per_mm: 1000.0 }, |p| p.x == 20.0));
    let (problem, how) = (weight(Vec::new()), StaticOptions::default());
    let refused = Some(StaticError::Springs { springs: 9 });
    assert_eq!(equilibrium(&bar(), &o, &problem, &how, &mut || true).err(), refused);
    assert_eq!(Model::new(&bar(), &o).expect("model").equilibrium(&problem, &how, &mut || true).err(), refused);
}
