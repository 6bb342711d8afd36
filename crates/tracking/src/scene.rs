//! What a fake tracker sees: four tools about a simulated head, with the noise of real cameras.

use monro_geometry::{Patient, Point, Rigid, Tool, Tracker, Vector};
use monro_guidance::simulation::{FORAMEN, LANDMARKS, MarkerTool, entry, head_point};
use monro_guidance::{Covariance, Random};

/// The tools that a fake tracker streams, in the order of their ids.
pub const TOOLS: [&str; 4] = ["Stylus", "Catheter", "Glasses", "Reference"];

/// Tip of the stylus in its body, mm.
pub const STYLUS_TIP: Point<Tool> = Point::new(3.0, -2.0, -120.0);

/// Tip of the catheter in its body, mm; its axis is the body's -z.
pub const CATHETER_TIP: Point<Tool> = Point::new(0.0, 0.0, -180.0);

/// What is played.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motion {
    /// The catheter goes from above the entry to the foramen and back, again and again.
    Insertion,
    /// The stylus swings about its resting tip.
    Pivot,
    /// The stylus touches the landmarks, one second each, and then strokes the skin.
    Trace,
}

impl Motion {
    /// From its name on the command line.
    pub fn parse(name: &str) -> Option<Self> {
        match name {
            "insertion" => Some(Self::Insertion),
            "pivot" => Some(Self::Pivot),
            "trace" => Some(Self::Trace),
            _ => None,
        }
    }
}

/// How well the tracker sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneOptions {
    /// What is played.
    pub motion: Motion,
    /// Noise of a marker across the view, mm.
    pub across: f64,
    /// Noise of a marker along the view, mm.
    pub along: f64,
    /// Probability that a tool is not seen in a frame.
    pub dropout: f64,
    /// When the reference is bumped by 3 mm, s of the scene after the start.
    pub bump_at: Option<f64>,
    /// How many times faster than real the motion is played.
    pub speed: f64,
    /// Seed of all that is random.
    pub seed: u64,
}

impl Default for SceneOptions {
    fn default() -> Self {
        Self { motion: Motion::Insertion, across: 0.12, along: 0.74, dropout: 0.0, bump_at: None, speed: 1.0, seed: 1 }
    }
}

/// The scene.
#[derive(Debug, Clone)]
pub struct Scene {
    options: SceneOptions,
    random: Random,
    markers: MarkerTool,
    tracker_from_patient: Rigid<Tracker, Patient>,
}

/// The turn that takes `from` to `to` by the shortest way, and a shift.
fn turned<To, From>(from: Vector<To>, to: Vector<To>) -> Rigid<To, From> {
    let axis = from.cross(to).normalized().or_else(|| from.any_perpendicular()).unwrap_or(Vector::new(1.0, 0.0, 0.0));
    Rigid::from_axis_angle(axis, from.angle(to), Vector::ZERO).unwrap_or(Rigid::IDENTITY)
}

/// A tool whose tip is at `tip` and whose -z points along `direction`.
fn held(tip: Point<Tracker>, direction: Vector<Tracker>, in_tool: Point<Tool>) -> Rigid<Tracker, Tool> {
    let turn: Rigid<Tracker, Tool> = turned(Vector::new(0.0, 0.0, -1.0), direction);
    Rigid::from_quaternion(turn.quaternion_wxyz(), tip - turn.point(in_tool)).unwrap_or(turn)
}

impl Scene {
    /// A scene at its start.
    pub fn new(options: SceneOptions) -> Self {
        let lying = Rigid::from_axis_angle(Vector::new(1.0, 0.1, 0.05), -1.5, Vector::new(50.0, 900.0, 1000.0));
        Self {
            random: Random::new(options.seed),
            options,
            markers: MarkerTool::stylus(Point::ORIGIN),
            tracker_from_patient: lying.unwrap_or(Rigid::IDENTITY),
        }
    }

    /// Where the patient truly is.
    pub const fn tracker_from_patient(&self) -> Rigid<Tracker, Patient> {
        self.tracker_from_patient
    }

    /// Depth of the catheter's tip under the entry, mm: 40 mm above at the start, in at 10 mm/s, 3 s of rest, out again.
    pub fn depth(&self, t: f64) -> f64 {
        let length = entry().distance(FORAMEN);
        let (way, rest) = ((length + 40.0) / 10.0, 3.0);
        let phase = t.rem_euclid(2.0 * way + rest);
        let inward = phase.min(way);
        let outward = (phase - way - rest).max(0.0);
        10.0 * (inward - outward) - 40.0
    }

    /// The true poses of all tools, `t` seconds after the start.
    pub fn truth(&self, t: f64) -> [Rigid<Tracker, Tool>; 4] {
        let m = &self.tracker_from_patient;
        let path = (FORAMEN - entry()).normalized().unwrap_or(Vector::new(0.0, 0.0, -1.0));
        let catheter = held(m.point(entry() + path * self.depth(t)), m.vector(path), CATHETER_TIP);
        // The surgeon looks on from the head of the table, swaying a little.
        let eyes = m.point(Point::new(20.0 * (0.5 * t).sin(), -150.0, 400.0));
        let glasses = held(eyes, m.point(FORAMEN) - eyes, Point::ORIGIN);
        let clamp = m.point(Point::new(-90.0, 20.0, 60.0));
        let mut reference = held(clamp, m.vector(Vector::new(0.4, 0.1, -1.0)), Point::ORIGIN);
        if self.options.bump_at.is_some_and(|b| t >= b) {
            let bumped = reference.translation() + Vector::new(2.0, -2.0, 1.0);
            reference = Rigid::from_quaternion(reference.quaternion_wxyz(), bumped).unwrap_or(reference);
        }
        [self.stylus(t), catheter, glasses, reference]
    }

