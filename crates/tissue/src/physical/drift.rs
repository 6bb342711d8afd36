//! Where nodes go by themselves, in words that the compiler makes as wide as it may.

use crate::fast::{Kernel, Lanes};

/// The way of nodes by inertia, and where loads would take them on it.
pub(super) struct Drift<'a> {
    pub(super) positions: &'a mut [[f32; 4]],
    pub(super) velocities: &'a [[f32; 4]],
    pub(super) targets: &'a mut [[f32; 4]],
    pub(super) dt: f32,
    /// Way that loads add, mm.
    pub(super) fall: [f32; 3],
}

impl Kernel for Drift<'_> {
    type Out = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let [x, y, z] = self.fall;
        for ((p, v), target) in self.positions.iter_mut().zip(self.velocities).zip(self.targets) {
            // The sweeps start without the fall: at rest under a load they then have nothing to undo.
            let moved: [f32; 4] = core::array::from_fn(|a| p[a] + self.dt * v[a]);
            let fallen = [moved[0] + x, moved[1] + y, moved[2] + z, moved[3]];
            if p[3] > 0.0 {
                (*p, *target) = (moved, fallen);
            }
        }
    }
}
