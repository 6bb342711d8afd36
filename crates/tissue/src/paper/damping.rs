//! Damping of equation (1): it takes the motion that deforms, never the motion of the whole (Müller et al. 2007, 3.5).

use crate::vec3::{V3, add, cross, sub, xyz};

/// Moves all velocities towards the rigid motion with the same momentum and angular momentum by the share `damping` of
/// the way. With fixed nodes there is no free rigid motion: velocities go towards zero.
pub(crate) fn damp(positions: &[[f32; 4]], velocities: &mut [[f32; 4]], mass: &[f32], damping: f32) {
    let held = positions.iter().any(|p| p[3] == 0.0);
    let rigid = if held { None } else { rigid_motion(positions, velocities, mass) };
    for (p, v) in positions.iter().zip(velocities) {
        let target = rigid.as_ref().map_or([0.0; 3], |r| r.at(xyz(*p)));
        for a in 0..3 {
            v[a] += damping * (target[a] - v[a]);
        }
    }
}

struct Rigid {
    centre: V3,
    velocity: V3,
    spin: V3,
}

impl Rigid {
    fn at(&self, p: V3) -> V3 {
        add(self.velocity, cross(self.spin, sub(p, self.centre)))
    }
}

fn rigid_motion(positions: &[[f32; 4]], velocities: &[[f32; 4]], mass: &[f32]) -> Option<Rigid> {
    let total: f64 = mass.iter().map(|&m| f64::from(m)).sum();
    let mean = |of: &[[f32; 4]]| -> V3 {
        core::array::from_fn(|a| {
            (of.iter().zip(mass).map(|(p, &m)| f64::from(p[a]) * f64::from(m)).sum::<f64>() / total) as f32
        })
    };
    let (centre, velocity) = (mean(positions), mean(velocities));
    let (mut inertia, mut momentum) = ([[0f64; 3]; 3], [0f64; 3]);
    for ((p, v), &m) in positions.iter().zip(velocities).zip(mass) {
        let r = sub(xyz(*p), centre).map(f64::from);
        let l = cross(sub(xyz(*p), centre), xyz(*v));
        let r2 = r.iter().map(|x| x * x).sum::<f64>();
        for a in 0..3 {
            momentum[a] += f64::from(m) * f64::from(l[a]);
            for b in 0..3 {
                inertia[a][b] += f64::from(m) * (f64::from(u8::from(a == b)) * r2 - r[a] * r[b]);
            }
        }
    }
    let spin = monro_geometry::Matrix3 { rows: inertia }.inverse()?.apply(momentum).map(|v| v as f32);
    Some(Rigid { centre, velocity, spin })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rigid_motion_is_untouched_and_a_deforming_one_is_damped() {
        let p: Vec<[f32; 4]> =
            [[0., 0., 0.], [2., 0., 0.], [0., 1., 0.], [0., 0., 3.]].map(|q: V3| [q[0], q[1], q[2], 1.0]).to_vec();
        let mass = [1.0, 2.0, 0.5, 1.5];
        let rigid: Vec<[f32; 4]> = p
            .iter()
            .map(|q| {
                let v = add([1.0, -2.0, 0.5], cross([0.3, 0.1, -0.7], xyz(*q)));
                [v[0], v[1], v[2], 0.0]
            })
            .collect();
        let mut v = rigid.clone();
        damp(&p, &mut v, &mass, 0.9);
        for (a, b) in v.iter().flatten().zip(rigid.iter().flatten()) {
            assert!((a - b).abs() < 1e-5);
        }
        let mut v = rigid.clone();
        v[0][0] += 1.0;
        let momentum = |v: &[[f32; 4]]| v.iter().zip(mass).map(|(v, m)| v[0] * m).sum::<f32>();
        let before = momentum(&v);
        damp(&p, &mut v, &mass, 1.0);
        assert!((momentum(&v) - before).abs() < 1e-5);
        assert!((v[0][0] - rigid[0][0]).abs() < 0.5);
    }
}
