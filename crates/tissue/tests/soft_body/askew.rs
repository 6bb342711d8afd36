//! Catheters of any thickness and tip that come askew upon a ventricle in elements of many shapes, rest, and go out again:
//! each wall is gone through once. Ways made at random, and among some hundred of them those that went wrong.

use crate::common::{cube_with_horn, options, paper, physical};
use monro_geometry::{Patient, Point, TetMesh, Vector};
use monro_tissue::{
    Event, FrameSettings, Insertion, Material, Model, ModelOptions, Stepper, TipShape, Tool, ToolMotion, ToolPose,
};

/// Edge of the cube, mm.
const EDGE: f64 = 48.0;
/// Frames in a second.
const RATE: f64 = 60.0;
/// Directions that ways are tilted to, radians: all but a few.
#[expect(clippy::approx_constant, reason = "ways that went wrong are those of their seeds to the last bit")]
const AROUND: f64 = 6.28;
/// Pull on a tool on its way in that no tissue gives it, mN: more than single frames show where it lets go of the shaft.
const PULL: f64 = -100.0;

/// Numbers that a seed gives (Marsaglia's xorshift).
struct Random(u64);

impl Random {
    fn new(seed: u64) -> Self {
        let mut random = Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        for _ in 0..5 {
            random.share();
        }
        random
    }

    fn share(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn within(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.share()
    }

    fn is_below(&mut self, share: f64) -> bool {
        self.share() < share
    }
}

/// A cube of brain with a horn of a ventricle along y in its middle, and a way into it.
struct Way {
    mesh: TetMesh,
    options: ModelOptions,
    is_paper: bool,
    tool: Tool,
    /// Of the tool, from its tip to its tail.
    back: Vector<Patient>,
    /// Where its tip turns.
    deepest: Point<Patient>,
    /// How far it goes to there, mm, how far in a frame, and for how many it rests there.
    length: f64,
    step: f64,
    rest: i32,
}

impl Way {
    fn new(seed: u64) -> Self {
        let mut r = Random::new(seed);
        let cells = r.within(6.0, 17.0) as usize;
        let skew = if r.is_below(0.3) { 0.0 } else { r.within(0.05, 0.22) };
        let [radius, height] = [r.within(5.0, 10.0), r.within(16.0, 28.0)];
        let (mesh, fixed) = cube_with_horn(EDGE, (cells, skew), [radius, height]);
        let is_paper = r.is_below(0.15);
        let mut options = options(if is_paper { paper() } else { physical() }, &fixed);
        if r.is_below(0.5) {
            let [puncture_force_mn, puncture_depth_mm] = [r.within(20.0, 200.0), r.within(1.0, 6.0)];
            let insertion = Insertion { puncture_force_mn, puncture_depth_mm, ..Insertion::VENTRICLE };
            options.materials.insert(5, Material { insertion, ..Material::VENTRICLE });
        }
        let [tilt, turn] = [r.within(0.0, 0.9), r.within(0.0, AROUND)];
        let back = Vector::new(tilt * turn.cos(), tilt * turn.sin(), 1.0).normalized().expect("a direction");
        let aim = Point::new(24.0 + r.within(-0.7, 0.7) * radius, r.within(20.0, 28.0), height);
        let radius_mm = r.within(0.7, 2.5);
        let tip = if r.is_below(0.6) { TipShape::Round } else { TipShape::Cone { half_angle: r.within(0.3, 1.2) } };
        let mm_s = if r.is_below(0.3) { r.within(40.0, 120.0) } else { r.within(2.0, 40.0) };
        let above = (EDGE + 3.0 - height) / back.z;
        let deep = r.within(-2.0, 12.0);
        let rest = (r.within(0.2, 1.0) * RATE) as i32;
        let (deepest, tool) = (aim - back * deep, Tool { tip, radius_mm });
        Self { mesh, options, is_paper, tool, back, deepest, length: above + deep, step: mm_s / RATE, rest }
    }

    /// The tool `out` mm before it turns.
    fn pose(&self, out: f64) -> ToolPose {
        let tip = self.deepest + self.back * out;
        ToolPose { tip, tail: tip + self.back * 120.0 }
    }

