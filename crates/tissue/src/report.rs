//! What a step gives back.

use monro_geometry::{Patient, Point, Vector};

/// Result of one step.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StepReport {
    /// What happened, in order.
    pub events: Vec<Event>,
    /// One entry per tool, in the order of the tools.
    pub tools: Vec<ToolReport>,
    /// Faces in contact with a tool at the end of the step.
    pub contacts: usize,
    /// Substeps taken (more than asked for when a tool is fast or after a rollback).
    pub substeps: u32,
    /// Times the step was taken back and tried again with half the time step.
    pub rollbacks: u32,
    /// Elements with negative volume at the end of the step.
    pub inverted: usize,
    /// Largest displacement of a node from rest, mm.
    pub max_displacement_mm: f64,
    /// Whole volume against rest: 0.01 is one per cent more.
    pub volume_change: f64,
    /// Largest motion of a node in the last iteration, mm: what the solver still had to say.
    pub residual_mm: f64,
    /// Pressure in the middle of the fluid regions above that at rest, kPa (physical mode).
    pub csf_kpa: f64,
    /// Volume of the fluid regions above that at rest, ml: fluid at rest gives way to a tool by a little.
    pub csf_change_ml: f64,
    /// Nodes the solver worked on in the last substep.
    pub active_nodes: usize,
}

impl StepReport {
    /// Whether not even the shortest step could be solved: the tissue was taken back to before it, so nothing was felt.
    pub fn held(&self) -> bool {
        self.events.contains(&Event::Held)
    }

    /// Force against the advance of the first tool, mN (without a unit in paper mode); `None` where nothing was felt.
    pub fn axial_force_mn(&self) -> Option<f64> {
        self.tools.first().filter(|_| !self.held()).map(|t| t.axial_force_mn)
    }
}

/// What one tool felt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToolReport {
    /// Force of the tissue on the tool at the end of the step, mN, patient frame. Only physical mode gives physical forces.
    pub force_mn: Vector<Patient>,
    /// Component of the force against the advance of the tool, mN.
    pub axial_force_mn: f64,
    /// Label the tip is in; `None` outside of the tissue.
    pub label: Option<u16>,
    /// Length of shaft held by tissue, mm.
    pub inserted_mm: f64,
    /// Whether the tip presses on a membrane that has not yielded.
    pub dimpling: bool,
}

/// Something that happened to a tool or to the solution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Event {
    /// The tip went through a membrane.
    Punctured {
        /// Index of the tool.
        tool: usize,
        /// Label it left; `None` for the outside.
        from: Option<u16>,
        /// Label it entered.
        to: u16,
        /// The tip.
        point: Point<Patient>,
        /// Axial force just before, mN.
        force_mn: f64,
        /// Depth of the dimple just before, mm.
        depth_mm: f64,
    },
    /// The tool was seen for the first time, or put from elsewhere, with its tip in the tissue: nothing was felt on its way.
    Found {
        /// Index of the tool.
        tool: usize,
        /// Label the tip is in.
        label: u16,
        /// The tip.
        point: Point<Patient>,
    },
    /// The tip passed from one fluid to another: no membrane in between.
    Entered {
        /// Index of the tool.
        tool: usize,
        /// Label it left.
        from: u16,
        /// Label it entered.
        to: u16,
        /// The tip.
        point: Point<Patient>,
    },
    /// The tip went back out of a region, or never came into it: its wall had yielded, but was slack and did not draw back over
    /// the tip.
    Withdrawn {
        /// Index of the tool.
        tool: usize,
        /// Label it left.
        from: u16,
        /// Label it is in now; `None` outside.
        to: Option<u16>,
    },
    /// The step led to a state that is not finite or inverted; it was taken back and tried with half the time step.
    RolledBack {
        /// Substeps of the failed attempt.
        substeps: u32,
        /// Elements inverted in it; `None` when coordinates were not finite.
        inverted: Option<usize>,
    },
    /// Even the shortest steps failed: the tissue was taken back to before the step, brought to a stop, and moved a tenth of
    /// the way to its rest shape, so that it comes free.
    Held,
    /// A tool's pose is not finite or has no length, or the tool no radius, or its cone no angle below a right one: it was
    /// ignored.
    BadPose {
        /// Index of the tool.
        tool: usize,
    },
}
