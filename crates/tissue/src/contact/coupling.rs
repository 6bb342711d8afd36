//! The one way in which a tool acts on the tissue.

use crate::vec3::{V3, add, axpy, dot, norm, scale, shift, sub, xyz};

/// What a coupling does to its material point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Rule {
    /// Keeps the point beyond a plane: `normal . x >= bound`. One-sided.
    Push { normal: V3, bound: f32 },
    /// Ties the point to a target: fully across the axis, along it up to the force `limit` (mN).
    Hold { axis: V3, target: V3, limit: f32 },
}

/// A material point under the influence of a tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Coupling {
    pub(crate) nodes: [u32; 4],
    /// Share of each node; a face has zero for its fourth.
    pub(crate) weights: [f32; 4],
    pub(crate) rule: Rule,
    /// Penalty stiffness, mN/mm: far above that of the tissue.
    pub(crate) stiffness: f32,
    /// Index of the tool.
    pub(crate) tool: u32,
    /// Index of the anchor this comes from (`Hold`), or the region behind the membrane (`Push`).
    pub(crate) source: u32,
    /// Whether it touches the end of the tool.
    pub(crate) tip: bool,
    /// Force on the tissue, mN; set by the solver.
    pub(crate) force: V3,
}

impl Coupling {
    /// Current place of the material point.
    pub(crate) fn point(&self, positions: &[[f32; 4]]) -> V3 {
        self.point_from(positions, 0)
    }

    /// As [`Coupling::point`], from positions that begin with the node `first`.
    pub(crate) fn point_from(&self, positions: &[[f32; 4]], first: usize) -> V3 {
        let mut x = [0.0; 3];
        for (&n, &w) in self.nodes.iter().zip(&self.weights) {
            x = axpy(x, w, xyz(positions[n as usize - first]));
        }
        x
    }
}

/// No vertex goes further in a pass than this many times what is missing of its coupling. The weights of a face that is free
/// make it 1.4 at most where masses are equal; where two of its corners are held and the point lies between them, the third
/// would go hundreds of times as far.
const FURTHEST: f32 = 4.0;

/// One Gauss-Seidel pass over the couplings as compliant position constraints (XPBD, Macklin et al. 2016): `force` holds
/// the multiplier over the square of the time step. Starting a substep, all forces must be zero.
pub(crate) fn project(couplings: &mut [Coupling], positions: &mut [[f32; 4]], dt: f32) {
    for c in couplings {
        let mobility: f32 = c.nodes.iter().zip(&c.weights).map(|(&n, &w)| w * w * positions[n as usize][3]).sum();
        if mobility <= 0.0 {
            continue;
        }
        let x = c.point(positions);
        let compliance = 1.0 / c.stiffness;
        let denominator = mobility * dt * dt + compliance;
        let gap = match c.rule {
            Rule::Push { normal, bound } => scale(normal, bound - dot(normal, x)),
            Rule::Hold { target, .. } => sub(target, x),
        };
        let missing = axpy(gap, -compliance, c.force);
        let wanted = axpy(c.force, 1.0 / denominator, missing);
        let change = sub(limited(c.rule, wanted), c.force);
        let swiftest = c.nodes.iter().zip(&c.weights).map(|(&n, &w)| w * positions[n as usize][3]).fold(0.0, f32::max);
        let way = swiftest * dt * dt * norm(change);
        let most = FURTHEST * norm(missing);
        let change = if way > most { scale(change, most / way) } else { change };
        c.force = add(c.force, change);
        let impulse = scale(change, dt * dt);
        for (&n, &w) in c.nodes.iter().zip(&c.weights) {
            let p = &mut positions[n as usize];
            shift(p, w * p[3], impulse);
        }
    }
}

/// The nearest force that the rule allows.
fn limited(rule: Rule, force: V3) -> V3 {
    match rule {
        Rule::Push { normal, .. } => scale(normal, dot(normal, force).max(0.0)),
        Rule::Hold { axis, limit, .. } => {
            let along = dot(force, axis);
            add(force, scale(axis, along.clamp(-limit, limit) - along))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn coupling(rule: Rule) -> Coupling {
        Coupling {
            nodes: [0, 1, 2, 3],
            weights: [0.4, 0.3, 0.2, 0.1],
            rule,
            stiffness: 1e6,
            tool: 0,
            source: 0,
            tip: false,
            force: [0.0; 3],
        }
    }

    fn corners() -> Vec<[f32; 4]> {
        vec![[0., 0., 0., 100.], [1., 0., 0., 100.], [0., 1., 0., 100.], [0., 0., 1., 100.]]
    }

    #[test]
    fn a_held_point_goes_to_its_target_and_the_impulse_moves_the_masses() {
        let (target, dt) = ([2.0, 1.0, -1.0], 0.01f32);
        let mut c = [coupling(Rule::Hold { axis: [1.0, 0.0, 0.0], target, limit: f32::INFINITY })];
        let (mut p, before) = (corners(), corners());
        for _ in 0..3 {
            project(&mut c, &mut p, dt);
        }
        let x = c[0].point(&p);
        assert!((0..3).all(|a| (x[a] - target[a]).abs() < 1e-3), "{x:?}");
        // Momentum given to the nodes = force times the square of the time step.
        for a in 0..3 {
            let moved: f32 = p.iter().zip(&before).map(|(q, b)| (q[a] - b[a]) / b[3]).sum();
            assert!((moved - c[0].force[a] * dt * dt).abs() < 1e-5);
        }
    }

    #[test]
    fn friction_limits_the_pull_along_the_axis_only() {
        let mut c = [coupling(Rule::Hold { axis: [1.0, 0.0, 0.0], target: [5.0, 3.0, 0.0], limit: 2.0 })];
        let mut p = corners();
        for _ in 0..5 {
            project(&mut c, &mut p, 0.01);
        }
        assert!((c[0].force[0] - 2.0).abs() < 1e-5);
        assert!((c[0].point(&p)[1] - 3.0).abs() < 1e-3);
    }

    /// It went 81 mm off, and the frame was taken back.
    #[test]
    fn the_free_corner_of_a_face_that_is_held_was_thrown_away() {
        let weights = [0.48, 0.516, 0.004, 0.0];
        let rule = Rule::Push { normal: [0.0, 0.0, 1.0], bound: 0.3 };
        let mut c = [Coupling { nodes: [0, 1, 2, 0], weights, stiffness: f32::INFINITY, ..coupling(rule) }];
        let mut p = corners();
        (p[0][3], p[1][3]) = (0.0, 0.0);
        let before = p[2];
        for _ in 0..10 {
            project(&mut c, &mut p, 0.01);
        }
        let way = p[2][2] - before[2];
        assert!(way > 0.0 && way < 10.0 * FURTHEST * 0.3, "{way} mm");
        // The other corners are held, and one that is free goes where it is to go.
        assert_eq!(p[..2], corners().iter().map(|p| [p[0], p[1], p[2], 0.0]).collect::<Vec<_>>()[..2]);
        let mut free = corners();
        c[0].force = [0.0; 3];
        project(&mut c, &mut free, 0.01);
        assert!((c[0].point(&free)[2] - 0.3).abs() < 1e-5);
    }

    #[test]
    fn a_plane_pushes_and_never_pulls() {
        for (bound, moves) in [(1.0, true), (-1.0, false)] {
            let mut c = [coupling(Rule::Push { normal: [0.0, 0.0, 1.0], bound })];
            let mut p = corners();
            project(&mut c, &mut p, 0.01);
            assert_eq!(c[0].force[2] > 0.0, moves);
            assert!(c[0].point(&p)[2] >= bound - 1e-3);
        }
    }
}
