//! Prediction, equations (1) and (2). Damping takes the motion that deforms, never the motion of the whole (Müller et al.
//! 2007, 3.5).

use crate::fast::{Kernel, Lanes};
use crate::rigid::Rigid;
use crate::vec3::xyz;

/// The rigid motion with the momentum and angular momentum of all velocities. With fixed nodes there is no free rigid motion:
/// velocities go towards zero.
pub(crate) fn kept_motion(positions: &[[f32; 4]], velocities: &[[f32; 4]]) -> Option<Rigid> {
    let held = positions.iter().any(|p| p[3] == 0.0);
    if held { None } else { Rigid::of(positions, |i| xyz(velocities[i])) }
}

/// What moves nodes before any constraint does.
#[derive(Clone, Copy)]
pub(crate) struct Inertia<'a> {
    pub(crate) kept: Option<&'a Rigid>,
    /// Share of the way to the motion that is kept.
    pub(crate) damping: f32,
    /// Velocity that loads add, mm/s.
    pub(crate) kick: [f32; 3],
    pub(crate) dt: f32,
}

/// Moves nodes on by inertia.
pub(crate) struct Predict<'a> {
    pub(crate) inertia: Inertia<'a>,
    pub(crate) positions: &'a mut [[f32; 4]],
    pub(crate) velocities: &'a mut [[f32; 4]],
}

impl Kernel for Predict<'_> {
    type Out = ();

    /// In words that the compiler makes as wide as it may.
    #[inline(always)]
    fn run<V: Lanes>(self) {
        let Inertia { kept, damping, kick: [x, y, z], dt } = self.inertia;
        for (p, v) in self.positions.iter_mut().zip(self.velocities) {
            let [a, b, c] = kept.map_or([0.0; 3], |k| k.at(xyz(*p)));
            let target = [a, b, c, 0.0];
            let damped: [f32; 4] = core::array::from_fn(|a| v[a] + damping * (target[a] - v[a]));
            let kicked = [damped[0] + x, damped[1] + y, damped[2] + z, damped[3]];
            // Held nodes have no velocity.
            if p[3] > 0.0 {
                *v = kicked;
                *p = core::array::from_fn(|a| p[a] + kicked[a] * dt);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fast::plain;
    use crate::vec3::{V3, add, cross};

    fn damp(p: &[[f32; 4]], v: &mut [[f32; 4]], damping: f32) {
        let kept = kept_motion(p, v);
        let inertia = Inertia { kept: kept.as_ref(), damping, kick: [0.0; 3], dt: 0.1 };
        let mut moved = p.to_vec();
        plain(Predict { inertia, positions: &mut moved, velocities: v });
        for ((before, after), v) in p.iter().zip(moved).zip(v) {
            assert!((0..4).all(|a| (after[a] - (before[a] + 0.1 * v[a])).abs() < 1e-6));
        }
    }

    #[test]
    fn a_rigid_motion_is_untouched_and_a_deforming_one_is_damped() {
        let mass = [1.0, 2.0, 0.5, 1.5];
        let p: [V3; 4] = [[0., 0., 0.], [2., 0., 0.], [0., 1., 0.], [0., 0., 3.]];
        let p: Vec<[f32; 4]> = p.iter().zip(mass).map(|(q, m)| [q[0], q[1], q[2], 1.0 / m]).collect();
        let rigid: Vec<[f32; 4]> = p
            .iter()
            .map(|q| {
                let v = add([1.0, -2.0, 0.5], cross([0.3, 0.1, -0.7], xyz(*q)));
                [v[0], v[1], v[2], 0.0]
            })
            .collect();
        let mut v = rigid.clone();
        damp(&p, &mut v, 0.9);
        for (a, b) in v.iter().flatten().zip(rigid.iter().flatten()) {
            assert!((a - b).abs() < 1e-5);
        }
        let mut v = rigid.clone();
        v[0][0] += 1.0;
        let momentum = |v: &[[f32; 4]]| v.iter().zip(mass).map(|(v, m)| v[0] * m).sum::<f32>();
        let before = momentum(&v);
        damp(&p, &mut v, 1.0);
        assert!((momentum(&v) - before).abs() < 1e-5);
        assert!((v[0][0] - rigid[0][0]).abs() < 0.5);
    }
}
