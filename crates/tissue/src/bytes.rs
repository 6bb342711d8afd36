//! Bytes that a model and its memory to work in take, by what they are for: counted from the arrays themselves, since what a
//! process holds also depends on what it held before.

use crate::model::Solver;
use crate::{Model, State, Stepper};

/// Bytes of an array, with what it keeps free.
pub(crate) fn of<T>(array: &Vec<T>) -> usize {
    array.capacity() * size_of::<T>()
}

/// Something for which memory is held, and its bytes.
pub type Held = (&'static str, usize);

impl Model {
    /// Bytes that the model takes, by what they are for.
    pub fn bytes(&self) -> Vec<Held> {
        let mut out = vec![
            ("nodes", of(&self.rest) + of(&self.mass) + of(&self.number)),
            ("attachments", of(&self.tethers) + of(&self.guides) + self.abutments.bytes()),
            ("elements", of(&self.tets) + of(&self.region) + of(&self.tet_number)),
            ("membranes", self.membranes.bytes()),
            ("sphere tree", self.tree.bytes()),
            ("volumes", self.volumes.bytes()),
        ];
        match &self.solver {
            Solver::Paper(p) => out.push(("constraints", p.bytes())),
            Solver::Physical(p) => out.extend(p.descent.bytes()),
        }
        out
    }
}

impl State {
    /// Bytes of its arrays over the nodes.
    pub fn bytes(&self) -> usize {
        of(&self.positions) + of(&self.velocities) + of(&self.pressure)
    }
}

impl Stepper {
    /// Bytes of the memory to work in, by what they are for; all of it is there after a first step with a tool.
    pub fn bytes(&self) -> Vec<Held> {
        let copies = self.backup.bytes() + of(&self.previous) + of(&self.tethers) + of(&self.loads) + of(&self.against);
        let checks = of(&self.growth) + self.crushed.bytes() + self.nodes.bytes();
        vec![
            ("copies of the state, loads", copies),
            ("spheres", self.spheres.bytes()),
            ("solver's memory", self.paper.bytes() + self.descent.bytes()),
            ("contact", self.found.bytes() + of(&self.couplings) + of(&self.rooms)),
            ("fluid, checks", self.fluid.bytes() + checks),
        ]
    }
}
