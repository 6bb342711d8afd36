//! Known truth for Monte-Carlo: a tool seen by noisy cameras, a swing about a divot, a head to be registered.

mod trials;

pub use trials::{Scene, Trial, TrialOptions, quantile, rms};

use crate::Covariance;
use crate::random::Random;
use crate::registration::rigid_from_pairs;
use monro_geometry::{Patient, Point, Rigid, Tool, Tracker, TriangleMesh, Vector};

/// A rigid body of markers with a tip.
#[derive(Debug, Clone)]
pub struct MarkerTool {
    /// Markers, mm.
    pub markers: Vec<Point<Tool>>,
    /// Tip, mm.
    pub tip: Point<Tool>,
}

impl MarkerTool {
    /// Five markers on a plate of some 8 by 10 cm about the origin of the tool's frame.
    pub fn stylus(tip: Point<Tool>) -> Self {
        let markers =
            [[0.0, 50.0, 5.0], [-40.0, -10.0, 0.0], [40.0, 0.0, -5.0], [15.0, -50.0, 0.0], [-25.0, 30.0, 20.0]];
        Self { markers: markers.map(Point::from_array).to_vec(), tip }
    }

    /// The pose as a tracking system sees it: each marker with its own noise, the body fitted to them.
    pub fn see(
        &self,
        tracker_from_tool: &Rigid<Tracker, Tool>,
        noise: &Covariance<Tracker>,
        random: &mut Random,
    ) -> Rigid<Tracker, Tool> {
        let pairs: Vec<_> =
            self.markers.iter().map(|&m| (m, tracker_from_tool.point(m) + noise.sample(random), 1.0)).collect();
        rigid_from_pairs(&pairs).unwrap_or(*tracker_from_tool)
    }

    /// The tip in the tracker's frame as the mean over `frames` frames; the tip's place in the tool as `tip` says.
    pub fn touch(
        &self,
        tip: Point<Tool>,
        tracker_from_tool: &Rigid<Tracker, Tool>,
        frames: usize,
        noise: &Covariance<Tracker>,
        random: &mut Random,
    ) -> Point<Tracker> {
        let mut sum = Vector::ZERO;
        for _ in 0..frames.max(1) {
            sum += self.see(tracker_from_tool, noise, random).point(tip) - Point::ORIGIN;
        }
        Point::ORIGIN + sum / frames.max(1) as f64
    }
}

/// A pose whose tool axis -z points down in the tracker, tilted by up to `cone` rad in a random direction and turned
/// about itself, with the tool's point `tip` at `place`.
pub fn pose_at(cone: f64, tip: Point<Tool>, place: Point<Tracker>, random: &mut Random) -> Rigid<Tracker, Tool> {
    let turn = Rigid::<Tracker, Tool>::from_axis_angle(
        Vector::new(0.0, 0.0, 1.0),
        random.between(-core::f64::consts::PI, core::f64::consts::PI),
        Vector::ZERO,
    );
    let (sin, cos) = random.between(0.0, core::f64::consts::TAU).sin_cos();
    // The square root spreads the tilts evenly over the cap of the sphere.
    let tilt = Rigid::<Tracker, Tracker>::from_axis_angle(
        Vector::new(cos, sin, 0.0),
        cone * random.uniform().sqrt(),
        Vector::ZERO,
    );
    let rotation = tilt.unwrap_or(Rigid::IDENTITY).after(&turn.unwrap_or(Rigid::IDENTITY));
    let translation = place - rotation.point(tip);
    Rigid::from_quaternion(rotation.quaternion_wxyz(), translation).unwrap_or(rotation)
}

/// `n` poses that swing about a divot.
pub fn swing(
    n: usize,
    cone: f64,
    tip: Point<Tool>,
    divot: Point<Tracker>,
    random: &mut Random,
) -> Vec<Rigid<Tracker, Tool>> {
    (0..n).map(|_| pose_at(cone, tip, divot, random)).collect()
}

