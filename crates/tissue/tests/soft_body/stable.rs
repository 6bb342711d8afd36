//! Equilibria in which a body stays.

use crate::common::{block, material, nodes};
use crate::equilibrium::held;
use monro_geometry::TetMesh;
use monro_tissue::{Finer, StaticOptions, StaticProblem, Support, equilibrium};

/// A bar of 100 x 8 x 8 mm, clamped at both ends, which come nearer by `mm`.
fn column(mm: f64) -> (TetMesh, StaticProblem) {
    let mesh = block([25, 2, 2], 4.0, |_| 4);
    let mut problem = StaticProblem::default();
    problem.supports.extend(held(nodes(&mesh, |p| p.x == 0.0), [Some(0.0); 3]));
    let moved = held(nodes(&mesh, |p| p.x == 100.0), [Some(-mm), Some(0.0), Some(0.0)]);
    problem.supports.extend(moved.map(|s| Support { set: 1, ..s }));
    (mesh, problem)
}

/// The straight bar is in balance beyond the force at which it buckles, too; from a coarse mesh, on which it had not, Newton's
/// method went there: 42 % too much force, converged on two meshes. Euler's load with both ends clamped is `4 pi^2 E I / L^2`, less
/// for shear and for the strain before; once buckled the force hardly grows.
#[test]
fn a_bar_beyond_the_force_that_it_bears_was_straight_and_called_converged() {
    let euler = 4.0 * core::f64::consts::PI.powi(2) * 3.0 * (8f64.powi(4) / 12.0) / 100f64.powi(2);
    let finer = StaticOptions { finer: Finer::Times(1), ..StaticOptions::default() };
    for mm in [2.5, 2.8, 3.0] {
        let (mesh, problem) = column(mm);
        let solved = equilibrium(&mesh, &material(0.3), &problem, &finer, &mut || true).expect("solved");
        let force = solved.sets[&0].x;
        let aside = solved.displacement.iter().map(|d| d.y.hypot(d.z)).fold(0.0, f64::max);
        assert!(solved.converged && !solved.unstable, "{mm} mm: {}", solved.residual);
        assert!(force < 1.15 * euler && force > 0.8 * euler, "{mm} mm: {force} of {euler} mN");
        assert!(aside > 2.0, "{mm} mm: {aside} mm aside");
    }
    // Well below it stays straight.
    let (mesh, problem) = column(1.0);
    let solved = equilibrium(&mesh, &material(0.3), &problem, &finer, &mut || true).expect("solved");
    let aside = solved.displacement.iter().map(|d| d.y.hypot(d.z)).fold(0.0, f64::max);
    assert!(solved.converged && !solved.unstable && aside < 0.1, "{aside} mm aside");
}

/// Time that was up while it was looked for whether the body stays left an answer without a word.
#[test]
fn an_answer_cut_short_before_it_was_known_to_stay_was_as_good_as_any() {
    let (mesh, problem) = column(1.0);
    let given = StaticOptions { finer: Finer::Times(0), ..StaticOptions::default() };
    let solve = |most: usize| {
        let mut asked = 0;
        let mut keep_going = || {
            asked += 1;
            asked <= most
        };
        let solved = equilibrium(&mesh, &material(0.3), &problem, &given, &mut keep_going).expect("solved");
        (solved, asked)
    };
    let (whole, asked) = solve(usize::MAX);
    assert!(whole.converged && !whole.unlooked);
    // The last products show that it stays.
    let (cut, _) = solve(asked - 5);
    assert!(cut.converged && cut.unlooked && !cut.unstable, "{asked}: {}", cut.residual);
}
