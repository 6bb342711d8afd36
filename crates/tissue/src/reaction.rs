//! Forces of the attachments on the tissue.

use crate::csf::FluidSpace;
use crate::physical::elastic::Tangent;
use crate::vec3::{V3, xyz};
use crate::{FrameSettings, Model, State};
use monro_geometry::d3::D3;
use monro_geometry::{Patient, Vector};

impl Model {
    /// Force of the attachments on each vertex of the mesh, mN: what holds a fixed vertex against elasticity, gravity and
    /// the fluid, what a spring pulls and a wall presses with; zero at free vertices. `None` in paper mode, whose forces have no unit. The
    /// energy is taken at the current positions, so the forces are those of a state at rest; viscous ones are left out, and so is what a
    /// tool presses on held vertices themselves.
    pub fn reactions(&self, state: &State, settings: &FrameSettings) -> Option<Vec<Vector<Patient>>> {
        let elastic = self.elastic()?;
        let x: Vec<D3> = state.positions.iter().map(|&p| xyz(p).map(f64::from)).collect();
        let mut force = Vec::new();
        elastic.gradient(&x, &mut force, &mut Tangent::default());
        for (f, m) in force.iter_mut().zip(&self.mass) {
            (0..3).for_each(|a| f[a] -= f64::from(*m) * settings.gravity_mm_s2[a]);
        }
        let fluid = FluidSpace::new(self);
        let pressure = fluid.under(state.csf_kpa, settings.gravity_mm_s2);
        let mut push = |node: u32, push: V3| (0..3).for_each(|a| force[node as usize][a] -= f64::from(push[a]));
        fluid.add_forces(self, &state.positions, &pressure, &mut push);
        fluid.add_weight(self, &state.positions, &pressure, push);
        let mut at = Vec::new();
        self.abutments.follow(&state.positions, &self.rest, &mut at);
        let pressed = self.abutments.pressed(&at, &self.rest, &force);
        let mut held: Vec<D3> = force;
        for (f, p) in held.iter_mut().zip(&self.rest) {
            if p[3] != 0.0 {
                *f = [0.0; 3];
            }
        }
        for (node, press) in pressed {
            (0..3).for_each(|a| held[node as usize][a] += press[a]);
        }
        for t in &self.tethers {
            let (now, rest) = (x[t.node as usize], elastic.rest[t.node as usize]);
            (0..3).for_each(|a| held[t.node as usize][a] += f64::from(t.stiffness) * (rest[a] - now[a]));
        }
        Some(self.number.iter().map(|&n| Vector::from_array(held[n as usize])).collect())
    }
}