/// Distance of a head's surface from its centre in a direction (patient axes), mm: an ellipsoid of 150 by 190 by 200 mm
/// with brow, nose, ears and a flattened back, so that no motion slides it on itself.
fn head_radius(d: Vector<Patient>) -> f64 {
    let ellipsoid = 1.0 / ((d.x / 75.0).powi(2) + (d.y / 95.0).powi(2) + (d.z / 100.0).powi(2)).sqrt();
    let bump = |x: f64, y: f64, z: f64, height: f64, width: f64| {
        let apart = d.angle(Vector::new(x, y, z));
        height * (-0.5 * (apart / width).powi(2)).exp()
    };
    ellipsoid
        + bump(0.0, -1.0, -0.25, 18.0, 0.12)
        + bump(0.3, -1.0, 0.15, 4.0, 0.25)
        + bump(-0.3, -1.0, 0.15, 4.0, 0.25)
        + bump(1.0, 0.1, -0.15, 9.0, 0.15)
        + bump(-1.0, 0.1, -0.15, 9.0, 0.15)
        + bump(0.1, 1.0, 0.3, -5.0, 0.4)
}

/// A point of the head's skin in a direction from its centre.
pub fn head_point(direction: Vector<Patient>) -> Point<Patient> {
    let d = direction.normalized().unwrap_or(Vector::new(0.0, 0.0, 1.0));
    Point::ORIGIN + d * head_radius(d)
}

/// The head as a closed mesh, its centre at the origin, the face towards -y.
pub fn head() -> TriangleMesh {
    let (rings, sectors) = (90u32, 180u32);
    let at = |i: u32, j: u32| {
        let polar = core::f64::consts::PI * f64::from(i) / f64::from(rings);
        let around = core::f64::consts::TAU * f64::from(j) / f64::from(sectors);
        head_point(Vector::new(polar.sin() * around.cos(), polar.sin() * around.sin(), polar.cos()))
    };
    let mut vertices = vec![at(0, 0)];
    vertices.extend((1..rings).flat_map(|i| (0..sectors).map(move |j| (i, j))).map(|(i, j)| at(i, j)));
    vertices.push(at(rings, 0));
    let id = |i: u32, j: u32| match i {
        0 => 0,
        i if i == rings => 1 + (rings - 1) * sectors,
        i => 1 + (i - 1) * sectors + j % sectors,
    };
    let mut triangles = Vec::new();
    for i in 0..rings {
        for j in 0..sectors {
            let quad = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
            if i + 1 < rings {
                triangles.push([quad[0], quad[1], quad[2]]);
            }
            if i > 0 {
                triangles.push([quad[0], quad[2], quad[3]]);
            }
        }
    }
    TriangleMesh { vertices, triangles }
}

/// Directions of six skin landmarks from the head's centre: nasion, the outer corners of the eyes, the tragi, and a mark on
/// the vertex.
pub const LANDMARKS: [(&str, [f64; 3]); 6] = [
    ("nasion", [0.0, -1.0, 0.0]),
    ("left canthus", [0.5, -0.85, -0.05]),
    ("right canthus", [-0.5, -0.85, -0.05]),
    ("left tragus", [1.0, -0.05, -0.2]),
    ("right tragus", [-1.0, -0.05, -0.2]),
    ("vertex", [0.1, 0.0, 1.0]),
];

/// Where the foramen of Monro lies in this head, mm.
pub const FORAMEN: Point<Patient> = Point::new(-5.0, -10.0, 5.0);

/// Where a catheter enters this head (Kocher's point, right), mm.
pub fn entry() -> Point<Patient> {
    head_point(Vector::new(-0.3, -0.45, 0.85))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_head_is_closed_oriented_and_of_a_heads_size() {
        let h = head();
        assert_eq!(h.validate(), Ok(()));
        let t = h.topology();
        assert!(t.is_closed() && t.is_manifold() && t.is_oriented() && t.euler() == 2);
        let litres = h.signed_volume() / 1e6;
        assert!((2.5..4.0).contains(&litres), "{litres}");
    }

    #[test]
    fn a_pose_has_its_tip_where_it_should() {
        let (tip, place) = (Point::new(1.0, 2.0, -150.0), Point::new(30.0, 40.0, 50.0));
        let p = pose_at(0.5, tip, place, &mut Random::new(1));
        assert!(p.point(tip).distance(place) < 1e-9);
    }
}