    /// Labels that the tip comes through on its way in as long as nothing moves, `None` for the outside.
    fn labels(&self) -> Vec<Option<u16>> {
        let mut labels = Vec::new();
        for i in 0..(self.length / 0.1) as usize {
            let tip = self.pose(self.length - 0.1 * i as f64).tip;
            labels.push((0..self.mesh.tets.len()).find(|&t| self.holds(t, tip)).map(|t| self.mesh.labels[t]));
        }
        labels.dedup();
        labels
    }

    /// Whether an element holds a point.
    fn holds(&self, tet: usize, x: Point<Patient>) -> bool {
        let p = self.mesh.tets[tet].map(|v| self.mesh.vertices[v as usize]);
        let six = |p: [Point<Patient>; 4]| (p[1] - p[0]).cross(p[2] - p[0]).dot(p[3] - p[0]);
        let is_near =
            (p[0] - x).norm() < 2.0 * (p[1] - p[0]).norm().max((p[2] - p[0]).norm()).max((p[3] - p[0]).norm());
        is_near && (0..4).all(|i| six(core::array::from_fn(|k| if k == i { x } else { p[k] })) >= 0.0)
    }
}

/// In, a rest, and out: fails where what the tool is told is not what happens to a catheter.
fn go(seed: u64) {
    let way = Way::new(seed);
    let model = Model::new(&way.mesh, &way.options).expect("model");
    let (mut state, mut stepper) = (model.rest_state(), Stepper::new(&model));
    let frames = (way.length / way.step).ceil() as i32;
    let gone = |f: i32| (f64::from(f.min(frames).min(2 * frames + way.rest - f)) * way.step).min(way.length);
    let (mut inside, mut through) = (None, 0);
    for f in 0..2 * frames + way.rest + 20 {
        let [from, to] = [f, f + 1].map(|f| way.pose(way.length - gone(f).max(0.0)));
        let motion = ToolMotion { tool: way.tool, from, to };
        let report = stepper.step(&model, &mut state, &[motion], &FrameSettings::default());
        let is_way_out = f >= frames + way.rest;
        for event in &report.events {
            let here = format!("seed {seed}, frame {f} of {frames} in: {event:?}, inside {inside:?}");
            match *event {
                Event::Punctured { from, to, .. } => {
                    assert!(from == inside && !is_way_out, "{here}");
                    (inside, through) = (Some(to), through + 1);
                }
                Event::Withdrawn { from, to, .. } => {
                    assert!(Some(from) == inside && f >= frames, "{here}");
                    inside = to;
                }
                _ => panic!("{here}"),
            }
        }
        let force = report.tools[0].axial_force_mn;
        assert!(way.is_paper || f >= frames || force > PULL, "seed {seed}, frame {f}: {force} mN");
        assert_eq!(report.inverted, 0, "seed {seed}, frame {f}");
    }
    let labels = way.labels();
    assert!(
        inside.is_none() && through < labels.len(),
        "seed {seed}: {through} punctures in {labels:?}, then {inside:?}"
    );
}

#[test]
fn each_wall_on_a_random_way_is_gone_through_once() {
    (0..16).for_each(go);
}

/// The faces around the hole pushed on it as if they were walls at its side, by more than a newton, and it went through these.
#[test]
fn a_thick_catheter_is_not_pushed_by_the_faces_around_its_hole() {
    go(50);
}

/// On its way out it pressed on the surface around it, which yielded: it was in the brain ever after.
#[test]
fn a_catheter_drawn_out_askew_is_outside() {
    [29, 42].into_iter().for_each(go);
}

/// All of its way along the wall counted as a dimple: at 10 and 30 mN the wall beside it yielded, and again the other way.
#[test]
fn a_tip_does_not_go_through_a_wall_that_it_grazes() {
    [411, 473].into_iter().for_each(go);
}

/// The surface had yielded, and was still before the tip in the second frame: it was said to be outside, and pressed anew.
#[test]
fn a_cone_stays_inside_a_surface_that_has_yet_to_draw_back() {
    go(466);
}

/// The wall behind it came over the tip before it counted as turned: it went through that, at no force; or it went through the
/// wall before it, which pushed on it.
#[test]
fn a_tip_that_turns_goes_through_nothing() {
    [127, 296, 608].into_iter().for_each(go);
}

/// The wall hung on to the shaft, and came along further than it was waited for: it was gone through to and fro.
#[test]
fn a_wall_that_a_thick_catheter_drags_along_is_gone_through_once() {
    go(70);
}
