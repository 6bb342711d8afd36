//! A catheter is pushed along the plan of a case, and everything of interest is read off frame by frame.

use crate::deformation::at;
use crate::schedule::Schedule;
use crate::tissue_model::{self, ModelSettings};
use crate::{Follower, Loads, SessionError, StructureVolumes};
use core::ops::RangeInclusive;
use monro_case::Case;
use monro_geometry::{Patient, Point, Structure, TetMesh};
use monro_guidance::{NeedlePose, Plan, Reading, TargetReading};
use monro_tissue::{Event, Model, State, StepReport, Stepper, TipShape, Tool, ToolMotion, ToolPose};

pub use monro_tissue::{Csf, FrameSettings, Mode};

/// Speeds that can be simulated, mm/s.
pub(crate) const SPEED_MM_S: RangeInclusive<f64> = 0.1..=500.0;

/// Diameters that can be simulated, mm: from a microelectrode's guide to twice the thickest ventricular catheter.
pub(crate) const DIAMETER_MM: RangeInclusive<f64> = 0.5..=8.0;
/// Outer diameter of a usual ventricular catheter, mm (9 Fr).
pub const CATHETER_MM: f64 = 3.0;
/// Paths are held against each other in such steps, mm.
const APART_STEP_MM: f64 = 0.5;

/// How the insertion is done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InsertionSettings {
    /// The soft body.
    pub model: ModelSettings,
    /// Speed of the tip, mm/s.
    pub speed_mm_s: f64,
    /// Outer diameter of the catheter, mm (9 Fr is 3 mm).
    pub diameter_mm: f64,
    /// Shape of its tip.
    pub tip: TipShape,
    /// Time the catheter rests at the target, s, and after it has been drawn out.
    pub hold_s: f64,
    /// Whether it is drawn out again, at the speed at which it went in.
    pub withdraw: bool,
    /// Time stepping of the soft body; frames are shorter where a thin catheter goes so fast that it would be taken for one that
    /// was put elsewhere ([`monro_tissue::Tool::farthest_mm`]). What it says of fluid and gravity comes on evenly in a second that is over half a second
    /// before the insertion, for a volume to be drained two before it.
    pub frame: FrameSettings,
}

/// Share of the farthest way of a tool in a frame that is used.
const WITHIN: f64 = 0.99;

impl InsertionSettings {
    /// The catheter.
    pub(crate) fn tool(&self) -> Tool {
        Tool { tip: self.tip, radius_mm: self.diameter_mm / 2.0 }
    }

    /// With frames in which the catheter goes all its way through tissue.
    fn gone_through(&self) -> Self {
        let longest_s = WITHIN * self.tool().farthest_mm() / self.speed_mm_s;
        Self { frame: FrameSettings { dt_s: self.frame.dt_s.min(longest_s), ..self.frame }, ..*self }
    }
}

/// One moment of the insertion. Lengths in mm, angles in radians, patient frame (LPS).
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Time since the start at the skin, s; negative while fluid and gravity come on and other catheters go in.
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
    schedule: Schedule,
    motions: Vec<ToolMotion>,
    frames_done: usize,
}

impl Insertion {
    /// Prepares the insertion of a case. Other catheters, alike, go in along the paths `beside` before, one after the other,
    /// and stay.
    ///
    /// # Errors
    /// A speed or diameter out of range, a load that cannot be put on, a mesh that cannot be simulated, a path
    /// beside the brain, paths through each other.
    pub fn new(case: &Case, beside: &[Plan], settings: &InsertionSettings) -> Result<Self, SessionError> {
        if !SPEED_MM_S.contains(&settings.speed_mm_s) {
            return Err(SessionError::Speed(settings.speed_mm_s));
        }
        if !DIAMETER_MM.contains(&settings.diameter_mm) {
            return Err(SessionError::Diameter(settings.diameter_mm));
        }
        let settings = &settings.gone_through();
        Loads::of(&settings.frame).check_on(settings.model.mode, StructureVolumes::new(&case.tets).ventricles_ml())?;
        let openings = openings(case, beside)?;
        stand_apart(&case.plan, beside, settings.diameter_mm)?;
        let model = Model::new(&case.tets, &tissue_model::options(case, &openings, &settings.model))?;
        Ok(Self {
            state: model.rest_state(),
            stepper: Stepper::new(&model),
            nodes: Vec::with_capacity(case.tets.vertices.len()),
            model,
            rest: case.tets.clone(),
            plan: case.plan,
            target: Follower::new(&case.tets, &[case.plan.target()])?,
            settings: *settings,
            schedule: Schedule::new(&case.plan, beside, settings),
            motions: Vec::with_capacity(1 + beside.len()),
            frames_done: 0,
        })
    }

