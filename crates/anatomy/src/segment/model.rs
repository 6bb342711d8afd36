//! A coarse model of the lateral ventricles, posed on the scan.
//!
//! The course of the lateral ventricles relative to the foramina of Monro varies little between people; size, width and
//! the pitch of the head vary more. The model is a curve per side and a few points that must be brain. Its pose is
//! searched; it gives seeds and the limits of search regions, never a boundary.

use super::lattice::Lattice;
use crate::image::{Mask, Raster, gaussian};
use monro_geometry::{Patient, Plane, Point, Vector};
use rayon::prelude::*;

/// Left lateral ventricle from the frontal horn's tip over the body to the atrium, in mm: lateral, posterior and
/// superior of the point midway between the foramina.
const COURSE: [[f64; 3]; 11] = [
    [14.0, -28.0, 0.0],
    [9.0, -20.0, 3.0],
    [6.0, -12.0, 6.0],
    [5.5, -4.0, 10.0],
    [7.0, 4.0, 15.0],
    [9.0, 12.0, 18.0],
    [11.0, 20.0, 17.5],
    [15.0, 28.0, 15.0],
    [21.0, 36.0, 10.0],
    [26.0, 44.0, 7.0],
    [28.0, 52.0, 5.0],
];

/// Left temporal horn from the atrium forwards; often too narrow to be seen, so it takes no part in the search of the pose.
const TEMPORAL: [[f64; 3]; 5] =
    [[26.0, 44.0, 4.0], [30.0, 36.0, -8.0], [33.0, 23.0, -17.0], [33.0, 9.0, -22.0], [31.0, -2.0, -24.0]];

/// Points that are brain: thalamus, internal capsule, white matter above the body and before the frontal horn.
const BRAIN: [[f64; 3]; 9] = [
    [10.0, 8.0, 4.0],
    [10.0, 16.0, 4.0],
    [18.0, 0.0, 5.0],
    [20.0, 10.0, 5.0],
    [20.0, -10.0, 10.0],
    [16.0, 0.0, 28.0],
    [16.0, 15.0, 30.0],
    [14.0, -36.0, 10.0],
    [14.0, -30.0, 16.0],
];

/// Inscribed radius (mm) of the braincase for which the model has its true size.
const TRUE_RADIUS: f64 = 49.0;
/// The foramina relative to the centre of the largest inscribed ball, mm (posterior, superior), for that size.
const FROM_CENTRE: [f64; 2] = [-25.0, -19.0];
/// Ventricles lie at least this deep below the inner skull, mm.
const LEAST_DEPTH: f32 = 14.0;

/// The head's own axes: lateral (to the left), posterior and superior, with the pitch of the scan still in them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Axes {
    /// Centre of the largest ball inside the braincase, moved onto the midplane.
    centre: Point<Patient>,
    left: Vector<Patient>,
    back: Vector<Patient>,
    up: Vector<Patient>,
    /// Size relative to the model's.
    size: f64,
}

/// How a head may lie in a scan whose header has its axes wrong, and the signs that the axes left, back and up then have.
const TURNS: [(&str, [f64; 3]); 3] = [
    ("backwards and upright", [-1.0, -1.0, 1.0]),
    ("upside down and backwards", [1.0, -1.0, -1.0]),
    ("upside down and forwards", [-1.0, 1.0, -1.0]),
];

/// The model's pose.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pose {
    axes: Axes,
    /// Moved left, back and up, mm.
    shift: [f64; 3],
    /// Nose down, radians.
    pub(crate) pitch: f64,
    /// Size.
    pub(crate) scale: f64,
    /// Distance from the midline relative to the model's.
    pub(crate) width: f64,
    /// Part of the model's course that shows fluid less that of the brain points; 1 is perfect.
    pub(crate) score: f64,
}

impl Axes {
    /// From the depth (mm) below the inner skull and the midplane.
    pub(crate) fn new(depth: &Raster<f32>, lattice: Lattice, plane: &Plane<Patient>) -> Option<Self> {
        Self::lying(Vault::new(depth, lattice), plane, (plane.normal, Vector::new(0.0, 1.0, 0.0)))
    }

    /// The same for a head whose left is there, across the midplane, and whose back is about there.
    pub(crate) fn lying(
        vault: Vault,
        plane: &Plane<Patient>,
        (left, back): (Vector<Patient>, Vector<Patient>),
    ) -> Option<Self> {
        let back = (back - left * back.dot(left)).normalized()?;
        Some(Self { centre: plane.project(vault.deepest), left, back, up: left.cross(back), size: vault.size })
    }
}

/// The room in the skull.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Vault {
    /// About the point that is furthest from bone.
    deepest: Point<Patient>,
    /// Size relative to the model's.
    size: f64,
}

impl Vault {
    /// From the depth (mm) below the inner skull.
    pub(crate) fn new(depth: &Raster<f32>, lattice: Lattice) -> Self {
        let soft = gaussian(depth, 3.0 / lattice.step);
        let deepest = (0..soft.data.len()).fold(0, |best, n| if soft.data[n] > soft.data[best] { n } else { best });
        let size = f64::from(depth.data.iter().copied().fold(0.0, f32::max)) / TRUE_RADIUS;
        Self { deepest: lattice.point(soft.voxel(deepest).map(|c| c as f64)), size: size.clamp(0.6, 1.3) }
    }
}

