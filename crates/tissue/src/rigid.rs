//! The rigid part of a motion of the whole.

use crate::vec3::{V3, add, cross, sub, xyz};

/// A rigid motion: of each point, velocity or way.
pub(crate) struct Rigid {
    centre: V3,
    velocity: V3,
    spin: V3,
}

impl Rigid {
    /// The rigid motion with the momentum and angular momentum of `motion`; none where points lie in a line. No vertex is
    /// held: masses are one over the fourth component of the positions.
    pub(crate) fn of(positions: &[[f32; 4]], motion: impl Fn(usize) -> V3) -> Option<Self> {
        let mass = |p: &[f32; 4]| 1.0 / f64::from(p[3]);
        let total: f64 = positions.iter().map(mass).sum();
        let mean = |of: &dyn Fn(usize) -> V3| -> V3 {
            let (mut sum, masses) = ([0f64; 3], positions.iter().map(mass));
            for (i, m) in masses.enumerate() {
                of(i).iter().zip(&mut sum).for_each(|(v, s)| *s += f64::from(*v) * m);
            }
            sum.map(|s| (s / total) as f32)
        };
        let (centre, velocity) = (mean(&|i| xyz(positions[i])), mean(&motion));
        let (mut inertia, mut momentum) = ([[0f64; 3]; 3], [0f64; 3]);
        for (i, p) in positions.iter().enumerate() {
            let (m, r) = (mass(p), sub(xyz(*p), centre));
            let l = cross(r, motion(i));
            let r = r.map(f64::from);
            let r2 = r.iter().map(|x| x * x).sum::<f64>();
            for a in 0..3 {
                momentum[a] += m * f64::from(l[a]);
                for b in 0..3 {
                    inertia[a][b] += m * (f64::from(u8::from(a == b)) * r2 - r[a] * r[b]);
                }
            }
        }
        let spin = monro_geometry::Matrix3 { rows: inertia }.inverse()?.apply(momentum).map(|v| v as f32);
        Some(Self { centre, velocity, spin })
    }

    /// Motion of a point.
    pub(crate) fn at(&self, p: V3) -> V3 {
        add(self.velocity, cross(self.spin, sub(p, self.centre)))
    }
}
