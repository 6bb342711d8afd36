//! Monte-Carlo of the whole way from cameras to the foramen: pivot, landmarks, surface, target.

use super::{FORAMEN, LANDMARKS, MarkerTool, entry, head, pose_at, swing};
use crate::calibration::{PivotOptions, calibrate_pivot};
use crate::registration::{
    Landmark, RefineOptions, Surface, SurfaceError, SurfaceSample, refine_on_surface, register_landmarks,
};
use crate::{Covariance, Random};
use monro_geometry::{Bvh, Patient, Point, Rigid, Tool, Tracker, TriangleMesh, Vector};

/// The conditions of a trial.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrialOptions {
    /// Noise of one marker across the cameras' view, mm.
    pub across: f64,
    /// Noise of one marker along the view, mm.
    pub along: f64,
    /// How well a hand finds a landmark on the skin, mm along each axis.
    pub hand: f64,
    /// Frames averaged while a landmark is touched.
    pub touch_frames: usize,
    /// Poses of the pivot calibration.
    pub pivot_poses: usize,
    /// Traced surface points.
    pub surface_points: usize,
    /// Noise of a traced point, mm along each axis.
    pub surface_noise: f64,
    /// Error of the start that surface refinement begins with, beside that of the landmarks, rad.
    pub start_error: f64,
    /// Whether the landmarks take part in the refinement, or only the surface.
    pub with_landmarks: bool,
}

impl Default for TrialOptions {
    fn default() -> Self {
        Self {
            across: 0.12,
            along: 0.74,
            hand: 1.0,
            touch_frames: 60,
            pivot_poses: 600,
            surface_points: 100,
            surface_noise: 0.5,
            start_error: 0.0,
            with_landmarks: true,
        }
    }
}

/// The errors of one trial, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trial {
    /// Error of the calibrated tip.
    pub tip: f64,
    /// Error at the foramen by landmarks alone.
    pub landmark_tre: f64,
    /// Error at the foramen after refinement.
    pub tre: f64,
    /// Error at the entry after refinement.
    pub entry_tre: f64,
    /// Predicted error at the foramen (root mean square).
    pub predicted: f64,
    /// Predicted error at the foramen by landmarks alone.
    pub landmark_predicted: f64,
}

/// A simulated patient and the cameras that look at it.
#[derive(Debug)]
pub struct Scene {
    surface: Surface,
    skin: Bvh,
    /// From here the skin is looked at: landmarks and traced points lie in directions from it.
    centre: Point<Patient>,
    target: Point<Patient>,
    entry: Point<Patient>,
    tool: MarkerTool,
    tracker_from_patient: Rigid<Tracker, Patient>,
    view: Vector<Tracker>,
}

impl Default for Scene {
    fn default() -> Self {
        Self::new()
    }
}

impl Scene {
    /// The head of this module, lying in front of a pair of cameras, and a stylus of 12 cm.
    pub fn new() -> Self {
        let made = Self::on_skin(&head(), Point::ORIGIN, FORAMEN, entry());
        made.unwrap_or_else(|e| unreachable!("the simulated head: {e}"))
    }

    /// Another head, such as that of a scan: its skin (mm, patient frame, the face towards -y), a point inside from which all
    /// of forehead, temples and crown can be seen, the target and the entry.
    ///
    /// # Errors
    /// When the skin has no triangles, or does not lie around the centre.
    pub fn on_skin(
        skin: &TriangleMesh,
        centre: Point<Patient>,
        target: Point<Patient>,
        entry: Point<Patient>,
    ) -> Result<Self, SurfaceError> {
        let about = Vector::new(1.0, 0.1, 0.05);
        let lying = Rigid::from_axis_angle(about, -1.5, Vector::new(50.0, 900.0, 80.0));
        let scene = Self {
            surface: Surface::new(skin)?,
            skin: Bvh::new(skin),
            centre,
            target,
            entry,
            tool: MarkerTool::stylus(Point::new(3.0, -2.0, -120.0)),
            tracker_from_patient: lying.unwrap_or(Rigid::IDENTITY),
            view: Vector::new(0.1, 0.8, -0.6),
        };
        let around = LANDMARKS.iter().all(|(_, d)| scene.skin_point(Vector::from_array(*d)).is_some());
        if around { Ok(scene) } else { Err(SurfaceError::Empty) }
    }

    /// Where the outermost skin lies in a direction from the centre.
    fn skin_point(&self, direction: Vector<Patient>) -> Option<Point<Patient>> {
        let direction = direction.normalized()?;
        let farthest = self.skin.ray_all(self.centre, direction).iter().map(|h| h.t).fold(f64::NEG_INFINITY, f64::max);
        farthest.is_finite().then(|| self.centre + direction * farthest)
    }