/// How the head lies when the model turned about fits, and how well it does.
#[derive(Debug, Clone)]
pub(crate) struct Turned {
    pub(crate) way: String,
    pub(crate) score: f64,
}

impl Pose {
    /// The best fit of the model turned about, on the same axes.
    pub(crate) fn turned(&self, like: &Raster<f32>, lattice: Lattice) -> Option<Turned> {
        let of = |&(way, [left, back, up]): &(&'static str, [f64; 3])| {
            let a = self.axes;
            let axes = Axes { left: a.left * left, back: a.back * back, up: a.up * up, ..a };
            Turned { way: way.to_owned(), score: fit(like, lattice, axes).score }
        };
        TURNS.iter().map(of).max_by(|a, b| a.score.total_cmp(&b.score))
    }

    /// Patient position of a model point (mm lateral, posterior, superior of the foramina).
    pub(crate) fn place(&self, m: [f64; 3]) -> Point<Patient> {
        let (s, c) = self.pitch.sin_cos();
        let centre = FROM_CENTRE.map(|v| v * self.axes.size);
        let (back, up) = (m[1] * self.scale + centre[0], m[2] * self.scale + centre[1]);
        self.axes.centre
            + self.axes.left * (m[0] * self.width * self.scale + self.shift[0])
            + self.axes.back * (back * c - up * s + self.shift[1])
            + self.axes.up * (back * s + up * c + self.shift[2])
    }

    /// Model coordinates of a patient position, not widened: mm lateral, posterior and superior of the foramina at the
    /// model's size.
    pub(crate) fn model(&self, p: Point<Patient>) -> [f64; 3] {
        let d = p - self.place([0.0; 3]);
        let (s, c) = self.pitch.sin_cos();
        let (lateral, back, up) = (d.dot(self.axes.left), d.dot(self.axes.back), d.dot(self.axes.up));
        [lateral, back * c + up * s, up * c - back * s].map(|v| v / self.scale)
    }

    /// Unit vector of the patient frame for a direction in the model (lateral, posterior, superior).
    pub(crate) fn direction(&self, m: [f64; 3]) -> Vector<Patient> {
        let (s, c) = self.pitch.sin_cos();
        self.axes.left * m[0] + self.axes.back * (m[1] * c - m[2] * s) + self.axes.up * (m[1] * s + m[2] * c)
    }

    /// The course of one side (`1.0` left, `-1.0` right) as points not farther apart than about 1 mm.
    pub(crate) fn course(&self, side: f64) -> Vec<Point<Patient>> {
        self.line(&COURSE, side)
    }

    /// The course of one side's temporal horn.
    pub(crate) fn temporal(&self, side: f64) -> Vec<Point<Patient>> {
        self.line(&TEMPORAL, side)
    }

    fn line(&self, stations: &[[f64; 3]], side: f64) -> Vec<Point<Patient>> {
        let corners: Vec<Point<Patient>> = stations.iter().map(|m| self.place([m[0] * side, m[1], m[2]])).collect();
        let between = |w: &[Point<Patient>]| -> Vec<Point<Patient>> {
            (0..12).map(|n| w[0].lerp(w[1], f64::from(n) / 12.0)).collect()
        };
        corners.windows(2).flat_map(between).collect()
    }
}

/// How much each voxel looks like fluid that may be ventricle: 1 fluid, 0 brain, -0.3 elsewhere; blurred a little.
/// `fluid` gives 0..1 from brain to fluid for a voxel of the cavity; `depth` is that below the inner skull, mm.
pub(crate) fn likeness(
    cavity: &Mask,
    (depth, lattice): (&Raster<f32>, Lattice),
    fluid: impl Fn(usize) -> f32,
) -> Raster<f32> {
    let mut like = Raster::filled(cavity.dims, -0.3f32);
    for (n, value) in like.data.iter_mut().enumerate() {
        if cavity.data[n] && depth.data[n] > LEAST_DEPTH {
            *value = fluid(n).clamp(-0.3, 1.0);
        }
    }
    gaussian(&like, 1.5 / lattice.step)
}

/// The best pose for any of the axes: where the vertex is missing, there are those of vaults of several heights.
pub(crate) fn best(like: &Raster<f32>, lattice: Lattice, axes: impl IntoIterator<Item = Axes>) -> Option<Pose> {
    let poses = axes.into_iter().map(|axes| fit(like, lattice, axes));
    poses.max_by(|a, b| a.score.total_cmp(&b.score))
}