    /// Frames done and in all.
    pub const fn progress(&self) -> (usize, usize) {
        (self.frames_done, self.schedule.total)
    }

    /// Frames before the planned catheter begins to move, and those before it is drawn out.
    pub const fn before(&self) -> [usize; 2] {
        [self.schedule.begins, self.schedule.turns]
    }

    /// One frame further; `None` at the end.
    ///
    /// # Errors
    /// When the needle pose is not usable.
    pub fn advance(&mut self) -> Result<Option<Frame>, SessionError> {
        let frame = self.frames_done;
        if frame >= self.schedule.total {
            return Ok(None);
        }
        self.motions.clear();
        self.motions.extend(self.schedule.motions(frame));
        let share = (frame + 1) as f64 / self.schedule.frames_on as f64;
        let settings = self.settings.frame.brought_on(share.min(1.0));
        let step = self.stepper.step(&self.model, &mut self.state, &self.motions, &settings);
        self.model.nodes_into(&self.state, &mut self.nodes);
        self.frames_done += 1;
        self.read(self.motions[0].to, step).map(Some)
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

    fn read(&mut self, pose: ToolPose, step: StepReport) -> Result<Frame, SessionError> {
        let needle = NeedlePose::new(pose.tip, pose.tip - pose.tail)?;
        self.target.follow(&self.stepper, &self.nodes);
        let target_now = self.target.point(0, self.model.origin());
        let reading = Reading::new(&self.plan, &needle);
        let label = step.tools.first().and_then(|t| t.label);
        Ok(Frame {
            time_s: (self.frames_done as f64 - self.schedule.begins as f64) * self.settings.frame.dt_s,
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

/// Where all paths meet the tissue.
fn openings(case: &Case, beside: &[Plan]) -> Result<Vec<Point<Patient>>, SessionError> {
    let of = |plan: &Plan| tissue_model::opening(&case.tets, plan).map(|(at, _)| at);
    let others = beside
        .iter()
        .enumerate()
        .map(|(i, plan)| of(plan).map_err(|source| SessionError::Beside { number: i + 1, source: Box::new(source) }));
    [of(&case.plan)].into_iter().chain(others).collect()
}

/// That no two catheters would lie in each other.
fn stand_apart(plan: &Plan, beside: &[Plan], diameter_mm: f64) -> Result<(), SessionError> {
    let all: Vec<&Plan> = [plan].into_iter().chain(beside).collect();
    let pairs = all.iter().enumerate().flat_map(|(i, a)| all[..i].iter().map(move |b| apart_mm(a, b)));
    let apart_mm = pairs.fold(f64::INFINITY, f64::min);
    if apart_mm < diameter_mm { Err(SessionError::Meet { diameter_mm, apart_mm }) } else { Ok(()) }
}

/// Least distance between two paths, mm, to half a step.
fn apart_mm(a: &Plan, b: &Plan) -> f64 {
    let steps = (a.length() / APART_STEP_MM).ceil() as usize;
    let at = (0..=steps).map(|i| a.at_depth((i as f64 * APART_STEP_MM).min(a.length())));
    at.map(|p| p.distance(p.nearest_on_segment(b.entry(), b.target()))).fold(f64::INFINITY, f64::min)
}

impl Frame {
    /// Whether the soft body could not take this step at all: it was taken back to before it, so nothing was felt.
    pub fn held(&self) -> bool {
        self.step.held()
    }

    /// Force of the tissue against the advance, mN (without a unit in paper mode); `None` where nothing was felt.
    pub fn axial_force_mn(&self) -> Option<f64> {
        self.step.axial_force_mn()
    }

    /// Whether the tip is in a ventricle: cerebrospinal fluid drips.
    pub fn in_ventricle(&self) -> bool {
        self.at_tip.is_some_and(Structure::is_ventricle)
    }

    /// What the tip of a catheter beside the planned one lies in, by its number from 0.
    pub fn beside(&self, number: usize) -> Option<Structure> {
        self.step.tools.get(number + 1).and_then(|t| t.label).and_then(Structure::from_label)
    }

    /// Punctures of this frame by the planned catheter: (depth of the dimple in mm, axial force in mN, label entered).
    pub fn punctures(&self) -> impl Iterator<Item = (f64, f64, u16)> + '_ {
        self.step.events.iter().filter_map(|e| match e {
            Event::Punctured { tool: 0, depth_mm, force_mn, to, .. } => Some((*depth_mm, *force_mn, *to)),
            _ => None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::deformation::tests::case;
    use crate::tissue_model::Skull;
    use monro_geometry::TriangleMesh;
    use monro_guidance::Side;

    fn settings() -> InsertionSettings {
        InsertionSettings {
            model: ModelSettings::of(Mode::Physical(monro_tissue::PhysicalOptions::default())),
            speed_mm_s: 40.0,
            diameter_mm: 3.0,
            tip: TipShape::Round,
            hold_s: 0.5,
            withdraw: true,
            frame: FrameSettings::default(),
        }
    }

    fn beside(x: f64) -> Plan {
        Plan::new(Side::Right, Point::new(x, 45.0, 80.0), Point::new(x, 45.0, 30.0)).expect("a path")
    }

    #[test]
    fn a_catheter_is_drawn_out_from_beside_another_that_stays() {
        let mut insertion = Insertion::new(&case(), &[beside(12.0)], &settings()).expect("an insertion");
        let [begins, turns] = insertion.before();
        let mut frames = Vec::new();
        while let Some(frame) = insertion.advance().expect("a frame") {
            frames.push(frame);
        }
        let (at_start, at_rest, last) = (&frames[begins - 1], &frames[turns - 1], &frames[frames.len() - 1]);
        assert_eq!((at_start.at_tip, at_start.beside(0)), (None, Some(Structure::Brain)));
        assert!(at_rest.at_tip.is_some() && at_rest.distance_rigid_mm < 1e-9, "{at_rest:?}");
        assert_eq!((last.at_tip, last.beside(0)), (None, Some(Structure::Brain)));
        assert!(
            last.step.tools[0].inserted_mm < 1e-9 && last.step.tools[1].inserted_mm > 10.0,
            "{:?}",
            last.step.tools
        );
        // Friction holds it back, against the push that it met.
        let pulled = frames[turns..].iter().filter_map(Frame::axial_force_mn).fold(0.0, f64::min);
        assert!(pulled < -1.0, "{pulled} mN");
        assert_eq!(last.step.inverted, 0);
    }

    /// It went further in a frame than 64 substeps follow it, and counted as put elsewhere in each of them: it felt nothing.
    #[test]
    fn a_thin_catheter_at_the_highest_speed_feels_what_a_slower_one_does() {
        let largest = |speed_mm_s: f64| {
            let thin = InsertionSettings { speed_mm_s, diameter_mm: 0.5, withdraw: false, ..settings() };
            let mut insertion = Insertion::new(&case(), &[], &thin).expect("an insertion");
            let mut forces = Vec::new();
            while let Some(frame) = insertion.advance().expect("a frame") {
                forces.extend(frame.axial_force_mn());
            }
            forces.into_iter().fold(0.0, f64::max)
        };
        let [slower, fastest] = [400.0, 500.0].map(largest);
        assert!(slower > 5.0 && (fastest / slower - 1.0).abs() < 0.4, "{slower} {fastest} mN");
    }

    /// With a surface that is held, volume that is drained can only come of tissue that is stretched and compressed: the cortex
    /// did not sink, and most of the suction was for that.
    #[test]
    fn what_is_drained_is_left_under_the_skull_that_the_brain_slides_along() {
        let drained = |skull: Skull| {
            let frame = FrameSettings { csf: Csf::Drained { ml: 1.0 }, iterations: 40, ..FrameSettings::default() };
            let model = ModelSettings { skull, ..settings().model };
            let mut insertion =
                Insertion::new(&case(), &[], &InsertionSettings { model, frame, ..settings() }).expect("an insertion");
            let frames = insertion.before()[0];
            let last = (0..frames).filter_map(|_| insertion.advance().expect("a frame")).last().expect("a frame");
            let whole_ml = StructureVolumes::new(insertion.rest()).change_ml(insertion.nodes()).iter().sum::<f64>();
            (last.step.csf_change_ml, whole_ml, last.step.csf_kpa)
        };
        let [(held_ml, held_whole_ml, held_kpa), (ml, whole_ml, kpa)] =
            [Skull::Held, Skull::Slides { septa: true }].map(drained);
        assert!((held_ml + 1.0).abs() < 0.02 && (ml + 1.0).abs() < 0.02, "{held_ml} {ml}");
        // Through the burr hole alone; all but what the suction compresses.
        assert!(held_whole_ml > -0.3 && (whole_ml + 1.0).abs() < 0.1, "{held_whole_ml} {whole_ml}");
        assert!(kpa < 0.0 && kpa > 0.7 * held_kpa, "{kpa} {held_kpa}");
    }

    /// A brain on its side, with a falx: what lay above it hung on what lay below.
    #[test]
    fn neither_side_goes_through_a_falx_and_both_slide_along_it() {
        let mut case = case();
        let corners = [[-1.0, -1.0], [61.0, -1.0], [61.0, 61.0], [-1.0, 61.0]];
        let vertices = corners.map(|[y, z]| Point::new(37.0, y, z)).to_vec();
        case.septa = Some(TriangleMesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] });
        let moved = |septa: bool, gravity_mm_s2: [f64; 3]| {
            let frame = FrameSettings { gravity_mm_s2, iterations: 20, ..FrameSettings::default() };
            let model = ModelSettings { skull: Skull::Slides { septa }, ..settings().model };
            let mut insertion =
                Insertion::new(&case, &[], &InsertionSettings { model, frame, ..settings() }).expect("an insertion");
            for _ in 0..insertion.before()[0] {
                insertion.advance().expect("a frame");
            }
            let rest = insertion.rest().vertices.clone();
            let origin = insertion.origin();
            let way = |n: usize| at(&insertion.nodes()[n], origin) - rest[n];
            // In the middle of the sheet's nodes, beside the ventricle.
            let node = rest.iter().position(|p| *p == Point::new(40.0, 10.0, 30.0)).expect("a node");
            way(node).to_array()
        };
        let across = [9810.0, 0.0, 0.0];
        let (through, held) = (moved(false, across), moved(true, across));
        assert!(through[0] > 0.1 && held[0].abs() < 1e-3, "{through:?} {held:?}");
        let along = [0.0, 9810.0, 0.0];
        let (alone, beside) = (moved(false, along), moved(true, along));
        assert!(alone[1] > 0.1 && beside[1] > 0.7 * alone[1], "{alone:?} {beside:?}");
    }

    #[test]
    fn catheters_through_each_other_beside_the_brain_or_of_no_thickness_are_refused() {
        let said = |beside: &[Plan], diameter_mm: f64| {
            let settings = InsertionSettings { diameter_mm, ..settings() };
            Insertion::new(&case(), beside, &settings).expect_err("refused").to_string()
        };
        let close = Plan::new(Side::Right, Point::new(33.0, 29.0, 80.0), Point::new(33.0, 29.0, 30.0)).expect("a path");
        assert!(said(&[close], 3.0).contains("within 2.0 mm of each other"), "{}", said(&[close], 3.0));
        let missed = said(&[beside(12.0), beside(500.0)], 3.0);
        assert!(missed.contains("catheter 2 beside") && missed.contains("does not meet the brain"), "{missed}");
        assert!(said(&[], 0.0).contains("0.5 to 8 mm"), "{}", said(&[], 0.0));
    }
}
