//! A catheter is pushed along the plan of a case, and everything of interest is read off frame by frame.

use crate::deformation::at;
use crate::tissue_model::{self, ModelSettings};
use crate::{Follower, SessionError, StructureVolumes};
use core::ops::RangeInclusive;
use monro_case::Case;
use monro_geometry::{Patient, Point, Structure, TetMesh};
use monro_guidance::{NeedlePose, Plan, Reading, TargetReading};
use monro_tissue::{Csf, Event, Model, State, StepReport, Stepper, TipShape, Tool, ToolMotion, ToolPose};

pub use monro_tissue::{FrameSettings, Mode};

/// Speeds that can be simulated, mm/s.
pub(crate) const SPEED_MM_S: RangeInclusive<f64> = 0.1..=500.0;

/// Length of the catheter behind its tip, mm (ventricular catheters are 200 to 350 mm long).
pub(crate) const CATHETER_LENGTH_MM: f64 = 250.0;

/// Time over which what is done to the fluid and gravity come on before the insertion, s. At once they would throw the
/// tissue; this is many periods of its slowest motion (a head's: about 8 Hz).
const BRING_ON_S: f64 = 1.0;
/// After that a volume that is drained is waited for, s: the pressure that takes it out is found as it goes.
const DRAIN_S: f64 = 2.0;

/// How the insertion is done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InsertionSettings {
    /// The soft body.
    pub model: ModelSettings,
    /// Speed of the tip, mm/s.
    pub speed_mm_s: f64,
    /// Outer diameter of the catheter, mm (9 Fr is 3 mm).
    pub diameter_mm: f64,
    /// Time the catheter rests at the target before the end, s.
    pub hold_s: f64,
    /// Time stepping of the soft body. What it says of fluid and gravity comes on evenly in a second before the insertion, for
    /// a volume to be drained a second that is over two before it.
    pub frame: FrameSettings,
}

/// One moment of the insertion. Lengths in mm, angles in radians, patient frame (LPS).
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Time since the start at the skin, s; negative while fluid and gravity come on.
    pub time_s: f64,
    /// Tip of the catheter.
    pub tip: Point<Patient>,
    /// Depth of the tip under the entry.
    pub depth_mm: f64,
    /// Distance from the tip to the planned target.
    pub distance_rigid_mm: f64,
    /// Distance from the tip to where the tissue of the target is now.
    pub distance_deformed_mm: f64,
    /// Angle between the catheter and the planned path.
    pub entry_angle_error: f64,
    /// How far the tissue of the target has moved.
    pub target_displacement_mm: f64,
    /// Structure at the tip; `None` outside of the simulated tissue.
    pub at_tip: Option<Structure>,
    /// What the soft body said of this frame.
    pub step: StepReport,
}

/// A running insertion.
#[derive(Debug)]
pub struct Insertion {
    model: Model,
    state: State,
    stepper: Stepper,
    /// Nodes in the order of the mesh, mm from the model's origin.
    nodes: Vec<[f32; 4]>,
    rest: TetMesh,
    plan: Plan,
    target: Follower,
    settings: InsertionSettings,
    tool: Tool,
    frames_done: usize,
    /// Frames over which fluid and gravity come on.
    frames_on: usize,
    /// Frames before the catheter begins to move.
    frames_before: usize,
    frames_in_all: usize,
}

impl Insertion {
    /// Prepares the insertion of a case.
    ///
    /// # Errors
    /// A speed out of range, more fluid to be drained than there is, a mesh that cannot be simulated, a path beside the brain.
    pub fn new(case: &Case, settings: &InsertionSettings) -> Result<Self, SessionError> {
        if !SPEED_MM_S.contains(&settings.speed_mm_s) {
            return Err(SessionError::Speed(settings.speed_mm_s));
        }
        if let Csf::Drained { ml } = settings.frame.csf {
            let holds_ml = StructureVolumes::new(&case.tets).ventricles_ml();
            if ml >= holds_ml {
                return Err(SessionError::Drained { ml, holds_ml });
            }
        }
        let length_mm = case.plan.length();
        let (opening, _) = tissue_model::opening(&case.tets, &case.plan)?;
        let model = Model::new(&case.tets, &tissue_model::options(&case.tets, opening, &settings.model))?;
        let moving = (length_mm / settings.speed_mm_s / settings.frame.dt_s).ceil();
        let resting = (settings.hold_s / settings.frame.dt_s).ceil();
        let [frames_on, frames_before] = frames_before(&settings.frame);
        Ok(Self {
            state: model.rest_state(),
            stepper: Stepper::new(&model),
            nodes: Vec::with_capacity(case.tets.vertices.len()),
            model,
            rest: case.tets.clone(),
            plan: case.plan,
            target: Follower::new(&case.tets, &[case.plan.target()])?,
            settings: *settings,
            tool: Tool { tip: TipShape::Round, radius_mm: settings.diameter_mm / 2.0 },
            frames_done: 0,
            frames_on,
            frames_before,
            frames_in_all: frames_before + (moving + resting) as usize,
        })
    }