/// Searches the pose: a grid over shift, pitch and width, then a pattern search.
pub(crate) fn fit(like: &Raster<f32>, lattice: Lattice, axes: Axes) -> Pose {
    let at = |shift: [f64; 3], pitch: f64, width: f64| Pose { axes, shift, pitch, scale: axes.size, width, score: 0.0 };
    let steps = || (-4..=4).map(|n| f64::from(n) * 4.0);
    let starts: Vec<Pose> = (-5..=5)
        .map(|n| f64::from(n * 5).to_radians())
        .flat_map(|pitch| steps().map(move |back| (pitch, back)))
        .flat_map(|(pitch, back)| steps().map(move |up| (pitch, back, up)))
        .flat_map(|(pitch, back, up)| [-5.0, 0.0, 5.0].map(|left| ([left, back, up], pitch)))
        .flat_map(|(shift, pitch)| [0.9, 1.3, 1.8].map(|width| at(shift, pitch, width)))
        .collect();
    let scores: Vec<f64> = starts.par_iter().map(|p| score(p, like, lattice)).collect();
    let best = (0..scores.len()).fold(0, |best, n| if scores[n] > scores[best] { n } else { best });
    refine(starts[best], like, lattice)
}

fn refine(mut pose: Pose, like: &Raster<f32>, lattice: Lattice) -> Pose {
    pose.score = score(&pose, like, lattice);
    let mut step = 1.0;
    while step > 0.05 {
        let mut better = false;
        for (a, sign) in (0..6).flat_map(|a| [(a, 1.0), (a, -1.0)]) {
            let mut next = moved(pose, a, sign * step);
            next.score = score(&next, like, lattice);
            if next.score > pose.score {
                (pose, better) = (next, true);
            }
        }
        if !better {
            step /= 2.0;
        }
    }
    pose
}

/// The pose with one parameter moved by a step: 2 mm, 3 degrees, 5 % of size, 15 % of width.
fn moved(mut pose: Pose, parameter: usize, step: f64) -> Pose {
    match parameter {
        0..=2 => pose.shift[parameter] += 2.0 * step,
        3 => pose.pitch += step * 3f64.to_radians(),
        4 => pose.scale = (pose.scale + 0.05 * step).clamp(0.5, 1.6),
        _ => pose.width = (pose.width + 0.15 * step).clamp(0.6, 2.5),
    }
    pose
}

/// Fluid on the course, the worse side counting as much as both, brain where brain must be, and mild priors.
fn score(pose: &Pose, like: &Raster<f32>, lattice: Lattice) -> f64 {
    let value = |m: [f64; 3]| f64::from(like.linear(lattice.index(pose.place(m))));
    let mean = |points: &[[f64; 3]], side: f64| {
        points.iter().map(|m| value([m[0] * side, m[1], m[2]])).sum::<f64>() / points.len() as f64
    };
    let (left, right) = (mean(&COURSE, 1.0), mean(&COURSE, -1.0));
    let brain = (mean(&BRAIN, 1.0) + mean(&BRAIN, -1.0)) / 2.0;
    let [lateral, back, up] = pose.shift;
    let prior = 0.0003 * (back * back + up * up)
        + 0.002 * lateral.abs()
        + 0.25 * pose.pitch.powi(2)
        + 0.5 * (pose.scale / pose.axes.size - 1.0).powi(2)
        + 0.05 * pose.width.ln().powi(2);
    (left + right) / 4.0 + left.min(right) / 2.0 - brain / 2.0 - prior
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose() -> Pose {
        let plane = Plane::new(Point::new(1.0, 2.0, 3.0), Vector::new(0.95, 0.2, -0.1)).expect("plane");
        let lattice = Lattice { origin: [-80.0, -80.0, -80.0], step: 2.0 };
        let mut depth = Raster::filled([80, 80, 80], 0f32);
        for n in 0..depth.data.len() {
            let r = depth.voxel(n).map(|c| c as f64 - 40.0).iter().map(|v| v * v).sum::<f64>().sqrt();
            depth.data[n] = (49.0 - 2.0 * r).max(0.0) as f32;
        }
        let axes = Axes::new(&depth, lattice, &plane).expect("axes");
        Pose { axes, shift: [1.0, -3.0, 4.0], pitch: 0.2, scale: 1.1, width: 1.3, score: 0.0 }
    }

    #[test]
    fn model_coordinates_come_back() {
        let pose = pose();
        for m in COURSE {
            let back = pose.model(pose.place(m));
            for (got, want) in back.iter().zip([m[0] * pose.width, m[1], m[2]]) {
                assert!((got - want).abs() < 1e-9, "{back:?} {m:?}");
            }
        }
        assert!((pose.direction([0.6, 0.0, 0.8]).norm() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_drawn_model_is_found_again() {
        let truth = pose();
        let lattice = Lattice { origin: [-80.0, -80.0, -80.0], step: 2.0 };
        let mut like = Raster::filled([80, 80, 80], 0f32);
        for side in [1.0, -1.0] {
            for p in truth.course(side) {
                let v = lattice.index(p);
                for n in 0..like.data.len() {
                    let at = like.voxel(n);
                    if (0..3).all(|a| (at[a] as f64 - v[a]).abs() < 1.6) {
                        like.data[n] = 1.0;
                    }
                }
            }
        }
        let found = fit(&gaussian(&like, 0.75), lattice, truth.axes);
        let apart = found.place([0.0; 3]).distance(truth.place([0.0; 3]));
        assert!(apart < 5.0 && (found.pitch - truth.pitch).abs() < 0.1, "{apart} {found:?}");
    }
}
