//! What changes from step to step.

use crate::contact::ToolState;

/// Positions, velocities and the memory of the tools. Made by `Model::rest_state`, changed by `Stepper::step`; a clone is
/// a snapshot to go back to. Nodes stand in the model's own order: read them through `Model::position`.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// x, y, z in mm from the model's origin, and the inverse mass in 1/kg (0 for a node that is held).
    pub(crate) positions: Vec<[f32; 4]>,
    /// mm/s; the fourth component is not used.
    pub(crate) velocities: Vec<[f32; 4]>,
    /// Nodal pressure of physical mode, kPa.
    pub(crate) pressure: Vec<f32>,
    /// Pressure of the fluid above that at rest, kPa.
    pub(crate) csf_kpa: f64,
    /// One per tool.
    pub(crate) tools: Vec<ToolState>,
    /// Frames in a row that ended with crushed elements though nothing acted.
    pub(crate) knotted: u32,
    /// Time since rest, s.
    pub(crate) time_s: f64,
}

impl State {
    /// Time since the state of rest, s.
    pub const fn time_s(&self) -> f64 {
        self.time_s
    }

    /// Copies another state into this one without allocating when the sizes agree.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.positions.clone_from(&other.positions);
        self.velocities.clone_from(&other.velocities);
        self.copy_rest_from(other);
    }

    /// Copies what is not of each node by itself.
    pub(crate) fn copy_rest_from(&mut self, other: &Self) {
        self.pressure.clone_from(&other.pressure);
        self.csf_kpa = other.csf_kpa;
        self.tools.clone_from(&other.tools);
        self.knotted = other.knotted;
        self.time_s = other.time_s;
    }
}