    /// Frames done and in all.
    pub const fn progress(&self) -> (usize, usize) {
        (self.frames_done, self.frames_in_all)
    }

    /// Frames before the catheter begins to move: fluid and gravity come on.
    pub const fn before(&self) -> usize {
        self.frames_before
    }

    /// One frame further; `None` at the end.
    ///
    /// # Errors
    /// When the needle pose is not usable.
    pub fn advance(&mut self) -> Result<Option<Frame>, SessionError> {
        if self.frames_done >= self.frames_in_all {
            return Ok(None);
        }
        let motion =
            ToolMotion { tool: self.tool, from: self.pose(self.frames_done), to: self.pose(self.frames_done + 1) };
        let share = (self.frames_done + 1) as f64 / self.frames_on as f64;
        let settings = self.settings.frame.brought_on(share.min(1.0));
        let step = self.stepper.step(&self.model, &mut self.state, &[motion], &settings);
        self.model.nodes_into(&self.state, &mut self.nodes);
        self.frames_done += 1;
        self.read(motion.to, step).map(Some)
    }

    /// The mesh as it is now.
    pub fn deformed(&self) -> TetMesh {
        let origin = self.model.origin();
        let vertices = self.nodes().iter().map(|p| at(p, origin)).collect();
        TetMesh { vertices, ..self.rest.clone() }
    }

    /// The mesh at rest.
    pub const fn rest(&self) -> &TetMesh {
        &self.rest
    }

    /// Moves points that are bound to the case's mesh to where they are now.
    pub fn moves(&self, follower: &mut Follower) {
        follower.follow(&self.stepper, &self.nodes);
    }

    /// Nodes now, mm from [`Insertion::origin`].
    pub fn nodes(&self) -> &[[f32; 4]] {
        &self.nodes
    }

    /// Origin of the nodes.
    pub fn origin(&self) -> Point<Patient> {
        self.model.origin()
    }

    fn pose(&self, frame: usize) -> ToolPose {
        let frame = frame.saturating_sub(self.frames_before);
        let depth = (frame as f64 * self.settings.frame.dt_s * self.settings.speed_mm_s).min(self.plan.length());
        ToolPose { tip: self.plan.at_depth(depth), tail: self.plan.at_depth(depth - CATHETER_LENGTH_MM) }
    }

    fn read(&mut self, pose: ToolPose, step: StepReport) -> Result<Frame, SessionError> {
        let needle = NeedlePose::new(pose.tip, pose.tip - pose.tail)?;
        self.target.follow(&self.stepper, &self.nodes);
        let target_now = self.target.point(0, self.model.origin());
        let reading = Reading::new(&self.plan, &needle);
        let label = step.tools.first().and_then(|t| t.label);
        Ok(Frame {
            time_s: (self.frames_done as f64 - self.frames_before as f64) * self.settings.frame.dt_s,
            tip: pose.tip,
            depth_mm: reading.depth,
            distance_rigid_mm: TargetReading::new(&needle, self.plan.target()).distance,
            distance_deformed_mm: TargetReading::new(&needle, target_now).distance,
            entry_angle_error: reading.entry_angle,
            target_displacement_mm: target_now.distance(self.plan.target()),
            at_tip: label.and_then(Structure::from_label),
            step,
        })
    }
}

/// Frames over which loads come on, and those before the catheter begins to move.
fn frames_before(settings: &FrameSettings) -> [usize; 2] {
    let frames = |s: f64| (s / settings.dt_s).ceil() as usize;
    let loaded = settings.csf != Csf::AtRest || settings.gravity_mm_s2 != [0.0; 3];
    let bring_on = if loaded { frames(BRING_ON_S) } else { 0 };
    let drain = if matches!(settings.csf, Csf::Drained { .. }) { frames(DRAIN_S) } else { 0 };
    [bring_on, bring_on + drain]
}

impl Frame {
    /// Whether the soft body could not take this step at all: it was taken back to before it, so nothing was felt.
    pub fn held(&self) -> bool {
        self.step.events.contains(&Event::Held)
    }

    /// Force of the tissue against the advance, mN (without a unit in paper mode); `None` where nothing was felt.
    pub fn axial_force_mn(&self) -> Option<f64> {
        self.step.tools.first().filter(|_| !self.held()).map(|t| t.axial_force_mn)
    }

    /// Whether the tip is in a ventricle: cerebrospinal fluid drips.
    pub fn in_ventricle(&self) -> bool {
        self.at_tip.is_some_and(Structure::is_ventricle)
    }

    /// Punctures of this frame: (depth of the dimple in mm, axial force in mN, label entered).
    pub fn punctures(&self) -> impl Iterator<Item = (f64, f64, u16)> + '_ {
        self.step.events.iter().filter_map(|e| match e {
            Event::Punctured { depth_mm, force_mn, to, .. } => Some((*depth_mm, *force_mn, *to)),
            _ => None,
        })
    }
}
