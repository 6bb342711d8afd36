//! Damping of equation (1): it takes the motion that deforms, never the motion of the whole (Müller et al. 2007, 3.5).

use crate::rigid::Rigid;
use crate::vec3::xyz;

/// Moves all velocities towards the rigid motion with the same momentum and angular momentum by the share `damping` of
/// the way. With fixed nodes there is no free rigid motion: velocities go towards zero.
pub(crate) fn damp(positions: &[[f32; 4]], velocities: &mut [[f32; 4]], damping: f32) {
    let held = positions.iter().any(|p| p[3] == 0.0);
    let rigid = if held { None } else { Rigid::of(positions, |i| xyz(velocities[i])) };
    for (p, v) in positions.iter().zip(velocities) {
        let target = rigid.as_ref().map_or([0.0; 3], |r| r.at(xyz(*p)));
        for a in 0..3 {
            v[a] += damping * (target[a] - v[a]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vec3::{V3, add, cross};

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