    fn stylus(&self, t: f64) -> Rigid<Tracker, Tool> {
        let m = &self.tracker_from_patient;
        match self.options.motion {
            Motion::Insertion => held(Point::new(400.0, 900.0, 900.0), Vector::new(0.3, 0.0, -1.0), STYLUS_TIP),
            Motion::Pivot => {
                // A rosette of tilts up to 35 degrees, and a turn about itself.
                let (around, tilt) = (1.3 * t, 0.6 * (0.9 * t).sin());
                let down = Vector::new(tilt.sin() * around.cos(), tilt.sin() * around.sin(), -tilt.cos());
                let turn = Rigid::<Tool, Tool>::from_axis_angle(Vector::new(0.0, 0.0, 1.0), 0.7 * t, Vector::ZERO);
                let pose = held(Point::ORIGIN, down, Point::ORIGIN).after(&turn.unwrap_or(Rigid::IDENTITY));
                let divot = Point::new(300.0, 900.0, 900.0);
                Rigid::from_quaternion(pose.quaternion_wxyz(), divot - pose.point(STYLUS_TIP)).unwrap_or(pose)
            }
            Motion::Trace => {
                let direction = trace_direction(t);
                let skin = head_point(direction);
                held(m.point(skin), m.vector(Point::ORIGIN - skin), STYLUS_TIP)
            }
        }
    }

    /// The poses as the cameras see them, `t` seconds of real time after the start; `None` for a tool that they miss.
    pub fn seen(&mut self, t: f64) -> [Option<Rigid<Tracker, Tool>>; 4] {
        let noise = Covariance::of_view(Vector::new(0.1, 0.8, -0.6), self.options.across, self.options.along);
        self.truth(t * self.options.speed).map(|pose| {
            let missed = self.random.uniform() < self.options.dropout;
            let seen = self.markers.see(&pose, &noise, &mut self.random);
            (!missed).then_some(seen)
        })
    }
}

/// The landmarks for a second each, then a spiral over the upper head.
fn trace_direction(t: f64) -> Vector<Patient> {
    match LANDMARKS.get(t.max(0.0) as usize) {
        Some((_, d)) => Vector::from_array(*d),
        None => {
            let s = t - LANDMARKS.len() as f64;
            let height = 0.5 + 0.45 * (0.21 * s).sin();
            let ring = (1.0 - height * height).max(0.0).sqrt();
            Vector::new(ring * s.sin(), -ring * s.cos(), height)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_catheter_reaches_the_foramen_and_comes_back() {
        let scene = Scene::new(SceneOptions::default());
        let m = scene.tracker_from_patient();
        let way = (entry().distance(FORAMEN) + 40.0) / 10.0;
        let tip = |t: f64| scene.truth(t)[1].point(CATHETER_TIP);
        assert!(tip(way + 1.0).distance(m.point(FORAMEN)) < 1e-9);
        assert!(tip(2.0 * way + 3.0).distance(tip(0.0)) < 1e-9);
        // Nothing moves faster than 10 mm/s.
        assert!((0..2000).all(|i| tip(0.01 * f64::from(i)).distance(tip(0.01 * f64::from(i + 1))) < 0.1 + 1e-9));
    }

    #[test]
    fn the_pivoting_stylus_keeps_its_tip_and_the_tracing_one_touches_the_skin() {
        let pivot = Scene::new(SceneOptions { motion: Motion::Pivot, ..SceneOptions::default() });
        let tip = |t: f64| pivot.truth(t)[0].point(STYLUS_TIP);
        assert!((0..100).all(|i| tip(0.1 * f64::from(i)).distance(tip(0.0)) < 1e-9));
        let trace = Scene::new(SceneOptions { motion: Motion::Trace, ..SceneOptions::default() });
        let nasion = trace.tracker_from_patient().point(head_point(Vector::from_array(LANDMARKS[0].1)));
        assert!(trace.truth(0.5)[0].point(STYLUS_TIP).distance(nasion) < 1e-9);
    }

    #[test]
    fn dropouts_and_a_bump_happen_as_often_as_told() {
        let options = SceneOptions { dropout: 0.25, bump_at: Some(1.0), ..SceneOptions::default() };
        let mut scene = Scene::new(options);
        let missed: usize = (0..1000).map(|_| scene.seen(0.0).iter().filter(|p| p.is_none()).count()).sum();
        assert!((850..1150).contains(&missed), "{missed}");
        let moved = scene.truth(1.0)[3].translation() - scene.truth(0.9)[3].translation();
        assert!((moved.norm() - 3.0).abs() < 1e-9);
    }
}