    /// One trial; `None` when a step refused its input, which counts as a failure.
    pub fn trial(&self, options: &TrialOptions, random: &mut Random) -> Option<Trial> {
        let noise = Covariance::of_view(self.view, options.across, options.along);
        let tip = self.pivot(options, &noise, random)?;
        let landmarks = self.landmarks(options, &noise, tip, random);
        let rough = register_landmarks(&landmarks).ok()?;
        let turn = Vector::from_array(random.direction());
        let off = Rigid::<Patient, Patient>::from_axis_angle(turn, options.start_error, Vector::ZERO)?;
        let samples = self.trace(options, random);
        let taking_part = if options.with_landmarks { landmarks.as_slice() } else { &[] };
        let refine = RefineOptions { surface_sigma: 0.05, ..RefineOptions::default() };
        let start = off.after(&rough.to_from);
        let fine = refine_on_surface(&start, &samples, taking_part, &self.surface, &refine).ok()?;
        let error =
            |m: &Rigid<Patient, Tracker>, at: Point<Patient>| m.point(self.tracker_from_patient.point(at)).distance(at);
        Some(Trial {
            tip: tip.distance(self.tool.tip),
            landmark_tre: error(&rough.to_from, self.target),
            tre: error(&fine.patient_from, self.target),
            entry_tre: error(&fine.patient_from, self.entry),
            predicted: fine.uncertainty.at(self.target).rms(),
            landmark_predicted: rough.uncertainty.at(self.target).rms(),
        })
    }

    fn pivot(&self, options: &TrialOptions, noise: &Covariance<Tracker>, random: &mut Random) -> Option<Point<Tool>> {
        let poses = swing(options.pivot_poses, 0.6, self.tool.tip, Point::new(0.0, 900.0, 0.0), random);
        let seen: Vec<_> = poses.iter().map(|p| self.tool.see(p, noise, random)).collect();
        Some(calibrate_pivot(&seen, &PivotOptions::default()).ok()?.tip)
    }

    fn landmarks(
        &self,
        options: &TrialOptions,
        noise: &Covariance<Tracker>,
        tip: Point<Tool>,
        random: &mut Random,
    ) -> Vec<Landmark<Patient, Tracker>> {
        // The hand dominates; tracking adds its own noise at the tip, some twice that of a marker, over the mean of frames.
        let own = Covariance::new(&noise.matrix()).plus(&Covariance::new(&noise.matrix()));
        let frames = options.touch_frames.max(1) as f64;
        let mean = Covariance::new(&scaled(&own, 1.0 / frames));
        let total = Covariance::isotropic(options.hand).plus(&mean);
        let one = |(name, direction): &(&str, [f64; 3])| {
            let marked = self.skin_point(Vector::from_array(*direction))?;
            let hand = Vector::from_array(random.normal3()) * options.hand;
            let place = self.tracker_from_patient.point(marked) + hand;
            let pose = pose_at(0.7, self.tool.tip, place, random);
            let touched = self.tool.touch(tip, &pose, options.touch_frames, noise, random);
            Some(Landmark { name: (*name).to_owned(), touched, marked, noise: total })
        };
        LANDMARKS.iter().filter_map(one).collect()
    }

    /// Points over forehead, temples and crown: where a supine head can be reached.
    fn trace(&self, options: &TrialOptions, random: &mut Random) -> Vec<SurfaceSample<Tracker>> {
        let noise = Covariance::isotropic(options.surface_noise);
        let one = |_| loop {
            let d = Vector::<Patient>::from_array(random.direction());
            if d.z > -0.1 && d.y < 0.5 {
                let Some(skin) = self.skin_point(d) else { continue };
                let at = self.tracker_from_patient.point(skin);
                return SurfaceSample { point: at + noise.sample(random), noise };
            }
        };
        (0..options.surface_points).map(one).collect()
    }
}

fn scaled(c: &Covariance<Tracker>, factor: f64) -> monro_geometry::Matrix3 {
    monro_geometry::Matrix3 { rows: c.matrix().rows.map(|r| r.map(|v| v * factor)) }
}

/// Root mean square of some values; 0 for none.
pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// The value below which a fraction `q` of the values lies; 0 for none.
pub fn quantile(values: &[f64], q: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = (q * (sorted.len().saturating_sub(1)) as f64).round() as usize;
    sorted.get(at).copied().unwrap_or(0.0)
}
